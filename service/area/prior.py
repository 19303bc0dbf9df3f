"""Prior mass per cell from the polygons, lines, points and rings of the area file, all integrals exact."""

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import ArrayLike
from scipy.special import ndtr

from service.area.frame import BoolArray, GridFrame
from service.area.geojson import Where
from service.area.model import RING_MASS, LinePrior, PointPrior, Prior, RingPrior, SearchArea, ring_edges
from service.area.projection import FloatArray
from service.area.zone import Zone


def cell_squares(frame: GridFrame) -> shapely.Geometry:
    """The cells as shapely squares [rows, cols] in the grid's metres."""
    west, north = np.meshgrid(np.arange(frame.cols) * frame.cell_m, np.arange(frame.rows) * frame.cell_m)
    return shapely.box(west, north, west + frame.cell_m, north + frame.cell_m)


def covered_fraction(squares: shapely.Geometry, ground: shapely.Geometry) -> FloatArray:
    """How much of each square [rows, cols] a flat geometry covers, float 0..1 [rows, cols]."""
    ground = Zone(ground).prepared
    touched = shapely.intersects(ground, squares)
    full = touched & shapely.contains_properly(ground, squares)
    fraction = full.astype(np.float64)
    partly = touched & ~full
    edge = squares[partly]
    fraction[partly] = shapely.area(shapely.intersection(edge, ground)) / shapely.area(edge)
    return np.asarray(np.minimum(fraction, 1.0))


def area_prior(
    area: SearchArea,
    frame: GridFrame,
    squares: shapely.Geometry,
    fraction: FloatArray,
    searchable: BoolArray,
    mobility: FloatArray | None = None,
) -> FloatArray:
    """The prior of an area file on a grid.

    Each prior feature is first scaled to have mass 1 on the searchable ground, so that its
    weight is its share of the whole; a polygon spreads evenly over the ground it shares with
    the area, a line likewise in its strip, a point as a Gaussian that is cut off at the area's
    edge, an initial planning point as rings of published distances. Without prior
    features the mass is even over the ground.

    Args:
        area: the checked area file.
        frame: the grid.
        squares: its cells, [rows, cols] (see `cell_squares`).
        fraction: how much of each cell is ground, float [rows, cols].
        searchable: the cells that count, bool [rows, cols].
        mobility: how well each is walked, float [rows, cols], 0 to 1, to which rings keep; None: all alike.

    Returns:
        float [rows, cols], zero where not searchable, summing to 1.

    Raises:
        BadInput: a prior feature has no mass on the searchable cells.
    """
    ground = np.where(searchable, fraction, 0.0)
    if not area.priors:
        return np.asarray(ground / ground.sum())
    mass: FloatArray = np.zeros(frame.shape)
    for part in prior_parts(area, frame, squares, fraction, searchable, mobility):
        mass += part
    return np.asarray(mass / mass.sum())


def prior_parts(
    area: SearchArea,
    frame: GridFrame,
    squares: shapely.Geometry,
    fraction: FloatArray,
    searchable: BoolArray,
    mobility: FloatArray | None = None,
) -> Iterator[FloatArray]:
    """What each prior feature of an area adds, float [rows, cols] in the file's order; arguments as `area_prior`.

    Each sums to its weight over the largest of them.
    """
    ground = np.where(searchable, fraction, 0.0)
    flat_ground = frame.flatten(area.ground)
    largest = max((prior.weight for prior in area.priors), default=1.0)
    for prior in area.priors:
        share = np.where(searchable, _share(prior, frame, squares, flat_ground, mobility), 0.0)
        if isinstance(prior, PointPrior):
            share = share * ground
        total = share.sum()
        if not total > 0:
            where = Where(area.source, prior.label)
            walked = "" if mobility is None or not isinstance(prior, RingPrior) else " and can be walked"
            raise where.bad(
                f"the prior has no mass on any cell that is searched{walked}; move it or widen it"
            )
        yield prior.weight / largest * (share / total)


def _share(
    prior: Prior,
    frame: GridFrame,
    squares: shapely.Geometry,
    flat_ground: shapely.Geometry,
    mobility: FloatArray | None,
) -> FloatArray:
    """One prior on the cells, [rows, cols], of any sum."""
    if isinstance(prior, PointPrior):
        return gaussian(frame, prior)
    if isinstance(prior, LinePrior):
        inside = shapely.buffer(frame.flatten(prior.line), prior.width_m / 2)
    elif isinstance(prior, RingPrior):
        east, south = frame.to_metres([prior.position])[0]
        return ring_mass(prior, (float(east), float(south)), squares, flat_ground, mobility)
    else:
        inside = frame.flatten(prior.polygon)
    return covered_fraction(squares, shapely.intersection(inside, flat_ground))


def ring_mass(
    prior: RingPrior,
    centre: tuple[float, float],
    squares: shapely.Geometry,
    ground: shapely.Geometry,
    mobility: FloatArray | None = None,
) -> FloatArray:
    """The probability that a ring prior gives to the ground in each square, [rows, cols]: exact, since within a ring
    it is even by surface times mobility. It sums to what lies in the ground: mobility moves nothing from ring to ring,
    so that the published distances stay, but for a ring in which nothing is walked, whose part is lost.

    Args:
        prior: the rings.
        centre: where they are centred, in the metres of `squares` and `ground`.
        squares, ground: flat geometries; the squares are [rows, cols].
        mobility: how well each square is walked, float [rows, cols], 0 to 1; None: all alike.
    """
    point = shapely.Point(centre)
    surface = shapely.area(squares)
    mass = np.zeros(np.shape(squares))
    inner = np.zeros(np.shape(squares))
    inner_area = 0.0
    for radius, share in zip(ring_edges(prior), RING_MASS, strict=True):
        disc = shapely.buffer(point, radius, quad_segs=64)
        within = covered_fraction(squares, shapely.intersection(disc, ground)) * surface
        mass += share * _by_mobility(within - inner, mobility) / (disc.area - inner_area)
        inner, inner_area = within, disc.area
    return np.maximum(mass, 0.0)


def _by_mobility(ring: FloatArray, mobility: FloatArray | None) -> FloatArray:
    """The ground of a ring in each square, m² [rows, cols], weighed by how well it is walked and of the same sum."""
    if mobility is None:
        return ring
    weighed = np.maximum(ring, 0.0) * mobility
    whole = weighed.sum()
    return np.asarray(weighed * (ring.sum() / whole)) if whole > 0.0 else weighed


def rings_inside(prior: RingPrior, centre: ArrayLike, ground: shapely.Geometry) -> float:
    """How much of the distances of a ring prior lies in flat ground, 0 to 1."""
    point = shapely.Point(np.asarray(centre))
    inside, inner, inner_area = 0.0, 0.0, 0.0
    for radius, share in zip(ring_edges(prior), RING_MASS, strict=True):
        disc = shapely.buffer(point, radius, quad_segs=64)
        within = shapely.intersection(disc, ground).area
        inside += share * (within - inner) / (disc.area - inner_area)
        inner, inner_area = within, disc.area
    return float(min(max(inside, 0.0), 1.0))


_POINT = 1e-9
"""A sigma below this part of a cell is a point; far below it, a cell's edge over sigma is no number."""


def gaussian(frame: GridFrame, prior: PointPrior) -> FloatArray:
    """The mass of an isotropic Gaussian in each cell, float [rows, cols]: an exact integral, so that a
    sigma much smaller than a cell works too."""
    east, south = frame.to_metres([prior.position])[0]
    in_cols = _normal_mass(frame.cols, east / frame.cell_m, prior.sigma_m / frame.cell_m)
    in_rows = _normal_mass(frame.rows, south / frame.cell_m, prior.sigma_m / frame.cell_m)
    return np.outer(in_rows, in_cols)


def _normal_mass(cells: int, mean: float, sigma: float) -> FloatArray:
    """The mass of a normal distribution (in cells) in each cell of a line, precise in both tails."""
    z = (np.arange(cells + 1) - mean) / max(sigma, _POINT)
    low, high = z[:-1], z[1:]
    right = low > 0
    mass = np.where(right, ndtr(-low) - ndtr(-high), ndtr(high) - ndtr(low))
    return np.asarray(mass, dtype=np.float64)

"""The grid that the search runs on: prior, searchable and flyable cells, launch point."""

import functools
import math
from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from service.area import route
from service.area.checks import check_launch
from service.area.document import name_in
from service.area.frame import BoolArray, GridFrame, lay_frame
from service.area.geojson import Where
from service.area.model import Prior, SearchArea, TargetMotion, prior_shape
from service.area.prior import area_prior, cell_squares, covered_fraction
from service.area.projection import FloatArray, surface_m2
from service.area.route import KeepOut
from service.chances import share
from service.errors import BadInput
from service.geometry import LatLon
from service.ground.relief import Relief
from service.places import Coordinates, written

if TYPE_CHECKING:
    from roisearch import Walk

Array = TypeVar("Array", FloatArray, BoolArray)

CLEARANCE_M = 5.0
"""How far the aircraft keeps from an exclusion, in metres: position error and overshoot at a waypoint."""

NEEDS_A_TEAM = 0.2
"""Ground on which less than this part of a target's chance in the open is left is not searched from above."""

_SLIVER = 1e-6
"""Less than this part of a cell is rounding, not ground."""

_NO_MASS = 1e-9
"""A cell with less prior than this will not be searched before the battery ends."""


@dataclass(frozen=True, eq=False)
class Grid:
    """What the planner and the mission need to know about the area. The arrays are read-only.

    Attributes:
        frame: cells to positions and back.
        prior: float [rows, cols], summing to 1, zero where not searchable; before `outside`.
        searchable: bool [rows, cols], cells that hold ground where the target may be.
        flyable: bool [rows, cols], cells that the aircraft may be in: one connected part.
        covered: float [rows, cols], how much of each cell is ground that is searched, 0..1.
        outside: probability that the target is not in the area at all.
        launch: (latitude, longitude) where the search starts and ends.
        start: the flyable cell (row, col) nearest to the launch point.
        keep_out: the exclusions on the plane, for `leg_is_clear` and `way_home`.
        clearance_m: how far legs keep from them, in metres.
        outline: the area as drawn, and what may be crossed between its parts, on the plane.
        layout_notes: what the operator should know about the layout; see `notes`.
        relief: the heights of the ground; None: it is taken as flat.
        target: how the target moves; None: it stands still.
        visibility: float [rows, cols], what a look from above finds there as a share of that in the open; None: all.
        mobility: float [rows, cols], how well each cell is walked, 0 (not at all) to 1; None: all alike.
        coordinates: how the team writes places, in notes and messages.
    """

    frame: GridFrame
    prior: FloatArray
    searchable: BoolArray
    flyable: BoolArray
    covered: FloatArray
    outside: float
    launch: LatLon
    start: tuple[int, int]
    keep_out: KeepOut
    outline: shapely.Geometry
    layout_notes: tuple[str, ...]
    clearance_m: float = CLEARANCE_M
    relief: Relief | None = None
    visibility: FloatArray | None = None
    target: TargetMotion | None = None
    mobility: FloatArray | None = None
    coordinates: Coordinates = "degrees"
    area: SearchArea | None = None
    """What the prior was made from; None: it is not that of an area file."""
    cut_off: str = ""
    """Where the ground is that exclusions told in flight have cut off, for people; empty: there is none."""

    @property
    def walk(self) -> "Walk | None":
        """How the target walks from cell to cell; None: it stands still.

        Made when it is asked for: who does not search, such as the process at the door, needs no compiler.
        """
        from roisearch import Walk

        if self.target is None:
            return None
        return Walk(cell_m=self.frame.cell_m, mobility=self.mobility, **asdict(self.target))

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences that the operator should read before the flight."""
        return self.layout_notes + _prior_notes(self.prior, self.searchable, self.flyable)

    @property
    def reachable_mass(self) -> float:
        """The share of the prior in flyable cells that can be seen: what a footprint of one cell can ever find."""
        return self.mass_seen(self.visibility)

    def mass_seen(self, visibility: FloatArray | None) -> float:
        """The same where a look finds such a part, [rows, cols], of what it finds in the open; None: all."""
        return float(self.prior[self.seen(visibility)].sum())

    def seen(self, visibility: FloatArray | None) -> BoolArray:
        """The flyable cells, bool [rows, cols], where a look finds what is worth a search from above."""
        return self.flyable if visibility is None else self.flyable & (visibility >= NEEDS_A_TEAM)

    @functools.cached_property
    def _flyable_cells(self) -> NDArray[np.int64]:
        return np.argwhere(self.flyable)

    def nearest_flyable(self, cell: tuple[int, int]) -> tuple[int, int]:
        """The flyable cell nearest to `cell` along the grid, itself if it is flyable."""
        away = np.abs(self._flyable_cells - np.array(cell)).sum(axis=1)
        row, col = self._flyable_cells[away.argmin()]
        return int(row), int(col)

    def over(self, relief: Relief, clear: BoolArray, why: str) -> "Grid":
        """The same grid over ground with heights, where only cells that are `clear`, bool [rows, cols], are flown.

        Of several separate parts only one stays: the one with the most prior mass. `why` others are not flown ends a
        note.

        Raises:
            BadInput: no cell stays.
        """
        labels, best_first = _parts_to_fly(self.flyable & clear, self.prior)
        if not best_first.size:
            raise BadInput(f"no cell of the area can be flown, or one alone: {why}")
        flyable = labels == best_first[0]
        lost = self.flyable & ~flyable
        notes = self.layout_notes
        if lost.any():
            notes += (
                f"{int(lost.sum())} cells with {share(float(self.prior[lost].sum()))} of the prior are not flown: "
                f"{why}.",
            )
        start = nearest_flyable(self.frame, flyable, self.launch)
        return replace(self, flyable=_frozen(flyable), start=start, layout_notes=notes, relief=relief)

    def under(self, visibility: FloatArray) -> "Grid":
        """The same grid where a look finds only a part, [rows, cols], 0 to 1, of what it finds in the open."""
        dark = float(self.prior[visibility < NEEDS_A_TEAM].sum())
        notes = self.layout_notes
        if dark >= 0.0005:
            notes += (
                f"{100 * dark:.3g} % of the prior lies under cover where a look finds less than {NEEDS_A_TEAM:.0%} of "
                "what it finds in the open: that needs a ground team.",
            )
        return replace(self, visibility=_frozen(visibility), layout_notes=notes)

    def walked_at(self, area: SearchArea, mobility: FloatArray) -> "Grid":
        """The same grid where the ground is walked so well, [rows, cols], 0 to 1: the rings of the area's lost persons
        keep to it, and so does a target that walks.

        Raises:
            BadInput: a prior has no mass where it can be walked.
        """
        squares = cell_squares(self.frame)
        prior = area_prior(area, self.frame, squares, self.covered, self.searchable, mobility)
        return replace(self, prior=_frozen(prior), mobility=_frozen(mobility))

    def noting(self, note: str) -> "Grid":
        """The same grid with one more sentence for the operator."""
        return replace(self, layout_notes=(*self.layout_notes, note))

    def excluding(self, shape: shapely.Geometry, mass: FloatArray | None = None) -> "Grid":
        """The same grid with one more exclusion (degrees, x = longitude), which keeps its mass but is not flown over.

        Of several parts that it leaves the one with the most of `mass` stays, float [rows, cols]: where the target may
        be by now; None: as the prior has it.

        Raises:
            BadInput: it leaves nothing to fly over, closes the way from the launch point, or has too many corners.
        """
        where = Where("the exclusion")
        flat = shapely.union(self.keep_out.core.shape, self.frame.flatten(shape))
        blocked = route.keep_out_of(flat, self.clearance_m)
        allowed = self.flyable & ~shapely.intersects(blocked.zone.prepared, cell_squares(self.frame))
        if not allowed.any():
            raise where.bad("it leaves no cell to fly over; make it smaller")
        mass = self.prior if mass is None else mass
        flyable, _, notes = _reachable_part(
            self.frame, allowed, mass, blocked, self.launch, where, self.coordinates
        )
        start = nearest_flyable(self.frame, flyable, self.launch)
        lost, place = allowed & ~flyable, ""
        if lost.any():
            row, col = np.unravel_index(np.argmax(np.where(lost, mass, -1.0)), lost.shape)
            lat, lon = self.frame.to_latlon([(row, col)])[0]
            place = written((float(lat), float(lon)), self.coordinates)
            whole = float(mass.sum())
            notes = (
                f"exclusions cut off ground around {place}, where {share(float(mass[lost].sum()) / whole)} of the "
                f"probability lies: it is not flown, what has {share(float(mass[flyable].sum()) / whole)} is",
            )
        return replace(
            self,
            flyable=_frozen(flyable),
            keep_out=blocked,
            start=start,
            layout_notes=self.layout_notes + notes,
            cut_off=place,
        )

    def with_prior(self, prior: ArrayLike) -> "Grid":
        """The same grid with another prior [rows, cols], such as one from a GeoTIFF; scaled to sum to 1.

        Raises:
            BadInput: no mass on searchable cells.
        """
        mass = np.where(self.searchable, np.asarray(prior, dtype=np.float64), 0.0)
        if not mass.sum() > 0:
            raise BadInput(
                "the prior has no mass on any cell that is searched; give one that covers the area."
            )
        return replace(self, prior=_frozen(mass / mass.sum()), area=None)

    @functools.cached_property
    def prior_places(self) -> dict[str, LatLon]:
        """The parts of the area file's prior by what people call them, with the middle of each, in the file's order."""
        parts = () if self.area is None else self.area.priors
        middles = {_called(part): prior_shape(part).centroid for part in parts}
        return {name: (float(middle.y), float(middle.x)) for name, middle in middles.items()}

    def prior_without(self, names: Collection[str]) -> FloatArray:
        """The prior, float [rows, cols], as it would be without the parts of these names in the area file."""
        assert self.area is not None
        priors = tuple(part for part in self.area.priors if _called(part) not in names)
        area, squares = replace(self.area, priors=priors), cell_squares(self.frame)
        return _frozen(area_prior(area, self.frame, squares, self.covered, self.searchable, self.mobility))


def _called(part: Prior) -> str:
    """What people call a part of the prior."""
    return name_in(part.label) or part.label


def build_grid(
    area: SearchArea,
    cell_m: float,
    *,
    margin_m: float | None = None,
    clearance_m: float = CLEARANCE_M,
    launch: LatLon | None = None,
    max_cells: int = 1_000_000,
    coordinates: Coordinates = "degrees",
) -> Grid:
    """Lay cells over an area.

    A cell is searchable when it holds any ground that is searched. It is flyable when its
    centre lies in the area grown by `margin_m` and its square keeps `clearance_m` from every
    exclusion. Between separate parts of the area the aircraft crosses the ground that the file
    draws for it (`transit`), or their convex hull, never an exclusion; of parts that are separate
    all the same only one is flyable: the one with the most prior mass that the launch point can
    reach. The strip of a searchable cell beside an exclusion
    stays searchable, though its cell may not be flown over: a footprint wider than a cell
    sees it, and with a footprint of one cell the belief honestly keeps its mass.

    Args:
        area: the checked area file.
        cell_m: the side of a cell in metres.
        margin_m: how far outside the area a cell's centre may be flown over, in metres; None
            is half a cell's diagonal, just enough that every searchable cell is flyable.
        clearance_m: the distance to keep from exclusions, in metres.
        launch: (latitude, longitude) to use instead of the launch point of the file, such as
            the aircraft's home; it may be as far from the area as one in the file.
        max_cells: the largest grid, rows x cols.
        coordinates: how the team writes places, in notes and messages.

    Raises:
        BadInput: cells too small or too large for the area, nothing left to fly over, or the
            launch point is in or behind an exclusion.
    """
    where = Where(area.source)
    _check_cell(area, cell_m, where)
    if launch is not None:
        check_launch(replace(area, launch=launch), where)
    half_diagonal = cell_m * math.sqrt(0.5) + 1e-6
    margin = half_diagonal if margin_m is None else margin_m
    if not (math.isfinite(margin) and margin >= 0):
        raise where.bad(f"the flight margin is {margin:g} m; give 0 or more metres")
    frame = lay_frame(area.polygon, cell_m, extra_m=0.0 if margin_m is None else margin)
    if frame.rows * frame.cols > max_cells:
        raise where.bad(
            f"cells of {cell_m:g} m make a grid of {frame.rows} x {frame.cols} cells, "
            f"more than {max_cells}; take larger cells or a smaller area"
        )
    squares = cell_squares(frame)
    covered = covered_fraction(squares, frame.flatten(area.ground))
    searchable = covered > _SLIVER
    if not searchable.any():
        raise where.bad(f"the area is too small for one cell of {cell_m:g} m; take smaller cells")
    prior = area_prior(area, frame, squares, covered, searchable)

    blocked = route.keep_out(frame, area.exclusions, clearance_m)
    centres = shapely.centroid(squares)
    clear = ~shapely.intersects(blocked.zone.prepared, squares)
    outline = frame.flatten(area.polygon)
    allowed = clear & shapely.dwithin(outline, centres, margin)
    crossed: tuple[str, ...] = ()
    if ndimage.label(allowed)[1] > 1 and not (transit := transit_ground(frame, area)).is_empty:
        outline = shapely.union(outline, transit)
        allowed = clear & shapely.dwithin(outline, centres, margin)
        ground = "the ground drawn as transit" if area.transit is not None else "their convex hull"
        crossed = (
            f"Between separate parts of the area the aircraft crosses {ground}, which is not searched.",
        )
    if not allowed.any():
        raise where.bad(f"the exclusions leave no cell of {cell_m:g} m to fly over; make them smaller")
    chosen = launch or area.launch
    flyable, home, notes = _reachable_part(frame, allowed, prior, blocked, chosen, where, coordinates)
    return Grid(
        frame=frame,
        prior=_frozen(prior),
        searchable=_frozen(searchable),
        flyable=_frozen(flyable),
        covered=_frozen(covered),
        outside=area.outside,
        launch=home,
        start=nearest_flyable(frame, flyable, home),
        keep_out=blocked,
        outline=outline,
        layout_notes=crossed + notes,
        clearance_m=clearance_m,
        area=area,
        target=area.target,
        coordinates=coordinates,
    )


def nearest_flyable(frame: GridFrame, flyable: BoolArray, latlon: LatLon) -> tuple[int, int]:
    """The flyable cell (row, col) whose centre is nearest to a position."""
    cells = np.argwhere(flyable)
    east, south = frame.to_metres([latlon])[0] / frame.cell_m - 0.5
    row, col = cells[np.argmin((cells[:, 0] - south) ** 2 + (cells[:, 1] - east) ** 2)]
    return int(row), int(col)


def leg_is_clear(grid: Grid, start: LatLon, end: LatLon) -> bool:
    """Whether the straight leg between two (latitude, longitude) stays clear of every exclusion."""
    return route.leg_is_clear(grid.frame, grid.keep_out, start, end)


def leads_out(grid: Grid, start: LatLon, end: LatLon) -> bool:
    """Whether the straight leg leaves the exclusion that it begins in or near, by about the nearest way."""
    return route.leads_out(grid.frame, grid.keep_out, start, end)


def way_home(grid: Grid, start: LatLon, end: LatLon) -> list[LatLon]:
    """The shortest route between two (latitude, longitude) around the exclusions; see `route.way`.

    Raises:
        BadInput: an exclusion closes every way.
    """
    points = route.way(grid.frame, grid.keep_out, start, end)
    if points is None:
        raise BadInput(
            f"no way from {written(start, grid.coordinates)} to {written(end, grid.coordinates)} "
            "goes around the exclusions; leave a gap between them."
        )
    return points


def transit_ground(frame: GridFrame, area: SearchArea) -> shapely.Geometry:
    """What may be crossed between the parts of an area, on the plane: as drawn, or their convex hull.

    A single polygon has no such ground unless it is drawn: what an exclusion cuts it into is not joined around it.
    """
    if area.transit is not None:
        return frame.flatten(area.transit)
    several = len(area.polygon.geoms) > 1
    return shapely.convex_hull(frame.flatten(area.polygon)) if several else shapely.Polygon()


def _check_cell(area: SearchArea, cell_m: float, where: Where) -> None:
    if not (math.isfinite(cell_m) and cell_m > 0):
        raise where.bad(f"the cell size is {cell_m:g} m; give a length greater than 0")
    surface = surface_m2(area.polygon)
    if surface < cell_m**2:
        raise where.bad(
            f"the area of {surface:.3g} m² is too small for one cell of {cell_m:g} m; "
            "take smaller cells or draw a larger area"
        )


def _reachable_part(
    frame: GridFrame,
    allowed: BoolArray,
    prior: FloatArray,
    blocked: KeepOut,
    launch: LatLon | None,
    where: Where,
    coordinates: Coordinates,
) -> tuple[BoolArray, LatLon, tuple[str, ...]]:
    """One connected part (4 neighbours) of the allowed cells, the launch point, and what to tell about it."""
    labels, best_first = _parts_to_fly(allowed, prior)
    if not best_first.size:
        raise where.bad(
            "no cell to fly over has another one beside it, and a search flies from cell to cell; take smaller cells, "
            "a larger area or smaller exclusions"
        )
    count = int(labels.max())
    notes: tuple[str, ...] = ()
    part = labels == best_first[0]
    if launch is None:
        cell = np.argwhere(part)[-1]
        lat, lon = frame.to_latlon([cell])[0]
        launch = (float(lat), float(lon))
        start = written(launch, coordinates)
        notes += (f"The area file has no launch point; the search starts from {start}.",)
    else:
        home = frame.to_metres([launch])[0]
        if shapely.intersects_xy(blocked.zone.prepared, *home):
            raise where.bad("the launch point lies in an exclusion or too near to one; move it away")
        for label in best_first:
            part = labels == label
            entry = frame.to_metres(frame.to_latlon([nearest_flyable(frame, part, launch)]))[0]
            if route.shortest_route(blocked, home, entry) is not None:
                break
        else:
            raise where.bad(
                "the launch point cannot reach the area without crossing an exclusion; move it or leave a gap"
            )
    if count > 1:
        lost = float(prior[allowed & ~part].sum())
        notes += (
            f"The cells that may be flown over fall into {count} separate parts; only the one with "
            f"{share(float(prior[part].sum()))} of the prior is flown, {share(lost)} lies in the others.",
        )
    return part, launch, notes


def _parts_to_fly(allowed: BoolArray, mass: FloatArray) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """The connected parts (4 neighbours) of the allowed cells: labels [rows, cols], and those of parts with more than
    one cell, which is where a planner has somewhere to go, the one with the most mass first, int [n]."""
    labels, count = ndimage.label(allowed)
    parts = np.arange(1, count + 1)
    held, size = ndimage.sum_labels(mass, labels, parts), ndimage.sum_labels(allowed, labels, parts)
    best_first = np.lexsort((-size, -held))
    return labels, best_first[size[best_first] > 1] + 1


def _prior_notes(prior: FloatArray, searchable: BoolArray, flyable: BoolArray) -> tuple[str, ...]:
    notes: tuple[str, ...] = ()
    unseen = 100 * float(prior[~flyable].sum())
    if unseen >= 0.05:
        notes += (
            f"{unseen:.3g} % of the prior lies in cells that may not be flown over; "
            "only a camera that sees more than one cell can look there.",
        )
    empty = int((searchable & (prior < _NO_MASS)).sum())
    if empty:
        notes += (
            f"{empty} of {int(searchable.sum())} searchable cells have a prior of 0: no search of them.",
        )
    return notes


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array

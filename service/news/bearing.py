"""What a piece of news says about each cell. Pure: a place on the ground goes in, numbers for cells come out.

A clue has a Bayes factor: how many times likelier it is to be met with if the target is there than if it is far from
there. A footprint that only the missing person can have left has a large one, a garment that anybody may have lost a
small one; below 1 it speaks against the place. At a point or a line it falls off as a Gaussian with the distance, in a
polygon it counts by the part of the cell that is covered. Ground that others have searched has a probability of
detection (POD), by the part of the cell that is covered. An exclusion says nothing of the target: it is ground that
must not be flown over any more. A part of the area file's prior that proved wrong, such as a phone fix, is refuted: it
was never assumed then.
"""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from service.area.document import one_line
from service.area.frame import GridFrame
from service.area.model import Exclusion
from service.area.prior import cell_squares, covered_fraction

NewsRole = Literal["clue", "searched", "exclude", "refute"]
ROLE_WORDS: dict[NewsRole, str] = {
    "clue": "a clue",
    "searched": "searched by others",
    "exclude": "not flown over any more",
    "refute": "not assumed any more",
}
"""What each role is called to people."""
_DRAWN_DEGREES, _MOST_CORNERS = 1e-5, 500  # about a metre
_NOTHING = 1e-6  # a factor so near to 1, or a POD so near to 0, is none


@dataclass(frozen=True, eq=False)
class FieldNews:
    """One piece of news as it is believed.

    `cells` int [k, 2]; `values` float [k]: for a clue the factors by which the prior there is multiplied, for ground
    that was searched the POD of it; none for an exclusion (early journals keep some). `shape` is its place in degrees,
    x = longitude; None: an early journal has only that of polygons. `words` are whose who sent it; `place` is its
    middle, latitude and longitude. `prior` is the name of the part of the area file's prior that is refuted.
    """

    id: str
    role: NewsRole
    words: str
    place: tuple[float, float]
    cells: NDArray[np.int64]
    values: NDArray[np.float64]
    shape: shapely.Geometry | None = None
    prior: str = ""

    @property
    def ground(self) -> shapely.MultiPolygon | None:
        """Its polygons in degrees, if it is drawn as such."""
        return self.shape if isinstance(self.shape, shapely.MultiPolygon) else None

    @functools.cached_property
    def drawn(self) -> dict[str, Any] | None:
        """Its shape as a GeoJSON geometry for maps, of no more corners than a page can be sent again and again."""
        if self.shape is None:
            return None
        tolerance, shape = _DRAWN_DEGREES, self.shape
        while shapely.get_num_coordinates(shape) > _MOST_CORNERS and tolerance < 1.0:
            shape, tolerance = shapely.simplify(self.shape, tolerance), 2.0 * tolerance
        told: dict[str, Any] = json.loads(shapely.to_geojson(shape))
        return told

    def says_as(self, other: FieldNews) -> bool:
        """Whether the other one says the same, under whatever name."""
        told, before = ((each.role, each.words, each.ground, each.prior) for each in (self, other))
        if told != before:
            return False
        return self.role == "exclude" or (
            np.array_equal(self.cells, other.cells) and np.array_equal(self.values, other.values)
        )


def as_exclusion(news: FieldNews) -> Exclusion:
    """An exclusion that was told as one of the area file, which keeps its mass."""
    assert news.ground is not None
    return Exclusion(
        news.ground, searchable=True, label=f'news ("{one_line(news.words)}")' if news.words else "news"
    )


def clue_factors(
    frame: GridFrame, shape: shapely.Geometry, bayes_factor: float, sigma_m: float | None
) -> NDArray[np.float64]:
    """The factor of each cell, float [rows, cols]; `shape` in degrees, `sigma_m` for what is no polygon."""
    flat = frame.flatten(shape)
    if shape.geom_type in ("Polygon", "MultiPolygon"):
        share = covered_fraction(cell_squares(frame), flat)
    else:
        assert sigma_m is not None
        rows, cols = np.indices(frame.shape)
        middles = shapely.points((cols + 0.5) * frame.cell_m, (rows + 0.5) * frame.cell_m)
        share = np.exp(-0.5 * (shapely.distance(middles, flat) / sigma_m) ** 2)
    return np.asarray(1.0 + (bayes_factor - 1.0) * share)


def searched_pod(frame: GridFrame, shape: shapely.Geometry, pod: float) -> NDArray[np.float64]:
    """The POD of each cell, float [rows, cols]; `shape` in degrees."""
    return pod * covered_fraction(cell_squares(frame), frame.flatten(shape))


def told_cells(
    values: NDArray[np.float64], searchable: NDArray[np.bool_], neutral: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The searchable cells about which something is said, int [k, 2], and what, float [k]."""
    says = searchable & (np.abs(values - neutral) > _NOTHING)
    return np.argwhere(says).astype(np.int64), values[says]

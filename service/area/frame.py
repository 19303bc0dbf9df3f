"""Cells to positions and back: a grid of square cells laid on the plane around the area."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from service.area.projection import FloatArray, Projection

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_SLACK = 1e-3
"""An extent of n cells and this part of one is n cells: drawn sizes are meant, millimetres are not."""


@dataclass(frozen=True)
class GridFrame:
    """Where the cells are. Rows go north to south, columns west to east, in the grid's own axes.

    Attributes:
        lat, lon: the point where the plane touches the earth, in degrees; the turn is about it.
        bearing_deg: true bearing of the grid's north at that point, in (-45, 45] degrees.
        cell_m: the side of a cell in metres.
        rows, cols: the number of cells.
        west_m, north_m: the north-west corner of the grid, in metres along the grid's own
            east and north from (lat, lon).
    """

    lat: float
    lon: float
    bearing_deg: float
    cell_m: float
    rows: int
    cols: int
    west_m: float
    north_m: float

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        return self.rows, self.cols

    @property
    def projection(self) -> Projection:
        """The plane under the grid."""
        return Projection(self.lat, self.lon)

    def to_metres(self, latlon: ArrayLike) -> FloatArray:
        """Positions [k, 2] (latitude, longitude) to metres [k, 2] (east, south) of the north-west corner,
        in the grid's own axes: row = floor(south / cell_m), col = floor(east / cell_m)."""
        return self._turn(self.projection.forward(latlon))

    def from_metres(self, metres: ArrayLike) -> FloatArray:
        """Metres [k, 2] (east, south) of the north-west corner to positions [k, 2] (latitude, longitude)."""
        points = np.asarray(metres, dtype=np.float64).reshape(-1, 2)
        east, north = points[:, 0] + self.west_m, self.north_m - points[:, 1]
        sin, cos = self._sin_cos()
        return self.projection.inverse(np.stack([east * cos + north * sin, north * cos - east * sin], axis=1))

    def to_latlon(self, cells: ArrayLike) -> FloatArray:
        """Centres of cells (row, col) [k, 2] as positions [k, 2]; fractions of a cell are allowed."""
        points = np.asarray(cells, dtype=np.float64).reshape(-1, 2)
        return self.from_metres((points[:, ::-1] + 0.5) * self.cell_m)

    def to_cells(self, latlon: ArrayLike) -> IntArray:
        """The cells (row, col) [k, 2] that positions [k, 2] lie in, also beyond the grid: see `locate`."""
        cells = np.floor(self.to_metres(latlon)[:, ::-1] / self.cell_m)
        return np.nan_to_num(cells, nan=-1.0, posinf=2.0**31, neginf=-(2.0**31)).astype(np.int64)

    def locate(self, latlon: ArrayLike) -> tuple[IntArray, BoolArray]:
        """The cells [k, 2] that positions [k, 2] lie in, and which of them are in the grid, bool [k]."""
        cells = self.to_cells(latlon)
        inside: BoolArray = np.all((cells >= 0) & (cells < np.array(self.shape)), axis=1)
        return cells, inside

    def corners(self) -> FloatArray:
        """The grid's corners north-west, north-east, south-east, south-west as positions [4, 2]."""
        width, height = self.cols * self.cell_m, self.rows * self.cell_m
        return self.from_metres([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])

    def flatten(self, shape: shapely.Geometry) -> shapely.Geometry:
        """A geometry in degrees (x = longitude) in the grid's metres (x = east, y = south)."""
        return shapely.transform(self.projection.flatten(shape), self._turn)

    def to_dict(self) -> dict[str, Any]:
        """The frame for the journal; `from_dict` gives it back to the last bit, also through JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, value: dict[str, Any]) -> "GridFrame":
        """The frame that `to_dict` wrote."""
        return cls(**value)

    def _sin_cos(self) -> tuple[float, float]:
        turn = math.radians(self.bearing_deg)
        return math.sin(turn), math.cos(turn)

    def _turn(self, plane: FloatArray) -> FloatArray:
        """Metres east and north of the projection's centre to metres east and south of our corner."""
        sin, cos = self._sin_cos()
        with np.errstate(invalid="ignore"):  # what is no position stays not finite
            east = plane[:, 0] * cos - plane[:, 1] * sin
            north = plane[:, 0] * sin + plane[:, 1] * cos
        return np.stack([east - self.west_m, self.north_m - north], axis=1)


def lay_frame(shape: shapely.Geometry, cell_m: float, *, extra_m: float = 0.0) -> GridFrame:
    """The smallest grid over a geometry in degrees, grown by `extra_m` metres all around.

    It is turned along the longest side of the geometry's minimum rotated rectangle when
    that makes fewer cells, else its north is true north.
    """
    projection = Projection.around(shape)
    hull = shapely.convex_hull(projection.flatten(shape))
    straight = _frame(projection, hull, cell_m, 0.0, extra_m)
    turned = _frame(projection, hull, cell_m, _bearing(hull), extra_m)
    return turned if turned.rows * turned.cols < straight.rows * straight.cols else straight


def _bearing(hull: shapely.Geometry) -> float:
    """The bearing in (-45, 45] of the axis nearest to north of the minimum rotated rectangle."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(hull))
    sides = np.diff(corners, axis=0)
    east, north = sides[np.argmax(np.hypot(*sides.T))]
    bearing = math.degrees(math.atan2(east, north)) % 90.0
    return bearing if bearing <= 45.0 else bearing - 90.0


def _frame(
    projection: Projection, hull: shapely.Geometry, cell_m: float, bearing_deg: float, extra_m: float
) -> GridFrame:
    unplaced = GridFrame(projection.lat, projection.lon, bearing_deg, cell_m, 0, 0, 0.0, 0.0)
    west, north, east, south = shapely.bounds(shapely.transform(hull, unplaced._turn))
    width, height = east - west + 2 * extra_m, south - north + 2 * extra_m
    cols = max(1, math.ceil(width / cell_m - _SLACK))
    rows = max(1, math.ceil(height / cell_m - _SLACK))
    west_m = float((west + east - cols * cell_m) / 2)
    north_m = float((rows * cell_m - north - south) / 2)
    return GridFrame(projection.lat, projection.lon, bearing_deg, cell_m, rows, cols, west_m, north_m)

"""What is drawn on a map, as GeoJSON features (RFC 7946): area, exclusions, launch, regions, cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from service.area import Grid, SearchArea
from service.area.prior import cell_squares

DIGITS = 7  # of a degree: a centimetre


def feature(geometry: dict[str, Any], role: str, **properties: Any) -> dict[str, Any]:
    """A feature with a role, as area files have it."""
    return {"type": "Feature", "geometry": geometry, "properties": {"role": role, **properties}}


def collection(features: Sequence[dict[str, Any]], **members: Any) -> dict[str, Any]:
    """Features as one file."""
    return {"type": "FeatureCollection", **members, "features": list(features)}


def point(lat: float, lon: float) -> dict[str, Any]:
    """A position as a geometry."""
    return {"type": "Point", "coordinates": [round(lon, DIGITS), round(lat, DIGITS)]}


def line(points: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Positions (lat, lon) as a line."""
    return {"type": "LineString", "coordinates": [[round(p[1], DIGITS), round(p[0], DIGITS)] for p in points]}


def area_features(area: SearchArea, grid: Grid) -> list[dict[str, Any]]:
    """The area as drawn, its exclusions and the launch point."""
    features = [feature(_plain(area.polygon), "search", name=area.name)]
    features += [
        feature(_plain(each.polygon), "exclude", searchable=each.searchable) for each in area.exclusions
    ]
    return [*features, feature(point(*grid.launch), "launch")]


def region_features(grid: Grid, labels: NDArray[np.integer[Any]]) -> list[dict[str, Any]]:
    """The outline of each region of interest along its cells, with its number and a place for its label."""
    squares, features = cell_squares(grid.frame), []
    for number in range(1, int(labels.max(initial=0)) + 1):
        outline = shapely.union_all(squares[labels == number])
        if outline.is_empty:
            continue
        middle = shapely.point_on_surface(outline)
        lat, lon = grid.frame.from_metres([[middle.x, middle.y]])[0]
        label = [round(float(lat), DIGITS), round(float(lon), DIGITS)]
        features.append(feature(_on_earth(grid, outline), "region", number=number, label=label))
    return features


def cell_features(
    grid: Grid, probability: NDArray[np.float64], pod: NDArray[np.float64]
) -> list[dict[str, Any]]:
    """Every cell that is searched, as a square with its probability and its POD."""
    cells = np.argwhere(grid.searchable)
    around = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])  # row, col; counter-clockwise seen from above
    corners = (cells[:, None, :] + around[None, :, :]).reshape(-1, 2)[:, ::-1] * grid.frame.cell_m
    rings = np.round(grid.frame.from_metres(corners)[:, ::-1], DIGITS).reshape(-1, 5, 2).tolist()
    return [
        feature(
            {"type": "Polygon", "coordinates": [ring]},
            "cell",
            row=row,
            col=col,
            probability=float(probability[row, col]),
            pod=round(float(pod[row, col]), 6),
        )
        for (row, col), ring in zip(cells.tolist(), rings, strict=True)
    ]


def _on_earth(grid: Grid, shape: shapely.Geometry) -> dict[str, Any]:
    """A geometry in the grid's metres as one in degrees."""
    return _plain(shapely.transform(shape, lambda xy: grid.frame.from_metres(xy)[:, ::-1]))


def _plain(shape: shapely.Geometry) -> dict[str, Any]:
    turned = shapely.orient_polygons(shape) if hasattr(shapely, "orient_polygons") else shape
    rounded = shapely.transform(turned, lambda xy: np.round(xy, DIGITS))
    geometry: dict[str, Any] = shapely.geometry.mapping(rounded)
    return geometry

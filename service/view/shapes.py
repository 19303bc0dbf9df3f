"""What is drawn on a map, as GeoJSON features (RFC 7946): area, exclusions, launch, regions, cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.polygon import orient

from service.area import Grid, SearchArea
from service.area.frame import GridFrame
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
    features = [feature(plain(area.polygon), "search", name=area.name)]
    features += [
        feature(plain(each.polygon), "exclude", searchable=each.searchable) for each in area.exclusions
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
        features.append(feature(plain(on_earth(grid.frame, outline)), "region", number=number, label=label))
    return features


def cell_features(
    grid: Grid, probability: NDArray[np.float64], pod: NDArray[np.float64], cells: NDArray[np.int64]
) -> list[dict[str, Any]]:
    """Cells, int [k, 2], as squares with their probability and their POD."""
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


def on_earth(frame: GridFrame, flat: shapely.Geometry) -> shapely.Geometry:
    """A geometry in the grid's metres (x = east, y = south) as one in degrees (x = longitude)."""
    return oriented(shapely.transform(flat, lambda points: frame.from_metres(points)[:, ::-1]))


def oriented(shape: shapely.Geometry) -> shapely.Geometry:
    """A Polygon or MultiPolygon with its outer rings counter-clockwise (RFC 7946, section 3.1.6)."""
    parts = [orient(part) for part in shapely.get_parts(shape)]
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)


def plain(shape: shapely.Geometry) -> dict[str, Any]:
    """A Polygon or MultiPolygon in degrees as a GeoJSON geometry."""
    rounded = shapely.transform(oriented(shape), lambda points: np.round(points, DIGITS))
    geometry: dict[str, Any] = shapely.geometry.mapping(rounded)
    return geometry

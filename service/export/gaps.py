"""Where the search has gaps: ground that was not looked at well enough and where the target may well be.

A cell belongs to a gap when its probability of detection so far is below a stated level and the target is there
with at least a stated part of what an average cell held at the start. Neighbouring cells (4 directions) make one
polygon, cut to the area as drawn; holes stay holes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage

from service.area.frame import BoolArray
from service.area.prior import cell_squares
from service.export.model import ExportedRun
from service.export.wishes import Wishes
from service.geometry import LatLon
from service.view.shapes import on_earth

_LEAST_M2 = 1.0


@dataclass(frozen=True)
class Gap:
    """A piece of ground to fly again.

    Attributes:
        polygon: shapely, x = longitude, y = latitude in degrees; a Polygon or MultiPolygon.
        poa: probability that the target is there.
        pod: mean probability of detection of its cells so far.
        area_m2: its surface.
        cells: how many cells it touches.
        middle: (lat, lon) of a point in it.
        flyable: False when no cell of it may be flown over.
    """

    polygon: shapely.Geometry
    poa: float
    pod: float
    area_m2: float
    cells: int
    middle: LatLon
    flyable: bool


def gap_cells(run: ExportedRun, wishes: Wishes) -> BoolArray:
    """The cells that are gaps, bool [rows, cols]."""
    grid = run.grid
    average = (1.0 - grid.outside) / int(grid.searchable.sum())
    return np.asarray(
        grid.searchable & (run.pod < wishes.pod_below) & (run.poa >= wishes.poa_above * average)
    )


def find_gaps(run: ExportedRun, wishes: Wishes) -> list[Gap]:
    """The gaps, the one with the most probability first."""
    frame, grid, poa = run.frame, run.grid, run.poa
    labels, count = ndimage.label(gap_cells(run, wishes))
    squares, ground = cell_squares(frame), frame.flatten(run.area.ground)
    gaps = []
    for number in range(1, count + 1):
        inside = labels == number
        flat = _surfaces(shapely.intersection(shapely.union_all(squares[inside]), ground))
        if flat.area < _LEAST_M2:
            continue
        middle = shapely.point_on_surface(flat)
        lat, lon = frame.from_metres([[middle.x, middle.y]])[0]
        gaps.append(
            Gap(
                polygon=on_earth(frame, flat),
                poa=float(poa[inside].sum()),
                pod=float(run.pod[inside].mean()),
                area_m2=float(flat.area),
                cells=int(inside.sum()),
                middle=(float(lat), float(lon)),
                flyable=bool((inside & grid.flyable).any()),
            )
        )
    return sorted(gaps, key=lambda gap: -gap.poa)


def _surfaces(shape: shapely.Geometry) -> shapely.Geometry:
    """The polygons of a geometry, without the points and lines at which others only touched."""
    parts = [part for part in shapely.get_parts(shape) if isinstance(part, shapely.Polygon)]
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)

"""What is left to search as a QGroundControl .plan: take-off, waypoints, the way home, and a geofence.

The waypoints are the turns of the path that the planner flies from here on if it detects nothing, so the richest
cells come first, in an order worth flying, and never over what is excluded. The fence is what encloses them. A mission
that is flown from a plan tells nobody what it has seen: `roisearch-service --resume` goes on with the search itself.

Format: QGroundControl developer guide, "Plan file format", mission version 2, geofence version 2.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from roisearch.detection import DetectionRecord
from service.area import way_home
from service.errors import BadInput
from service.export.model import ExportedRun
from service.export.wishes import Wishes
from service.geometry import Cell, LatLon
from service.ground.route import route_over
from service.mission.navigator import straight_part
from service.preview.foresight import foresee
from service.preview.pace import climb_seconds, farthest_from_launch, route_seconds
from service.search import Search
from service.view.shapes import on_earth

log = logging.getLogger("roisearch")
MOST_WAYPOINTS = 480
"""Turns of the path at most: an autopilot holds only so many items, and a person wants to look through them."""

ENOUGH = 0.95
"""The mission ends when it would have found so much of what can be found."""

FENCE_M = 30.0
"""How far the fence is from the path: position error, overshoot and wind at a turn."""

TAKE_OFF, WAYPOINT, CHANGE_SPEED, RETURN = 22, 16, 178, 20  # MAV_CMD
GLOBAL_RELATIVE, MISSION = 3, 2  # MAV_FRAME
PX4, ARDUPILOT, QUADROTOR = 12, 3, 2  # MAV_AUTOPILOT, MAV_TYPE


def write(run: ExportedRun, wishes: Wishes) -> bytes:
    """The plan as JSON. Raises BadInput when nothing is left to search."""
    if run.find is not None:
        raise BadInput(f"{run.name}: the target was found, so there is nothing left to plan for")
    route = mission_route(run, wishes)
    flight, launch = run.settings.flight, run.grid.launch
    route, up = heights_of(run, route)
    items = [
        _item(CHANGE_SPEED, MISSION, [1, flight.speed_mps, -1, 0, 0, 0, 0]),
        _item(TAKE_OFF, GLOBAL_RELATIVE, [0, 0, 0, None, *launch, up[0]]),
        *(
            _item(WAYPOINT, GLOBAL_RELATIVE, [0, 0, 0, None, *at, height])
            for at, height in zip(route, up[1:], strict=True)
        ),
        _item(RETURN, MISSION, [0, 0, 0, 0, 0, 0, 0]),
    ]
    plan = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": ARDUPILOT if run.autopilot == "ardupilot" else PX4,
            "vehicleType": QUADROTOR,
            "cruiseSpeed": flight.speed_mps,
            "hoverSpeed": flight.speed_mps,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [*launch, run.launch_amsl_m or 0.0],
            "items": [{**item, "doJumpId": number} for number, item in enumerate(items, 1)],
        },
        "geoFence": {"version": 2, "circles": [], "polygons": _fence(run, [launch, *route])},
        "rallyPoints": {"version": 2, "points": []},
    }
    return json.dumps(plan, indent=2, allow_nan=False).encode()


def heights_of(run: ExportedRun, route: list[LatLon]) -> tuple[list[LatLon], list[float]]:
    """The waypoints, and the height of the take-off and of each of them above the launch point.

    Over ground with heights there are more, so that each leg clears the ground, and the last is above the launch point:
    the autopilot's own return from elsewhere might not.
    """
    relief, launch = run.grid.relief, run.grid.launch
    if relief is None:
        return route, [run.settings.flight.altitude_m] * (1 + len(route))
    over = route_over(run.grid, relief, run.settings.flight, [launch, *route, launch])
    if not all(math.isfinite(height) for height in over.heights):
        raise BadInput(
            f"{run.name}: the route leads over ground whose height is not known; give a larger ground file"
        )
    return list(over.points[1:]), list(over.heights)


def mission_route(run: ExportedRun, wishes: Wishes) -> list[LatLon]:
    """The waypoints (lat, lon) in order, without take-off and landing."""
    search = Search(run.grid, run.settings)
    search.known.belief = run.belief.copy()
    search.known.record = DetectionRecord(
        run.poa, run.belief.outside, walk=run.grid.walk, searchable=run.grid.searchable
    )
    search.warm_up(lambda name, done, total: log.info("preparing the planner: %s (%d/%d)", name, done, total))
    reachable = float(run.poa[run.grid.flyable].sum())
    seen = foresee(
        search,
        run.grid.start,
        most_s=_seconds(run, wishes),
        until=ENOUGH * reachable,
        most_steps=run.settings.search.max_steps,
        rng=np.random.default_rng(run.settings.run.seed),
        false_alarms=False,
    )
    turns = turning_cells(seen.cells)[:MOST_WAYPOINTS]
    grid = run.grid
    path = [(float(lat), float(lon)) for lat, lon in grid.frame.to_latlon(np.array(turns))]
    there, home = way_home(grid, grid.launch, path[0]), way_home(grid, path[-1], grid.launch)
    log.info("plan: %d waypoints, %.0f %% of the probability", len(path), 100 * float(seen.pos[-1]))
    return [*there, *path[1:], *home[:-1]]


def turning_cells(cells: Sequence[Cell]) -> list[Cell]:
    """The cells of a path at which an aircraft must be told something: the first, every turn, the last."""
    turns = [cells[0]]
    rest = list(cells[1:])
    while rest:
        straight = straight_part(turns[-1], rest)
        turns.append(straight[-1])
        rest = rest[len(straight) :]
    return turns


def _seconds(run: ExportedRun, wishes: Wishes) -> float:
    """How long the search itself may take: the mission less take-off, landing and the longest way home."""
    grid, flight = run.grid, run.settings.flight
    farthest = route_seconds(grid, flight, farthest_from_launch(grid), grid.launch)
    most = flight.max_flight_s if wishes.minutes is None else 60.0 * wishes.minutes
    landing = flight.return_height_m / flight.descent_mps
    around = climb_seconds(flight, grid) + 2.0 * farthest + landing
    if most <= around:
        raise BadInput(
            f"{run.name}: {most / 60:g} minutes are too short: take-off, landing and the longest way there and home "
            f"take {around / 60:.1f}; give more --minutes"
        )
    return most - around


def _item(command: int, frame: int, params: list[float | None]) -> dict[str, Any]:
    """A simple mission item; `params` are the seven of MISSION_ITEM, None for NaN."""
    item: dict[str, Any] = {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": command,
        "frame": frame,
        "params": [None if value is None else round(value, 8) for value in params],
    }
    if frame == GLOBAL_RELATIVE:
        item |= {"AMSLAltAboveTerrain": None, "Altitude": params[6], "AltitudeMode": 1}
    return item


def _fence(run: ExportedRun, points: Sequence[LatLon]) -> list[dict[str, Any]]:
    """What encloses every waypoint, and the exclusions, which the route keeps `CLEARANCE_M` away from."""
    frame = run.frame
    hull = shapely.convex_hull(shapely.MultiPoint(frame.to_metres(points)))
    polygons = [_ring(on_earth(frame, shapely.buffer(hull, FENCE_M, quad_segs=2)), inclusion=True)]
    for exclusion in run.area.exclusions:
        for part in exclusion.polygon.geoms:
            polygons.append(_ring(part, inclusion=False))
    return polygons


def _ring(polygon: shapely.Polygon, *, inclusion: bool) -> dict[str, Any]:
    corners = [[round(lat, 8), round(lon, 8)] for lon, lat, *_ in polygon.exterior.coords[:-1]]
    return {"version": 1, "inclusion": inclusion, "polygon": corners}

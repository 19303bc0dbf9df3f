"""Paths flown by the mock autopilot's body under the service's navigator, without a link: for tests of time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from service.config import FlightSettings
from service.mission.navigator import Navigator
from service.motion import motion_of
from sim.autopilot.ardupilot import ArduCopter
from sim.autopilot.motion import Body, Demand
from sim.autopilot.px4 import Px4
from sim.autopilot.settings import STEP_S

FLAVOURS = {"px4": Px4, "ardupilot": ArduCopter}
TICK_STEPS = 5  # the mission looks ten times a second
Cell = tuple[int, int]


def flown(path: list[Cell], flavour: str, *, cell_m: float = 25.0) -> NDArray[np.float64]:
    """Seconds at which the middle of each cell is reached, float [n], from a stand in the cell before the first.

    `path` begins with the cell where the aircraft stands: the result is for the others.
    """
    body = Body(FLAVOURS[flavour].flavor.limits, 0.0)
    body.up, body.on_ground = 30.0, False
    body.north, body.east = -path[0][0] * cell_m, path[0][1] * cell_m
    flight = FlightSettings()
    navigator = Navigator(motion_of(flight, cell_m), flight.speed_mps)
    navigator.begin(path[0], "north")
    demand = Demand(body.limits)
    demand.north, demand.east, demand.up, demand.speed = body.north, body.east, 30.0, flight.speed_mps
    sent = 0  # the place in the path of the last cell that was sent
    trace: list[tuple[float, float, float]] = []
    last = path[-1]
    for step in range(200_000):
        if step % TICK_STEPS == 0:
            trace.append((step * STEP_S, -body.north / cell_m, body.east / cell_m))
            here = (round(-body.north / cell_m), round(body.east / cell_m))
            navigator.entered(here)
            row, col = navigator.waypoint
            remaining = math.hypot(-row * cell_m - body.north, col * cell_m - body.east)
            if here == last and sent == len(path) - 1 and remaining < 2.0:
                break
            if sent < len(path) - 1 and navigator.wants_decision(remaining, 0.1):
                navigator.decide(path[sent + 1 : sent + 9])
            leg = navigator.due(remaining, body.speed)
            if leg is not None:
                target = leg.end
                while path[sent] != target or sent == 0:
                    sent += 1
                row, col = navigator.aim(leg)
                demand.north, demand.east = -row * cell_m, col * cell_m
        body.step(demand, (body.north, body.east, body.up), (0.0, 0.0), True)
    return nearest_times(np.array(trace), path)


def nearest_times(trace: NDArray[np.float64], path: list[Cell]) -> NDArray[np.float64]:
    """When the aircraft was nearest to the middle of each cell, one after the other."""
    times, begin = [], 0
    for row, col in path[1:]:
        away = np.hypot(trace[begin:, 1] - row, trace[begin:, 2] - col)
        near = np.flatnonzero(away < 0.45)
        gone = np.flatnonzero(away[near[0] :] >= 0.45)
        end = near[0] + (gone[0] if gone.size else away.size - near[0])
        best = near[0] + int(away[near[0] : end].argmin())
        begin += best
        times.append(trace[begin, 0])
    return np.array(times)

"""Whole searches over drawn grounds and drawn areas: no leg, no climb and no way home is nearer than the clearance.

An ideal aircraft is flown by the words of `Heights` alone: to the area, from cell to cell, and home from wherever it
is. What it clears is asked of the posts themselves, by another reckoning than the legs' own.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch.directions import STEPS, moves_allowed
from service.area import Grid, build_grid, parse_area
from service.config import Settings
from service.errors import BadInput
from service.geometry import LatLon
from service.ground.flyable import can_be_flown
from service.ground.relief import Relief
from service.mavlink.events import Home
from service.mission.chart import Chart
from service.mission.heights import Heights, Leg
from tests.service.area.files import at, box, collection, feature, point, polygon
from tests.service.mission.flown import telemetry

STEP, CLEARANCE, ALTITUDE, NEAR, MOST = 10.0, 15.0, 30.0, 10.0, 120.0
AROUND = 500.0
SETTINGS = Settings.model_validate(
    {
        "flight": {"altitude_m": ALTITUDE, "clearance_m": CLEARANCE, "max_height_m": MOST},
        "sensor": {"cell_m": 20.0},
    }
)
TURN = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
RING = np.concatenate([[[0.0, 0.0]], NEAR * np.stack([np.cos(TURN), np.sin(TURN)], axis=1)])


def area_of(east: float, north: float, launch: tuple[float, float], pond: bool) -> Grid:
    """A rectangle, with a pond in its middle that is not flown over or none, and a launch point outside or inside."""
    features = [feature(polygon(box(0, 0, east, north))), feature(point(at(*launch)), role="launch")]
    if pond:
        middle = box(0.4 * east, 0.4 * north, 0.6 * east, 0.6 * north)
        features.append(feature(polygon(middle), role="exclude"))
    return build_grid(parse_area(json.dumps(collection(*features)).encode(), source="drawn"), 20.0)


def over_ground(grid: Grid, seed: int, steep: float, rough: float) -> Grid:
    """The grid over waves and a slope, with tops that stand out between cells; BadInput where nothing is left."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:150, 0:150] * 1.0
    heights = steep * STEP * (x * rng.uniform(-1, 1) + y * rng.uniform(-1, 1))
    for _ in range(3):
        a, b, c = rng.uniform(0.02, 0.25), rng.uniform(0.02, 0.25), rng.uniform(0.0, 6.0)
        heights += rng.uniform(0.0, 25.0) * np.sin(a * x + b * y + c)
    heights += rough * (rng.random(heights.shape) < 0.04)
    relief = Relief(heights, STEP, -AROUND, -AROUND, NEAR, 400.0)
    base = float(relief.height_at(grid.frame.to_metres([grid.launch]))[0])
    relief = replace(relief, heights=heights - base)
    return grid.over(relief, can_be_flown(relief, grid.frame, CLEARANCE, MOST), "it is too steep")


class Ideal:
    """An aircraft that does exactly what it is told; it notes the least that it was above any ground within reach."""

    def __init__(self, grid: Grid) -> None:
        assert grid.relief is not None
        self.relief: Relief = grid.relief
        self.grid, self.chart = grid, Chart(grid)
        self.heights = Heights(self.chart, SETTINGS)
        self.place, self.up, self.least = grid.launch, 0.0, math.inf
        self.heights.reckon(self.told(armed=False), grid.launch)
        self.up = self.heights.take_off_m()

    def told(self, **more: Any) -> Any:
        """The telemetry."""
        lat, lon = self.place
        home = Home(*self.grid.launch, 400.0)
        return telemetry(lat=lat, lon=lon, alt_home_m=self.up, alt_amsl_m=400.0 + self.up, home=home, **more)

    def send(self, there: LatLon, *, on_way: bool) -> None:
        """Fly to a place: climb or sink first where it says so; then the gate must let the leg pass."""
        for _ in range(8):
            leg = self.heights.leg(there, self.told(), on_way=on_way)
            if not (leg.climbs or leg.sinks):
                break
            assert self.heights.objection(self.place, leg.altitude_m, self.told(), on_way=on_way) == ""
            self._move(self.place, leg)
        else:
            pytest.fail("it climbs and climbs")
        assert self.heights.objection(there, leg.altitude_m, self.told(), on_way=on_way) == ""
        self._move(there, leg)

    def way(self, points: list[LatLon]) -> None:
        """Fly a way, piece by piece."""
        for goal in points:
            for _ in range(80):
                self.send(point := self.heights.piece(goal, self.told()), on_way=True)
                if point == goal:
                    break
            else:
                pytest.fail("the way does not end")

    def _move(self, there: LatLon, leg: Leg) -> None:
        up = leg.altitude_m - 400.0
        a, b = self._metres(self.place), self._metres(there)
        share = np.linspace(0.0, 1.0, 2 + int(np.hypot(*(b - a)) / 4.0))
        straight = self.up + share * (up - self.up)
        at_once = np.full(share.size, up) if up < self.up else straight
        late = np.minimum(self.up + share * np.hypot(*(b - a)) * 2.0 / 8.0, np.maximum(up, self.up))
        lowest = np.minimum(np.minimum(straight, at_once), late if up > self.up else straight)
        if there == self.place:
            lowest = np.array([min(self.up, up)])
            share = share[:1]
        around = a + share[:, None, None] * (b - a) + RING
        roof = self.relief.height_at(around.reshape(-1, 2)).reshape(share.size, -1).max(axis=1)
        climbing_from_below = there == self.place and up > self.up
        if not climbing_from_below:
            self.least = min(self.least, float((lowest - roof).min()))
        self.place, self.up = there, up

    def _metres(self, there: LatLon) -> NDArray[np.float64]:
        return np.asarray(self.grid.frame.to_metres([there])[0])


sides = st.floats(60.0, 320.0)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32), st.floats(0.0, 0.5), st.floats(0.0, 50.0), sides, sides,
    st.tuples(st.floats(-60.0, 100.0), st.floats(-60.0, 100.0)), st.booleans(),
)  # fmt: skip
def test_over_any_ground_and_area_nothing_that_is_flown_is_nearer_than_the_clearance(
    seed: int, steep: float, rough: float, east: float, north: float, launch: tuple[float, float], pond: bool
) -> None:
    try:
        flown = Ideal(over_ground(area_of(east, north, launch, pond), seed, steep, rough))
    except BadInput:
        assume(False)
    grid, rng = flown.grid, np.random.default_rng(seed)
    cell = grid.start
    flown.way(flown.chart.route(flown.place, flown.chart.latlon(cell)))
    allowed = moves_allowed(grid.flyable)
    for _ in range(24):
        moves = [step for bit, step in enumerate(STEPS) if allowed[cell] >> bit & 1]
        if not moves:
            break
        down, right = moves[rng.integers(len(moves))]
        cell = (cell[0] + down, cell[1] + right)
        flown.send(flown.chart.latlon(cell), on_way=False)
    flown.way(flown.chart.route(flown.place, grid.launch))
    assert flown.place == grid.launch
    assert flown.least >= CLEARANCE

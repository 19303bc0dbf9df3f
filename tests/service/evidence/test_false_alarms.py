"""How often FOUND is wrong, with a detector that raises a false alarm in every tenth look.

Whole searches without the flight: the planner's moves, the sensor's footprint, the simulated detector, the intake's
evidence. FOUND at level `a` promises that the target is there with probability `a` or more, so of n searches that end
FOUND at that level, wrong ones are at most Binomial(n, 1 - a). The test is exact and one-sided: it fails when so many
wrong ones as were seen, or more, had a probability below 1 in 1000 at the promised rate.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from roisearch import SearchState
from roisearch.directions import direction_between
from service.area import Grid, build_grid, read_area
from service.config import Settings
from service.demo import draw
from service.evidence.observe import FramePose, observe
from service.evidence.passes import Passes
from service.evidence.reports import Report
from service.evidence.sensors import cell_size, make_sensor
from service.search import Search
from sim.detector import Detector

AREAS = sorted((Path(__file__).parents[3] / "config" / "areas").glob("*.geojson"))
SEEDS = range(1, 21)
LEVELS = (0.8, 0.999)  # a low level, which gives wrong ones to count, and the default
BEARING = {"north": 0.0, "east": 90.0, "south": 180.0, "west": 270.0}
MOST_STEPS = 6000
SETTINGS = Settings.model_validate({"search": {"planner": "index"}})
CORNERS = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])


def fly(grid: Grid, seed: int, *, frames: int = 2, one_look_per_pass: bool = True) -> dict[float, bool]:
    """One search with so many frames of each cell flown over: for each level that was passed, whether the place was
    right when it was passed first."""
    search, frame = Search(grid, SETTINGS), grid.frame
    sensor, passes = make_sensor(SETTINGS, grid), Passes()
    target = draw(grid, seed)
    goal = frame.to_cells([target])[0]
    detector = Detector(target, SETTINGS.sensor.p_tp, SETTINGS.sensor.p_tn, seed)
    rng = np.random.default_rng(seed)
    state, first = SearchState(cell=grid.start, heading="north"), {}
    for step in range(MOST_STEPS):
        after = search.planner.plan(search.belief, state, rng).path[0]
        state = SearchState(cell=after, heading=direction_between(state.cell, after))
        (lat, lon), *corners = frame.to_latlon(np.vstack([[after], np.array(after) + CORNERS])).tolist()
        where = {"row": after[0], "col": after[1], "lat": lat, "lon": lon, "corners": corners}
        worth = {"counts": True, "covered": 1.0, "p_tp": 0.9, "p_tn": 0.9}
        pose = FramePose(lat, lon, SETTINGS.flight.altitude_m, BEARING[state.heading], float(step))
        for frame_number in range(frames):
            time = step + frame_number / frames
            told = {"pose": {"time": time}, "footprint": {**worth, "cells": [{**where, **worth}]}}
            reading = sensor.read(pose, Report.model_validate(detector.frame(told)))
            if not one_look_per_pass:
                passes = Passes()
            if (observation := observe(passes, "simulated", time, reading)) is not None:
                search.take(observation)
        for level in LEVELS:
            if level not in first and search.place.probability >= level and search.was_hit(search.place):
                first[level] = bool(np.abs(np.array(search.place.cell) - goal).max() <= 1)
        if len(first) == len(LEVELS):
            break
    return first


def too_many(wrong: int, of: int, level: float) -> bool:
    """Whether so many wrong ones are next to impossible at the promised rate."""
    return float(binom.sf(wrong - 1, of, 1.0 - level)) < 1e-3


@pytest.fixture(scope="module")
def grids() -> dict[str, Grid]:
    return {area.stem: build_grid(read_area(area), cell_size(SETTINGS)) for area in AREAS}


def test_found_is_wrong_no_more_often_than_its_level_says(grids: dict[str, Grid]) -> None:
    flights = [fly(grid, seed) for grid in grids.values() for seed in SEEDS]
    assert len(flights) == 60
    for level in LEVELS:
        ends = [flight[level] for flight in flights if level in flight]
        assert len(ends) >= 55  # the others ran out of steps
        assert not too_many(ends.count(False), len(ends), level), (level, ends.count(False), len(ends))


def test_taking_every_frame_for_a_look_would_be_seen_to_be_wrong(grids: dict[str, Grid]) -> None:
    flights = [fly(grids["coast"], seed, frames=3, one_look_per_pass=False) for seed in SEEDS]
    wrong = sum(not flight.get(0.999, True) for flight in flights)
    assert too_many(wrong, len(flights), 0.999)

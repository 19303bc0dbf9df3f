"""When how much POS is to be expected: by the planner that flies, and by its motion."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from service.config import Settings
from service.search import Search, begin
from service.survey import AREA, survey
from service.view.estimate import Estimator, Forecast, SearchingAircraft
from tests.service.export.recorded import SETTINGS, field_grid


@pytest.fixture
def search(tmp_path: Path) -> Search:
    field_grid(tmp_path)
    return Search(survey(tmp_path / AREA, None, SETTINGS)[1], SETTINGS)


def latest(estimator: Estimator, *crew: Search) -> Forecast:
    """The first forecast, once it is there."""
    for _ in range(2000):
        if (
            forecast := estimator.latest(
                [SearchingAircraft(each, each.grid.start, "north") for each in crew], 100.0
            )
        ) is not None:
            return forecast
        time.sleep(0.05)
    raise AssertionError("no forecast came")


def test_the_forecast_is_by_the_planner_that_flies_and_in_seconds_of_its_motion(search: Search) -> None:
    forecast = latest(Estimator(time.monotonic), search)
    assert forecast.planner == search.settings.search.planner == "puct-regions-lite"
    assert len(forecast.seconds) == len(forecast.gained)
    assert (np.diff(forecast.seconds) > 0.0).all()
    fastest = search.grid.frame.cell_m / search.motion.speed_mps
    assert forecast.seconds[-1] > 0.7 * fastest * (len(forecast.seconds) - 1)
    said = forecast.to_goals(0.0, 100.0)
    assert "puct-regions-lite" in said["basis"]
    half = said["goals"][0]["seconds"]
    assert half is not None
    assert 0.0 < half <= forecast.seconds[-1]
    assert forecast.to_goals(0.0, 110.0)["goals"][0]["seconds"] == pytest.approx(half - 10.0)


def test_a_slower_aircraft_is_expected_later(search: Search) -> None:
    slow_settings = Settings.model_validate(
        {**SETTINGS.model_dump(), "flight": {**SETTINGS.flight.model_dump(), "speed_mps": 4.0}}
    )
    slow = Search(search.grid, slow_settings)
    usual_s, slow_s = (
        latest(Estimator(time.monotonic), each).to_goals(0.0, 100.0)["goals"][0]["seconds"]
        for each in (search, slow)
    )
    assert usual_s is not None
    assert slow_s is not None
    assert slow_s > 1.1 * usual_s  # the field is small: most is speeding up and braking


def test_two_are_expected_in_little_more_than_half_of_the_time_of_one(search: Search) -> None:
    common = begin(search.grid, SETTINGS)
    first = Search(search.grid, SETTINGS, aircraft="1", common=common)
    second = first.beside("2", SETTINGS)
    estimator = Estimator(time.monotonic)
    together = latest(estimator, first, second)
    alone = latest(Estimator(time.monotonic), first)
    assert (np.diff(together.seconds) >= 0.0).all()
    assert together.crew == ("1", "2")
    assert together.gained[-1] == pytest.approx(alone.gained[-1], abs=0.02)
    pair_s, one_s = (each.to_goals(0.0, 100.0)["goals"][1]["seconds"] for each in (together, alone))
    assert pair_s is not None
    assert one_s is not None
    assert 0.45 * one_s < pair_s < 0.8 * one_s  # the field is small, and both start in one corner
    assert "for the 2 aircraft that search now" in together.to_goals(0.0, 100.0)["basis"]
    one = [SearchingAircraft(first, first.grid.start, "north")]
    assert estimator.latest(one, 100.0) is None  # that of both is none of one

"""How many batteries a search takes: each is home in time, POS is never lost between them, and height is no guess."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.area import Grid
from service.config import Settings
from service.preview.batteries import fly_batteries, from_height, p_tp_from, what_would_help
from service.survey import AREA, survey
from tests.service.export.recorded import SETTINGS, field_grid

FULL_S = 300.0


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Grid]:
    folder = tmp_path_factory.mktemp("field")
    field_grid(folder)
    return folder / AREA, survey(folder / AREA, None, SETTINGS)[1]


def quiet(name: str, part: float) -> None:
    pass


def test_batteries_follow_each_other_until_the_goal_and_all_are_home_in_time(
    field: tuple[Path, Grid],
) -> None:
    flown = fly_batteries(field[1], SETTINGS, FULL_S, 0.6, quiet)
    assert len(flown) >= 2
    pos = [each.pos for each in flown]
    assert pos == sorted(pos)
    assert pos[-2] < 0.6 <= pos[-1]
    flight = SETTINGS.flight
    assert all(each.seconds <= FULL_S * (1.0 - flight.reserve_percent / 100.0) for each in flown)
    longer = fly_batteries(field[1], SETTINGS, 2.0 * FULL_S, 0.6, quiet)
    assert len(longer) < len(flown)
    assert longer[0].pos > flown[0].pos


def test_where_a_battery_is_too_small_nothing_is_promised(field: tuple[Path, Grid]) -> None:
    flown = fly_batteries(field[1], SETTINGS, 100.0, 0.6, quiet)
    assert not flown or flown[-1].pos < 0.1


def test_p_tp_from_another_height_is_that_of_the_pixels_on_the_target() -> None:
    small = SETTINGS.model_copy(update={"sensor": SETTINGS.sensor.model_copy(update={"target_size_m": 0.3})})
    at = small.flight.altitude_m
    assert p_tp_from(small, at) == pytest.approx(small.sensor.p_tp)
    assert small.sensor.p_tp > p_tp_from(small, 1.5 * at) > p_tp_from(small, 3.0 * at)
    higher = from_height(small, 2.0 * at)
    assert higher.flight.altitude_m == 2.0 * at
    assert higher.sensor.cell_m == 2.0 * 20.0
    assert higher.sensor.p_tp == p_tp_from(small, 2.0 * at)


def test_what_would_help_is_flown_on_the_ground_as_it_is_seen_from_there(field: tuple[Path, Grid]) -> None:
    asked: list[Settings] = []

    def resurvey(there: Settings) -> Grid:
        asked.append(there)
        return survey(field[0], None, there)[1]

    flight = SETTINGS.flight.model_copy(update={"max_height_m": 1.7 * SETTINGS.flight.altitude_m})
    low = SETTINGS.model_copy(update={"flight": flight})
    (one,) = what_would_help(resurvey, low, FULL_S, 0.6, quiet)  # twice as high is higher than it may fly
    assert (one.altitude_m, one.cell_m) == (1.5 * flight.altitude_m, 30.0)
    assert (
        one.pos
        == fly_batteries(survey(field[0], None, asked[0])[1], asked[0], FULL_S, 0.6, quiet, most=1)[0].pos
    )

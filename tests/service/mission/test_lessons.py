"""What the flight tells of how the aircraft moves."""

from __future__ import annotations

import numpy as np
import pytest

from roisearch.motion_fit import Flown
from service.mission.lessons import EACH, KEPT, UNSURE, Lessons

Cell = tuple[int, int]


def zigzag(cells: int) -> list[Cell]:
    """A path that turns at every tenth cell."""
    return [(i // 10, i % 10 if i // 10 % 2 == 0 else 9 - i % 10) for i in range(cells)]


def fly(lessons: Lessons, path: list[Cell], begin: float = 0.0, past: Cell | None = None) -> list[Flown]:
    """Fly straight from middle to middle, a cell in three seconds, to the middle of the last; the last lesson."""
    taken: list[Flown] = []
    lessons.commit(path)
    corners = np.array([*path, past or path[-1]], dtype=float)
    times = begin + 3.0 * np.arange(len(corners))
    for time in np.arange(times[0], times[-1] + 0.05, 0.1):
        place = (np.interp(time, times, corners[:, 0]), np.interp(time, times, corners[:, 1]))
        lessons.at((float(place[0]), float(place[1])), float(time))
        taken = list(lessons.take()) or taken
    return taken


def test_a_lesson_tells_when_the_middle_of_each_cell_was_reached() -> None:
    path = zigzag(80)
    (flight,) = fly(Lessons(), path)
    assert len(flight.path) == EACH - UNSURE - 1
    assert [flight.start, *flight.path] == path[UNSURE:EACH]
    np.testing.assert_allclose(flight.durations(), 3.0, atol=0.11)


def test_what_was_committed_and_not_flown_is_not_told() -> None:
    lessons, path = Lessons(), zigzag(200)
    fly(lessons, path[:31])
    lessons.begin()
    taken = fly(lessons, path[100:140], begin=200.0)
    assert [flight.start for flight in taken] == [path[UNSURE], path[100 + UNSURE]]
    assert taken[0].path[-1] == path[29]  # the last was not left yet


def test_a_cell_that_was_missed_parts_two_flights() -> None:
    lessons, path = Lessons(), zigzag(90)
    lessons.commit(path)
    taken: list[Flown] = []
    for i, (row, col) in enumerate(path):
        lessons.at((row + 0.6, float(col)) if i == 25 else (float(row), float(col)), 3.0 * i)
        taken = list(lessons.take()) or taken
    assert [flight.start for flight in taken] == [path[UNSURE], path[26 + UNSURE]]
    assert path[25] not in taken[0].path


@pytest.mark.parametrize("missing", [2, 25])
def test_a_leg_across_other_cells_parts_two_flights(missing: int) -> None:
    """Making room for another aircraft, a way through transit ground: what follows is no neighbour."""
    lessons, path = Lessons(), zigzag(30)
    fly(lessons, path)
    rest = zigzag(130)[30 + missing :]
    taken = fly(lessons, rest, begin=200.0)
    assert [flight.start for flight in taken] == [path[UNSURE], rest[UNSURE]]
    assert taken[0].path[-1] == path[-1]


def test_only_the_last_cells_are_kept_and_a_clock_that_began_anew_parts_two_flights() -> None:
    lessons, path, taken = Lessons(), zigzag(100), []
    for _ in range(5):
        taken = fly(lessons, path) or taken
    told = sum(len(flight.path) for flight in taken)
    assert KEPT - len(path) < told <= KEPT + len(path)
    assert all((flight.durations() > 0.0).all() for flight in taken)


@pytest.mark.parametrize("cells", [EACH - 5, 10 * EACH])
def test_too_little_is_no_lesson(cells: int) -> None:
    straight = [(0, col) for col in range(cells)]
    assert not fly(Lessons(), straight)
    assert not fly(Lessons(), zigzag(30))

"""What a run has been so far, from its rows alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from service.area.frame import GridFrame
from service.entries import Entry
from service.evidence.found import Found
from service.evidence.observe import FramePose, Observation
from service.mission.states import Event, State
from service.rows import (
    CommandRow,
    DecisionRow,
    FlightRow,
    FoundRow,
    KnownRow,
    OrderRow,
    ReportRow,
    ResumedRow,
    TransitionRow,
    VerdictRow,
)
from service.story import FlightSoFar, StoriesSoFar, story

FRAME = GridFrame(47.0, 11.0, 0.0, 20.0, 10, 10, -100.0, 100.0)
UP = TransitionRow(State.READY, Event.AIRBORNE, State.SEARCHING, "in the air")
HOME = TransitionRow(State.SEARCHING, Event.SEARCHED, State.RETURNING, "searched to POS 97.0 %")
DOWN = TransitionRow(State.RETURNING, Event.LANDED, State.DONE, "landed")
AGAIN = ResumedRow("1", {})


def told(*rows: tuple[float, KnownRow]) -> FlightSoFar:
    """The story of rows at these times."""
    return story([Entry(number + 1, time, row) for number, (time, row) in enumerate(rows)], FRAME)


def report(name: str, cell: tuple[float, float], *, hit: bool = False, height: float = 30.0) -> ReportRow:
    """A frame over a cell that looked at it."""
    lat, lon = FRAME.to_latlon([cell])[0].tolist()
    at = np.array([[int(cell[0]), int(cell[1])]])
    sure = np.array([0.9])
    look = Observation(at, np.array([hit]), sure, sure, np.array([True]))
    return ReportRow({"id": name}, FramePose(lat, lon, height, 0.0, 0.0), look)


def found_at(cell: tuple[int, int]) -> FoundRow:
    lat, lon = FRAME.to_latlon([cell])[0].tolist()
    return FoundRow(
        Found(lat, lon, 0.99, 4.0, {"semi_major_m": 1.0, "semi_minor_m": 1.0, "bearing_deg": 0.0})
    )


def verdict(cell: tuple[int, int], *, confirmed: bool = False) -> VerdictRow:
    look = report("v", cell).observation
    assert look is not None
    return VerdictRow(confirmed, cell, look)


def test_a_journal_that_has_just_begun_tells_of_no_flight() -> None:
    flight = told()
    assert (flight.state, flight.steps, flight.flown_s, flight.began, flight.over) == (
        State.WAITING, 0, 0.0, None, False,
    )  # fmt: skip


def test_seconds_in_the_air_steps_and_decisions_go_on_over_processes() -> None:
    east = DecisionRow("east", ((0, 1),), "one cell east")
    flight = told(
        (0.0, UP),
        (1.0, east),
        (10.0, FlightRow(9.0, 0.0, 3, ((9.0, 47.0, 11.0, 30.0),))),
        (500.0, AGAIN),
        (510.0, TransitionRow(State.WAITING, Event.LINKED, State.READY, "px4 is ready")),
        (520.0, UP),
        (530.0, east),
        (540.0, FlightRow(29.0, 9.0, 5)),
        (560.0, HOME),
        (580.0, DOWN),
    )
    assert flight.flown_s == pytest.approx(29.0 + 40.0)  # as was told last, and what has passed since
    assert (flight.decisions, flight.steps, flight.began, flight.resumed) == (2, 5, 0.0, 1)


def test_seconds_of_a_journal_that_tells_no_flights_are_those_between_its_rows() -> None:
    again = TransitionRow(State.WAITING, Event.LINKED, State.READY, "px4 is ready")
    flight = told(
        (0.0, UP), (10.0, CommandRow("hold")), (500.0, AGAIN), (510.0, again), (520.0, UP), (560.0, DOWN)
    )
    assert flight.flown_s == pytest.approx(10.0 + 40.0)  # nobody was there in between


def test_a_killed_process_that_said_no_more_is_not_counted_as_flying() -> None:
    flight = told((0.0, UP), (30.0, report("a", (0, 0))), (4000.0, report("b", (0, 1))))
    assert flight.flown_s == pytest.approx(30.0)


def test_cells_are_counted_by_the_poses_of_reports_where_no_row_tells_them() -> None:
    over = [(0, 0), (0, 0.2), (0, 1), (1, 1), (1, 2)]
    rows = [(1.0 + number, report(str(number), cell)) for number, cell in enumerate(over)]
    assert told((0.0, UP), *rows).steps == 3
    assert told(*rows).steps == 0  # before the search and after it, no cell of it is flown


def test_the_track_has_one_place_a_second_and_no_place_that_is_none() -> None:
    rows = [(number * 0.25, report(str(number), (0, number / 10))) for number in range(9)]
    nowhere = report("x", (0, 0), height=float("nan"))
    flight = told((0.0, UP), *rows, (9.0, nowhere))
    assert [point[0] for point in flight.track] == [0.0, 1.0, 2.0]
    assert flight.reports == 10


def test_places_that_were_told_fill_the_track_where_no_report_does() -> None:
    places = tuple((float(number), 47.0, 11.0, 30.0) for number in range(1, 6))
    flight = told((0.0, UP), (2.0, report("a", (0, 0))), (5.0, FlightRow(5.0, 0.0, 0, places)))
    assert [point[0] for point in flight.track] == [2.0, 3.0, 4.0, 5.0]


def test_hits_are_the_cells_where_something_was_seen() -> None:
    flight = told((0.0, UP), (1.0, report("a", (2, 3), hit=True)), (2.0, report("b", (4, 4))))
    assert FRAME.to_cells(flight.hits).tolist() == [[2, 3]]


@pytest.mark.parametrize(
    ("rows", "over"), [([UP], False), ([UP, HOME], False), ([UP, HOME, DOWN], True), ([UP, HOME, DOWN, AGAIN], True)]
)  # fmt: skip
def test_whether_a_run_is_over_is_asked_of_its_rows(rows: list[KnownRow], over: bool) -> None:
    assert told(*((float(number), row) for number, row in enumerate(rows))).over is over


ORDERED = TransitionRow(State.SEARCHING, Event.RETURN, State.RETURNING, "the operator asked")


@pytest.mark.parametrize(
    ("rows", "searched", "why"),
    [
        ([UP, HOME, DOWN], True, "searched to POS 97.0 %"),
        ([UP, OrderRow("return", "SEARCHING"), ORDERED, DOWN], False, "the operator asked to return"),
        ([UP, HOME, TransitionRow(State.RETURNING, Event.REJECTED, State.SEARCHING, "")], False, None),
    ],
)
def test_why_the_search_ended(rows: list[KnownRow], searched: bool, why: str | None) -> None:
    flight = told(*((float(number), row) for number, row in enumerate(rows)))
    assert flight.searched is searched
    assert (flight.stopped_by and flight.stopped_by[1]) == why


def test_a_place_that_was_found_counts_until_that_place_is_rejected() -> None:
    rows: list[Any] = [(0.0, UP), (1.0, CommandRow("hold")), (2.0, found_at((2, 3)))]
    assert told(*rows).found is not None
    assert told(*rows, (3.0, verdict((7, 7)))).found is not None
    assert told(*rows, (3.0, verdict((2, 3), confirmed=True))).found is not None
    assert told(*rows, (3.0, verdict((2, 4)))).found is None


def of_two(*rows: tuple[str, KnownRow]) -> StoriesSoFar:
    """The stories of rows of these aircraft, a second apart."""
    stories = StoriesSoFar(["north", "south"])
    for number, (aircraft, row) in enumerate(rows):
        stories.take(Entry(number + 1, float(number), row, aircraft), FRAME)
    return stories


def test_each_aircraft_has_a_story_of_its_own_rows() -> None:
    stories = of_two(
        ("", UP),  # the first flew alone until here
        ("south", UP),
        ("south", report("a", (1, 1), hit=True)),
        ("north", HOME),
        ("north", DOWN),
        ("south", FlightRow(4.0, 0.0, 2)),
    )
    north, south = stories.flights["north"], stories.flights["south"]
    assert (north.state, south.state) == (State.DONE, State.SEARCHING)
    assert (north.reports, south.reports, south.steps) == (0, 1, 2)
    assert stories.leading is south
    assert len(stories.hits) == 1


def test_what_is_found_by_one_and_rejected_by_a_person_is_found_by_nobody() -> None:
    assert of_two(("south", found_at((4, 4)))).found is not None
    assert of_two(("south", found_at((4, 4))), ("", verdict((4, 4)))).found is None

"""What a journal says about the run that it is of: whether it is over, how it was left, and what was flown."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from service.config import Settings, each_aircraft
from service.errors import BadInput
from service.journal import Journal
from service.mission.orders import ASKED
from service.mission.standing import Standing
from service.mission.states import FINAL, State
from service.provenance import note_beginning, note_resumption
from service.resume import (
    ALONE,
    Whose,
    interrupted_run,
    left_flight,
    left_standing,
    left_system_id,
    stored_settings,
    why_over,
)
from service.run import resume
from service.search import Search
from service.survey import AREA, JOURNAL
from tests.service.area.files import box, collection, feature, polygon
from tests.service.mission.flown import GRID

UP = [("WAITING", "linked", "READY"), ("READY", "climb", "TAKEOFF"), ("TAKEOFF", "airborne", "SEARCHING")]
FOUND = [*UP, ("SEARCHING", "confirmed", "FOUND"), ("FOUND", "return", "RETURNING")]
SEARCHED = [*UP, ("SEARCHING", "searched", "RETURNING")]
LOW = [*UP, ("SEARCHING", "energy low", "RETURNING")]
TAKEN = [*UP, ("SEARCHING", "pilot", "YIELDED")]
FINISHED = ("RETURNING", "finish", "RETURNING")
LANDED = ("RETURNING", "landed", "DONE")
Step = tuple[str, str, str]


def journal_of(
    folder: Path, steps: Sequence[Step], *more: tuple[str, Mapping[str, object]], why: str = "so"
) -> Path:
    """A journal of these transitions, and of other rows after them."""
    folder.mkdir(exist_ok=True, parents=True)
    journal = Journal(folder / JOURNAL)
    journal.set_meta("settings", Settings().model_dump())
    for number, (before, event, to) in enumerate(steps):
        body = {"from": before, "event": event, "to": to, "reason": why}
        journal.write(1000.0 + number, "transition", body)
    for kind, body in more:
        journal.write(2000.0, kind, body)
    journal.close()
    return folder / JOURNAL


def left(journal: Path) -> State:
    """The state that a run was left in."""
    return left_standing(journal, Search(GRID, Settings())).state


@pytest.mark.parametrize(
    ("steps", "over"),
    [
        ([*FOUND, LANDED], True),
        ([*SEARCHED, LANDED], True),
        ([*LOW, LANDED], False),  # another battery goes on with it
        ([*LOW, FINISHED, LANDED], True),
        ([*LOW, FINISHED], False),  # it is on its way home
        ([*TAKEN, ("YIELDED", "landed", "DONE")], False),
        (FOUND, False),
        (UP, False),
        ([], False),
        ([*UP, ("SEARCHING", "abort", "ABORTED")], False),  # by a fault
    ],
)
def test_a_run_is_over_when_there_is_nothing_more_to_gain(
    steps: Sequence[Step], over: bool, tmp_path: Path
) -> None:
    assert bool(why_over(journal_of(tmp_path, steps))) == over


def test_a_run_that_an_operator_aborted_is_over(tmp_path: Path) -> None:
    steps = [*UP, ("SEARCHING", "abort", "ABORTED")]
    assert why_over(journal_of(tmp_path, steps, why="the operator asked")) == "an operator aborted it"


def test_a_run_that_is_over_is_not_gone_on_with(tmp_path: Path) -> None:
    journal_of(tmp_path, [*FOUND, LANDED])
    with pytest.raises(BadInput, match=r"this run is over \(so\) and is not gone on with; begin a new one"):
        resume(tmp_path, {})


@pytest.mark.parametrize(
    ("steps", "state"),
    [
        ([], State.WAITING),
        (UP, State.SEARCHING),
        (TAKEN, State.YIELDED),
        ([*TAKEN, ("WAITING", "linked", "READY")], State.YIELDED),  # killed again before it said so
        ([*TAKEN, ("WAITING", "linked", "READY"), ("READY", "pilot", "YIELDED")], State.YIELDED),
        (
            [*TAKEN, ("YIELDED", "abort", "ABORTED")],
            State.YIELDED,
        ),  # neither a fault nor a signal is a person's word
        ([*UP, ("SEARCHING", "hold", "HOLDING")], State.HOLDING),
        ([*UP, ("SEARCHING", "abort", "ABORTED")], State.SEARCHING),
        (FOUND, State.RETURNING),
        ([*LOW, LANDED], State.WAITING),
        ([("WAITING", "hold", "WAITING")], State.HOLDING),  # ordered before it was heard
        ([("WAITING", "hold", "WAITING"), ("WAITING", "linked", "READY")], State.HOLDING),
        ([*UP, ("WAITING", "return", "WAITING")], State.RETURNING),
        ([*UP, ("WAITING", "finish", "WAITING")], State.RETURNING),
        ([*TAKEN, ("WAITING", "hold", "WAITING")], State.YIELDED),
    ],
)
def test_a_run_is_taken_up_as_it_was_left(steps: Sequence[Step], state: State, tmp_path: Path) -> None:
    assert left(journal_of(tmp_path, steps)) == state


@pytest.mark.parametrize(("on_found", "state"), [("hover", State.HOLDING), ("return", State.FOUND)])
def test_what_hovers_over_a_find_until_a_person_decides_is_not_flown_home_by_a_restart(
    on_found: str, state: State, tmp_path: Path
) -> None:
    settings = Settings.model_validate({"search": {"on_found": on_found}})
    over_it = [*UP, ("SEARCHING", "confirmed", "FOUND")]
    standing = left_standing(journal_of(tmp_path, over_it), Search(GRID, settings))
    assert (standing.state, standing.goes_home) == (state, state == State.FOUND)


def test_a_search_that_an_operator_finished_on_the_way_home_stays_finished_across_a_kill(
    tmp_path: Path,
) -> None:
    standing = left_standing(journal_of(tmp_path, [*LOW, FINISHED]), Search(GRID, Settings()))
    assert (standing.state, standing.settled, standing.why_stopped) == (State.RETURNING, True, "so")
    assert not left_standing(journal_of(tmp_path / "not", LOW), Search(GRID, Settings())).settled


def test_a_search_that_news_ended_and_were_taken_back_goes_on_across_a_kill(tmp_path: Path) -> None:
    again = ("RETURNING", "resume", "RETURNING")
    settled = left_standing(journal_of(tmp_path / "a", SEARCHED), Search(GRID, Settings()))
    assert (settled.settled, settled.enough) == (True, True)
    steps = [*SEARCHED, again]
    standing = left_standing(journal_of(tmp_path / "b", steps), Search(GRID, Settings()))
    assert (standing.state, standing.settled, standing.enough) == (State.RETURNING, False, False)
    assert why_over(journal_of(tmp_path / "c", [*steps, LANDED])) == ""
    assert not left_standing(
        journal_of(tmp_path / "d", [*SEARCHED, FINISHED]), Search(GRID, Settings())
    ).enough


def test_a_search_is_not_said_to_be_finished_by_an_operator_who_has_not_asked(tmp_path: Path) -> None:
    for number, (why, told) in enumerate(
        {
            "searched to POS 95 %": "searched to POS 95 %",
            "the operator asked": "the operator finished the search",
        }.items()
    ):
        steps = [("WAITING", "linked", "READY"), ("READY", "finish", "DONE")]
        assert why_over(journal_of(tmp_path / str(number), steps, why=why)) == told


def test_what_was_flown_goes_on_across_processes(tmp_path: Path) -> None:
    track = [[1001.0, 47.0, 8.3, 15.0], [1002.0, 47.0001, 8.3, 15.0]]
    first = {"seconds": 40.0, "earlier_s": 0.0, "steps": 3, "track": track}
    second = {"seconds": 45.0, "earlier_s": 0.0, "steps": 5, "track": [[1007.0, 47.0002, 8.3, 15.0]]}
    command = {"command": "reposition", "lat": 47.0, "lon": 8.3, "alt_amsl_m": 415.0}
    rows = [
        ("flight", first),
        ("decision", {"action": "north", "path": [[1, 1]], "reason": "so", "options": []}),
        ("command", command),
        ("command", {"command": "hold"}),
    ]
    flight = left_flight(journal_of(tmp_path, UP, *rows, ("flight", second)), Search(GRID, Settings()))
    assert (flight.seconds(5000.0), flight.steps, flight.decisions, flight.waypoints) == (45.0, 5, 1, 1)
    assert len(flight.track) == 3
    assert flight.flown
    assert flight.goal == (47.0, 8.3)


def test_who_flew_what_and_how_far_the_rows_tell_is_taken_up(tmp_path: Path) -> None:
    flown = {"seconds": 40.0, "earlier_s": 0.0, "steps": 3, "track": [[1001.0, 47.0, 8.3, 15.0]]}
    first, second = {"system_id": 1, "autopilot": "px4"}, {"system_id": 7, "autopilot": "ardupilot"}
    rows = [("vehicle", first), ("flight", flown), ("vehicle", second)]  # heard, and not flown yet
    flight = left_flight(journal_of(tmp_path, UP, *rows), Search(GRID, Settings()))
    assert flight.by == (1, "px4")
    assert flight.told_at == 2000.0
    row = flight.left_sortie_row(0.25, "it landed")
    assert row is not None
    assert (row.number, row.landed, row.system_id) == (1, 2000.0, 1)
    assert flight.left_sortie_row(0.25, "it landed") is None


def test_of_several_one_that_was_left_in_the_air_is_the_one_that_it_was(
    tmp_path: Path,
) -> None:
    """Two radios were exchanged with the restart: the one that a person held was found hovering, and flown on."""
    heard = ("vehicle", {"system_id": 4, "autopilot": "px4", "aircraft": "south"})
    landed = [*UP, ("SEARCHING", "landed", "DONE")]
    for number, (moves, wanted) in enumerate(((UP, 4), (landed, None), (UP[:1], None))):
        steps = [
            ("transition", {"from": before, "event": event, "to": to, "reason": "so", "aircraft": "south"})
            for before, event, to in moves
        ]
        journal = journal_of(tmp_path / str(number), [], heard, *steps)
        assert left_system_id(journal, Whose("south", first=False), None) == wanted
        assert left_system_id(journal, Whose("north", first=True), None) is None


REPLACED = {"system_id": 7, "was_system_id": 1, "was_autopilot": "px4"}


@pytest.mark.parametrize(
    ("rows", "wanted"),
    [
        ([], 1),
        ([("replaced", REPLACED)], 7),
        ([("replaced", {**REPLACED, "system_id": None})], None),
        ([("replaced", REPLACED), ("replaced", {**REPLACED, "system_id": 3})], 3),
        ([("replaced", REPLACED), ("resumed", {"version": "1", "changed": {"search.found_at": 0.9}})], 7),
        ([("replaced", REPLACED), ("resumed", {"version": "1", "changed": {"link.system_id": 1}})], 1),
        ([("replaced", {**REPLACED, "aircraft": "south"})], 1),
    ],
)
def test_a_run_goes_on_with_the_aircraft_that_an_operator_chose_last(
    rows: Sequence[tuple[str, Mapping[str, object]]], wanted: int | None, tmp_path: Path
) -> None:
    assert left_system_id(journal_of(tmp_path, UP, *rows), ALONE, 1) == wanted


def test_a_run_that_never_left_the_ground_has_not_flown(tmp_path: Path) -> None:
    assert not left_flight(journal_of(tmp_path, UP[:1]), Search(GRID, Settings())).flown


def area_text(east_m: float = 0.0, name: str = "field") -> str:
    """An area of 200 m by 200 m, so far east."""
    return json.dumps(collection(feature(polygon(box(east_m, 0, east_m + 200, 200)), name=name)))


def begun(folder: Path, steps: Sequence[Step]) -> Path:
    """The folder of a run over that area."""
    journal_of(folder, steps)
    (folder / AREA).write_text(area_text(), encoding="utf-8")
    return folder


def test_the_last_run_over_an_area_is_gone_on_with_if_it_was_interrupted(tmp_path: Path) -> None:
    area, runs = tmp_path / "area.geojson", tmp_path / "runs"
    area.write_text(area_text(), encoding="utf-8")
    assert interrupted_run(runs, area, Settings()) == (None, "")
    first = begun(runs / "20260101-000000-field", UP)
    assert interrupted_run(runs, area, Settings()) == (first, "")
    begun(runs / "20260101-000001-field", [*SEARCHED, LANDED])
    assert interrupted_run(runs, area, Settings()) == (None, "")


@pytest.mark.parametrize(
    ("text", "goes_on", "words"),
    [
        (
            area_text(name="north slope"),
            True,
            "is not what it was begun with; it goes on over the area as it",
        ),
        (area_text(60.0), True, "is not what it was begun with"),
        (area_text()[:100], True, "it goes on over the area as it was, which is"),
        ("", True, "it goes on over the area as it was"),
        (None, True, "it goes on over the area as it was"),
        (area_text(500.0), False, "was interrupted too, over other ground: --resume goes on with it"),
    ],
    ids=["another name", "moved", "half written", "empty", "gone", "another area"],
)
def test_an_area_file_that_was_changed_in_flight_begins_no_second_search_beside_the_first(
    text: str | None, goes_on: bool, words: str, tmp_path: Path
) -> None:
    area = tmp_path / "area.geojson"
    if text is not None:
        area.write_text(text, encoding="utf-8")
    first = begun(tmp_path / "runs" / "20260101-000000-field", TAKEN)
    folder, said = interrupted_run(tmp_path / "runs", area, Settings())
    assert folder == (first if goes_on else None)
    assert words in said


def of_two(
    folder: Path, north: Sequence[Step], south: Sequence[Step], *more: dict[str, object], why: str = "so"
) -> Path:
    """A journal in which two aircraft did these steps, and the second has these rows of its flight."""
    rows: list[tuple[str, Mapping[str, object]]] = [
        ("transition", {"from": before, "event": event, "to": to, "reason": why, "aircraft": name})
        for name, steps in (("north", north), ("south", south))
        for before, event, to in steps
    ]
    return journal_of(folder, [], *rows, *(("flight", {**each, "aircraft": "south"}) for each in more))


def test_a_run_that_was_begun_without_the_date_is_the_last_all_the_same(tmp_path: Path) -> None:
    area, runs = tmp_path / "area.geojson", tmp_path / "runs"
    area.write_text(area_text(), encoding="utf-8")

    def begin(name: str, steps: Sequence[Step]) -> Path:
        begun(runs / name, steps)
        with contextlib.closing(Journal(runs / name / JOURNAL)) as journal:
            note_beginning(journal, runs / name, Settings())
        return runs / name

    begin("20260101-000000-field", [*SEARCHED, LANDED])
    today = begin("20000101-000012-field", TAKEN)  # by a computer that has just been switched on
    assert interrupted_run(runs, area, Settings()) == (today, "")
    (runs / "20260102-000000-field").mkdir()
    Journal(runs / "20260102-000000-field" / JOURNAL).close()  # the power failed before it began
    assert interrupted_run(runs, area, Settings()) == (today, "")
    begin("20000101-000010-field", [*SEARCHED, LANDED])
    assert interrupted_run(runs, area, Settings()) == (None, "")
    with contextlib.closing(Journal(today / JOURNAL)) as journal:  # a person goes on with the one before
        note_resumption(journal, today, Settings())
    assert interrupted_run(runs, area, Settings()) == (today, "")


def test_each_of_two_aircraft_is_taken_up_as_it_was_left(tmp_path: Path) -> None:
    flown = {"seconds": 40.0, "earlier_s": 0.0, "steps": 3, "track": [[1001.0, 47.0, 8.3, 15.0]]}
    journal, search = of_two(tmp_path, UP, TAKEN, flown), Search(GRID, Settings())
    north, south = Whose("north", first=True), Whose("south", first=False)
    assert left_standing(journal, search, north).state == State.SEARCHING
    assert left_standing(journal, search, south).state == State.YIELDED
    assert (left_flight(journal, search, north).steps, left_flight(journal, search, south).steps) == (0, 3)


@pytest.mark.parametrize(
    ("steps", "why", "state"),
    [
        ([*LOW, LANDED], "so", State.DONE),
        ([*UP, ("SEARCHING", "abort", "ABORTED")], ASKED, State.ABORTED),
        ([*UP, ("SEARCHING", "abort", "ABORTED")], "the link is lost", State.SEARCHING),  # a fault of its own
    ],
)
def test_what_was_over_for_one_while_another_flew_stays_so(
    steps: Sequence[Step], why: str, state: State, tmp_path: Path
) -> None:
    def standing(north: Sequence[Step]) -> Standing:
        journal = of_two(tmp_path / f"{len(north)}", north, steps, why=why)
        return left_standing(journal, Search(GRID, Settings()), Whose("south", first=False))

    assert standing(UP).state == state
    assert bool(standing(UP).why_stopped) == (state in FINAL)
    both = standing([*LOW, LANDED]).state  # the run has ended, and another flight goes on with it
    assert both == (State.WAITING if state == State.DONE else State.SEARCHING)


def test_what_flew_alone_before_is_the_first_ones(tmp_path: Path) -> None:
    journal, search = journal_of(tmp_path, UP), Search(GRID, Settings())
    assert left_standing(journal, search, Whose("north", first=True)).state == State.SEARCHING
    assert left_standing(journal, search, Whose("south", first=False)).state == State.WAITING


def begun_alone(folder: Path, alone: Sequence[Step], first: Sequence[Step], second: Sequence[Step]) -> Path:
    """A journal of a run that one aircraft began, and that then two went on with, who have the names of their numbers;
    its settings are still those of one."""
    journal_of(folder, alone)
    with contextlib.closing(Journal(folder / JOURNAL)) as journal:
        for name, steps in (("1", first), ("2", second)):
            for before, event, to in steps:
                body = {"from": before, "event": event, "to": to, "reason": "so", "aircraft": name}
                journal.write(3000.0, "transition", body)
    return folder / JOURNAL


def test_what_flew_alone_and_then_beside_others_is_one_aircraft_everywhere(tmp_path: Path) -> None:
    search = Search(GRID, Settings())
    over = begun_alone(tmp_path / "over", UP, [*FOUND, LANDED], [*FOUND, LANDED])
    assert why_over(over) == "so"  # that it searched before it was killed is no third one
    taken = begun_alone(tmp_path / "taken", UP, TAKEN, UP)
    assert left_standing(taken, search, Whose("", first=True)).state == State.YIELDED
    assert left_standing(taken, search, Whose("1", first=True)).state == State.YIELDED
    assert left_standing(taken, search, Whose("2", first=False)).state == State.SEARCHING
    out = begun_alone(tmp_path / "out", UP, [*LOW, LANDED], UP)
    assert left_standing(out, search, Whose("1", first=True)).state == State.DONE


def test_who_went_on_with_a_run_last_goes_on_with_it_again(tmp_path: Path) -> None:
    journal_of(tmp_path, UP)
    links = ["udpin://0.0.0.0:14540", "udpin://0.0.0.0:14541"]
    with contextlib.closing(Journal(tmp_path / JOURNAL)) as journal:
        two = stored_settings(journal.path, {"aircraft": [{"connect": link} for link in links]})
        note_resumption(journal, tmp_path, two)
        again = stored_settings(journal.path, {})
    assert [each.link.connect for each in each_aircraft(again).values()] == links
    assert list(each_aircraft(again)) == ["1", "2"]


@pytest.mark.parametrize(
    ("north", "south", "over"),
    [
        ([*FOUND, LANDED], [*UP, ("SEARCHING", "return", "RETURNING"), LANDED], True),
        ([*FOUND, LANDED], [*UP, ("SEARCHING", "confirmed", "FOUND")], False),  # it is in the air yet
        ([*FOUND, LANDED], [*LOW, ("RETURNING", "down", "GROUNDED")], False),
        ([*LOW, LANDED], [*UP, ("SEARCHING", "abort", "ABORTED")], False),  # another battery goes on with it
    ],
)
def test_a_run_of_two_is_over_when_both_have_ended_and_one_had_nothing_more_to_gain(
    north: Sequence[Step], south: Sequence[Step], over: bool, tmp_path: Path
) -> None:
    assert bool(why_over(of_two(tmp_path, north, south))) == over

"""What the core does whatever the phase: at every change of state, at every stop, and ten times a second."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from service.mavlink.events import Notice
from service.mavlink.telemetry import Wind
from service.mission.core import GIVEN_UP_AFTER
from service.mission.effects import (
    Answer,
    Brake,
    DropAction,
    DropThought,
    EnterGuided,
    LetGo,
    Note,
    Rest,
    SendWaypoint,
    Stop,
    Tell,
    WriteRow,
)
from service.mission.flight import Flight
from service.mission.limits import Objection
from service.mission.news import Done, NotSent, NotStopped, Order
from service.mission.phase import RETRY_S
from service.mission.standing import Standing
from service.mission.states import FINAL, FLYING, TABLE, Event, State
from service.rows import CommandRow, TransitionRow
from tests.service.mission.flown import START, Talk, place, reached, searching

CHANGES = [(*pair, after) for pair, after in TABLE.items()]
MOVING = {State.SEARCHING, State.CONFIRMING, State.RETURNING}


@pytest.mark.parametrize(("state", "event", "after"), CHANGES)
def test_every_change_is_written_down_and_told_to_the_pilot(state: State, event: Event, after: State) -> None:
    talk = reached(state)
    did = talk.happens(event)
    row = TransitionRow(state, event, after, "for a test")
    (told,) = [each for each in did if isinstance(each, Tell)]
    assert told.text.startswith(f"search {after}: for a test")
    assert did.index(WriteRow(row)) < did.index(told)


@pytest.mark.parametrize(("state", "event", "after"), CHANGES)
def test_nothing_that_was_wanted_outlives_the_state_that_wanted_it(
    state: State, event: Event, after: State
) -> None:
    talk = reached(state)
    under_way = talk.core.doing is not None
    did = talk.happens(event)
    other = not {state, after} <= set(FLYING)
    assert (Rest() in did) == (DropThought() in did) == other
    assert (DropAction() in did) == (under_way and other)
    assert (LetGo("for a test") in did) == (after == State.YIELDED)


@pytest.mark.parametrize(("state", "event", "after"), CHANGES)
def test_why_a_search_stopped_is_forgotten_when_it_goes_on(state: State, event: Event, after: State) -> None:
    talk = reached(state)
    goes_on = after in FLYING and state not in FLYING
    before = talk.core.standing.why_stopped
    talk.happens(event)
    kept = "" if event == Event.FINISH else before  # an order to finish has a reason of its own, here none
    assert talk.core.standing.why_stopped == ("" if goes_on else kept)


def test_an_event_that_changes_nothing_does_nothing() -> None:
    assert reached(State.HOLDING).happens(Event.HOLD) == [Answer(0)]


def test_a_waypoint_is_judged_again_after_its_row_is_written() -> None:
    """Between the wish and the wire the row is written, and meanwhile anything may have happened."""
    talk = sent_to_a_cell()
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    assert talk.core.objection(waypoint, talk.seen, talk.now) is None
    doubtful = replace(talk.seen, telemetry=replace(talk.seen.telemetry, fix=1))
    objection = talk.core.objection(waypoint, doubtful, talk.now)
    assert objection is not None
    assert objection.cause == "position"
    talk.pilot()
    objection = talk.core.objection(waypoint, talk.seen, talk.now)
    assert objection == Objection("state", "the mission is not to move the aircraft")


def test_a_waypoint_that_another_one_or_a_stop_replaced_is_not_sent_any_more() -> None:
    talk = sent_to_a_cell()
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    talk.on(Order("hold"))
    talk.on(Order("resume"))
    assert talk.state == State.SEARCHING  # which may move, but this is not what it wants
    assert talk.core.objection(waypoint, talk.seen, talk.now) is not None
    assert talk.on(Done(waypoint)) == []


@pytest.mark.parametrize(("cause", "held"), [("position", True), ("limits", True), ("link", False)])
def test_a_waypoint_that_must_not_be_sent_holds_or_is_decided_anew(cause: str, held: bool) -> None:
    talk = sent_to_a_cell()
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    talk.on(NotSent(waypoint, Objection(cause, "for a test")))
    assert (talk.state == State.HOLDING) == held


def test_a_waypoint_that_the_ground_forbids_stops_and_is_planned_anew_until_that_is_in_vain() -> None:
    """The aircraft comes nearer to a slope while a row is written: a hold for that would never end."""
    talk = sent_to_a_cell()
    for number in range(GIVEN_UP_AFTER + 1):
        waypoint = talk.doing()
        assert isinstance(waypoint, SendWaypoint)
        said = talk.on(NotSent(waypoint, Objection("ground", "comes within 14 m of the ground")))
        assert any(isinstance(each, Stop) for each in said)
        assert talk.state == (State.SEARCHING if number < GIVEN_UP_AFTER else State.HOLDING)
        if number < GIVEN_UP_AFTER:
            talk.pass_by(RETRY_S + 0.2)
            row, col = talk.core.chart.cell(talk.seen.telemetry)[0]
            talk.decides((row - 1, col))
    assert talk.core.standing.causes == {"limits"}


def test_the_row_of_a_waypoint_comes_before_it_and_that_of_a_stop_after() -> None:
    talk = sent_to_a_cell()
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    before = talk.wanted[talk.wanted.index(waypoint) - 1]
    assert isinstance(before, WriteRow)
    assert before.row == CommandRow("reposition", *waypoint.point, waypoint.altitude_m)
    did = talk.on(Order("hold"))
    assert did.index(Stop()) < did.index(WriteRow(CommandRow("hold")))


def test_without_a_position_to_trust_the_autopilot_brakes_by_itself() -> None:
    """A stop is a place, and there is none; flying on to the last waypoint is no stop either."""
    talk = searching()
    talk.shows(fix=1)
    did = talk.tick()
    assert Stop() not in did
    assert did.index(Brake()) < did.index(WriteRow(CommandRow("brake")))
    assert talk.state == State.HOLDING
    talk.shows(fix=3, guided=False, mode="BRAKE")
    talk.pass_by(5.0)
    assert talk.doing() == EnterGuided()
    assert talk.state == State.HOLDING
    talk.shows(guided=True, mode="GUIDED")
    talk.done()
    talk.tick()
    assert talk.state == State.SEARCHING


def test_a_stop_that_could_not_be_sent_is_sent_again() -> None:
    talk = reached(State.HOLDING)
    assert Stop() not in talk.tick()
    talk.on(NotStopped("the link was lost"))
    assert talk.pass_by(3.0).count(Stop()) == 1


# ---- ten times a second


def test_all_well_and_the_guard_objects_to_nothing() -> None:
    talk = reached(State.HOLDING)
    assert talk.tick() == []


@pytest.mark.parametrize("state", list(State))
def test_a_doubtful_position_holds_what_moves_and_nothing_else(state: State) -> None:
    talk = reached(state)
    talk.shows(fix=1, guided=True)
    talk.tick()
    held = state in MOVING | {State.HOLDING}
    assert ("position" in talk.core.standing.causes) == held
    assert (talk.state == State.HOLDING) == held


@pytest.mark.parametrize("state", list(State))
def test_the_energy_for_the_way_home_is_asked_for_on_every_leg_of_a_search(state: State) -> None:
    talk = reached(state)
    talk.shows(battery_percent=10.0, landed_state="in_air")
    talk.tick()
    if state in FLYING:
        assert (talk.state, talk.core.standing.why_stopped) == (State.RETURNING, "battery at 10 %")
        assert talk.core.standing.searched


@pytest.mark.parametrize("state", list(State))
def test_wind_and_straying_lead_home_from_a_search_and_from_nothing_else(state: State) -> None:
    for what in ("wind", "straying"):
        talk = reached(state)
        talk.tick()
        if what == "wind":
            talk.shows(wind=Wind(14.0, 0.0))
        else:
            lat, lon = place(330.0, 50.0)
            talk.shows(lat=lat, lon=lon)
        talk.flew()
        before = talk.state
        talk.pass_by(7.0)
        if state in FLYING:
            assert talk.state == State.RETURNING, what
            assert ("14 m/s" if what == "wind" else "outside") in talk.core.standing.why_stopped
        elif state in FINAL:
            assert talk.state == before


def test_a_run_that_cannot_go_on_stops_the_aircraft_and_tells_the_pilot() -> None:
    talk = searching()
    did = talk.core.leave("the journal is gone", talk.seen, talk.now)
    assert Stop() in did
    assert Tell("search ABORTED, hovering: the journal is gone", 2) in did
    assert talk.state == State.ABORTED


@pytest.mark.parametrize("theirs", [{"in_control": False}, {"guided": False}])
def test_a_run_that_cannot_go_on_does_not_stop_what_is_not_ours(theirs: dict[str, bool]) -> None:
    talk = searching()
    talk.shows(**theirs)
    assert Stop() not in talk.core.leave("a mistake", talk.seen, talk.now)


def sent_to_a_cell() -> Talk:
    """A search whose first waypoint waits for its row."""
    talk = searching()
    talk.tick()
    row, col = talk.core.chart.cell(talk.seen.telemetry)[0]
    talk.decides((row - 1, col))
    assert isinstance(talk.doing(), SendWaypoint)
    return talk


def test_a_battery_that_is_not_told_any_longer_is_counted_down_and_told_once() -> None:
    talk = searching()
    talk.pass_by(20.0)
    talk.shows(battery_percent=None)
    did = talk.pass_by(10.0)
    said = [each.text for each in did if isinstance(each, Tell) and "battery" in each.text]
    assert said == ["search: the battery's level is not told any longer: reckoned to be 90 %"]
    assert "reckoned to be" in talk.core.battery_doubt
    talk.happens(Event.HOLD)
    talk.pass_by(10.0)
    assert "reckoned to be 88 %" in talk.core.battery_doubt  # on the page it goes on, whatever the state
    talk.happens(Event.RESUME)
    talk.shows(battery_percent=80.0)
    talk.pass_by(1.0)
    assert talk.core.battery_doubt == ""
    talk.shows(battery_percent=None)
    assert [each for each in talk.pass_by(10.0) if isinstance(each, Tell) and "battery" in each.text]


def test_a_home_that_is_not_told_is_said_once() -> None:
    talk = searching()
    talk.shows(home=None)
    did = talk.pass_by(60.0)
    said = "search: home is not told: the launch point of the area is taken for it"
    assert [each.text for each in did if isinstance(each, Tell)].count(said) == 1


def test_an_estimate_whose_health_was_never_told_is_said_once() -> None:
    """What stops being told holds; what never was is no objection, and a person has to know."""
    said = "search: the health of its position estimate is not told: the GPS is all to go by"
    for told, times in (({}, 1), ({"EKF_STATUS_REPORT": START}, 0), ({"ESTIMATOR_STATUS": START}, 0)):
        talk = searching()
        talk.shows(told=told)
        did = talk.pass_by(60.0)
        assert [each.text for each in did if isinstance(each, Tell)].count(said) == times


def test_what_a_restart_in_the_air_has_not_heard_yet_is_not_called_untold() -> None:
    talk = Talk(flight=Flight(flown=True, carried_s=300.0, left_at=START), home=None, battery_percent=None)
    talk.pass_by(5.0)
    assert not [each for each in talk.wanted if isinstance(each, Tell) and "not " in each.text]
    talk.pass_by(20.0)
    said = [each.text for each in talk.wanted if isinstance(each, Tell) and "not " in each.text]
    assert [each.split(":")[1] for each in said] == [" the battery's level is not known", " home is not told"]


def test_a_wind_that_is_neither_told_nor_reckoned_is_said_once() -> None:
    talk = searching()
    talk.shows(wind=Wind(1.0, 0.0))
    talk.pass_by(70.0)
    talk.shows(wind=None)
    did = talk.pass_by(30.0)
    assert [each.text for each in did if isinstance(each, Tell)] == [
        "search: wind is not known, look at it yourself"
    ]
    assert [each for each in did if isinstance(each, Note) and "max_wind_mps does nothing" in each.text]


def test_a_wind_that_is_reckoned_leads_home_as_one_that_is_told() -> None:
    talk = searching()
    # a wind that is reckoned needs minutes of leaning flight, which this is not about
    talk.core.reserve._wind = SimpleNamespace(update=lambda *_: Wind(13.0, 0.0))  # type: ignore[assignment]
    talk.pass_by(10.0)
    assert (talk.state, talk.core.standing.why) == (
        State.RETURNING,
        "wind of 13 m/s, more than 12 m/s",
    )


def test_why_it_is_as_it_is_does_not_grow_with_every_notice() -> None:
    talk = searching()
    why = talk.core.standing.why
    for number in range(500):
        talk.on(Notice(talk.now, f"flies {number} m/s, asked for 5"))
    said = talk.core.standing.why
    assert said.startswith(why)
    assert said.endswith("flies 499 m/s, asked for 5")
    assert len(said) < 600


@pytest.mark.parametrize("state", sorted(FINAL))
def test_what_is_over_for_an_aircraft_is_over_in_the_next_process_too(state: State) -> None:
    talk = Talk(may_take_off=True, standing=Standing(state=state, why="so", why_stopped="so"))
    assert talk.state == state
    assert not [each for each in talk.pass_by(5.0) if not isinstance(each, Note)]
    (said,) = [each for each in talk.on(Order("launch", 1)) if isinstance(each, Answer)]
    assert (bool(said.refused), talk.state) == (True, state)

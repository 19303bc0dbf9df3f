"""What follows from what the vehicle does by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import pytest

from service.mavlink.events import (
    AnotherService,
    ArmedChanged,
    Home,
    LandedChanged,
    LinkLost,
    ModeChanged,
    Notice,
    Rebooted,
    ReferenceMoved,
    Stalled,
    StatusText,
    Target,
    TargetNotTaken,
    TargetReplaced,
    TargetTaken,
    VehicleEvent,
)
from service.mavlink.modes import ModeKind
from service.mission.effects import (
    Brake,
    EnterGuided,
    LetGo,
    ReturnToLaunch,
    SendWaypoint,
    Stop,
    Tell,
    WriteRow,
)
from service.mission.states import MAY_MOVE, State
from service.mission.watch import LISTENERS, REFUSALS
from service.rows import ModeRow, VehicleClockRow, YieldedRow
from tests.service.mission.flown import GRID, ON_GROUND, Talk, reached, searching

TARGET = Target(47.0, 8.3, 415.0)


def replaced(now: float) -> TargetReplaced:
    """A ground station has sent the aircraft somewhere."""
    return TargetReplaced(now, TARGET, Target(47.001, 8.3, 450.0), "a ground station")


@pytest.mark.parametrize("state", sorted(MAY_MOVE))
def test_a_pilots_mode_change_ends_all_motion_in_the_call_that_tells_it(state: State) -> None:
    talk = reached(state)
    did = talk.pilot()
    assert talk.state == State.YIELDED
    assert any(isinstance(effect, LetGo) for effect in did)
    assert not [effect for effect in did if isinstance(effect, (Stop, SendWaypoint))]
    assert talk.core.doing is None
    moved = talk.pass_by(60.0)
    assert not [effect for effect in moved if isinstance(effect, (Stop, SendWaypoint))]


def test_what_happens_while_the_pilot_has_it_is_written_down_too() -> None:
    talk = reached(State.YIELDED)
    talk.on(Rebooted(talk.now))
    assert talk.core.standing.why.endswith("; the autopilot has rebooted")
    assert YieldedRow("the autopilot has rebooted") in talk.rows


def test_a_disarm_takes_the_aircraft_away_unless_it_has_just_come_home() -> None:
    talk = searching()
    talk.on(ArmedChanged(talk.now, False, False))
    assert talk.state == State.YIELDED
    home = reached(State.RETURNING)
    home.on(ArmedChanged(home.now, False, False))
    assert home.state == State.RETURNING


def test_one_waypoint_that_is_not_flown_is_followed_by_another_and_two_hold() -> None:
    talk = searching()
    talk.on(TargetNotTaken(talk.now, TARGET, 5, "no"))
    assert talk.state == State.SEARCHING
    talk.on(TargetTaken(talk.now, TARGET, 0.1))
    talk.on(TargetNotTaken(talk.now, TARGET, 5, "no"))
    assert talk.state == State.SEARCHING
    talk.on(TargetNotTaken(talk.now, TARGET, 5, "no"))
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"target"})


def test_a_waypoint_given_up_because_we_stood_still_is_nobodys_refusal() -> None:
    talk = searching()
    talk.on(Stalled(talk.now, 3.0))
    for _ in range(3):
        talk.on(TargetNotTaken(talk.now, TARGET, 1, "the service stood still"))
    assert talk.state == State.SEARCHING


def test_a_lost_link_holds() -> None:
    talk = searching()
    talk.on(LinkLost(talk.now, 4.0))
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"link"})


@pytest.mark.parametrize("state", [State.YIELDED, State.HOLDING])
def test_an_aircraft_that_lands_in_other_hands_ends_the_run_with_the_reason(state: State) -> None:
    talk = reached(state)
    why = talk.core.standing.why
    talk.shows(**ON_GROUND)
    talk.sees(events_waiting=True)
    talk.on(LandedChanged(talk.now, "on_ground", "landing"))
    assert talk.state == state  # why it landed may be among what waits
    talk.sees(events_waiting=False)
    talk.on(StatusText(talk.now, 2, "Critical battery failsafe"))
    assert talk.state == State.DONE
    assert why in talk.core.standing.why_stopped


def test_words_that_come_after_the_failsafe_are_told_though_the_mode_changes_once_more() -> None:
    talk = searching()
    talk.on(StatusText(talk.now, 2, "EKF warning"))
    talk.pass_by(60.0)
    talk.pilot("RTL")
    talk.on(StatusText(talk.now, 2, "Geofence violation"))
    talk.pass_by(60.0)
    talk.shows(**ON_GROUND)
    talk.pilot("LOITER")
    assert "(Geofence violation)" in talk.core.standing.why_stopped


def test_every_mode_that_the_heartbeat_shows_is_written_down() -> None:
    talk: Talk = searching()
    assert WriteRow(ModeRow("LOITER", False)) in talk.pilot()


def test_where_else_the_aircraft_is_sent_is_as_the_team_writes_places() -> None:
    talk = reached(State.SEARCHING, grid=replace(GRID, coordinates="mgrs"))
    talk.on(replaced(talk.now))
    assert "a ground station sends the aircraft to 32T MT " in talk.core.standing.why


def test_every_event_that_the_link_tells_has_a_listener() -> None:
    assert set(LISTENERS) == set(get_args(VehicleEvent))


@pytest.mark.parametrize(
    "state", [State.SEARCHING, State.CONFIRMING, State.HOLDING, State.FOUND, State.RETURNING]
)
def test_whoever_else_sends_the_aircraft_somewhere_gets_it(state: State) -> None:
    talk = reached(state)
    did = talk.on(replaced(talk.now))
    assert talk.state == State.YIELDED
    assert "a ground station sends the aircraft to 47.001000, 8.300000" in talk.core.standing.why
    assert any(isinstance(effect, LetGo) for effect in did)
    assert not [effect for effect in talk.pass_by(60.0) if isinstance(effect, (Stop, SendWaypoint))]


def test_who_commands_the_aircraft_without_a_target_that_is_known_gets_it() -> None:
    talk = searching()
    talk.on(replace(replaced(talk.now), found=None))
    assert (talk.state, talk.core.standing.why) == (State.YIELDED, "a ground station commands the aircraft")


def test_a_yield_always_says_how_to_give_the_aircraft_back() -> None:
    talk = searching()
    (told,) = [effect.text for effect in talk.pilot() if isinstance(effect, Tell)]
    assert told.endswith("Resume gives it back")
    talk.shows(guided=True, mode="GUIDED")  # a failsafe that is over
    talk.sees(guided_title="Hold")
    did = talk.on(ModeChanged(talk.now, "GUIDED", "LOITER", ModeKind.GUIDED, True, False, False))
    assert Tell("search YIELDED: in Hold again; Resume gives it back", 5) in did
    assert talk.state == State.YIELDED


@pytest.mark.parametrize(
    ("may_take_off", "how"), [(True, "Launch gives it back"), (False, "take off, then Resume gives it back")]
)
def test_a_yield_on_the_ground_says_what_is_not_refused_there(may_take_off: bool, how: str) -> None:
    talk = reached(State.HOLDING, may_take_off=may_take_off)
    talk.shows(**ON_GROUND)
    (told, *_) = [effect.text for effect in talk.pilot("STABILIZE") if isinstance(effect, Tell)]
    assert told.endswith(how)


def test_a_hold_that_another_restart_or_landing_finds_on_the_ground_is_not_over() -> None:
    """A pilot who chose a mode before the flight has not landed."""
    talk = reached(State.TAKEOFF)
    talk.pilot()
    talk.pass_by(10.0)
    talk.on(StatusText(talk.now, 6, "all is well"))
    assert talk.state == State.YIELDED


def test_a_second_service_on_the_aircraft_is_said() -> None:
    talk = searching()
    talk.on(AnotherService(talk.now, "another program commands as this service"))
    assert Tell("search: another program commands as this service; end one", 4) in talk.wanted


def test_what_a_person_must_hear_of_is_told_to_the_pilot_and_on_the_page() -> None:
    talk = reached(State.TAKEOFF)
    talk.on(Notice(talk.now, "not armed yet: Need Position Estimate"))
    assert Tell("search: not armed yet: Need Position Estimate", 4) in talk.wanted
    assert talk.core.standing.why.endswith("; not armed yet: Need Position Estimate")


@pytest.mark.parametrize(
    ("mode", "words"),
    [("POSCTL", "Position"), ("AUTO_LOITER", "Hold"), ("AUTO_RTL", "Return"), ("RTL", "RTL")],
)
def test_a_reason_calls_a_mode_what_a_ground_station_calls_it(mode: str, words: str) -> None:
    talk = searching()
    talk.pilot(mode)
    assert talk.core.standing.why == f"the pilot or the autopilot selected {words}"


@pytest.mark.parametrize("too", [True, False])
def test_a_position_that_moves_with_the_estimators_origin_waits_for_a_person(too: bool) -> None:
    talk = searching()
    here, there = Home(47.0, 8.0, 400.0), Home(47.001, 8.0, 400.0)
    talk.on(ReferenceMoved(talk.now, "origin", here, there, too))
    talk.pass_by(10.0)
    assert (talk.state, talk.core.standing.causes) == (
        (State.HOLDING, {"operator"}) if too else (State.SEARCHING, set())
    )


def test_the_vehicles_clock_is_journalled_when_it_is_known_and_when_it_steps() -> None:
    talk = searching()

    def pass_by(seconds: float, ahead: float) -> list[VehicleClockRow]:
        told = len(talk.rows)
        for _ in range(int(seconds * 2)):
            talk.shows(boot_time_s=talk.now + 0.5 - ahead)
            talk.tick(0.5)
        return [row for row in talk.rows[told:] if isinstance(row, VehicleClockRow)]

    (first,) = pass_by(20.0, 900.0)
    assert (first.service - first.boot_s, first.step_s) == (900.0, 0.0)
    assert pass_by(20.0, 901.0) == []  # what the link delays
    assert pass_by(0.5, 800.0) == []  # one message
    assert pass_by(20.0, 900.0) == []
    (stepped,) = pass_by(20.0, 940.0)  # it has booted again
    assert (stepped.service - stepped.boot_s, stepped.step_s) == (940.0, 40.0)


@pytest.mark.parametrize("flies", [True, False])
@pytest.mark.parametrize("event", ["silence", "moved", "not taken"])
def test_a_return_that_the_autopilot_flies_by_our_order_is_not_broken_off(event: str, flies: bool) -> None:
    """It needs neither us nor our waypoints, and a link that comes back does not want it stopped either."""
    talk = reached(State.RETURNING)
    talk.tick()
    assert talk.doing() == ReturnToLaunch()
    if flies:
        talk.done()
        talk.shows(guided=False, mode="RTL")
    talk.wanted.clear()
    if event == "silence":
        talk.silent.add("heartbeat")
        talk.tick(4.0)
        talk.on(LinkLost(talk.now, 4.0))
        talk.silent.clear()
    elif event == "moved":
        moved = Home(47.0, 8.301, 400.0)
        talk.on(ReferenceMoved(talk.now, "origin", Home(47.0, 8.3, 400.0), moved, position_too=True))
    else:
        for _ in range(REFUSALS):
            talk.on(TargetNotTaken(talk.now, Target(47.0, 8.3, 415.0), 5, "no"))
    talk.pass_by(3.0)
    assert talk.state == State.RETURNING
    assert not [each for each in talk.wanted if isinstance(each, Stop | Brake | EnterGuided)]

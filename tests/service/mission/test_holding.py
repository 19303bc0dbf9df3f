"""What a mission hovers for, and when that ends."""

from __future__ import annotations

import math
from typing import Any

import pytest

from service.mavlink.events import LinkLost, Stalled, Target, TargetNotTaken
from service.mavlink.telemetry import Home
from service.mission.effects import Land, Note, ReturnToLaunch, Stop
from service.mission.news import Judged, NotStopped, Order
from service.mission.states import State
from sim.soak import ground
from tests.service.mission.flown import FOUND, ON_GROUND, Talk, reached, searching


def silenced(after_silence: str = "resume") -> Talk:
    """A search whose autopilot has just fallen silent."""
    talk = searching({"link": {"after_silence": after_silence}})
    talk.silent.add("heartbeat")
    talk.tick(4.0)
    talk.on(LinkLost(talk.now, 4.0))
    assert talk.core.standing.causes == {"link"}
    return talk


@pytest.mark.parametrize(
    ("after_silence", "state"), [("resume", State.SEARCHING), ("return", State.RETURNING)]
)
def test_after_a_silence_it_does_what_the_settings_say(after_silence: str, state: State) -> None:
    talk = silenced(after_silence)
    talk.silent.clear()
    talk.tick()
    assert talk.state == state


def test_after_a_silence_it_may_have_to_wait_for_an_operator() -> None:
    talk = silenced("hold")
    talk.silent.clear()
    talk.pass_by(60.0)
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"operator"})


def test_after_a_silence_it_hovers_until_the_link_has_shown_how_slow_it_is_and_says_so() -> None:
    talk = silenced()
    talk.silent.clear()
    talk.shows(round_trip_s=math.inf)
    did = talk.pass_by(30.0)
    assert talk.core.standing.causes == {"position"}
    assert "silent" in talk.core.standing.why
    assert "has yet to show how slow it is" in talk.core.standing.why
    assert sum("for another reason too" in each.text for each in did if isinstance(each, Note)) == 1
    talk.shows(round_trip_s=8.0)
    talk.pass_by(30.0)
    assert talk.state == State.HOLDING
    talk.shows(round_trip_s=0.3)
    talk.pass_by(30.0)
    assert talk.state == State.SEARCHING


def test_a_stop_that_may_have_been_lost_is_sent_again_once() -> None:
    talk = reached(State.HOLDING)
    talk.on(Stalled(talk.now, 3.0))
    assert talk.pass_by(5.0).count(Stop()) == 1


def test_a_search_that_goes_on_may_fly_home_by_its_own_way_again() -> None:
    talk = reached(State.RETURNING)
    for _ in range(2):  # the way home is not flown
        talk.on(TargetNotTaken(talk.now, Target(47.0, 8.3, 415.0), 5, "no"))
    assert talk.core.standing.causes == {"target"}
    talk.pass_by(901.0)
    assert (talk.state, talk.core.standing.direct) == (State.RETURNING, True)
    talk.on(Order("hold"))
    talk.done()
    assert (talk.state, talk.core.standing.direct) == (State.HOLDING, True)
    talk.on(Order("resume"))
    assert (talk.state, talk.core.standing.direct) == (State.SEARCHING, False)


def test_a_cause_does_not_outlive_its_hold() -> None:
    """An operator holds, and then orders the return: a later hold on the way home ends by itself."""
    talk = reached(State.HOLDING)
    talk.on(Order("return"))
    talk.shows(fix=1)
    talk.tick()
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"position"})
    talk.shows(fix=3)
    talk.pass_by(10.0)
    assert talk.state == State.RETURNING


def test_a_hold_that_the_state_does_not_allow_leaves_no_cause_behind() -> None:
    talk = reached(State.YIELDED)
    talk.on(LinkLost(talk.now, 4.0))
    assert talk.core.standing.causes == frozenset()


def test_the_detector_is_waited_for() -> None:
    talk = searching()
    talk.silent.add("detector")
    talk.pass_by(11.0)
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"detector"})
    talk.silent.clear()
    talk.tick()
    assert talk.state == State.SEARCHING


def test_a_hold_for_a_fault_leads_home_in_the_end_and_at_once_without_the_energy() -> None:
    talk = searching({"flight": {"altitude_m": 15.0, "full_battery_s": 7200.0}})
    for _ in range(2):
        talk.on(TargetNotTaken(talk.now, Target(47.0, 8.3, 415.0), 5, "no"))
    talk.pass_by(901.0)
    assert talk.state == State.RETURNING
    assert talk.core.standing.why_stopped.startswith("hovered for")
    low = reached(State.HOLDING)
    low.shows(battery_percent=18.0)
    low.tick()
    standing: Any = low.core.standing
    assert (low.state, standing.why_stopped, standing.searched) == (
        State.RETURNING,
        "battery at 18 %",
        True,
    )


def test_a_silent_autopilot_is_not_sent_home_blindly() -> None:
    talk = silenced()
    talk.shows(battery_percent=18.0)
    talk.pass_by(60.0)
    assert talk.state == State.HOLDING


@pytest.mark.parametrize("fault", ["position", "link"])
def test_a_hold_looks_at_energy_whatever_it_is_for(fault: str) -> None:
    """Without a position no waypoint of ours leads home: the autopilot's own return or landing does."""
    talk = searching() if fault == "position" else silenced("hold")
    if fault == "position":
        talk.shows(fix=1)
        talk.tick()
    else:
        talk.silent.clear()
        talk.tick()
    assert talk.state == State.HOLDING
    talk.shows(battery_percent=18.0)
    talk.tick()
    assert talk.state == State.RETURNING
    talk.pass_by(2.0)
    assert talk.doing() == ReturnToLaunch()
    assert talk.state == State.RETURNING  # the doubtful position does not hold what needs none


def test_an_autopilot_that_does_not_know_the_way_home_lands() -> None:
    talk = searching()
    talk.shows(fix=1)
    talk.tick()
    talk.shows(battery_percent=18.0)
    talk.tick()
    talk.tick()
    assert talk.doing() == ReturnToLaunch()
    talk.failed("it answered DENIED")
    talk.pass_by(6.0)
    assert talk.doing() == Land()


def test_an_operators_hold_on_the_way_home_ends_in_the_same_way_home_which_goes_past_the_others() -> None:
    talk = reached(State.RETURNING)
    talk.on(Order("hold"))
    talk.pass_by(2.0)
    talk.shows(battery_percent=18.0)
    talk.pass_by(2.0)
    assert (talk.state, talk.core.standing.direct) == (State.RETURNING, False)


def test_a_slow_journal_holds_and_its_energy_leads_home_all_the_same() -> None:
    talk = searching()
    talk.sees(journal_behind_s=3.0)
    talk.tick()
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"journal"})
    talk.sees(journal_behind_s=0.0)
    talk.tick()
    assert talk.state == State.HOLDING  # a slow disk is not slow at every row
    talk.pass_by(4.0)
    assert talk.state == State.SEARCHING
    talk.sees(journal_behind_s=3.0)
    talk.tick()
    talk.shows(battery_percent=18.0)
    talk.tick()
    assert talk.state == State.RETURNING


def test_a_contradiction_about_home_holds_until_it_is_gone() -> None:
    talk = searching()
    talk.shows(alt_amsl_m=435.0)  # a correction of 20 m
    talk.tick()
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"position"})
    assert "above the sea" in talk.core.standing.why
    talk.shows(home=Home(*ground.launch(), 420.0))
    talk.pass_by(10.0)
    assert talk.state == State.SEARCHING
    assert talk.core.helm.leg(talk.core.chart.grid.launch, talk.seen.telemetry).altitude_m == 435.0


def test_a_climb_that_was_broken_off_on_the_ground_is_not_stopped_again_and_again() -> None:
    talk = reached(State.TAKEOFF)
    talk.on(Order("hold"))
    talk.shows(**ON_GROUND)
    talk.on(NotStopped("the aircraft is not armed"))
    talk.wanted.clear()
    talk.pass_by(5.0)
    assert talk.state == State.HOLDING
    assert Stop() not in talk.wanted


def test_a_stop_is_not_tried_again_and_again_while_nobody_is_heard() -> None:
    talk = silenced()
    talk.on(NotStopped("the vehicle has not been heard for 4 s"))
    talk.wanted.clear()
    talk.pass_by(20.0)
    assert Stop() not in talk.wanted
    talk.on(Order("hold"))
    talk.on(NotStopped("the vehicle has not been heard for 24 s"))
    talk.silent.clear()
    talk.wanted.clear()
    talk.pass_by(3.0)
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"operator"})
    assert talk.wanted.count(Stop()) == 1


@pytest.mark.parametrize("rejected", [False, True])
def test_after_a_silence_over_what_was_found_it_hovers_over_that_again(rejected: bool) -> None:
    talk = searching({"search": {"on_found": "hover"}})
    talk.sees(found=FOUND)
    talk.tick()
    assert talk.state == State.FOUND
    talk.silent.add("heartbeat")
    talk.tick(4.0)
    talk.on(LinkLost(talk.now, 4.0))
    assert talk.state == State.HOLDING
    if rejected:
        talk.sees(found=None)
        talk.on(Judged(False, None))
    talk.silent.clear()
    talk.pass_by(5.0)
    assert talk.state == (State.SEARCHING if rejected else State.FOUND)


def test_a_find_that_the_search_went_on_after_is_not_hovered_over_after_a_hold() -> None:
    talk = searching({"search": {"on_found": "continue"}})
    talk.sees(found=FOUND)
    talk.tick()
    talk.silent.add("detector")
    talk.pass_by(11.0)
    assert (talk.state, talk.core.standing.found) == (State.HOLDING, FOUND)
    talk.silent.clear()
    talk.tick()
    assert talk.state == State.SEARCHING

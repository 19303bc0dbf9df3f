"""A search outlives a battery: what happens between two sorties, and what does not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from service.mavlink.events import Home
from service.mission.effects import (
    Answer,
    Arm,
    Connect,
    EnterGuided,
    PlanAnew,
    SendWaypoint,
    TakeOff,
    Tell,
    WaitReady,
)
from service.mission.flight import Flight
from service.mission.news import Judged, Order
from service.mission.standing import Standing
from service.mission.states import Event, State
from service.rows import FoundRow, SortieRow, TransitionRow
from tests.service.mission.flown import FOUND, LEFT_US, ON_GROUND, Talk, reached, takes_off

WAITS = {"run": {"next_sortie_within_s": 600.0}}
MOVES = (Arm, TakeOff, SendWaypoint, EnterGuided)


def grounded(percent: float = 30.0, **terms: Any) -> Talk:
    """An aircraft that has landed for want of energy, with the search unfinished."""
    talk = reached(State.SEARCHING, WAITS, **terms)
    talk.pass_by(60.0)
    talk.shows(battery_percent=15.0)
    talk.tick()
    assert talk.state == State.RETURNING
    talk.shows(**ON_GROUND, battery_percent=percent, in_control=False)
    talk.pass_by(1.0)
    assert talk.state == State.GROUNDED
    talk.wanted.clear()
    return talk


def said(talk: Talk) -> list[str]:
    return [effect.text for effect in talk.wanted if isinstance(effect, Tell)]


@pytest.mark.parametrize("coming", [False, True])
def test_what_others_have_searched_enough_meanwhile_needs_no_sortie(coming: bool) -> None:
    talk = grounded()
    if coming:
        talk.on(Order("replace"))
    talk.sees(searched=0.98, enough=0.95)
    talk.pass_by(1.0)
    standing = talk.core.standing
    assert (talk.state, standing.searched, standing.why_stopped) == (
        State.DONE,
        True,
        "searched to POS 98.0 %",
    )


def test_a_landing_before_the_search_is_over_waits_and_moves_nothing() -> None:
    talk = grounded()
    talk.pass_by(60.0)
    talk.pilot("LOITER")
    talk.pilot("GUIDED")
    talk.pass_by(60.0)
    assert talk.state == State.GROUNDED
    assert not [effect for effect in talk.wanted if isinstance(effect, MOVES)]


@pytest.mark.parametrize("finished", ["enough", "found", "finished on the way", "no further sortie wanted"])
def test_a_landing_ends_the_run_when_nothing_is_left_to_fly_for(finished: str) -> None:
    talk = reached(State.SEARCHING, {} if finished.startswith("no") else WAITS)
    if finished == "enough":
        talk.pass_by(1.0)
        talk.done()
        talk.sees(searched=0.9999, enough=0.999)
        talk.pass_by(1.0)
    elif finished == "found":
        talk.on(Order("return"))
        talk.core.standing = Standing(state=State.RETURNING, settled=True)
    elif finished == "finished on the way":
        talk.on(Order("return"))
        talk.on(Order("finish", 7))
        assert talk.core.standing.why_stopped == "the operator finished the search"
    else:
        talk.on(Order("return"))
    assert talk.state == State.RETURNING
    talk.shows(**ON_GROUND)
    talk.pass_by(1.0)
    assert talk.state == State.DONE


def test_an_order_to_finish_on_the_way_home_is_a_row_of_its_own() -> None:
    talk = reached(State.SEARCHING, WAITS)
    talk.on(Order("return"))
    before = len(talk.rows)
    talk.on(Order("finish", 7))
    why = "the operator finished the search"
    assert talk.rows[before:] == [TransitionRow(State.RETURNING, Event.FINISH, State.RETURNING, why)]


@pytest.mark.parametrize("by", ["a person", "the posterior"])
def test_what_is_found_on_the_way_home_needs_no_other_sortie(by: str) -> None:
    talk = reached(State.SEARCHING, WAITS)
    talk.pass_by(30.0)
    talk.shows(battery_percent=15.0)
    talk.tick()
    assert talk.state == State.RETURNING
    talk.sees(found=FOUND, confirmed=by == "a person")
    if by == "a person":
        talk.on(Judged(True, FOUND, 7))
    talk.pass_by(1.0)
    assert (talk.state, talk.core.standing.found) == (State.RETURNING, FOUND)
    assert [row for row in talk.rows if isinstance(row, FoundRow)] == [FoundRow(FOUND)]
    talk.shows(**ON_GROUND, in_control=False)
    talk.pass_by(1.0)
    assert (talk.state, talk.core.standing.found, talk.core.standing.settled) == (State.DONE, FOUND, True)


def test_a_find_that_every_look_moves_a_little_is_told_once_on_the_way_home() -> None:
    talk = reached(State.SEARCHING, WAITS)
    talk.pass_by(30.0)
    talk.shows(battery_percent=15.0)
    talk.tick()
    for step in range(5):
        talk.sees(found=replace(FOUND, lat=FOUND.lat + 1e-5 * step))
        talk.tick()
    assert len([row for row in talk.rows if isinstance(row, FoundRow)]) == 5
    told = [each for each in talk.wanted if isinstance(each, Tell) and "found at" in each.text]
    assert len(told) == 1


def test_what_was_found_on_the_way_home_and_rejected_is_searched_for_again() -> None:
    talk = reached(State.SEARCHING, WAITS)
    talk.pass_by(30.0)
    talk.shows(battery_percent=15.0)
    talk.tick()
    talk.sees(found=FOUND)
    talk.pass_by(1.0)
    talk.sees(found=None)
    talk.on(Judged(False, None, 7))
    talk.shows(**ON_GROUND, in_control=False)
    talk.pass_by(1.0)
    assert (talk.state, talk.core.standing.found) == (State.GROUNDED, None)


def test_a_pilot_who_lands_it_before_the_end_may_fly_it_again() -> None:
    talk = reached(State.SEARCHING, WAITS)
    talk.pass_by(30.0)
    talk.pilot("LAND")
    talk.shows(**ON_GROUND, **LEFT_US)
    talk.pilot("STABILIZE")
    assert talk.state == State.GROUNDED
    talk.shows(landed_state="in_air", armed=True, alt_home_m=15.0, alt_amsl_m=415.0)
    talk.pass_by(5.0)
    assert talk.state == State.GROUNDED  # in the pilot's hands
    talk.shows(guided=True, mode="GUIDED")
    talk.pass_by(5.0)
    assert talk.doing() == EnterGuided()
    talk.done()
    assert talk.state == State.SEARCHING


def test_an_order_launches_the_next_sortie_and_a_flat_battery_does_not() -> None:
    talk = grounded(percent=15.0, may_take_off=True)
    talk.on(Order("launch", 7))
    assert [e.refused for e in talk.wanted if isinstance(e, Answer)] == [
        "no take-off: battery at 15 %, and 20 % is the least"
    ]
    talk.shows(battery_percent=100.0, in_control=False)
    talk.pass_by(1.0)
    assert (
        "search GROUNDED: fresh battery, 100 %: order launch, or take off and select the guided mode"
        in said(talk)
    )
    assert talk.core.doing is None  # nobody has ordered it yet
    talk.on(Order("launch", 8))
    assert talk.doing() == WaitReady()
    talk.done()
    assert talk.state == State.TAKEOFF
    talk.pass_by(1.0)
    takes_off(talk)
    talk.pass_by(60.0)
    assert talk.state == State.SEARCHING  # and the first battery's end is not this one's
    assert talk.core.standing.why_stopped == ""


@pytest.mark.parametrize("how", ["it does not arm", "its battery is empty by then"])
def test_a_take_off_in_vain_between_two_sorties_ends_no_search(how: str) -> None:
    talk = grounded(percent=90.0, may_take_off=True)
    why_stopped = talk.core.standing.why_stopped
    talk.on(Order("launch", 7))
    if how.startswith("its"):
        talk.shows(battery_percent=10.0)
    talk.done()
    assert talk.state == State.TAKEOFF
    talk.pass_by(1.0)
    if how.startswith("it d"):
        assert talk.doing() == EnterGuided()
        talk.done()
        talk.failed("PreArm: compass not calibrated")
        talk.pass_by(10.0)
    assert talk.state == State.GROUNDED
    assert talk.core.standing.why_stopped == why_stopped
    why = (
        "it did not take off: PreArm: compass"
        if how.startswith("it d")
        else "it did not take off: no take-off"
    )
    assert talk.core.standing.why.startswith(why)
    assert len(talk.core.flight.sorties) == 1
    talk.shows(battery_percent=90.0)
    talk.on(Order("launch", 8))
    talk.done()
    talk.pass_by(1.0)
    takes_off(talk)
    assert talk.state == State.SEARCHING
    assert talk.core.flight.aloft_s(talk.now) < 5.0


def test_an_aircraft_that_is_given_over_too_far_away_ends_no_search() -> None:
    talk = grounded()
    lat, lon = talk.core.chart.grid.launch
    talk.shows(landed_state="in_air", armed=True, alt_home_m=15.0, alt_amsl_m=415.0, battery_percent=90.0)
    talk.shows(guided=True, mode="GUIDED", home=Home(lat + 0.01, lon, 400.0))
    talk.pass_by(30.0)
    assert talk.state == State.GROUNDED
    assert not [each for each in talk.wanted if isinstance(each, EnterGuided)]
    assert len([text for text in said(talk) if "it is not taken over: home is 11" in text]) == 1
    assert "from the launch point" in talk.core.standing.why
    talk.shows(home=Home(lat, lon, 400.0))
    talk.pass_by(1.0)
    assert talk.doing() == EnterGuided()


def test_a_restart_between_two_sorties_waits_for_an_aircraft_that_is_switched_off() -> None:
    flight = Flight(flown=True, carried_s=60.0, earlier_s=60.0, left_at=990.0)
    left = Standing(state=State.GROUNDED, why="on the ground, disarmed", why_stopped="battery at 20 %")
    talk = Talk(WAITS, standing=left, flight=flight, **ON_GROUND)
    for _ in range(5):
        talk.pass_by(5.0)
        assert talk.doing() == Connect()
        talk.failed("nothing was heard in 30 s")
        assert talk.state == State.WAITING
    talk.pass_by(5.0)
    talk.done()
    talk.pass_by(1.0)
    assert talk.state == State.GROUNDED
    fresh, never = Talk(WAITS, **ON_GROUND), Talk(WAITS, standing=left, flight=flight, **ON_GROUND)
    fresh.tick()
    fresh.failed("nothing was heard in 30 s")
    assert fresh.state == State.ABORTED
    never.pass_by(601.0)
    never.failed("nothing was heard in 30 s")
    assert never.state == State.ABORTED


def test_a_launch_without_leave_to_take_off_is_refused() -> None:
    talk = grounded()
    talk.on(Order("launch", 7))
    assert [effect.refused for effect in talk.wanted if isinstance(effect, Answer)] == [
        "this service was not allowed to arm or take off (--takeoff)"
    ]


def test_the_built_in_world_flies_on_with_a_fresh_battery_by_itself_if_that_was_why_it_landed() -> None:
    talk = grounded()
    talk.core.terms = type(talk.core.terms)(may_take_off=True, may_take_off_again=True)
    talk.pass_by(5.0)
    assert talk.core.doing is None
    talk.shows(battery_percent=100.0)
    talk.pass_by(1.0)
    assert talk.doing() == WaitReady()
    ordered = reached(State.SEARCHING, WAITS)
    ordered.core.terms = talk.core.terms
    ordered.pass_by(30.0)
    ordered.on(Order("return"))
    ordered.shows(**ON_GROUND, battery_percent=60.0)
    ordered.pass_by(1.0)
    ordered.shows(battery_percent=100.0)
    ordered.pass_by(5.0)
    assert (ordered.state, ordered.core.doing) == (State.GROUNDED, None)


def test_a_run_ends_when_an_operator_finishes_it_or_nobody_flies_for_long() -> None:
    finished = grounded()
    finished.on(Order("finish", 7))
    standing = finished.core.standing
    assert (standing.state, standing.why_stopped) == (State.DONE, "the operator finished the search")
    assert standing.searched
    waited = grounded()
    waited.pass_by(590.0)
    assert waited.state == State.GROUNDED
    waited.pass_by(20.0)
    assert waited.state == State.DONE
    standing = waited.core.standing
    assert (standing.why, standing.why_stopped) == ("nobody flew again within 10 min", "battery at 15 %")


def test_every_flight_is_a_sortie_of_its_own_in_the_journal() -> None:
    talk = grounded(may_take_off=True)
    (first,) = talk.core.flight.sorties
    assert first.number == 1
    assert 55.0 < first.seconds < 70.0
    assert "battery" in first.why
    assert talk.core.flight.aloft_s(talk.now) == 0.0
    talk.shows(**{**ON_GROUND, "landed_state": "in_air", "armed": True}, guided=True, mode="GUIDED")
    talk.shows(battery_percent=95.0, alt_home_m=15.0, alt_amsl_m=415.0, in_control=True)
    talk.pass_by(5.0)
    talk.done()
    assert talk.state == State.SEARCHING
    talk.pass_by(30.0)
    talk.on(Order("finish"))
    talk.shows(**ON_GROUND)
    talk.pass_by(1.0)
    rows = [row for row in talk.rows if isinstance(row, SortieRow)]
    assert [row.number for row in rows] == [2]
    assert rows[0].seconds == pytest.approx(31.0, abs=3.0)
    assert rows[0].why == "the operator finished the search"


def test_a_restart_on_the_ground_comes_up_grounded_and_counts_no_flight_twice() -> None:
    flight = Flight(flown=True, carried_s=60.0, earlier_s=60.0, steps=7, left_at=990.0)
    left = Standing(state=State.GROUNDED, why="on the ground, disarmed", why_stopped="battery at 20 %")
    talk = Talk(WAITS, may_take_off=True, standing=left, flight=flight, **ON_GROUND)
    talk.tick()
    talk.done()
    talk.pass_by(5.0)
    assert (talk.state, talk.core.standing.why_stopped) == (State.GROUNDED, "battery at 20 %")
    assert not [effect for effect in talk.wanted if isinstance(effect, MOVES)]
    assert flight.sorties == []


def left_in_the_air(**changes: Any) -> Flight:
    """What the rows tell of a second flight whose end the service did not live to write."""
    first = SortieRow(1, 400.0, 60.0, 7, 0.2, "battery at 15 %", 1, "px4")
    usual: dict[str, Any] = {
        "flown": True,
        "carried_s": 100.0,
        "earlier_s": 60.0,
        "steps": 12,
        "sorties": [first],
    }
    usual |= {"left_at": 990.0, "told_s": 104.0, "told_at": 994.0, "by": (1, "px4")}
    return Flight(**usual | changes)


@pytest.mark.parametrize(
    "left", [State.RETURNING, State.SEARCHING, State.YIELDED, State.HOLDING, State.GROUNDED]
)
def test_a_flight_whose_end_was_lost_with_the_process_is_a_sortie_all_the_same(left: State) -> None:
    standing = Standing(state=left, why="energy", why_stopped="battery at 12 %", found=None)
    flight = left_in_the_air()
    talk = Talk(WAITS, may_take_off=True, standing=standing, flight=flight, **ON_GROUND)
    talk.tick()
    talk.done()
    talk.pass_by(5.0)
    (row,) = [row for row in talk.rows if isinstance(row, SortieRow)]
    assert row == SortieRow(2, 994.0, pytest.approx(44.0), 5, 0.0, "battery at 12 %", 1, "px4")
    assert [each.number for each in flight.sorties] == [1, 2]
    assert flight.aloft_s(talk.now) == 0.0
    assert talk.state == State.GROUNDED  # as it would be, had a service seen it land
    assert not [effect for effect in talk.wanted if isinstance(effect, MOVES)]


@pytest.mark.parametrize("left", [State.RETURNING, State.SEARCHING, State.YIELDED])
def test_a_sortie_whose_row_was_the_last_to_be_written_is_told_once(left: State) -> None:
    """Killed after the sortie's row and before that of the landing's transition."""
    second = SortieRow(2, 994.0, 44.0, 5, 0.3, "battery at 12 %", 1, "px4")
    flight = left_in_the_air()
    flight.recall_sortie(second)
    standing = Standing(state=left, why="energy", why_stopped="battery at 12 %")
    talk = Talk(WAITS, may_take_off=True, standing=standing, flight=flight, **ON_GROUND)
    talk.tick()
    talk.done()
    talk.pass_by(10.0)
    assert talk.state == State.GROUNDED
    assert not [row for row in talk.rows if isinstance(row, SortieRow)]
    assert flight.sorties[-1] == second


def test_what_goes_on_in_the_air_is_the_same_sortie() -> None:
    flight = left_in_the_air()
    talk = Talk(WAITS, standing=Standing(state=State.SEARCHING), flight=flight, boot_time_s=500.0)
    talk.tick()
    talk.done()
    talk.pass_by(5.0)
    assert not [row for row in talk.rows if isinstance(row, SortieRow)]
    assert flight.aloft_s(talk.now) == pytest.approx(40.0 + talk.now - 990.0, abs=1.0)


def test_an_aircraft_that_was_switched_on_since_flies_another_sortie() -> None:
    """It has landed, got another battery and taken off again while no service was there."""
    flight = left_in_the_air(left_at=400.0, told_at=404.0)
    talk = Talk(
        WAITS, standing=Standing(state=State.SEARCHING), flight=flight, boot_time_s=120.0, system_id=1
    )
    talk.tick()
    talk.done()
    talk.pass_by(5.0)
    (row,) = [row for row in talk.rows if isinstance(row, SortieRow)]
    assert (row.number, row.landed, row.seconds) == (2, 404.0, pytest.approx(44.0))
    assert flight.aloft_s(talk.now) < 10.0


def test_time_on_the_ground_while_no_service_was_there_is_not_flown() -> None:
    """Killed on the ground, and in the air by a pilot's hand when it comes up again."""
    flight = left_in_the_air(carried_s=60.0, left_at=400.0)
    talk = Talk(WAITS, standing=Standing(state=State.GROUNDED), flight=flight)
    talk.tick()
    talk.done()
    talk.pass_by(5.0)
    assert flight.aloft_s(talk.now) < 10.0
    assert not [row for row in talk.rows if isinstance(row, SortieRow)]


def test_the_way_home_of_a_later_flight_is_reckoned_over_the_ground_like_that_of_the_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Hills that it climbs over cost energy in every flight, not in the first alone."""
    seconds = []
    for highest_m in (0.0, 110.0):
        talk = grounded()
        monkeypatch.setattr(talk.core.helm.heights, "highest_return_m", lambda points, up=highest_m: up)
        talk.shows(**{**ON_GROUND, "landed_state": "in_air", "armed": True}, guided=True, mode="GUIDED")
        talk.shows(battery_percent=95.0, alt_home_m=15.0, alt_amsl_m=415.0, in_control=True)
        talk.pass_by(5.0)
        talk.done()
        assert talk.state == State.SEARCHING
        talk.pass_by(1.0)
        seconds.append(talk.core.reserve.energy.home.seconds)
    assert seconds[1] > seconds[0] + 20.0


def test_what_a_sortie_leaves_is_planned_from_the_launch_point_before_the_next() -> None:
    talk = grounded(100.0, may_take_off=True)
    talk.pass_by(60.0)
    assert PlanAnew() not in talk.wanted
    talk.on(Order("launch"))
    talk.done()
    assert talk.state == State.TAKEOFF
    assert talk.wanted.count(PlanAnew()) == 1
    over = grounded()
    over.on(Order("finish"))
    assert over.state == State.DONE
    assert PlanAnew() not in over.wanted


def test_it_waits_between_two_sorties_after_a_restart_too() -> None:
    assert grounded().core.between_sorties
    assert Talk(standing=Standing(state=State.GROUNDED)).core.between_sorties
    assert not Talk(standing=Standing(state=State.SEARCHING)).core.between_sorties

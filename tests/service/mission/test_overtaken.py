"""The last word counts: what was ordered before a person stopped the aircraft, or took it, is not carried out after."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from service.mavlink import NotPermitted
from service.mavlink.events import Rebooted
from service.mission.effects import Answer, Arm, DropAction, EnterGuided, Rest, SetSpeed, Tell, WaitReady
from service.mission.news import Judged, Order
from service.mission.states import State
from tests.service.mission.aloft import aloft, until
from tests.service.mission.flown import FOUND, LEFT_US, ON_GROUND, Talk, reached, searching
from tests.service.mission.test_grounded import grounded
from tests.service.mission.test_mission import locked

TO_LAUNCH = [State.READY, State.HOLDING, State.YIELDED, State.GROUNDED]


def on_the_ground(state: State) -> Talk:
    """An aircraft that may be launched from a state."""
    if state == State.GROUNDED:
        return grounded(90.0, may_take_off=True)
    talk = reached(State.READY, may_take_off=True, **ON_GROUND)
    if state == State.HOLDING:
        talk.on(Order("hold"))
    elif state == State.YIELDED:
        talk.pilot("STABILIZE")
    return talk


@pytest.mark.parametrize("state", TO_LAUNCH)
def test_a_hold_while_a_launch_gets_ready_keeps_the_aircraft_on_the_ground(state: State) -> None:
    talk = on_the_ground(state)
    talk.on(Order("launch", 7))
    assert (talk.state, talk.doing()) == (state, WaitReady())
    assert "hold" in talk.core.orders(talk.seen)
    did = talk.on(Order("hold", 8))
    assert DropAction() in did
    assert Rest() in did
    assert Answer(8) in did
    talk.pass_by(60.0)
    assert talk.state == (State.HOLDING if state == State.READY else state)
    assert not [each for each in talk.wanted if isinstance(each, (EnterGuided, Arm))]


@pytest.mark.parametrize("state", TO_LAUNCH)
def test_a_mode_that_the_pilot_selects_while_a_launch_gets_ready_ends_it(state: State) -> None:
    talk = on_the_ground(state)
    talk.on(Order("launch", 7))
    assert DropAction() in talk.pilot("ALT_HOLD")
    talk.pass_by(60.0)
    assert talk.state == (State.GROUNDED if state == State.GROUNDED else State.YIELDED)
    assert not [each for each in talk.wanted if isinstance(each, (EnterGuided, Arm))]


def test_who_ordered_a_launch_hears_why_it_is_not_carried_out() -> None:
    talk = on_the_ground(State.GROUNDED)
    talk.on(Order("launch", 7))
    did = talk.on(Rebooted(talk.now))
    said = "launch is not carried out: the autopilot has rebooted"
    assert Tell(f"search GROUNDED: {said}", 4) in did
    assert said in talk.core.standing.why


@pytest.mark.parametrize("state", [State.YIELDED, State.HOLDING])
def test_a_hold_while_a_resume_is_carried_out_counts(state: State) -> None:
    talk = reached(state)
    talk.shows(**LEFT_US)
    talk.on(Order("resume", 7))
    assert talk.doing() == EnterGuided()
    did = talk.on(Order("hold", 8))
    assert DropAction() in did
    assert Rest() in did
    answers = {each.ticket: each.refused for each in did if isinstance(each, Answer)}
    assert answers == {7: "another order or event came before it was carried out", 8: ""}
    assert (talk.state, talk.core.doing) == (state, None)


def test_a_pilot_who_selects_another_mode_while_a_resume_is_carried_out_keeps_the_aircraft() -> None:
    talk = reached(State.YIELDED)
    talk.on(Order("resume", 7))
    assert DropAction() in talk.pilot("ALT_HOLD")
    assert (talk.state, talk.core.doing) == (State.YIELDED, None)


@pytest.mark.parametrize("state", [State.READY, State.GROUNDED])
def test_an_aircraft_that_its_pilot_takes_back_before_it_is_taken_over_is_left_alone(state: State) -> None:
    talk = reached(State.READY) if state == State.READY else grounded()
    talk.shows(landed_state="in_air", armed=True, alt_home_m=15.0, alt_amsl_m=415.0, battery_percent=90.0)
    talk.shows(guided=True, mode="GUIDED", in_control=False)
    talk.pass_by(1.0)
    assert talk.doing() == EnterGuided()  # which waits until all rows are on disk
    assert DropAction() in talk.pilot("ALT_HOLD")
    talk.pass_by(30.0)
    assert (talk.state, talk.core.doing) == (state, None)
    talk.shows(guided=True, mode="GUIDED")
    talk.pass_by(5.0)
    assert talk.doing() == EnterGuided()


@pytest.mark.timeout(180)
@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_a_mode_that_the_pilot_selected_is_not_left_without_an_order(flavor: str, tmp_path: Path) -> None:
    async def fly() -> None:
        async with aloft(tmp_path, flavor) as mission:
            vehicle = mission.vehicle
            await mission.order("hold")
            await vehicle.return_to_launch()
            mode = vehicle.telemetry.mode
            with pytest.raises(NotPermitted, match="its pilot has selected R"):
                await vehicle.enter_guided(there=True)
            with pytest.raises(NotPermitted, match="its pilot has selected R"):
                await vehicle.enter_guided(out_of="BRAKE")
            await mission.clock.sleep(3.0)
            assert vehicle.telemetry.mode == mode

    asyncio.run(fly())


@pytest.mark.timeout(180)
def test_a_hold_is_not_undone_by_a_resume_that_was_ordered_before_it_and_waits_for_the_disk(
    tmp_path: Path,
) -> None:
    async def fly() -> None:
        async with aloft(tmp_path) as mission:
            await mission.order("hold")
            with locked(mission.journal.path):
                resume = asyncio.create_task(mission.order("resume"))
                await asyncio.sleep(0.2)
                await mission.order("hold")
            receipt = await asyncio.wait_for(resume, 10.0)
            assert "was stopped or taken over before it was carried out" in (receipt.refused or "")
            assert mission.state == State.HOLDING
            assert (await mission.order("resume")).refused is None
            await until(mission, lambda: mission.state == State.SEARCHING)

    asyncio.run(fly())


@pytest.mark.parametrize("state", [State.HOLDING, State.FOUND, State.RETURNING, State.YIELDED])
@pytest.mark.parametrize("confirmed", [True, False])
def test_a_word_on_a_place_moves_nothing_once_a_person_has_stopped_the_aircraft_since(
    confirmed: bool, state: State
) -> None:
    talk = reached(state, {"search": {"on_found": "hover"}})
    talk.sees(confirmed=confirmed, found=FOUND if confirmed else None)
    did = talk.on(Judged(confirmed, FOUND if confirmed else None, 7, moves=False))
    assert Answer(7) in did
    assert (talk.state, talk.core.doing) == (state, None)
    assert [each for each in did if isinstance(each, Tell) and "stays stopped" in each.text]


def test_a_place_that_was_confirmed_while_the_aircraft_was_stopped_ends_the_search_that_goes_on() -> None:
    talk = searching()
    talk.on(Order("hold"))
    talk.sees(confirmed=True, found=FOUND)
    talk.on(Judged(True, FOUND, 7, moves=False))
    talk.on(Order("resume"))
    for _ in range(4):
        talk.tick()
        if isinstance(talk.core.doing, SetSpeed):
            talk.done()
    assert (talk.state, talk.core.standing.found) == (State.RETURNING, FOUND)


@pytest.mark.timeout(180)
@pytest.mark.parametrize("word", ["confirm", "reject"])
def test_a_hold_is_not_undone_by_a_word_on_a_place_that_was_given_before_it_and_waits_for_the_disk(
    word: str, tmp_path: Path
) -> None:
    async def fly() -> None:
        async with aloft(tmp_path) as mission:
            place = mission.core.chart.latlon(mission.cell())
            with locked(mission.journal.path):
                judging = asyncio.create_task(mission.order(word, place))
                await asyncio.sleep(0.2)
                await mission.order("hold")
            receipt = await asyncio.wait_for(judging, 10.0)
            assert receipt.refused is None
            await mission.clock.sleep(3.0)
            assert mission.state == State.HOLDING

    asyncio.run(fly())


def test_what_no_person_orders_just_now_leaves_no_mode_but_the_one_that_was_seen() -> None:
    """The mode that a pilot selects may be read in the very moment in which ours is to be sent."""
    talk = searching()
    talk.shows(fix=1)
    talk.tick()
    talk.shows(guided=False, mode="BRAKE", fix=3)
    talk.pass_by(10.0)
    braked = talk.doing()
    assert isinstance(braked, EnterGuided)
    assert braked.out_of == "BRAKE"
    talk = reached(State.TAKEOFF, mode="STABILIZE", guided=False)
    talk.tick()
    first = talk.doing()
    assert isinstance(first, EnterGuided)
    assert first.out_of == "STABILIZE"
    talk = reached(State.YIELDED)
    talk.on(Order("resume", 7))
    ordered = talk.doing()
    assert isinstance(ordered, EnterGuided)
    assert (ordered.there, ordered.out_of) == (False, None)

"""Another aircraft flies the next sortie: an order at GROUNDED, and what the search does with it."""

from __future__ import annotations

from typing import Any

import pytest

from service.mavlink.events import Paired
from service.mavlink.telemetry import Telemetry
from service.mission.effects import (
    Answer,
    Arm,
    Connect,
    EnterGuided,
    ForgetAircraft,
    SendWaypoint,
    TakeOff,
    Tell,
)
from service.mission.news import Order
from service.mission.states import State
from service.rows import ReplacedRow, SortieRow, VehicleRow
from tests.service.mission.flown import ON_GROUND, Talk, reached, takes_off, telemetry
from tests.service.mission.test_grounded import WAITS, grounded

MOVES = (Arm, TakeOff, SendWaypoint, EnterGuided)


def refusals(talk: Talk) -> list[str]:
    return [each.refused for each in talk.wanted if isinstance(each, Answer)]


def replaced(system_id: int | None = None) -> Talk:
    """The aircraft that landed is let go, and no other one is heard yet."""
    talk = grounded(may_take_off=True)
    talk.shows(system_id=1)
    talk.on(Order("replace", 7, system_id))
    talk.sees(telemetry=Telemetry())
    talk.silent = {"heartbeat", "position"}
    return talk


def comes(talk: Talk, **changes: Any) -> None:
    """It is heard, and stands on the ground."""
    talk.sees(telemetry=telemetry(**ON_GROUND, system_id=9, in_control=False, **changes))
    talk.silent.clear()
    talk.on(Paired(talk.now, 9, "px4", "AUTO_LOITER", False))
    talk.done()


@pytest.mark.parametrize("state", [each for each in State if each != State.GROUNDED])
def test_it_is_refused_in_every_other_state_in_one_sentence(state: State) -> None:
    talk = reached(state, WAITS)
    talk.wanted.clear()
    talk.on(Order("replace", 7))
    assert refusals(talk) == [f"another aircraft comes between two sorties, in GROUNDED; this one is {state}"]
    assert not [each for each in talk.wanted if isinstance(each, ForgetAircraft)]
    assert talk.state == state


def test_one_that_a_pilot_flies_is_not_forgotten() -> None:
    talk = grounded()
    talk.shows(landed_state="in_air", armed=True, in_control=False, guided=False, mode="LOITER")
    talk.on(Order("replace", 7))
    assert refusals(talk) == ["the aircraft that is heard does not stand on the ground with its motors off"]
    talk.silent = {"heartbeat"}
    talk.pass_by(30.0)  # nobody knows where it is now, and the operator says that it is another one
    talk.on(Order("replace", 8))
    assert refusals(talk)[-1] == ""


def test_the_one_that_landed_is_let_go_and_another_is_waited_for() -> None:
    talk = replaced(9)
    assert refusals(talk) == [""]
    assert talk.rows[-1] == ReplacedRow(9, 1, "ardupilot")
    (forget,) = [each for each in talk.wanted if isinstance(each, ForgetAircraft)]
    assert forget.system_id == 9
    talk.wanted.clear()
    talk.pass_by(2.0)
    assert talk.doing() == Connect()
    talk.failed("nothing was heard")
    assert talk.state == State.GROUNDED
    talk.pass_by(2.0)
    assert talk.doing() == Connect()
    assert not [each for each in talk.wanted if isinstance(each, MOVES)]


def test_nothing_that_the_one_before_told_is_held_of_the_other() -> None:
    talk = grounded()
    core = talk.core
    before = core.helm, core.helm.trust, core.helm.heights, core.reserve
    talk.on(Order("replace", 7))
    now = core.helm, core.helm.trust, core.helm.heights, core.reserve
    assert all(one is not other for one, other in zip(before, now, strict=True))
    assert core.reserve.energy.percent is None


def test_the_other_one_is_told_of_and_flies_the_next_sortie() -> None:
    talk = replaced()
    talk.pass_by(1.0)
    comes(talk, autopilot="px4", battery_percent=99.0)
    assert VehicleRow(9, "px4") in talk.rows
    assert (
        "search GROUNDED: another aircraft, system 9 (px4): order launch, or take off and select the guided mode"
        in [each.text for each in talk.wanted if isinstance(each, Tell)]
    )
    talk.on(Order("launch", 8))
    talk.done()
    talk.pass_by(1.0)
    takes_off(talk)
    talk.pass_by(30.0)
    assert talk.state == State.SEARCHING
    talk.on(Order("return"))
    talk.shows(**ON_GROUND)
    talk.pass_by(1.0)
    (sortie,) = [row for row in talk.rows if isinstance(row, SortieRow) and row.number == 2]
    assert (sortie.system_id, sortie.autopilot) == (9, "px4")


def test_nobody_waits_for_ever_for_one_that_does_not_come() -> None:
    talk = replaced()
    for _ in range(14):
        talk.pass_by(50.0)
        if talk.core.doing is not None:
            talk.failed("nothing was heard")
    assert (talk.state, talk.core.standing.why) == (State.DONE, "nobody flew again within 10 min")


def test_a_launch_that_was_getting_ready_is_dropped() -> None:
    talk = grounded(may_take_off=True)
    talk.shows(battery_percent=100.0)
    talk.on(Order("launch", 3))
    talk.on(Order("replace", 4))
    talk.pass_by(1.0)
    assert talk.doing() == Connect()
    talk.done()
    assert talk.state == State.GROUNDED

"""An armed aircraft that does not say that it is in the air: it can be sent no waypoint, and is not left alone."""

from __future__ import annotations

import pytest

from service.mavlink.events import Target, TargetNotTaken
from service.mission.effects import Brake, EnterGuided, ReturnToLaunch, SendWaypoint, Stop, Tell
from service.mission.helm import AIRBORNE_S
from service.mission.limits import Objection
from service.mission.news import NotSent, Order
from service.mission.states import State
from tests.service.mission.flown import Talk, reached, searching
from tests.service.mission.test_homeward import BEHIND

STICKS = ["on_ground", "undefined", "takeoff", "landing"]


def refusing(talk: Talk, seconds: float) -> None:
    """Time passes in which the link sends no waypoint, as it sends none to what is not in the air."""
    for _ in range(int(seconds)):
        talk.tick(1.0)
        if isinstance(waypoint := talk.core.doing, SendWaypoint):
            talk.on(NotSent(waypoint, Objection("link", "the aircraft is not in the air")))


@pytest.mark.parametrize("landed", STICKS)
@pytest.mark.parametrize("state", [State.SEARCHING, State.CONFIRMING, State.RETURNING])
def test_what_does_not_say_that_it_is_in_the_air_is_braked_and_its_pilot_is_told(
    state: State, landed: str
) -> None:
    talk = reached(state, lat=BEHIND[0], lon=BEHIND[1])
    talk.shows(landed_state=landed)
    talk.wanted.clear()
    refusing(talk, AIRBORNE_S + 2.0)
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"air"})
    assert Brake() in talk.wanted
    assert not [each for each in talk.wanted if isinstance(each, Stop)]
    assert [each for each in talk.wanted if isinstance(each, Tell) and "is in the air" in each.text]


def test_a_word_that_is_late_for_a_moment_holds_nothing() -> None:
    talk = searching()
    talk.shows(landed_state="landing")
    talk.pass_by(AIRBORNE_S - 0.5)
    talk.shows(landed_state="in_air")
    talk.pass_by(5.0)
    assert talk.state == State.SEARCHING


@pytest.mark.parametrize("state", [State.SEARCHING, State.RETURNING])
def test_it_goes_on_when_it_says_so_again_and_leaves_the_mode_that_it_braked_in(state: State) -> None:
    talk = reached(state, lat=BEHIND[0], lon=BEHIND[1])
    talk.shows(landed_state="on_ground")
    refusing(talk, 6.0)
    talk.shows(guided=False, mode="BRAKE", landed_state="in_air")
    talk.tick()
    assert talk.doing() == EnterGuided()
    talk.shows(guided=True, mode="GUIDED")
    talk.done()
    talk.tick()
    assert talk.state == state


@pytest.mark.parametrize("landed", STICKS)
def test_its_energy_and_its_patience_end_such_a_hold_by_the_autopilots_own_return(landed: str) -> None:
    for changes, seconds in (({"battery_percent": 18.0}, 2.0), ({}, 1000.0)):
        talk = searching({"flight": {"altitude_m": 15.0, "full_battery_s": 7200.0}})
        talk.shows(landed_state=landed)
        refusing(talk, 6.0)
        talk.shows(**changes)
        refusing(talk, seconds)
        assert talk.state == State.RETURNING
        assert isinstance(talk.doing(), ReturnToLaunch)


@pytest.mark.parametrize("landed", STICKS)
def test_its_battery_is_reckoned_whatever_it_says_of_the_ground(landed: str) -> None:
    talk = searching()
    talk.shows(landed_state=landed)
    refusing(talk, 1150.0)  # a level that stands still is counted down
    assert talk.state == State.RETURNING
    assert isinstance(talk.doing(), ReturnToLaunch)


@pytest.mark.parametrize("landed", STICKS)
def test_an_operators_hold_brakes_it(landed: str) -> None:
    talk = searching()
    talk.shows(landed_state=landed)
    assert Brake() in talk.on(Order("hold"))


def test_a_waypoint_that_is_not_flown_before_it_is_known_is_no_reason_to_stop_by_one() -> None:
    talk = searching()
    talk.shows(landed_state="undefined")
    talk.wanted.clear()
    for _ in range(2):
        talk.on(TargetNotTaken(talk.now, Target(47.0, 8.3, 415.0), 5, "no"))
    assert Brake() in talk.wanted

"""The way home: ours around the exclusions, then the autopilot's own."""

from __future__ import annotations

from service.mavlink.events import Stalled
from service.mission.effects import EnterGuided, ReturnToLaunch, SendWaypoint
from service.mission.homeward import HOME_AGAIN_S
from service.mission.news import Done, Order
from service.mission.states import State
from tests.service.mission.flown import ON_GROUND, Talk, place, reached

BEHIND = place(60.0, 60.0)  # on the other side of an exclusion, seen from the launch point


def homebound() -> Talk:
    """An aircraft on its way home, on the last part of it."""
    talk = reached(State.RETURNING)
    for _ in range(20):
        talk.tick()
        waypoint = talk.core.doing
        if not isinstance(waypoint, SendWaypoint):
            return talk
        talk.core.sent(waypoint)
        talk.done()
        talk.shows(lat=waypoint.point[0], lon=waypoint.point[1])
        talk.core.helm.trust = type(talk.core.helm.trust)(
            talk.settings.flight, 2.0
        )  # it flew, it did not jump
    raise AssertionError("it never gets home")


def orders(talk: Talk) -> int:
    """How often the return to launch was ordered."""
    return sum(isinstance(effect, ReturnToLaunch) for effect in talk.wanted)


def test_no_waypoint_of_ours_is_watched_while_the_autopilot_lands() -> None:
    """Landed in the guided mode, the aircraft comes no nearer to it, and that is no fault."""
    talk = homebound()
    assert isinstance(talk.doing(), ReturnToLaunch)
    assert not talk.core.helm.under_way(talk.seen.telemetry)
    talk.done()
    talk.shows(guided=False)
    talk.pass_by(60.0)
    assert talk.state == State.RETURNING


def test_a_return_to_launch_that_is_not_flown_is_ordered_again_and_one_that_is_flown_is_not() -> None:
    talk = homebound()
    talk.done()
    talk.pass_by(HOME_AGAIN_S + 1.0)
    assert orders(talk) == 2
    talk.done()
    talk.shows(guided=False)
    talk.pass_by(4 * HOME_AGAIN_S)
    assert orders(talk) == 2


def test_an_aircraft_that_is_down_is_not_ordered_home() -> None:
    talk = reached(State.RETURNING)
    talk.shows(guided=False, **ON_GROUND)
    talk.tick()
    assert (talk.state, orders(talk)) == (State.DONE, 0)


def test_a_return_that_the_state_does_not_outlast_is_dropped() -> None:
    talk = homebound()
    order = talk.doing()
    talk.on(Order("hold"))
    assert talk.doing() == EnterGuided()
    assert talk.on(Done(order)) == []
    talk.done()
    assert talk.state == State.HOLDING


def test_a_point_of_the_way_that_may_have_been_lost_is_sent_again() -> None:
    talk = reached(State.SEARCHING)
    talk.shows(lat=BEHIND[0], lon=BEHIND[1])
    talk.flew()
    talk.on(Order("return"))
    talk.tick()
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    talk.done()
    talk.pass_by(3.0)
    assert talk.core.doing is None
    talk.on(Stalled(talk.now, 3.0))
    talk.pass_by(1.5)
    assert talk.doing() == waypoint

"""The way home: ours around the exclusions, then the autopilot's own."""

from __future__ import annotations

from typing import Any

import pytest

from service.mavlink.events import Stalled
from service.mission.effects import EnterGuided, Land, Note, ReturnToLaunch, SendWaypoint, Tell
from service.mission.homeward import HOME_AGAIN_S, KEPT_S, LANDS_AFTER, SHORT_S
from service.mission.limits import Objection
from service.mission.news import Done, NotSent, Order
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


def kept(talk: Talk, cause: str, seconds: int) -> None:
    """Time passes in which each waypoint is refused for a cause."""
    for _ in range(seconds):
        talk.tick(1.0)
        if isinstance(waypoint := talk.core.doing, SendWaypoint):
            talk.on(NotSent(waypoint, Objection(cause, "for a test")))


def behind(full_battery_s: float = 1200.0) -> Talk:
    """An aircraft that has to fly around an exclusion on its way home."""
    talk = reached(State.SEARCHING, {"flight": {"altitude_m": 15.0, "full_battery_s": full_battery_s}})
    talk.shows(lat=BEHIND[0], lon=BEHIND[1])
    talk.flew()
    talk.on(Order("return"))
    talk.tick()
    assert isinstance(talk.doing(), SendWaypoint)
    return talk


def test_a_way_home_whose_waypoints_are_refused_becomes_the_autopilots_own() -> None:
    """Whatever the link has against them: a control that is doubtful, another's target that is suspected."""
    talk = behind()
    kept(talk, "link", int(KEPT_S) + 3)
    assert talk.doing() == ReturnToLaunch()
    talk.done()
    talk.shows(guided=False)
    talk.pass_by(30.0)
    said = [each.text for each in talk.wanted if isinstance(each, Tell) and "by itself" in each.text]
    assert (len(said), talk.state) == (1, State.RETURNING)


def test_a_point_that_is_refused_for_a_moment_does_not_end_our_own_way() -> None:
    talk = behind()
    for _ in range(4):
        kept(talk, "link", int(KEPT_S) - 2)
        talk.pass_by(1.5)
        talk.done()
        talk.on(Stalled(talk.now, 3.0))
        talk.pass_by(1.5)
        assert isinstance(talk.doing(), SendWaypoint)


def test_the_others_are_waited_for_on_the_way_home_until_the_energy_or_the_patience_is_spent() -> None:
    for battery, ends in ((60.0, False), (9.0, True)):
        talk = behind()
        kept(talk, "apart", 30)
        talk.shows(battery_percent=battery)
        kept(talk, "apart", 30)
        assert isinstance(talk.core.doing, ReturnToLaunch) == ends
    talk = behind(full_battery_s=7200.0)
    kept(talk, "apart", 910)
    assert talk.doing() == ReturnToLaunch()


def test_a_way_home_that_it_has_left_is_planned_anew_and_not_flown_by_the_autopilot_past_the_others() -> None:
    """It had made room for another, from where the next point of its way lay behind an excluded area: it held, and the
    autopilot's own return led it 12 m from a third."""
    talk = behind()
    first = talk.doing()
    talk.on(NotSent(first, Objection("limits", "the waypoint lies behind an excluded area")))
    assert talk.state == State.RETURNING
    talk.tick()
    again = talk.doing()
    assert isinstance(again, SendWaypoint)
    assert talk.core.standing.direct is False
    talk.on(NotSent(again, Objection("limits", "the waypoint lies behind an excluded area")))
    assert talk.state == State.HOLDING  # not for ever


def test_a_way_home_that_may_not_be_flown_on_from_here_is_planned_anew_in_the_same_tick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The waypoint is judged when it is wanted, and again before it is sent: both ways lead to another way."""
    talk = reached(State.SEARCHING, {"flight": {"altitude_m": 15.0, "full_battery_s": 1200.0}})
    talk.shows(lat=BEHIND[0], lon=BEHIND[1])
    talk.flew()
    refusals = iter([Objection("limits", "the waypoint lies behind an excluded area")])
    monkeypatch.setattr(type(talk.core.helm), "objection", lambda *_: next(refusals, None))
    talk.on(Order("return"))
    talk.tick()
    assert next(refusals, None) is None
    assert talk.state == State.RETURNING
    assert any("another way is planned" in each.text for each in talk.wanted if isinstance(each, Note))
    talk.tick()
    assert isinstance(talk.doing(), SendWaypoint)


def test_a_low_battery_alone_does_not_end_our_own_way_around_what_is_excluded() -> None:
    talk = behind()
    talk.done()
    talk.shows(battery_percent=9.0)
    talk.pass_by(10.0)
    assert talk.core.doing is None


@pytest.mark.parametrize("cause", ["limits", "ground"])
def test_a_way_home_that_is_refused_for_where_it_leads_holds_and_goes_by_itself_when_its_energy_is_low(
    cause: str,
) -> None:
    talk = behind()
    kept(talk, cause, 30)
    assert talk.state == State.HOLDING
    talk.shows(battery_percent=18.0)
    kept(talk, cause, 3)
    assert (talk.state, talk.doing()) == (State.RETURNING, ReturnToLaunch())


@pytest.mark.parametrize("mode", [{"guided": True}, {"guided": False, "mode": "BRAKE"}])
def test_a_return_that_is_refused_is_ordered_again_in_any_mode_and_lands_in_the_end(
    mode: dict[str, Any],
) -> None:
    talk = homebound()
    talk.shows(**mode)
    for _ in range(LANDS_AFTER):
        assert talk.doing() == ReturnToLaunch()
        talk.failed("it answered FAILED")
        talk.pass_by(HOME_AGAIN_S - 1.0)
        assert talk.core.doing is None
        talk.pass_by(2.0)
    assert talk.doing() == Land()
    talk.failed("it did not answer", answered=False)
    talk.pass_by(HOME_AGAIN_S + 1.0)
    assert talk.doing() == Land()


def test_a_return_that_is_not_answered_while_the_position_is_in_doubt_does_not_become_a_landing() -> None:
    """An autopilot that was not heard for half a minute has not heard of the return: when it is there again, it is
    ordered home, and not down onto whatever lies below."""
    talk = homebound()
    talk.shows(fix=1)
    for _ in range(2 * LANDS_AFTER):
        assert talk.doing() == ReturnToLaunch()
        talk.failed("it did not answer", answered=False)
        talk.pass_by(HOME_AGAIN_S + 2.0)
    talk.failed("it answered DENIED")
    talk.pass_by(HOME_AGAIN_S + 2.0)
    assert talk.doing() == Land()


@pytest.mark.parametrize("by_itself", [False, True])
def test_an_aircraft_whose_battery_does_not_last_lands_before_it_falls(by_itself: bool) -> None:
    """A battery that drained while it flew home: it fell from the sky beside its way."""
    talk = behind(full_battery_s=200.0)
    if not by_itself:
        talk.done()
    else:
        kept(talk, "link", int(KEPT_S) + 3)
        assert talk.doing() == ReturnToLaunch()
        talk.done()
        talk.shows(guided=False, mode="RTL")
    talk.shows(battery_percent=30.0)  # less than the way, and more than a landing needs
    talk.pass_by(SHORT_S + 2.0)
    assert Land() not in talk.wanted
    talk.shows(battery_percent=9.0)
    talk.pass_by(SHORT_S + 1.0)
    assert talk.doing() == Land()
    assert "it lands where it is" in "".join(each.text for each in talk.wanted if isinstance(each, Note))
    talk.done()
    talk.shows(guided=False, mode="LAND")
    talk.pass_by(4 * HOME_AGAIN_S)
    assert talk.wanted.count(Land()) == 1


def test_a_single_word_of_a_low_battery_does_not_land_it() -> None:
    talk = behind(full_battery_s=200.0)
    talk.done()
    talk.shows(battery_percent=9.0)
    talk.pass_by(1.0)
    talk.shows(battery_percent=60.0)
    talk.pass_by(60.0)
    assert Land() not in talk.wanted


def test_a_battery_that_lasts_for_the_way_home_is_flown_home_with() -> None:
    talk = behind(full_battery_s=7200.0)
    talk.shows(battery_percent=9.0)
    talk.pass_by(60.0)
    assert Land() not in talk.wanted


def test_a_return_that_fails_as_nobody_hears_it_does_not_become_a_landing() -> None:
    talk = homebound()
    talk.silent.add("heartbeat")
    for _ in range(2 * LANDS_AFTER):
        talk.pass_by(HOME_AGAIN_S + 2.0)
        assert talk.doing() == ReturnToLaunch()
        talk.failed("the vehicle has not been heard", answered=False)


def test_a_return_that_an_order_broke_off_in_vain_is_ordered_again() -> None:
    talk = homebound()
    talk.shows(guided=False, mode="BRAKE")
    talk.on(Order("hold"))
    talk.failed("it did not answer")
    assert talk.state == State.RETURNING
    talk.pass_by(HOME_AGAIN_S + 1.0)
    assert talk.doing() == ReturnToLaunch()


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

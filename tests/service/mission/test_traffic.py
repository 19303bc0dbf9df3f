"""One mission among several: what it waits for, what it stops for, and what the others are told of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from service.mavlink.events import Target
from service.mavlink.telemetry import Telemetry
from service.mission.apart import SETTLES_S, Claim, Other, Room, Spacing, home_by_s, objection
from service.mission.core import MissionCore
from service.mission.effects import Arm, EnterGuided, Note, ReturnToLaunch, SendWaypoint, Stop
from service.mission.flight import Flight
from service.mission.news import NotSent, Order, Unwritten
from service.mission.standing import Standing, Terms
from service.mission.states import State
from sim.soak import ground
from tests.service.mission.flown import GRID, HERE, ON_GROUND, START, Talk, place, reached, searching

HOME = ground.launch()
FAR = place(20.0, 190.0)


def other(where: tuple[float, float], up: float = 15.0, name: str = "1", **changes: Any) -> Other:
    """Another aircraft, hovering."""
    return replace(Other(name, where, up, where, HOME, 60.0, 8.0), **changes)


def named(talk: Talk, name: str = "2") -> Talk:
    """The mission gets a name of its own."""
    talk.core.helm.traffic.name = name
    return talk


def sent(talk: Talk) -> bool:
    """The waypoint under way has nothing against it right before it is sent, and is."""
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    objection = talk.core.objection(waypoint, talk.seen, talk.now)
    if objection is not None:
        talk.on(NotSent(waypoint, objection))
        return False
    talk.core.sent(waypoint)
    talk.done()
    return True


def heads_north(talk: Talk) -> tuple[float, float]:
    """A decision to fly two cells north arrives; the place that it leads to."""
    talk.tick()
    row, col = talk.core.chart.cell(talk.seen.telemetry)[0]
    talk.decides((row - 1, col), (row - 2, col))
    return talk.core.chart.latlon((row - 2, col))


def north(talk: Talk, cells: int) -> tuple[float, float]:
    """The place so many cells north of the aircraft."""
    row, col = talk.core.chart.cell(talk.seen.telemetry)[0]
    return talk.core.chart.latlon((row - cells, col))


def on_the_ground() -> Talk:
    """A mission that is about to take off."""
    telling: dict[str, Any] = {"may_take_off": True, **ON_GROUND}
    talk = named(reached(State.READY, None, **telling))
    talk.tick()
    return talk


def notes(talk: Talk, words: str) -> int:
    """How often the console was told."""
    return sum(isinstance(effect, Note) and words in effect.text for effect in talk.wanted)


def test_a_leg_that_others_leave_no_room_for_is_tried_again_until_they_do() -> None:
    talk = named(searching())
    talk.sees(others=(other(north(talk, 2)),))
    for _ in range(3):
        heads_north(talk)
        assert not isinstance(talk.core.doing, SendWaypoint)
        talk.pass_by(2.0)
    assert talk.state == State.SEARCHING
    assert notes(talk, "of where aircraft 1 is or goes") == 1  # and not at every try
    talk.sees(others=(other(FAR),))
    heads_north(talk)
    assert sent(talk)


def test_a_leg_that_got_in_the_way_while_its_row_was_written_is_not_sent() -> None:
    talk = named(searching())
    heads_north(talk)
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    talk.sees(others=(other(waypoint.point),))
    assert not sent(talk)
    assert talk.state == State.SEARCHING


def test_a_take_off_waits_for_whoever_is_over_the_place_and_is_in_the_air_from_then_on() -> None:
    talk = on_the_ground()
    talk.sees(others=(other(HERE, up=12.0),))
    talk.done()
    talk.pass_by(3.0)
    assert talk.state == State.TAKEOFF
    assert not any(isinstance(effect, EnterGuided | Arm) for effect in talk.wanted)
    assert notes(talk, "waits to take off: the take-off comes within 0 m of where aircraft 1 is") == 1
    waiting = talk.core.told(talk.seen, talk.now)
    assert not waiting.in_air
    assert waiting.claim is not None
    assert waiting.claim.to == "take off"
    talk.sees(others=(other(FAR, up=12.0),))
    talk.tick()
    assert isinstance(talk.doing(), EnterGuided)
    begun = talk.core.told(talk.seen, talk.now)
    assert begun.in_air
    assert begun.claim is None
    assert 15.0 in begun.goals_up_m  # all of the column is its room


def test_a_take_off_that_is_broken_off_on_the_ground_keeps_nobody_away() -> None:
    talk = on_the_ground()
    talk.sees(others=(other(FAR),))
    talk.done()
    talk.tick()
    assert talk.core.told(talk.seen, talk.now).in_air
    talk.on(Order("hold"))
    assert not talk.core.told(talk.seen, talk.now).in_air


def test_a_take_off_that_ends_the_run_on_the_ground_keeps_nobody_away() -> None:
    talk = on_the_ground()
    talk.sees(others=(other(FAR),))
    talk.done()
    talk.tick()
    assert talk.core.told(talk.seen, talk.now).in_air
    talk.failed("it does not arm")
    talk.pass_by(3.0)
    assert talk.state == State.ABORTED
    assert not talk.core.told(talk.seen, talk.now).in_air


def test_one_that_is_lost_at_its_take_off_is_taken_to_climb_until_it_is_heard_again() -> None:
    """Armed or not was never told: the command may have arrived, and the answer not."""
    talk = on_the_ground()
    talk.sees(others=(other(FAR),))
    talk.done()
    talk.tick()
    talk.silent |= {"heartbeat", "position"}
    talk.pass_by(3.0)
    talk.failed("no answer")
    talk.pass_by(30.0)
    assert talk.state == State.ABORTED
    lost = talk.core.told(talk.seen, talk.now)
    assert lost.in_air
    assert not lost.steered
    assert lost.age_s > 30.0
    spacing = Spacing.of(talk.settings.flight, 2.0)
    over = other(HERE, up=12.0)
    assert objection(over, over.sent(north(talk, 2), 12.0), (lost,), spacing)
    talk.silent.clear()
    talk.tick()
    assert not talk.core.told(talk.seen, talk.now).in_air


@pytest.mark.parametrize(
    ("twin", "gives_up"), [({}, True), ({"name": "9"}, False), ({"system_id": 4}, False)]
)
def test_an_aircraft_that_another_mission_has_already_is_not_flown_twice(
    twin: dict[str, Any], gives_up: bool
) -> None:
    """Two links may lead to one aircraft: a radio that passes everything on to both."""
    talk = named(reached(State.WAITING, None, may_take_off=True, system_id=3, **ON_GROUND))
    talk.sees(others=(other(HERE, up=0.0, in_air=False, **{"system_id": 3, **twin}),))
    talk.tick()
    talk.done()
    talk.pass_by(3.0)
    assert (talk.state == State.ABORTED) == gives_up
    if gives_up:
        assert "system id 3, as that of aircraft 1: it may be the same aircraft" in talk.core.standing.why
    flying = named(reached(State.WAITING, None, may_take_off=True, system_id=3, **ON_GROUND), "0")
    flying.sees(others=(other(FAR, system_id=3),))
    flying.tick()
    flying.done()
    flying.pass_by(3.0)
    assert flying.state == State.ABORTED  # who flies keeps it, whatever its name


def test_among_others_the_way_home_is_flown_in_the_own_layer_and_the_landing_waits_its_turn() -> None:
    alone = reached(State.RETURNING)
    alone.tick()
    assert isinstance(alone.doing(), ReturnToLaunch)
    talk = named(searching())
    below = other(HOME, up=4.0, returns=True, return_up_m=0.0)
    talk.sees(others=(below,))
    talk.on(Order("return"))
    talk.tick()
    flown = []
    for _ in range(20):
        if not isinstance(talk.core.doing, SendWaypoint):
            break
        flown.append(talk.core.doing.point)
        assert sent(talk)
        talk.flew(flown[-1])
        talk.tick()
    assert flown[-1] == pytest.approx(HOME)
    talk.pass_by(5.0)
    assert notes(talk, "waits to land") == 1
    assert not any(isinstance(effect, ReturnToLaunch) for effect in talk.wanted)
    claim = talk.core.told(talk.seen, talk.now).claim
    assert claim is not None
    assert claim.urgent
    talk.sees(others=(replace(below, in_air=False),))
    talk.tick()
    assert isinstance(talk.doing(), ReturnToLaunch)
    assert talk.core.told(talk.seen, talk.now).returns


def test_who_lands_already_makes_no_room_for_one_that_waits_to_land_after_it() -> None:
    """What it would be sent to its autopilot does not fly to any more, and down there it would never be over."""
    talk = named(searching())
    talk.sees(others=(other(FAR),))
    talk.on(Order("return"))
    talk.tick()
    while isinstance(talk.core.doing, SendWaypoint):
        point = talk.core.doing.point
        assert sent(talk)
        talk.flew(point)
        talk.tick()
    assert isinstance(talk.doing(), ReturnToLaunch)
    talk.done()
    talk.shows(guided=False, mode="RTL")
    waits = Claim(Room((HOME,), -math.inf, 60.0), True, "land")
    talk.sees(others=(other(place(60.0, 20.0), up=60.0, claim=waits),))
    talk.wanted.clear()
    talk.pass_by(20.0)
    assert not any(isinstance(effect, SendWaypoint) for effect in talk.wanted)
    talk.shows(**ON_GROUND)
    talk.tick()
    assert talk.state == State.DONE


def test_the_wait_for_those_who_land_before_is_in_the_battery() -> None:
    """Two others over the same launch point, 30 and 40 m up: each takes its descent and a while to stand still."""

    def flying(percent: float, *others: Other) -> Talk:
        talk = named(searching())
        talk.sees(others=others)
        for tick in range(120):  # a percent in five seconds, down to `percent`
            talk.shows(battery_percent=float(round(percent + (120 - tick) * 0.1)))
            talk.tick(0.5)
        return talk

    def returned(percent: float, *others: Other) -> bool:
        return flying(percent, *others).state == State.RETURNING

    low, high = other(FAR, up=30.0, name="1"), other(FAR, up=40.0, name="3")
    waits_s = 30.0 + 40.0 + 2.0 * SETTLES_S
    alone = flying(80.0).core.reserve.energy
    rate = alone.percent_per_s
    assert rate is not None
    least = 15.0 + alone.home.seconds * rate
    assert flying(80.0, low, high).core.reserve.energy.home.waits_s == pytest.approx(waits_s)
    assert not returned(math.ceil(least + 3.0))
    assert returned(math.ceil(least + 3.0), low, high)
    assert not returned(math.ceil(least + waits_s * rate + 3.0), low, high)
    why = flying(math.ceil(least + 3.0), low, high).core.standing.why
    assert f"and {waits_s:.0f} s of waiting until others have landed" in why
    beside = (replace(low, home=FAR), replace(high, in_air=False))
    assert flying(80.0, *beside).core.reserve.energy.home.waits_s == 0.0
    # what the planner is asked with, which no effect shows while the aircraft stands still
    left, own = (flying(80.0, *each).core._look().battery_left() for each in ((low, high), ()))
    assert left is not None
    assert own is not None
    assert left.ground_s == pytest.approx(own.ground_s - waits_s)  # the end of a battery is planned with it
    assert left.here_s == pytest.approx(own.here_s)


def test_the_wait_for_one_that_is_not_heard_lasts_until_its_autopilot_has_brought_it_home() -> None:
    talk = named(searching())
    silent = other(FAR, name="1", age_s=20.0)
    talk.sees(others=(silent,))
    talk.tick()
    by = home_by_s(silent, Spacing.of(talk.settings.flight, 2.0))
    assert talk.core.reserve.energy.home.waits_s == pytest.approx(by - 20.0)
    talk.sees(others=(replace(silent, age_s=by + 1.0),))
    talk.tick()
    assert talk.core.reserve.energy.home.waits_s == 0.0


def test_nobody_takes_off_without_the_battery_to_wait_for_the_others() -> None:
    over = tuple(other(FAR, up=100.0, name=name) for name in "134567")  # 720 s of waiting
    for others, flies in (((), True), (over, False)):
        talk = on_the_ground()
        talk.shows(battery_percent=60.0)
        talk.sees(others=others)
        talk.done()
        talk.tick()
        assert (talk.state == State.TAKEOFF) == flies


def test_an_aircraft_that_comes_too_near_is_held_until_it_is_apart() -> None:
    talk = named(searching())
    close = other(place(188.0, 50.0))
    talk.sees(others=(close,))
    talk.tick()
    assert talk.state == State.SEARCHING  # it stands
    talk.shows(velocity_ned_mps=(0.0, -3.0, 0.0))
    talk.flew()
    effects = talk.tick()
    assert any(isinstance(effect, Stop) for effect in effects)
    assert str(talk.state) == State.HOLDING
    assert "nearer than 20 m" in talk.core.standing.why
    talk.pass_by(5.0)
    assert str(talk.state) == State.HOLDING
    talk.shows(velocity_ned_mps=(0.0, 0.0, 0.0))
    talk.flew()
    talk.pass_by(talk.settings.flight.settle_s + 1.0)
    assert talk.state == State.SEARCHING


def test_the_first_by_name_stops_too_since_one_that_hovers_cannot_make_room() -> None:
    talk = named(searching(), "0")
    talk.sees(others=(other(place(188.0, 50.0)),))
    talk.shows(velocity_ned_mps=(0.0, -3.0, 0.0))
    talk.flew()
    talk.tick()
    assert talk.state == State.HOLDING


def test_nobody_enters_what_another_waits_for() -> None:
    talk = named(searching())
    column = Room((north(talk, 2),), -1.0, 50.0)
    waits = other(FAR, up=50.0, claim=Claim(column, urgent=True, to="land"))
    talk.sees(others=(waits,))
    heads_north(talk)
    assert not isinstance(talk.core.doing, SendWaypoint)
    assert notes(talk, "leads through where aircraft 1 waits to land") == 1


def under_way() -> tuple[Talk, SendWaypoint]:
    """A search of several that has been sent north, and where to."""
    talk = named(searching())
    heads_north(talk)
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    assert sent(talk)
    return talk, waypoint


def test_what_was_sent_and_what_the_autopilot_names_are_where_it_may_go() -> None:
    talk, waypoint = under_way()
    told = talk.core.told(talk.seen, talk.now)
    assert waypoint.point in told.goals
    assert told.steered
    talk.on(Order("hold"))
    held = talk.core.told(talk.seen, talk.now)
    assert waypoint.point in held.goals
    talk.pass_by(11.0)
    assert talk.core.told(talk.seen, talk.now).goals == ()
    talk.shows(target=Target(*FAR, 425.0))
    told = talk.core.told(talk.seen, talk.now)
    assert (told.goals, told.goals_up_m) == ((FAR,), (25.0,))


def test_the_point_before_counts_until_the_autopilot_names_the_newest() -> None:
    """What was sent last can get lost on the radio: it flies on to the one before."""
    talk, waypoint = under_way()
    first = waypoint.point
    row, col = talk.core.chart.cell(talk.seen.telemetry)[0]
    second = SendWaypoint(talk.core.chart.latlon((row, col - 2)), 415.0)
    talk.core.sent(second)
    assert set(talk.core.told(talk.seen, talk.now).goals) == {first, second.point}
    talk.shows(target=Target(*first, 415.0))
    talk.pass_by(11.0)
    assert first in talk.core.told(talk.seen, talk.now).goals  # it names it still
    talk.core.sent(second)
    talk.shows(target=Target(*second.point, 415.0))
    assert set(talk.core.told(talk.seen, talk.now).goals) == {second.point}


def test_one_that_flies_nobody_knows_where_to_is_not_steered_by_us() -> None:
    """A process that was killed does not know, when it is back, where the one before had sent it."""
    talk = named(searching())
    assert talk.core.told(talk.seen, talk.now).steered  # it hovers
    talk.shows(velocity_ned_mps=(0.0, 5.0, 0.0))
    assert not talk.core.told(talk.seen, talk.now).steered
    talk.shows(target=Target(*FAR, 415.0))
    assert talk.core.told(talk.seen, talk.now).steered


def test_a_climb_that_is_broken_off_in_the_air_may_go_on_for_a_while() -> None:
    talk = on_the_ground()
    talk.sees(others=(other(FAR),))
    talk.done()
    talk.tick()
    talk.shows(armed=True, landed_state="takeoff", alt_home_m=3.0, alt_amsl_m=403.0)
    talk.on(Order("hold"))
    assert 15.0 in talk.core.told(talk.seen, talk.now).goals_up_m
    talk.pass_by(11.0)
    assert 15.0 not in talk.core.told(talk.seen, talk.now).goals_up_m


def test_who_is_not_heard_or_is_flown_by_its_pilot_is_not_steered_and_its_place_has_an_age() -> None:
    talk = named(searching())
    talk.silent |= {"position"}
    talk.pass_by(1.5)
    told = talk.core.told(talk.seen, talk.now)
    assert told.steered
    assert told.age_s == pytest.approx(1.5)
    talk.silent |= {"heartbeat"}
    talk.pass_by(3.0)
    assert not talk.core.told(talk.seen, talk.now).steered
    other_one = named(searching())
    other_one.pilot()
    told = other_one.core.told(other_one.seen, other_one.now)
    assert told.in_air
    assert not told.steered


@pytest.mark.parametrize(
    ("east_m", "link", "said"), [(1.0, "udpin://:14550", 1), (6.0, "udpin://:14550", 0), (1.0, None, 0)]
)
def test_who_lands_where_another_one_lands_is_told_before_the_take_off(
    east_m: float, link: str | None, said: int
) -> None:
    talk = named(
        reached(State.READY, {"link": {"connect": link} if link else {}}, may_take_off=True, **ON_GROUND)
    )
    talk.tick()
    lat, lon = HOME
    parked = other(HERE, system_id=2, in_air=False, home=(lat, lon + east_m / 76_000.0))
    talk.sees(others=(parked,))
    talk.done()
    talk.pass_by(2.0)
    assert isinstance(talk.doing(), EnterGuided)
    assert notes(talk, "may come down on who stands there") == said
    assert ("from that of aircraft 1" in talk.core.standing.why) == bool(said)


LOST = "the journal cannot be written: the disk is full"


@pytest.mark.parametrize(
    "state", [State.TAKEOFF, State.SEARCHING, State.CONFIRMING, State.FOUND, State.HOLDING, State.RETURNING]
)
def test_without_a_journal_the_way_home_among_others_is_our_own(state: State) -> None:
    talk = named(reached(state))
    talk.shows(landed_state="in_air", armed=True, in_control=True, alt_home_m=15.0, alt_amsl_m=415.0)
    talk.flew(FAR)
    talk.sees(others=(other(HERE),))
    talk.on(Unwritten(LOST))
    assert talk.state == State.RETURNING
    assert talk.core.standing.comes_home
    assert LOST in (talk.core.standing.why_stopped, talk.core.standing.why) or state == State.RETURNING
    talk.pass_by(2.0)
    assert isinstance(talk.doing(), SendWaypoint)
    assert not any(isinstance(effect, ReturnToLaunch) for effect in talk.wanted)


def test_without_a_journal_one_that_holds_blind_goes_home_once_it_sees_and_what_is_not_ours_does_not() -> (
    None
):
    talk = named(searching())
    talk.silent.add("position")
    talk.pass_by(4.0)
    assert talk.core.standing.causes == {"position"}
    talk.on(Unwritten(LOST))
    assert (talk.state, talk.core.standing.comes_home) == (State.HOLDING, True)
    talk.silent.clear()
    talk.pass_by(20.0)
    assert talk.state == State.RETURNING
    yielded = named(reached(State.YIELDED))
    yielded.on(Unwritten(LOST))
    assert (yielded.state, yielded.core.standing.comes_home) == (State.YIELDED, False)


@pytest.mark.parametrize(
    ("another", "refused"),
    [
        ({"home_amsl_m": 410.0, "home": FAR}, True),
        ({"home_amsl_m": 410.0}, False),  # side by side, and two receivers
        ({"home_amsl_m": 402.5, "home": FAR}, False),
        ({"home": FAR}, False),
        # whose take-off is refused then
        ({"home_amsl_m": 410.0, "home": FAR, "name": "9", "in_air": False}, False),
        ({"home_amsl_m": 410.0, "home": FAR, "name": "9"}, True),
        ({"home_amsl_m": 410.0, "home": FAR, "ended": True, "in_air": False}, False),
    ],
)
def test_without_a_ground_file_who_would_fly_at_anothers_height_does_not_take_off(
    another: dict[str, Any], refused: bool
) -> None:
    talk = on_the_ground()
    talk.sees(others=(other(FAR, **another),))
    talk.done()
    talk.pass_by(2.0)
    assert (talk.state == State.ABORTED) == refused
    if refused:
        assert talk.core.standing.why.startswith("home is 10 m lower than that of aircraft ")
        assert "more than the 3 m that the layers allow for" in talk.core.standing.why
    else:
        assert isinstance(talk.doing(), EnterGuided)


SPACING = Spacing.of(Talk().settings.flight, 2.0)
LAST = place(180.0, 120.0)


def left_behind(left: State, *, earlier_s: float = 0.0, seconds_ago: float = 10.0) -> Talk:
    """A mission whose aircraft an earlier process flew, so long ago, and that has not been heard yet."""
    flight = Flight(flown=True, carried_s=90.0, earlier_s=earlier_s, left_at=START - seconds_ago)
    flight.track.append((START - seconds_ago, *LAST, 15.0))
    flight.goal, flight.told_at = FAR, START - seconds_ago
    talk = Talk(standing=Standing(state=left), flight=flight)
    talk.sees(telemetry=Telemetry())
    return talk


@pytest.mark.parametrize(
    "left", [State.SEARCHING, State.HOLDING, State.YIELDED, State.RETURNING, State.TAKEOFF]
)
def test_one_that_was_left_in_the_air_and_is_not_heard_yet_may_be_on_its_way_home(left: State) -> None:
    talk = left_behind(left)
    told = talk.core.told(talk.seen, talk.now)
    assert (told.in_air, told.steered, told.place, told.up_m, told.age_s) == (True, False, LAST, 15.0, 10.0)
    below = other(HOME, up=0.0, name="3")
    through_its_way_home = below.sent(HOME, 15.0)
    assert "not been heard for 10 s" in objection(below, through_its_way_home, (told,), SPACING)
    later = talk.core.told(talk.seen, talk.now + SPACING.battery_s)
    assert not objection(below, through_its_way_home, (later,), SPACING)


def test_what_is_ordered_before_it_is_heard_does_not_take_it_from_the_air() -> None:
    talk = left_behind(
        State.TAKEOFF, earlier_s=90.0
    )  # of a first flight; nothing is journalled of this one yet
    talk.on(Order("hold"))
    told = talk.core.told(talk.seen, talk.now)
    assert told.in_air
    assert 15.0 in told.goals_up_m


def test_until_it_is_heard_it_may_fly_to_where_it_was_sent_last() -> None:
    talk = left_behind(State.SEARCHING)
    assert talk.core.told(talk.seen, talk.now).goals == (FAR,)
    talk.sees(telemetry=searching().seen.telemetry)
    heard = talk.core.told(talk.seen, talk.now)
    assert (heard.place, heard.goals) == (HERE, ())


def test_a_heartbeat_alone_ends_no_room_until_the_place_is_told_too() -> None:
    talk = left_behind(State.SEARCHING)
    talk.shows(heartbeat_time=START, armed=True, landed_state="in_air", system_id=2)
    told = talk.core.told(talk.seen, talk.now)
    assert (told.in_air, told.steered, told.place, told.goals, told.system_id) == (
        True,
        False,
        LAST,
        (FAR,),
        2,
    )
    below = other(HOME, up=0.0, name="3")
    assert objection(below, below.sent(HOME, 15.0), (told,), SPACING)
    talk.core.leave("it was not connected in time", talk.seen, talk.now)
    assert talk.core.told(talk.seen, talk.now) == told
    talk.shows(armed=False, landed_state="on_ground")
    assert not talk.core.told(talk.seen, talk.now).in_air


def test_one_that_flies_and_has_never_told_its_place_may_be_anywhere() -> None:
    talk = Talk()
    talk.sees(telemetry=Telemetry(heartbeat_time=START, armed=True, landed_state="in_air"))
    told = talk.core.told(talk.seen, talk.now)
    far = other(FAR, up=90.0, name="3")
    said = objection(far, far.sent(HERE, 90.0), (told,), SPACING)
    assert said == "may come near aircraft , which flies and has never told its place"
    silent_for_long = talk.core.told(talk.seen, talk.now + SPACING.battery_s + 1.0)
    assert not objection(far, far.sent(HERE, 90.0), (silent_for_long,), SPACING)


@pytest.mark.parametrize(
    ("left", "earlier_s"), [(State.GROUNDED, 90.0), (State.WAITING, 0.0), (State.HOLDING, 90.0)]
)
def test_one_that_was_left_on_the_ground_takes_no_room(left: State, earlier_s: float) -> None:
    talk = left_behind(left, earlier_s=earlier_s)
    assert not talk.core.told(talk.seen, talk.now).in_air


def test_the_name_comes_with_the_terms() -> None:
    core = MissionCore(Talk().settings, GRID, Terms(name="kestrel"))
    assert core.told(Talk().seen, 1000.0).name == "kestrel"

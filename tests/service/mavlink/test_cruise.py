"""The speed that was asked for: sent when it counts, sent again, and told when the aircraft does not keep to it."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.errors import NotPermitted
from service.mavlink.events import Notice

from .peer import ALT, FLAVORS, LON, NORTH, PILOT, Rig, go

SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED


def asked(flavor: str) -> Rig:
    """In our control, and a speed of 3 m/s asked for and answered."""
    rig = Rig(flavor).flying()
    rig.core.request(rig.autopilot.change_speed(3.0), rig.now)
    rig.say(rig.peer.ack(SPEED, 0))
    rig.run(1.0)
    rig.forget()
    return rig


def taken(rig: Rig) -> None:
    """A waypoint that the autopilot names."""
    go(rig)
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(1.0)


def speeds(rig: Rig) -> list[Any]:
    """The speeds sent."""
    return [m.param2 for m in rig.messages("COMMAND_LONG", SPEED)]


@FLAVORS
def test_a_speed_is_sent_after_the_first_waypoint_that_is_taken_and_not_after_each(flavor: str) -> None:
    rig = asked(flavor)
    assert speeds(rig) == []
    taken(rig)
    rig.say(rig.peer.ack(SPEED, 0))
    assert speeds(rig) == [3.0]
    go(rig, NORTH + 0.0002)
    rig.peer.target = (NORTH + 0.0002, LON, ALT)
    rig.run(2.0)
    assert speeds(rig) == [3.0]


@FLAVORS
def test_a_speed_is_sent_again_after_each_entry_of_the_guided_mode(flavor: str) -> None:
    rig = asked(flavor)
    taken(rig)
    rig.say(rig.peer.ack(SPEED, 0))
    guided, rig.peer.mode = rig.peer.mode, PILOT[flavor]
    rig.say(rig.peer.heartbeat())
    rig.peer.mode = guided
    rig.say(rig.peer.heartbeat())
    rig.core.take_control(rig.now)
    rig.forget()
    taken(rig)
    assert speeds(rig) == [3.0]


@FLAVORS
def test_an_aircraft_that_is_faster_is_told_again_and_then_a_person_is(flavor: str) -> None:
    rig = asked(flavor)
    taken(rig)
    rig.say(rig.peer.ack(SPEED, 0))
    rig.forget()
    rig.peer.velocity = (7.0, 0.0, 0.0)
    rig.run(4.5)
    rig.say(rig.peer.ack(SPEED, 0))
    assert speeds(rig) == [3.0]
    assert rig.of(Notice) == []
    rig.run(30.0)
    (notice,) = rig.of(Notice)
    assert notice.text == "flies 7.0 m/s, asked for 3"


@FLAVORS
def test_a_gust_is_not_told(flavor: str) -> None:
    rig = asked(flavor)
    taken(rig)
    rig.say(rig.peer.ack(SPEED, 0))
    rig.forget()
    for speed in (7.0, 3.5, 7.0, 3.5, 7.0):
        rig.peer.velocity = (speed, 0.0, 0.0)
        rig.run(3.0)
    assert speeds(rig) == []
    assert rig.of(Notice) == []


@FLAVORS
def test_no_speed_is_sent_to_an_aircraft_that_is_not_ours(flavor: str) -> None:
    rig = asked(flavor)
    taken(rig)
    rig.say(rig.peer.ack(SPEED, 0))
    rig.core.release_control("a test", rig.now)
    rig.forget()
    rig.peer.velocity = (7.0, 0.0, 0.0)
    rig.run(30.0)
    assert speeds(rig) == []


@FLAVORS
def test_a_speed_that_could_not_be_sent_is_sent_with_the_next_waypoint_that_is_taken(flavor: str) -> None:
    rig = Rig(flavor).flying()
    rig.now += rig.core.settings.stall_s + 0.5  # and its heartbeats wait in a buffer
    with pytest.raises(NotPermitted, match="stood still"):
        rig.core.request(rig.autopilot.change_speed(3.0), rig.now)
    assert speeds(rig) == []
    rig.run(1.0)
    taken(rig)
    assert speeds(rig) == [3.0]


@FLAVORS
def test_an_aircraft_that_cruises_slower_is_told_again_and_then_a_person_is(flavor: str) -> None:
    rig = asked(flavor)
    taken(rig)
    rig.say(rig.peer.ack(SPEED, 0))
    rig.forget()
    rig.peer.velocity = (1.6, 0.0, 0.0)
    rig.run(6.5)
    rig.say(rig.peer.ack(SPEED, 0))
    assert speeds(rig) == [3.0]
    assert rig.of(Notice) == []
    rig.run(30.0)
    assert speeds(rig) == [3.0]
    (notice,) = rig.of(Notice)
    assert notice.text == "flies 1.6 m/s, asked for 3"


@FLAVORS
@pytest.mark.parametrize(
    "velocities",
    [
        [(1.2, 0.0, 0.0), (1.8, 0.0, 0.0)] * 8,  # it brakes and speeds up around corners
        [(1.6, 0.0, -1.0)] * 16,  # it climbs to its waypoint
        [(0.1, 0.0, 0.0)] * 16,  # it hovers
    ],
)
def test_corners_climbing_and_hovering_are_no_slow_cruise(
    flavor: str, velocities: list[tuple[float, float, float]]
) -> None:
    rig = asked(flavor)
    taken(rig)
    rig.say(rig.peer.ack(SPEED, 0))
    rig.forget()
    for velocity in velocities:
        rig.peer.velocity = velocity
        rig.run(2.0)
    assert speeds(rig) == []
    assert rig.of(Notice) == []

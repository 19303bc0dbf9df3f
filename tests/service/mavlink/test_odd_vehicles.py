"""Autopilots that lack something, and links that carry one way or an old protocol."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.events import LandedChanged, Notice
from service.mavlink.landing import Landing

from .peer import FLAVORS, REPOSITION, Rig

NAN = float("nan")


@FLAVORS
def test_a_vehicle_that_tells_and_answers_everything_lacks_nothing(flavor: str) -> None:
    rig = Rig(flavor)
    rig.say(rig.peer.heartbeat())
    rig.run(3.0)
    assert rig.core.missing() == []


def test_a_vehicle_that_does_not_say_whether_it_flies_is_told_before_it_does() -> None:
    rig = Rig()
    rig.peer.silent = {"landed"}
    rig.say(rig.peer.heartbeat())
    rig.run(3.0)
    assert rig.core.missing() == ["it does not tell whether it is in the air (EXTENDED_SYS_STATE)"]


def test_a_link_that_carries_one_way_is_told_before_the_ground_is_left() -> None:
    rig = Rig()
    rig.acking = False
    rig.say(rig.peer.heartbeat())
    rig.run(10.0)
    (lack,) = rig.core.missing()
    assert "one way" in lack


def test_a_multirotor_of_a_kind_of_its_own_is_one() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat(kind=43))
    assert rig.core.paired


def versions(rig: Rig) -> set[int]:
    """The first bytes of what is sent."""
    return {frame[0] for frame in rig.core.data_to_send()}


def test_a_vehicle_that_knows_only_mavlink_1_is_spoken_to_in_it_after_a_while() -> None:
    rig = Rig()
    v1 = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)

    def old(data: bytes) -> bytes:
        message = mavlink.MAVLink(None).parse_char(data)
        return bytes(message.pack(v1, force_mavlink1=True))

    rig.say(old(rig.peer.heartbeat()))
    for _ in range(4):
        rig.now += 1.0
        rig.say(old(rig.peer.heartbeat()))
        rig.core.tick(rig.now)
    assert versions(rig) == {0xFD}
    for _ in range(6):
        rig.now += 1.0
        rig.say(old(rig.peer.heartbeat()) + old(rig.peer.position(rig.now)))
        rig.core.tick(rig.now)
    rig.core.data_to_send()
    rig.now += 1.0
    rig.core.tick(rig.now)
    assert versions(rig) == {0xFE}
    assert rig.core.telemetry.position_known


def test_a_vehicle_that_answers_is_spoken_to_in_mavlink_2() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    rig.run(20.0)
    assert not rig.core.codec.speaks_v1


def test_a_landed_state_that_sticks_on_the_ground_is_not_believed_in_the_air() -> None:
    landing = Landing()
    landing.on_armed(True, 0.0)
    assert [landing.judge("on_ground", height, 1.0) for height in (0.2, 3.0, 9.0)] == [
        "on_ground",
        "on_ground",
        "in_air",
    ]


def test_a_take_off_that_is_over_and_goes_on_being_told_is_over() -> None:
    landing = Landing()
    landing.on_armed(True, 0.0)

    def judged(since: float, heights: list[float]) -> list[str]:
        return [landing.judge("takeoff", height, since + second) for second, height in enumerate(heights)]

    assert judged(0.0, [0.0] * 9) == ["takeoff"] * 9  # the motors turn up
    assert judged(9.0, [2.0 * second for second in range(9)]) == ["takeoff"] * 9
    assert judged(18.0, [17.0, 17.2, 16.9, 17.1, 17.0, 17.1])[-1] == "in_air"
    assert judged(24.0, [20.0, 25.0]) == ["in_air"] * 2  # it climbs on
    assert landing.judge("landing", 12.0, 30.0) == "landing"
    assert judged(31.0, [12.0, 14.0]) == ["takeoff"] * 2  # another one


def test_an_aircraft_that_landed_on_a_hill_is_on_the_ground_there() -> None:
    landing = Landing()
    landing.on_armed(True, 0.0)
    for told, height in (("on_ground", 0.0), ("takeoff", 5.0), ("in_air", 30.0), ("landing", 20.0)):
        assert landing.judge(told, height, 1.0) == told
    assert landing.judge("on_ground", 15.0, 2.0) == "on_ground"


def test_an_aircraft_whose_motors_are_off_for_a_while_is_on_the_ground_whatever_it_says() -> None:
    landing = Landing()
    landing.on_armed(True, 0.0)
    assert landing.judge("in_air", 20.0, 1.0) == "in_air"
    landing.on_armed(False, 10.0)
    assert landing.judge("in_air", 0.0, 11.0) == "in_air"
    landing.on_armed(False, 12.0)
    assert landing.judge("in_air", 0.0, 13.5) == "on_ground"
    assert landing.judge("undefined", NAN, 13.5) == "on_ground"


def test_a_landed_state_that_stops_in_the_air_becomes_unknown() -> None:
    rig = Rig().flying()
    rig.peer.silent = {"landed"}
    rig.run(8.0)
    assert rig.core.telemetry.landed_state == "undefined"
    assert rig.of(LandedChanged) == []


def test_datagrams_from_other_addresses_are_not_even_decoded_while_the_vehicle_is_heard() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat(), source="radio")
    before = rig.core.messages_received, rig.core.bytes_received
    for _ in range(100):
        rig.say(rig.peer.heartbeat() * 20, source="flood")
    assert (rig.core.messages_received, rig.core.bytes_received) == before
    assert rig.core.datagrams_dropped == 100
    rig.now += 10.0
    rig.say(rig.peer.heartbeat(), source="elsewhere")
    (notice,) = rig.of(Notice)
    assert notice.text == "the autopilot is heard from elsewhere now, and not from radio"


def grounded(flavor: str, *, ours: bool = True) -> Rig:
    """A vehicle that stands disarmed on the ground, in our control since a take-off was ordered."""
    rig = Rig(flavor)
    rig.peer.armed, rig.peer.landed, rig.peer.height = False, 1, 0.0
    rig.say(rig.peer.heartbeat())
    rig.run(1.0)
    if ours:
        rig.core.take_control(rig.now)
    return rig


def test_an_autopilot_that_does_not_know_reposition_is_told_before_the_ground_is_left() -> None:
    rig = grounded("ardupilot")
    rig.run(4.0)
    (asked, *_) = rig.messages("COMMAND_INT", REPOSITION)
    assert (asked.x, asked.param2) == (950_000_000, 0.0)  # which no autopilot that is asked flies to
    rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_UNSUPPORTED))
    (lack,) = rig.core.missing()
    assert "does not know DO_REPOSITION" in lack
    rig.forget()
    rig.run(10.0)
    assert rig.messages("COMMAND_INT", REPOSITION) == []


def test_an_autopilot_that_denies_what_is_no_place_knows_reposition() -> None:
    rig = grounded("ardupilot")
    rig.run(4.0)
    rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_DENIED))
    rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_UNSUPPORTED))  # of another time
    assert rig.core.missing() == []


def test_what_is_no_place_is_asked_of_nobody_who_flies_or_might_fly_there() -> None:
    for rig in (grounded("px4"), grounded("ardupilot", ours=False), Rig("ardupilot"), Rig("px4")):
        rig.say(rig.peer.heartbeat())
        rig.run(10.0)
        assert rig.messages("COMMAND_INT", REPOSITION) == []
    rig = grounded("ardupilot")
    rig.run(30.0)
    assert len(rig.messages("COMMAND_INT", REPOSITION)) == 5  # nobody answers

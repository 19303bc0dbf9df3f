"""Another aircraft on the same link: nothing of the one before is believed of it, and only an order lets it come."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.events import Cancelled, CommandDone, Notice, Paired
from service.mavlink.settings import MavlinkSettings
from service.mavlink.signing import PER_S, Signer
from service.mavlink.telemetry import Telemetry

from .peer import FLAVORS, START, Peer, Rig
from .test_signing import KEY, NOW, let_sign

OTHER = {"px4": "ardupilot", "ardupilot": "px4"}


def exchanged(rig: Rig, flavor: str, system: int, *, wanted: int | None = None) -> Rig:
    """The aircraft of a rig is gone, and another one is there that has said nothing yet."""
    rig.core, events = rig.core.forget(wanted, rig.now)
    rig.events += events
    rig.peer = Peer(flavor, system)
    rig.forget()
    return rig


@FLAVORS
def test_another_one_is_taken_as_if_it_were_the_first(flavor: str) -> None:
    rig = Rig(flavor, read_motion=True, read_return_height=True).flying()
    rig.say(rig.peer.text("EKF3 IMU0 is using GPS"))
    rig.core.reposition(47.001, 8.0, 520.0, rig.now)
    exchanged(rig, OTHER[flavor], 9)
    core, fresh = rig.core, Rig(flavor, read_motion=True, read_return_height=True).core
    assert core.telemetry_at(rig.now) == Telemetry()
    assert (core.autopilot, core.target, core.in_control, core.destination) == (None, None, False, None)
    assert (len(core.history), core.history.pose_at(rig.now - 1.0)) == (0, None)
    assert core.history.time_of_boot(100.0) is None
    assert core.missing() == fresh.missing()
    assert core.recent_texts(-math.inf) == []
    assert (core.quality.received, core.reposition_known) == (None, False)
    rig.events.clear()
    rig.run(4.0)
    (paired,) = rig.of(Paired)
    assert (paired.system_id, paired.autopilot) == (9, OTHER[flavor])
    t = rig.core.telemetry
    assert (t.system_id, t.in_control) == (9, False)
    assert {m.target_system for m in rig.messages("COMMAND_LONG")} == {9}
    assert {m.get_srcSystem() for m in rig.messages("HEARTBEAT")} <= {9}


def test_nothing_that_was_for_the_one_before_moves_the_other() -> None:
    rig = Rig().flying()
    rig.core.reposition(47.001, 8.0, 520.0, rig.now)
    exchanged(rig, "px4", 7)
    rig.run(20.0)
    assert {m.get_type() for m in rig.motion()} <= {"PARAM_REQUEST_READ"}
    assert rig.core.why_not_reposition(rig.now) is not None


def test_what_was_under_way_has_ended_and_has_no_namesake() -> None:
    rig = Rig("ardupilot").flying()
    ticket = rig.core.request(rig.autopilot.change_speed(5.0), rig.now)
    exchanged(rig, "ardupilot", 8)
    (done,) = [each for each in rig.of(CommandDone) if each.ticket == ticket]
    assert done.outcome == Cancelled("another aircraft is waited for")
    rig.run(4.0)
    rig.core.take_control(rig.now)
    assert rig.core.request(rig.autopilot.change_speed(6.0), rig.now) > ticket


def test_one_that_is_not_the_one_asked_for_is_not_taken() -> None:
    rig = exchanged(Rig().flying(), "ardupilot", 9, wanted=4)
    rig.run(3.0)
    assert not rig.core.paired
    assert rig.core.rejected == "system 9 is not the system 4 asked for"
    rig.peer = Peer("ardupilot", 4)
    rig.run(3.0)
    assert rig.core.telemetry.system_id == 4


def test_a_link_that_was_kept_to_one_system_takes_any_other_on_an_order() -> None:
    rig = Rig(system_id=7).flying()
    exchanged(rig, "ardupilot", 9).run(3.0)
    assert rig.core.telemetry.system_id == 9


def test_without_an_order_another_kind_under_the_same_id_is_not_believed() -> None:
    rig = Rig("px4").flying()
    rig.peer = Peer("ardupilot", 7)
    rig.run(10.0)
    assert rig.core.telemetry.link_lost
    exchanged(rig, "ardupilot", 7).run(3.0)
    assert rig.core.telemetry.autopilot == "ardupilot"


def test_its_clock_since_boot_is_its_own() -> None:
    rig = Rig().flying()
    exchanged(rig, "px4", 7)
    rig.peer.booted_at = rig.now - 5.0
    rig.run(3.0)
    seen = rig.core.telemetry.boot_time_s
    assert seen == pytest.approx(8.0, abs=0.5)
    assert rig.core.history.time_of_boot(7.5) == pytest.approx(rig.now - 0.5, abs=0.2)


def test_it_is_spoken_to_in_mavlink_2_again() -> None:
    rig = Rig().flying()
    rig.core.codec.speaks_v1 = True  # as to one that knows nothing else
    exchanged(rig, "px4", 8).run(3.0)
    assert not rig.core.codec.speaks_v1


def test_an_aircraft_whose_signatures_lag_behind_those_of_the_one_before_is_heard() -> None:
    rig = Rig(signing_key=KEY)
    signer = rig.core.codec.signer
    assert signer is not None
    signer.advance(NOW)
    let_sign(rig.peer.mav)
    let_sign(rig.reader)
    rig.flying()
    exchanged(rig, "px4", 7)
    let_sign(rig.peer.mav, timestamp=signer.timestamp - 20 * PER_S)
    rig.run(3.0)
    assert rig.core.paired


def test_forgotten_streams_are_no_way_around_the_signature() -> None:
    signer = Signer(KEY)
    signer.advance(NOW)
    signer.forget_streams()
    peer = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    let_sign(peer, timestamp=NOW - 120 * PER_S)
    assert not signer.verify(bytes(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(peer)))


def test_before_it_is_heard_we_speak_as_before_any_vehicle_was() -> None:
    rig = exchanged(Rig(speaks_first=True).flying(), "px4", 9)
    rig.beating = False
    rig.run(2.0)
    assert {m.get_srcSystem() for m in rig.messages("HEARTBEAT")} == {1}
    assert MavlinkSettings().system_id is None
    assert rig.now > START


@pytest.mark.parametrize(("flavor", "system"), [("ardupilot", 9), ("px4", 9), ("ardupilot", 7)])
def test_whoever_exchanges_the_aircraft_and_does_not_say_so_is_told_once_how_to(
    flavor: str, system: int
) -> None:
    rig = Rig("px4").flying()
    rig.peer.armed, rig.peer.landed = False, 1
    rig.run(3.0)
    rig.events.clear()
    rig.peer = Peer(flavor, system)
    rig.run(20.0)
    (notice,) = rig.of(Notice)
    title = {"px4": "PX4", "ardupilot": "ArduCopter"}[flavor]
    who = f"system {system} ({title}) is heard, and not the aircraft that was there"
    assert notice.text == f"{who}: if it is another one now, order replace"


def test_nobody_is_told_to_exchange_an_aircraft_that_is_heard_or_in_the_air() -> None:
    for armed, heard in ((False, True), (True, False)):
        rig, other = Rig("px4").flying(), Peer("ardupilot", 9)
        rig.peer.armed = armed
        rig.run(2.0)
        rig.beating = heard
        for _ in range(10):
            rig.run(1.0)
            rig.say(other.heartbeat())
        assert rig.core.telemetry.link_lost is not heard
        assert rig.of(Notice) == []

"""Pairing, own heartbeat, streams, silence, reboot: the link itself."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.events import (
    ArmedChanged,
    LandedChanged,
    LinkBack,
    LinkLost,
    ModeChanged,
    Paired,
    Rebooted,
    StatusText,
)
from service.mavlink.streams import streams_of
from service.mavlink.telemetry import Wind

from .peer import GROUND, GUIDED, LAT, LON, Peer, Rig

FLAVORS = pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
MSG_POSITION = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
MSG_WIND = mavlink.MAVLINK_MSG_ID_WIND_COV


def asked(rig: Rig, message_id: int) -> list[Any]:
    """The requests for a stream."""
    return [m for m in rig.messages("COMMAND_LONG", 511) if m.param1 == message_id]


@FLAVORS
def test_pairs_with_the_first_autopilot_and_speaks_as_its_companion(flavor: str) -> None:
    rig = Rig(flavor)
    rig.say(rig.peer.heartbeat())
    assert rig.of(Paired) == [Paired(rig.now, 7, flavor, GUIDED[flavor], True)]
    rig.run(3.0)
    beats = rig.messages("HEARTBEAT")
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in beats} == {(7, 191)}
    assert {m.type for m in beats} == {mavlink.MAV_TYPE_ONBOARD_CONTROLLER}


def test_own_heartbeat_goes_out_once_a_second() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    rig.run(20.0)
    assert 19 <= len(rig.messages("HEARTBEAT")) <= 21


def test_nobody_but_an_autopilot_is_paired_with() -> None:
    rig = Rig()
    ground_station = Peer(system=255, component=190)
    camera = Peer(system=7, component=100)
    companion = Peer(system=7, component=191)
    rig.say(ground_station.heartbeat(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID))
    rig.say(camera.heartbeat(mavlink.MAV_TYPE_CAMERA, mavlink.MAV_AUTOPILOT_INVALID))
    rig.say(companion.heartbeat(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID))
    rig.say(Peer(system=3).heartbeat(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID))
    assert not rig.core.paired


@pytest.mark.parametrize(
    ("kind", "autopilot", "why"),
    [
        (mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, "FIXED_WING"),
        (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_GENERIC, "GENERIC"),
    ],
)
def test_vehicle_that_cannot_be_flown_is_named_and_not_paired_with(
    kind: int, autopilot: int, why: str
) -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat(kind, autopilot))
    assert not rig.core.paired
    assert why in rig.core.rejected


def test_only_the_system_asked_for_is_paired_with() -> None:
    rig = Rig(system_id=9)
    rig.say(rig.peer.heartbeat())
    assert not rig.core.paired
    rig.say(Peer(system=9).heartbeat())
    assert rig.core.telemetry.system_id == 9


def test_nothing_is_sent_before_a_vehicle_is_heard_where_we_only_listen() -> None:
    rig = Rig()
    rig.beating = False
    rig.run(5.0)
    assert rig.sent == []


def test_heartbeats_go_out_at_once_where_we_speak_first() -> None:
    rig = Rig(speaks_first=True)
    rig.beating = False
    rig.run(3.0)
    assert len(rig.sent) == 3
    assert {m.get_type() for m in rig.sent} == {"HEARTBEAT"}


def test_only_the_paired_system_is_believed() -> None:
    rig = Rig().flying()
    stranger = Peer(system=8)
    stranger.lat, stranger.mode, stranger.armed = 10.0, "POSCTL", False
    rig.say(stranger.heartbeat() + stranger.position(rig.now) + stranger.text("hello"))
    camera = Peer(system=7, component=100)
    camera.lat = 10.0
    rig.say(camera.position(rig.now))
    assert rig.events == []
    assert rig.core.telemetry.lat == pytest.approx(LAT)
    assert rig.core.in_control


def test_another_source_cannot_speak_for_a_vehicle_that_is_still_heard() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat(), source="radio")
    impostor = Peer()
    impostor.armed = False
    rig.say(impostor.heartbeat(), source="elsewhere")
    assert rig.core.telemetry.armed
    assert rig.core.destination == "radio"
    rig.now += 10.0
    rig.say(impostor.heartbeat(), source="elsewhere")
    assert str(rig.core.destination) == "elsewhere"
    assert not rig.core.telemetry.armed


def test_streams_are_asked_for_once_when_they_arrive() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    rig.run(20.0)
    requests = asked(rig, MSG_POSITION)
    assert [m.param2 for m in requests] == [100_000]
    wanted = {m.param1 for m in rig.messages("COMMAND_LONG", 511)}
    names = "SYS_STATUS BATTERY_STATUS GPS_RAW_INT EXTENDED_SYS_STATE HOME_POSITION VFR_HUD WIND_COV ATTITUDE"
    for name in [*names.split(), "POSITION_TARGET_GLOBAL_INT"]:
        assert getattr(mavlink, f"MAVLINK_MSG_ID_{name}") in wanted


def test_a_stream_that_stops_is_asked_for_again_but_not_without_end() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    rig.run(5.0)
    rig.forget()
    rig.positioning = False
    rig.run(6.0)
    assert len(asked(rig, MSG_POSITION)) >= 1
    rig.forget()
    rig.run(300.0)
    assert 8 <= len(asked(rig, MSG_POSITION)) <= 20


def test_an_optional_stream_that_was_refused_is_not_asked_for_again() -> None:
    rig = Rig()
    rig.refused = {MSG_WIND, MSG_POSITION}
    rig.positioning = False
    rig.say(rig.peer.heartbeat())
    rig.run(120.0)
    assert len(asked(rig, MSG_WIND)) == 1
    assert len(asked(rig, MSG_POSITION)) > 3, "what is needed is asked for again all the same"


def test_streams_do_not_pile_up_when_nothing_answers() -> None:
    rig = Rig()
    rig.acking = False
    rig.say(rig.peer.heartbeat())
    longest = 0
    for _ in range(120):
        rig.run(1.0)
        # a queue that grows is not seen on the wire until it is too late
        longest = max(longest, rig.core._book.waiting_for(511))
    assert longest == len(streams_of(rig.core.settings, "px4"))


def test_silence_is_link_lost_and_the_next_heartbeat_link_back() -> None:
    rig = Rig().flying()
    rig.beating = False
    rig.run(3.0)
    assert rig.of(LinkLost) == []
    rig.run(2.0)
    (lost,) = rig.of(LinkLost)
    assert lost.silent_s == pytest.approx(3.6, abs=0.2)
    assert rig.core.telemetry.link_lost
    rig.forget()
    rig.beating = True
    rig.run(2.0)
    assert len(rig.of(LinkBack)) == 1
    assert not rig.core.telemetry.link_lost
    assert asked(rig, MSG_POSITION), "streams are asked for again after a loss"


def test_nothing_but_heartbeats_is_sent_while_the_link_is_lost() -> None:
    rig = Rig().flying()
    rig.beating = False
    rig.run(10.0)
    rig.forget()
    rig.run(60.0)
    assert {m.get_type() for m in rig.sent} == {"HEARTBEAT"}


def test_reboot_is_noticed_and_everything_is_asked_for_again() -> None:
    rig = Rig().flying()
    rig.forget()
    rig.peer.booted_at = rebooted = rig.now
    rig.run(2.0)
    assert len(rig.of(Rebooted)) == 1
    assert not rig.core.in_control
    assert asked(rig, MSG_POSITION)
    assert rig.core.history.pose_at(rebooted - 1.0) is not None, "where it was stays true"
    assert rig.core.history.time_of_boot(100.0) is None, "but its time since boot is another"


@pytest.mark.parametrize("stamp", [0xFFFFFFFF, 1, 5_000])
def test_a_single_impossible_stamp_is_no_reboot_and_loses_no_pose(stamp: int) -> None:
    rig = Rig().flying()
    booted, rig.peer.booted_at = rig.peer.booted_at, rig.now - stamp / 1000.0
    rig.say(rig.peer.position(rig.now) + rig.peer.attitude(rig.now))
    rig.peer.booted_at = booted
    rig.run(2.0)
    assert rig.of(Rebooted) == []
    assert rig.core.in_control
    assert rig.core.history.pose_at(rig.now - 2.5) is not None
    assert rig.core.telemetry.boot_time_s == pytest.approx(rig.now - booted, abs=0.2)


def test_a_first_stamp_that_was_nonsense_makes_no_reboot_of_the_right_ones() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    booted, rig.peer.booted_at = rig.peer.booted_at, rig.now - 4_000_000.0
    rig.say(rig.peer.position(rig.now))
    rig.peer.booted_at = booted
    rig.run(2.0)
    assert rig.of(Rebooted) == []
    assert rig.core.telemetry.boot_time_s == pytest.approx(rig.now - booted, abs=0.2)


def test_a_late_datagram_is_not_a_reboot() -> None:
    rig = Rig().flying()
    newest = rig.core.telemetry.boot_time_s
    rig.say(rig.peer.position(rig.now - 0.5))
    assert rig.of(Rebooted) == []
    assert rig.core.telemetry.boot_time_s == newest


def test_the_clock_of_the_vehicle_may_wrap() -> None:
    rig = Rig().flying()
    rig.peer.booted_at = rig.now - 2**32 / 1000 + 1.0
    rig.run(0.5)
    rig.peer.booted_at = rig.now - 1.0
    rig.run(0.5)
    assert rig.of(Rebooted) == []


def test_telemetry_is_in_si_units_and_degrees() -> None:
    rig = Rig()
    rig.peer.velocity = (3.0, 4.0, -1.0)
    rig.say(rig.peer.heartbeat())
    rig.run(3.0)
    t = rig.core.telemetry
    assert (t.lat, t.lon) == pytest.approx((LAT, LON))
    assert (t.alt_amsl_m, t.alt_home_m) == pytest.approx((GROUND + 20.0, 20.0))
    assert t.velocity_ned_mps == pytest.approx((3.0, 4.0, -1.0))
    assert t.ground_speed_mps == pytest.approx(5.0)
    assert (t.heading_deg, t.yaw_deg) == pytest.approx((90.0, 90.0))
    assert t.roll_deg == pytest.approx(math.degrees(0.1), abs=1e-4)
    assert (t.battery_percent, t.battery_voltage_v, t.battery_current_a) == (80.0, 15.4, 12.0)
    assert (t.satellites, t.fix, t.eph) == (12, 3, 0.7)
    assert t.home is not None
    assert (t.home.lat, t.home.lon, t.home.alt_amsl_m) == pytest.approx((LAT, LON, GROUND))
    assert t.landed_state == "in_air"
    assert t.position_time == pytest.approx(rig.now)


def test_unknown_values_are_none_and_not_numbers() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    peer = rig.peer
    rig.say(peer.pack(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 65535, -1, -1, 0, 0, 0, 0, 0, 0)))
    rig.say(peer.pack(mavlink.MAVLink_gps_raw_int_message(0, 1, 0, 0, 0, 65535, 65535, 0, 0, 255)))
    rig.say(peer.pack(mavlink.MAVLink_wind_cov_message(0, math.nan, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    t = rig.core.telemetry
    assert (t.battery_percent, t.battery_voltage_v, t.battery_current_a) == (None, None, None)
    assert (t.satellites, t.eph, t.wind) == (None, None, None)


@pytest.mark.parametrize(("lat", "lon"), [(0.0, 0.0), (95.0, 8.0), (47.0, 181.0)])
def test_a_position_that_is_none_is_not_believed(lat: float, lon: float) -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    rig.peer.lat, rig.peer.lon = lat, lon
    rig.say(rig.peer.position(rig.now))
    assert not rig.core.telemetry.position_known
    assert len(rig.core.history) == 0


def test_both_wind_messages_say_where_the_air_goes() -> None:
    px4 = Rig("px4")
    px4.say(px4.peer.heartbeat())
    px4.say(px4.peer.pack(mavlink.MAVLink_wind_cov_message(0, 3.0, -4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert px4.core.telemetry.wind == Wind(3.0, -4.0)
    copter = Rig("ardupilot")
    copter.say(copter.peer.heartbeat())
    copter.say(copter.peer.pack(mavlink.MAVLink_wind_message(270.0, 5.0, 0.0)))  # from the west
    wind = copter.core.telemetry.wind
    assert wind is not None
    assert (wind.north_mps, wind.east_mps) == pytest.approx((0.0, 5.0), abs=1e-6)


def test_landed_and_armed_changes_are_told() -> None:
    rig = Rig().flying()
    rig.peer.landed = 4
    rig.run(1.0)
    (landing,) = rig.of(LandedChanged)
    assert (landing.state, landing.previous) == ("landing", "in_air")
    rig.peer.armed = False
    rig.run(1.0)
    (disarmed,) = rig.of(ArmedChanged)
    assert not disarmed.armed


def test_texts_in_chunks_are_put_together_even_out_of_order() -> None:
    rig = Rig().flying()
    long = "Preflight Fail: the quick brown fox jumps over the lazy dog again and again"
    rig.say(rig.peer.text(long[50:], 4, text_id=3, chunk=1))
    rig.say(rig.peer.text(long[:50], 4, text_id=3, chunk=0))
    rig.say(rig.peer.text("short one", 6))
    said = [(e.severity, e.text) for e in rig.of(StatusText)]
    assert said == [(4, long), (6, "short one")]


def test_text_whose_end_is_lost_is_told_as_far_as_it_got() -> None:
    rig = Rig().flying()
    rig.say(rig.peer.text("x" * 50, 4, text_id=9, chunk=0))
    assert rig.of(StatusText) == []
    rig.run(3.0)
    assert [e.text for e in rig.of(StatusText)] == ["x" * 50]


@pytest.mark.parametrize("length", [1, 50, 51, 100, 120])
def test_own_texts_are_readable_by_the_same_rules(length: int) -> None:
    rig = Rig().flying()
    text = ("searching region " * 20)[:length].strip()
    assert rig.core.status_text(text, 6)
    chunks = rig.messages("STATUSTEXT")
    assert all(len(m.text) <= 50 for m in chunks)
    pieces = [m.text for m in sorted(chunks, key=lambda m: m.chunk_seq)]
    assert " ".join("".join(pieces).split()) == text
    assert set(" ".join(pieces).split()) <= set(text.split()), "no word is cut"
    assert (len(chunks) == 1) == (chunks[0].id == 0)
    other = Rig().flying()
    for m in chunks:
        other.say(other.peer.text(m.text, m.severity, m.id, m.chunk_seq))
    assert [" ".join(e.text.split()) for e in other.of(StatusText)] == [text]


def test_mode_names_follow_the_heartbeat() -> None:
    rig = Rig("ardupilot")
    rig.say(rig.peer.heartbeat())
    rig.peer.mode = "RTL"
    rig.say(rig.peer.heartbeat())
    (change,) = rig.of(ModeChanged)
    assert (change.mode, change.previous, change.kind, change.guided) == ("RTL", "GUIDED", "return", False)

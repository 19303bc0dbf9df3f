"""A value that is not told any longer is unknown, whichever message told it."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.heard import Heard
from service.mavlink.history import PoseHistory
from service.mavlink.settings import MavlinkSettings
from service.mavlink.sources import SOURCES
from service.mavlink.telemetry import Telemetry

from .peer import GROUND, LAT, LON, Rig
from .samples import SAMPLES

LASTING = {name for name, source in SOURCES.items() if math.isinf(source.old_after_s)}


def heard_at(now: float) -> Heard:
    """A vehicle whose heartbeat came just now."""
    heard = Heard(MavlinkSettings())
    heard.base = Telemetry(heartbeat_time=now, armed=True)
    return heard


def beats(heard: Heard, now: float) -> None:
    """Another heartbeat."""
    heard.base = Telemetry(heartbeat_time=now, armed=True)


def same(a: Any, b: Any) -> bool:
    """Equal, NaN being equal to NaN."""
    return repr(a) == repr(b)


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_every_field_of_the_table_is_told_and_becomes_unknown_once_it_is_old(name: str) -> None:
    source, heard, unknown = SOURCES[name], heard_at(100.0), Telemetry()
    assert heard.take(SAMPLES[name], 100.0)
    told = heard.view(100.0)
    tells = {f.name for f in fields(Telemetry) if not same(getattr(told, f.name), getattr(unknown, f.name))}
    tells -= {
        "heartbeat_time",
        "armed",
        "told",
        "position_time",
        "status_time",
        "lat",
        "lon",
        "alt_amsl_m",
        "alt_home_m",
    }
    assert tells <= set(source.fields)
    if name in LASTING:
        return
    just, after = 100.0 + source.old_after_s - 0.01, 100.0 + source.old_after_s + 0.01
    for second in range(101, int(after) + 1):
        beats(heard, float(second))
    assert same(getattr(heard.view(just), source.fields[0]), getattr(told, source.fields[0]))
    beats(heard, after)
    old = heard.view(after)
    assert old.old == {name}
    assert old.told[name] == 100.0, "when it was told stays known"
    for field in source.fields:
        assert same(getattr(old, field), getattr(unknown, field)), field


def test_all_messages_that_are_read_have_a_sample_and_an_age() -> None:
    from service.mavlink.readers import READERS

    assert set(READERS) == set(SAMPLES)
    assert set(READERS) == {name for name, source in SOURCES.items() if source.fields}


def test_a_message_that_comes_again_with_the_same_stamp_is_no_younger() -> None:
    heard = heard_at(100.0)
    for second in range(100, 104):
        beats(heard, float(second))
        assert heard.take(SAMPLES["ATTITUDE"], float(second)) == (second == 100)
    assert math.isnan(heard.view(103.0).yaw_deg)


def test_nothing_grows_old_while_the_vehicle_is_not_heard_at_all() -> None:
    rig = Rig().flying()
    rig.beating = False
    rig.run(60.0)
    assert rig.core.telemetry.link_lost
    assert rig.core.telemetry.battery_percent == 80.0
    rig.say(rig.peer.heartbeat())
    assert not rig.core.telemetry.link_lost
    assert (rig.core.telemetry.fix, rig.core.telemetry.battery_percent) == (3, 80.0)
    rig.beating = True
    rig.peer.silent = {"sys_status", "gps"}
    rig.run(6.0)
    assert (rig.core.telemetry.fix, rig.core.telemetry.battery_percent) == (0, None)


def test_the_last_place_stays_known_as_the_last_place_only() -> None:
    rig = Rig().flying()
    rig.positioning = False
    rig.run(4.0)
    t = rig.core.telemetry
    assert not t.position_known
    assert (t.lat, t.lon, t.alt_amsl_m) == pytest.approx((LAT, LON, GROUND + 20.0))
    assert math.isnan(t.ground_speed_mps)
    assert t.position_time == pytest.approx(rig.now - 4.0)


def test_a_pose_never_has_the_attitude_of_an_attitude_that_froze() -> None:
    rig = Rig().flying()
    rig.peer.heading = None
    rig.run(0.5)
    newest = rig.core.history.newest
    assert newest is not None
    assert newest.heading_deg == pytest.approx(90.0)
    rig.peer.silent = {"attitude"}
    rig.run(3.0)
    newest = rig.core.history.newest
    assert newest is not None
    assert math.isnan(newest.heading_deg)
    assert math.isnan(newest.roll_deg)
    between = rig.core.history.pose_at(rig.now - 0.05)
    assert between is not None, "an unknown heading is no error"
    assert math.isnan(between.heading_deg)


def test_the_course_stands_for_the_heading_of_an_aircraft_that_is_under_way() -> None:
    rig = Rig().flying()
    rig.peer.heading, rig.peer.silent = None, {"attitude"}
    rig.peer.velocity = (0.0, -5.0, 0.0)
    rig.run(3.0)
    assert rig.core.telemetry.heading_deg == pytest.approx(270.0)
    rig.peer.velocity = (0.3, 0.0, 0.0)
    rig.run(1.0)
    assert math.isnan(rig.core.telemetry.heading_deg)


def test_a_pose_has_the_heading_that_came_with_its_place() -> None:
    rig = Rig().flying()
    rig.peer.heading = 12_000  # turned on, while the attitude says for ever what it said first
    rig.run(2.0)
    newest = rig.core.history.newest
    assert newest is not None
    assert newest.heading_deg == pytest.approx(120.0)


def test_no_pose_is_recorded_twice_for_one_position() -> None:
    history = PoseHistory(10.0)
    t = Telemetry(position_time=5.0, lat=1.0, lon=2.0, alt_amsl_m=3.0, alt_home_m=4.0)
    history.record(t)
    history.record(t)
    assert len(history) == 1


def test_a_busy_host_at_twenty_times_real_time_finds_nothing_old_too_soon() -> None:
    settings = MavlinkSettings().for_speedup(20.0)
    heard = Heard(settings)
    heard.base = Telemetry(heartbeat_time=100.0)
    heard.take(SAMPLES["ATTITUDE"], 100.0)
    for second in range(101, 110):
        beats(heard, float(second))
    assert math.isfinite(heard.view(110.0).yaw_deg)
    assert MavlinkSettings().for_speedup(1.0) == MavlinkSettings()


def test_vehicle_time_is_taken_over_with_a_position_too() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    rig.now += 1.0
    rig.say(rig.peer.position(rig.now))
    assert rig.core.telemetry.boot_time_s == pytest.approx(101.0)
    assert rig.core.telemetry.told["GLOBAL_POSITION_INT"] == rig.now
    assert mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT == 33

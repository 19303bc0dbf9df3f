"""What a mock under a fault tells: nothing, the same for ever, a sentinel, in an old protocol, by two of a kind."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim.autopilot.faults import Fault, describe
from tests.conformance.wire import mav
from tests.sim.autopilot.hovering import Flight, flavor, flight

__all__ = ["flavor", "flight"]

STREAMS = (
    "SYS_STATUS",
    "BATTERY_STATUS",
    "GPS_RAW_INT",
    "ESTIMATOR",
    "ATTITUDE",
    "EXTENDED_SYS_STATE",
    "GLOBAL_POSITION_INT",
)


def named(flight: Flight, message: str) -> str:
    """The flavour's own name of the estimator's message."""
    ours = "ESTIMATOR_STATUS" if flight.px4 else "EKF_STATUS_REPORT"
    return ours if message == "ESTIMATOR" else message


def asked_for(flight: Flight, message: str, hz: float = 5.0) -> None:
    """Ask for a stream."""
    number = getattr(mav, f"MAVLINK_MSG_ID_{message}")
    assert flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / hz) == ["ACCEPTED"]


def told(flight: Flight, message: str, seconds: float = 3.0) -> list[Any]:
    """The messages of a name that come in some time."""
    return [each for each in flight.heard(seconds) if each.get_type() == message]


@pytest.mark.parametrize("message", STREAMS)
def test_any_stream_stops_and_comes_back(flight: Flight, message: str) -> None:
    name = named(flight, message)
    asked_for(flight, name)
    assert told(flight, name)
    flight.fault("stream_stops", message=name, seconds=4.0)
    heard = {each.get_type() for each in flight.heard(3.5)}
    assert name not in heard
    assert "HEARTBEAT" in heard
    flight.listen(1.0)
    assert told(flight, name)


@pytest.mark.parametrize("message", STREAMS)
def test_any_stream_freezes_while_the_vehicle_moves(flight: Flight, message: str) -> None:
    name = named(flight, message)
    asked_for(flight, name)
    flight.go(60, 0, wait=0)
    flight.listen(1.0)
    flight.fault("stream_freezes", message=name)
    frozen = [each.to_dict() for each in told(flight, name, 6.0)]
    assert len(frozen) > 20
    for each in frozen:
        each.pop("time_boot_ms", None), each.pop("time_usec", None)
    assert all(each == frozen[0] for each in frozen)


def test_a_frozen_stream_has_stamps_that_go_on_or_stand(flight: Flight) -> None:
    flight.fault("stream_freezes", message="ATTITUDE")
    stamps = [each.time_boot_ms for each in told(flight, "ATTITUDE")]
    assert stamps == sorted(set(stamps))
    flight.autopilot.faults.clear()
    flight.fault("stream_freezes", message="ATTITUDE", stamp="stands")
    assert len({each.time_boot_ms for each in told(flight, "ATTITUDE")}) == 1


def test_an_unknown_message_is_never_sent_and_refused_to_who_asks(flight: Flight) -> None:
    flight.fault("no_message", message="EXTENDED_SYS_STATE")
    number = mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
    refusal = "FAILED" if flight.px4 else "DENIED"
    assert flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 2e5) == [refusal]
    assert told(flight, "EXTENDED_SYS_STATE") == []


@pytest.mark.parametrize(
    ("message", "field", "value"),
    [
        ("SYS_STATUS", "battery_remaining", -1),
        ("GLOBAL_POSITION_INT", "hdg", 65535),
        ("ATTITUDE", "yaw", math.nan),
        ("EXTENDED_SYS_STATE", "landed_state", 3),
        ("HEARTBEAT", "type", 43),
    ],
)
def test_a_field_has_another_value_for_a_while(
    flight: Flight, message: str, field: str, value: float
) -> None:
    flight.fault("field", message=message, field=field, value=value, seconds=4.0)
    values = [getattr(each, field) for each in told(flight, message)]
    assert values
    assert all(each == value or (math.isnan(value) and math.isnan(each)) for each in values)
    flight.listen(1.5)
    assert value not in [getattr(each, field) for each in told(flight, message)]


def test_a_field_is_wrong_in_a_single_message(flight: Flight) -> None:
    flight.fault("field", message="GLOBAL_POSITION_INT", field="time_boot_ms", value=4294967295, times=1)
    stamps = [each.time_boot_ms for each in told(flight, "GLOBAL_POSITION_INT")]
    assert stamps.count(4294967295) == 1
    assert flight.autopilot.vehicle.time > 10.0  # it has not rebooted


def test_a_shifted_field_keeps_moving(flight: Flight) -> None:
    before = flight.latest["GLOBAL_POSITION_INT"].alt
    flight.fault("field_shifts", message="GLOBAL_POSITION_INT", field="alt", by=20000)
    altitudes = [each.alt for each in told(flight, "GLOBAL_POSITION_INT")]
    assert all(abs(each - before - 20000) < 3000 for each in altitudes)
    assert len(set(altitudes)) > 3


def test_home_in_another_datum_contradicts_the_position(flight: Flight) -> None:
    asked_for(flight, "HOME_POSITION", 1.0)
    flight.fault("home_datum", metres=47.0)
    flight.listen(2.0)
    here, home = flight.latest["GLOBAL_POSITION_INT"], flight.latest["HOME_POSITION"]
    assert home.altitude - (here.alt - here.relative_alt) == pytest.approx(47000, abs=1500)


def test_an_unknown_battery_drains_all_the_same(flight: Flight) -> None:
    asked_for(flight, "BATTERY_STATUS")
    flight.fault("battery_unknown")
    flight.fault("battery_drains", percent_per_s=10.0)
    heard = flight.heard(3.0)
    assert {each.battery_remaining for each in heard if each.get_type() == "SYS_STATUS"} == {-1}
    batteries = [each for each in heard if each.get_type() == "BATTERY_STATUS"]
    assert {(each.battery_remaining, each.charge_state, each.current_consumed) for each in batteries} == {
        (-1, 0, -1)
    }
    assert flight.autopilot.vehicle.battery.percent < 75
    flight.listen(12.0)
    assert flight.autopilot.vehicle.body.on_ground  # its motors have stopped
    assert not flight.armed


@pytest.mark.parametrize("flavor", ["px4"])
def test_a_level_falls_as_fast_as_it_is_told(flavor: str) -> None:
    flight = Flight(flavor)
    flight.listen(1.0)
    before = flight.status.battery_remaining
    flight.fault("battery_drains", percent_per_s=4.0, seconds=5.0)
    flight.listen(7.0)
    assert before - flight.status.battery_remaining == pytest.approx(20, abs=3)


def test_more_than_one_battery_receiver_and_estimator_are_told(flight: Flight) -> None:
    estimator = named(flight, "ESTIMATOR")
    for name in ("BATTERY_STATUS", "GPS_RAW_INT", estimator):
        asked_for(flight, name)
    flight.fault("second_battery", percent=17.0)
    flight.fault("second_gps", fix=1, satellites=3)
    flight.fault("second_estimator", flags=0)
    heard = flight.heard(4.0)
    levels = {(m.id, m.battery_remaining) for m in heard if m.get_type() == "BATTERY_STATUS"}
    assert (1, 17) in levels
    assert {battery for battery, _ in levels} == {0, 1}
    assert {m.fix_type for m in heard if m.get_type() == "GPS2_RAW"} == {1}
    assert {m.fix_type for m in heard if m.get_type() == "GPS_RAW_INT"} == {3}
    flags = {m.flags for m in heard if m.get_type() == estimator}
    assert 0 in flags
    assert len(flags) == 2


def test_an_old_wire_carries_no_extensions_and_no_high_numbers(flight: Flight) -> None:
    for name in ("GPS_RAW_INT", "BATTERY_STATUS"):
        asked_for(flight, name)
    flight.fault("mavlink1")
    heard = flight.heard(3.0)
    assert {message.get_msgbuf()[0] for message in heard} == {0xFE}
    assert {"GPS_RAW_INT", "BATTERY_STATUS", "HEARTBEAT"} <= {message.get_type() for message in heard}
    assert {m.charge_state for m in heard if m.get_type() == "BATTERY_STATUS"} == {0}
    assert flight.long(mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == ["ACCEPTED"]


@pytest.mark.parametrize(("carries", "heard", "obeyed"), [("down", True, False), ("up", False, True)])
def test_a_one_way_link(flight: Flight, carries: str, heard: bool, obeyed: bool) -> None:
    flight.fault("one_way", carries=carries)
    mode = flight.autopilot.firmware.mode
    flight.send(mav.MAVLink_command_long_message(1, 1, mav.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0, *(0.0,) * 7))
    assert bool(flight.heard(2.0)) == heard
    assert (flight.autopilot.firmware.mode != mode) == obeyed


def test_a_refused_command_is_answered_and_not_obeyed(flight: Flight) -> None:
    flight.fault("command_refused", text="not today")
    leg = flight.go(20, 0, wait=0)
    flight.listen(3.0)
    assert leg.acks == ["UNSUPPORTED"]
    assert leg.moved < 2.0
    assert flight.said("not today")


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "stream_stops", "message": "SYS_STATE"}, "MAVLink has no message 'SYS_STATE'"),
        ({"kind": "field", "field": "heading"}, "GLOBAL_POSITION_INT has no field 'heading'; it has: time_boot_ms"),
        ({"kind": "field", "value": math.nan}, "hdg is a uint16_t and cannot be nan"),
        ({"kind": "field", "value": 65536}, "hdg is a uint16_t and cannot be 65536"),
        ({"kind": "field", "times": 1.5}, "'times' of a fault of kind 'field' should be like 0"),
        ({"kind": "command_refused", "command": "MAV_CMD_SING"}, "MAVLink has no command 'MAV_CMD_SING'"),
    ],
)  # fmt: skip
def test_a_fault_that_makes_no_sense_is_named_in_one_sentence(table: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Fault.of(table)


def test_the_list_of_faults_says_what_each_can_be_told() -> None:
    text = describe()
    assert "stream_freezes: Some messages say for ever what they said first" in text
    assert '    stamp = "moves"  # moves | stands' in text

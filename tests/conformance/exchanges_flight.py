"""Exchanges in the air about what is said and refused: take-off, telemetry, forms of DO_REPOSITION."""

from __future__ import annotations

import math
from functools import partial

from tests.conformance.compare import Facts
from tests.conformance.dialogue import GUIDED, NAN, Dialogue, Leg
from tests.conformance.wire import mav

_INT32_MAX = 2**31 - 1


def takeoff_20m(d: Dialogue) -> Facts:
    """The proper take-off: acknowledgements, modes, landed states, climb."""
    leg = Leg(d, 0, 0)
    facts: Facts = dict(d.take_off())
    began = d.now
    facts["reaches_95_percent"] = d.wait(lambda: d.here.up > 19.0, 90)
    facts["to_19m_s"] = d.now - began
    d.wait(lambda: abs(d.here.climb) < 0.15 and d.mode == GUIDED[d.flavor], 15)
    d.listen(4)
    return facts | {
        "settled_altitude_m": d.here.up,
        "peak_climb_mps": max(s.climb for s in leg.samples),
        "overshoot_m": max(s.up for s in leg.samples) - 20,
        "mode_sequence": d.modes,
        "landed_sequence": d.landed,
    }


def telemetry_fields(d: Dialogue) -> Facts:
    """Units and sentinels of what a service reads in the hover."""
    d.listen(3)
    told = "HEARTBEAT GLOBAL_POSITION_INT ATTITUDE SYS_STATUS BATTERY_STATUS GPS_RAW_INT EXTENDED_SYS_STATE"
    kinds = [*told.split(), "HOME_POSITION", "VFR_HUD", "POSITION_TARGET_GLOBAL_INT"]
    facts: Facts = {f"has_{kind}": kind in d.latest for kind in kinds}
    position, gps, status = d.latest["GLOBAL_POSITION_INT"], d.latest["GPS_RAW_INT"], d.latest["SYS_STATUS"]
    battery, home = d.latest["BATTERY_STATUS"], d.latest["HOME_POSITION"]
    cells = [v for v in battery.voltages if v != 65535]
    apart = math.dist(d.metres(gps.lat, gps.lon), d.metres(position.lat, position.lon))
    return facts | {
        "altitude_is_amsl_mm": abs(position.alt - position.relative_alt - home.altitude) < 3000,
        "relative_altitude_is_mm_over_home": 17000 < position.relative_alt < 23000,
        "gps_agrees_with_position": apart < 8,
        "gps_fix_is_3d_or_better": gps.fix_type >= 3,
        "gps_eph_known": gps.eph != 65535,
        "gps_satellites_known": gps.satellites_visible != 255,
        "heading_centidegrees": 0 <= position.hdg < 36000,
        "battery_remaining_is_percent": 0 <= status.battery_remaining <= 100,
        "battery_remaining_same_in_both": abs(status.battery_remaining - battery.battery_remaining) <= 2,
        "battery_voltage_is_millivolts": 3000 < status.voltage_battery < 60000,
        "battery_voltage_sum_agrees": abs(sum(cells) - status.voltage_battery) < 500,
        "battery_current_known": status.current_battery != -1,
        "battery_cells_filled": len(cells),
        "battery_time_remaining_known": battery.time_remaining != 0,
        "gps_sensor_healthy_bit": bool(status.onboard_control_sensors_health & mav.MAV_SYS_STATUS_SENSOR_GPS),
        "landed_state": d.landed[-1],
    }


def disarm_airborne(d: Dialogue) -> Facts:
    """In the air: disarm, arm, and a mode that does not exist."""
    return {
        "disarm_ack": d.long(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0),
        "arm_ack": d.long(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1),
        "no_such_mode_ack": d.long(mav.MAV_CMD_DO_SET_MODE, 1, 99, 0),
        "armed_after": d.armed,
    }


def _low_or_there(d: Dialogue, leg: Leg) -> bool:
    return d.here.up < 8 or (leg.remaining < 1.5 and d.here.speed < 0.5)


def _off(d: Dialogue, leg: Leg) -> bool:
    return d.here.up < 12 or leg.moved > 8


def reposition_frames(d: Dialogue) -> Facts:
    """Hops with the altitude in each frame: does it arrive, and at which height?"""
    facts: Facts = {}
    for label, frame in (("global", 0), ("relative_alt", 3), ("global_int", 5), ("relative_alt_int", 6)):
        leg = d.go(30 if d.here.north < 15 else 0, 0, frame=frame, wait=0)
        facts[f"{label}_ack"] = leg.acks
        d.wait(partial(_low_or_there, d, leg), 40)
        facts[f"{label}_arrives"] = leg.remaining < 2
        facts[f"{label}_altitude_kept"] = abs(d.here.up - 20) < 2
        if d.here.up < 15:
            d.go(d.here.north, d.here.east, wait=0)
            d.wait(lambda: d.here.up > 18, 40)
    facts["local_ned_ack"] = d.reposition(0, 0, 20.0, frame=1)
    d.go(0, 0, wait=30)
    return facts


def reposition_options(d: Dialogue) -> Facts:
    """In the guided mode: flags 0 and 3, a NaN altitude, INT32_MAX for "keep the place"."""
    facts: Facts = {}
    for flags in (0, 3):
        leg = d.go(15, 0, flags=flags, wait=0)
        d.listen(5)
        facts[f"flags_{flags}_ack"] = leg.acks
        facts[f"flags_{flags}_moves"] = leg.moved > 3
        d.go(0, 0)
    leg = Leg(d, 15, 0)
    facts["nan_altitude_ack"] = d.reposition(*d.point(15, 0), NAN)
    d.listen(5)
    facts["nan_altitude_moves"] = leg.moved > 3
    facts["nan_altitude_keeps_height"] = abs(d.here.up - 20) < 2
    d.go(0, 0)
    leg = Leg(d, 0, 0)
    facts["int32_max_position_ack"] = d.reposition(_INT32_MAX, _INT32_MAX, d.amsl(26))
    d.listen(6)
    facts["int32_max_position_moves"] = leg.moved > 3
    facts["int32_max_position_climbs"] = d.here.up > 22
    return facts


def reposition_absurd(d: Dialogue) -> Facts:
    """Latitude 95, 0/0, 200 km away, 5 km under the ground: refused, or flown?"""
    targets = {
        "latitude_95": (950_000_000, d.origin[1], d.amsl(20)),
        "zero_zero": (0, 0, d.amsl(20)),
        "far_200km": (d.origin[0] + 18_000_000, d.origin[1], d.amsl(20)),
        "below_ground": (*d.point(0, 0), d.amsl(20) - 5000),
    }
    facts: Facts = {}
    for label, target in targets.items():
        leg = Leg(d, 0, 0)
        facts[f"{label}_ack"] = d.reposition(*target)
        d.wait(partial(_off, d, leg), 5)
        facts[f"{label}_moves"] = leg.moved > 3 or d.here.up < 18.5
        d.go(0, 0, wait=30)
        d.wait(lambda: abs(d.here.up - 20) < 1.0, 20)
    return facts


def reposition_command_long(d: Dialogue) -> Facts:
    """The same hop as COMMAND_LONG, in degrees."""
    leg = Leg(d, 20, 0)
    x, y = d.point(20, 0)
    leg.acks = d.long(mav.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, x * 1e-7, y * 1e-7, d.amsl(20))
    d.listen(12)
    return {"ack": leg.acks, "arrives_within_3m": leg.remaining < 3}

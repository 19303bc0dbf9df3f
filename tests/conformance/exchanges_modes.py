"""Exchanges about who is in charge: pilots, failsafes, fences, landing and coming home."""

from __future__ import annotations

import math

from tests.conformance import transfer
from tests.conformance.compare import Facts
from tests.conformance.dialogue import NAN, PILOT, Dialogue, Leg, entry
from tests.conformance.wire import mav

_POSITION_ONLY = 0x0DF8


def gcs_silence(d: Dialogue) -> Facts:
    """Twenty seconds without ground station heartbeats, and a command afterwards."""
    d.silent, d.sticks = True, False
    heard = len(d.texts)
    d.listen(20)
    facts: Facts = {"mode_sequence": list(d.modes), "text_sent": len(d.texts) > heard}
    d.silent = False
    return facts | {"reposition_ack_afterwards": d.go(5, 0, wait=0).acks}


def _setpoint(d: Dialogue) -> None:
    x, y = d.point(15, 0)
    frame = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    d.send(
        mav.MAVLink_set_position_target_global_int_message(
            0, d.system, 1, frame, _POSITION_ONLY, x, y, 20, *(0.0,) * 8
        )
    )


def setpoint_stream(d: Dialogue) -> Facts:
    """One setpoint in ArduCopter's GUIDED; a stream in PX4's OFFBOARD that ends."""
    leg = Leg(d, 15, 0)
    if not d.px4:
        _setpoint(d)
        d.wait(lambda: leg.remaining < 1, 30)
        d.listen(5)
        return {"single_setpoint_moves": leg.moved > 12, "mode_sequence": d.modes}
    facts: Facts = {"offboard_without_stream_ack": d.select("OFFBOARD")}
    d.listen(2)
    facts["mode_without_stream"] = d.mode
    d.guided()
    d.listen(1.5)
    first = len(d.modes)
    start = due = d.now
    asked = False
    while d.now < start + 12:
        if d.now >= due:
            _setpoint(d)
            due = d.now + 0.05
        d.pump()
        if not asked and d.now > start + 2:
            asked = True
            d.send(
                mav.MAVLink_command_long_message(d.system, 1, mav.MAV_CMD_DO_SET_MODE, 0, 1, 6, *(0.0,) * 5)
            )
    acks = [entry("MAV_RESULT", a.result) for a in d.acks if a.command == mav.MAV_CMD_DO_SET_MODE]
    facts |= {"offboard_ack": acks[-2:], "stream_moves": leg.moved > 10}
    stop = d.now
    facts["leaves_offboard"] = d.wait(lambda: d.mode != "OFFBOARD", 15)
    facts["failsafe_after_s"] = d.now - stop
    d.listen(5)
    facts["mode_sequence"] = d.modes[first - 1 :]
    facts["reposition_after_failsafe_ack"] = d.go(0, 0, wait=0).acks
    d.listen(2)
    return facts | {"mode_after_reposition": d.mode}


def fence_reposition(d: Dialogue) -> Facts:
    """An inclusion square, enabled; a reposition out of it, and one within."""
    kind, side = mav.MAV_MISSION_TYPE_FENCE, 30.0
    frame = mav.MAV_FRAME_GLOBAL if d.px4 else mav.MAV_FRAME_GLOBAL_INT
    corners = [(-side, -side), (-side, side), (side, side), (side, -side)]
    vertex = mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    items = [transfer.item(d, k, vertex, frame, *corner, 0, kind) for k, corner in enumerate(corners)]
    facts = transfer.prefixed("upload", transfer.upload(d, items, kind))
    facts["download_count"] = transfer.download(d, kind)["count"]
    facts["enable_ack"] = d.long(mav.MAV_CMD_DO_FENCE_ENABLE, 1)
    d.listen(2)
    heard = len(d.texts)
    leg = d.go(60, 0, wait=0)
    facts["outside_ack"] = leg.acks
    d.listen(15)
    furthest = max(s.north for s in leg.samples)
    facts |= {"outside_moves": leg.moved > 3, "furthest_north_m": furthest, "crosses_fence": furthest > side}
    facts |= {"statustext_after_command": len(d.texts) > heard, "mode_sequence": list(d.modes)}
    leg = d.go(15, 0, wait=0)
    d.listen(6)
    facts["inside_ack_afterwards"] = leg.acks
    facts["disable_ack"] = d.long(mav.MAV_CMD_DO_FENCE_ENABLE, 0)
    return facts | {"clear_result": transfer.clear(d, kind)}


def rtl_abort(d: Dialogue) -> Facts:
    """RTL, then a reposition without and with the change-mode flag."""
    d.go(40, 0)
    facts: Facts = {"rtl_ack": d.long(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH)}
    d.listen(3)
    facts["mode_in_rtl"] = d.mode
    facts["flags_0_ack"] = d.go(40, 20, flags=0, wait=0).acks
    d.listen(2)
    facts["mode_after_flags_0"] = d.mode
    leg = d.go(40, 20, wait=0)
    facts["flags_1_ack"] = leg.acks
    d.wait(lambda: leg.remaining < 2, 30)
    return facts | {"mode_after_flags_1": d.mode, "flags_1_flies_there": leg.remaining < 2.5}


def pilot_takeover(d: Dialogue) -> Facts:
    """A pilot takes the mode; repositions without and with the flag; a take-over on the way."""
    d.sticks = True
    d.listen(1.5)
    facts: Facts = {}
    for flags in (0, 1):
        facts[f"pilot_mode_ack_{flags}"] = d.select(PILOT[d.flavor])
        d.listen(2)
        facts[f"mode_before_flags_{flags}"] = d.mode
        leg = d.go(20, 0, flags=flags, wait=0)
        d.listen(6)
        facts[f"flags_{flags}_ack"] = leg.acks
        facts[f"mode_after_flags_{flags}"] = d.mode
        facts[f"flags_{flags}_moves"] = leg.moved > 4
    leg = d.go(40, 0, wait=0)
    d.wait(lambda: d.here.speed > 2, 10)
    facts["takeover_mid_leg_ack"] = d.select(PILOT[d.flavor])
    d.wait(lambda: d.here.speed < 0.5, 20)
    d.listen(1)
    return facts | {"takeover_mode": d.mode, "takeover_stops_before_target": leg.remaining > 3}


def stale_reposition(d: Dialogue) -> Facts:
    """A reposition without the flag while a pilot flies: is it flown when the guided mode comes back?"""
    d.sticks = True
    d.listen(1.5)
    d.select(PILOT[d.flavor])
    d.listen(2)
    leg = d.go(20, 0, flags=0, wait=0)
    d.listen(2)
    facts: Facts = {"ack": leg.acks, "guided_mode_ack": d.guided()}
    d.listen(8)
    return facts | {"mode_after": d.mode, "flies_to_stale_target": leg.moved > 5}


def sticks_lost(d: Dialogue) -> Facts:
    """Neutral sticks in the guided mode, then none."""
    d.sticks = True
    d.listen(3)
    d.sticks = False
    d.listen(14)
    ack = d.go(0, 0, wait=0).acks
    d.listen(2)
    return {"mode_sequence": d.modes, "reposition_ack": ack, "mode_after_reposition": d.mode}


def _land(d: Dialogue) -> list[str]:
    return d.long(mav.MAV_CMD_NAV_LAND, 0, 0, 0, NAN, 0, 0, 0)


def land_and_abort(d: Dialogue) -> Facts:
    """A landing called off by a reposition, then one to the ground."""
    facts: Facts = {"land_ack": _land(d)}
    d.listen(4)
    facts["mode_in_landing"] = d.mode
    facts["abort_ack"] = d.go(10, 0, wait=0).acks
    facts["abort_climbs_back"] = d.wait(lambda: abs(d.here.up - 20) < 1 and d.here.north > 8, 30)
    facts["mode_after_abort"] = d.mode
    d.modes, d.landed = d.modes[-1:], d.landed[-1:]
    _land(d)
    start = d.now
    facts["disarms"] = d.wait(lambda: not d.armed, 120)
    facts["from_20m_to_disarm_s"] = d.now - start
    d.listen(2)
    off = math.dist((d.here.north, d.here.east), (10, 0))
    facts |= {"mode_sequence": d.modes, "landed_sequence": d.landed}
    return facts | {"lands_where_it_was_told_to_land": off < 4}


def rtl_land(d: Dialogue) -> Facts:
    """RTL from 40 m out, all the way to disarmed."""

    def from_home() -> float:
        return math.hypot(d.here.north, d.here.east)

    d.go(40, 0)
    leg = Leg(d, 0, 0)
    d.modes, d.landed = d.modes[-1:], d.landed[-1:]
    facts: Facts = {"ack": d.long(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH)}
    d.wait(lambda: from_home() < 2.0, 120)
    facts["over_home_s"] = d.now - leg.began
    d.wait(lambda: d.landed[-1] == "ON_GROUND", 180)
    facts["on_ground_s"] = d.now - leg.began
    facts["disarms"] = d.wait(lambda: not d.armed, 60)
    facts["disarmed_s"] = d.now - leg.began
    d.listen(2)
    low = [-s.climb for s in leg.samples if 1.5 < s.up < 4 and s.climb < -0.1]
    return facts | {
        "peak_altitude_m": max(s.up for s in leg.samples),
        "peak_speed_mps": max(s.speed for s in leg.samples),
        "peak_descent_mps": -min(s.climb for s in leg.samples),
        "final_descent_mps": sum(low) / len(low) if low else None,
        "mode_sequence": d.modes,
        "landed_sequence": d.landed,
        "lands_within_3m_of_home": from_home() < 3,
    }


def takeoff_wrong_altitude(d: Dialogue) -> Facts:
    """NAV_TAKEOFF with the other flavour's altitude reference."""
    facts: Facts = {"arm_ack": d.long(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)}
    z = 20.0 if d.px4 else 20.0 + d.latest["HOME_POSITION"].altitude / 1e3
    place = (NAN, NAN) if d.px4 else (0.0, 0.0)
    facts["takeoff_ack"] = d.long(mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, *place, z)
    d.listen(15)
    facts["takes_off"] = d.here.up > 1.5
    d.wait(lambda: d.here.up > 24, 10)
    facts["exceeds_24m"] = d.here.up > 24
    if d.armed:
        _land(d)
        d.wait(lambda: not d.armed, 120)
    return facts | {"mode_sequence": d.modes}

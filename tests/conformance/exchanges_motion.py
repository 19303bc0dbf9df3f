"""Exchanges about how it moves: hops, trains of hops, reversal, speed, height, heading."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise

from tests.conformance.compare import Facts
from tests.conformance.dialogue import Dialogue, Leg
from tests.conformance.wire import mav

Place = tuple[float, float]


def _hop(d: Dialogue, metres: float) -> Facts:
    leg = d.go(metres, 0, wait=0)
    d.wait(lambda: leg.settled, 90)
    d.listen(3)
    return {"ack": leg.acks, **leg.motion(), "mode_sequence": d.modes}


def hop_20m(d: Dialogue) -> Facts:
    """A short hop from standstill."""
    return _hop(d, 20)


def hop_100m(d: Dialogue) -> Facts:
    """A long hop from standstill."""
    return _hop(d, 100)


def position_target(d: Dialogue) -> Facts:
    """POSITION_TARGET_GLOBAL_INT on a hop: the final target, or one that wanders there?"""
    leg = d.go(40, 0, wait=0)
    gaps: list[float] = []
    start = d.now
    while d.now < start + 14:
        message = d.pump()
        if message is not None and message.get_type() == "POSITION_TARGET_GLOBAL_INT":
            gaps.append(math.dist(d.metres(message.lat_int, message.lon_int), leg.target))
    last = d.latest["POSITION_TARGET_GLOBAL_INT"]
    above = last.alt - d.origin[2] / 1e3
    return {
        "sent": bool(gaps),
        "names_final_target_at_once": max(gaps[3:] or gaps) < 1.5,
        "names_final_target_at_end": gaps[-1] < 1.5,
        "rate_hz": d.rate("POSITION_TARGET_GLOBAL_INT", start),
        "coordinate_frame": last.coordinate_frame,
        "type_mask": last.type_mask,
        "altitude_is": "AMSL" if abs(above - 20) < 5 else "above home" if abs(last.alt - 20) < 5 else "other",
    }


def _off_path(place: Place, path: list[Place]) -> float:
    """Metres from a path of straight legs."""
    nearest = math.inf
    for (an, ae), (bn, be) in pairwise(path):
        length2 = (bn - an) ** 2 + (be - ae) ** 2
        along = ((place[0] - an) * (bn - an) + (place[1] - ae) * (be - ae)) / length2
        share = min(max(along, 0.0), 1.0)
        nearest = min(nearest, math.dist(place, (an + share * (bn - an), ae + share * (be - ae))))
    return nearest


def _there(leg: Leg, last: bool) -> bool:
    return leg.settled if last else leg.remaining < 5.0


def _train(d: Dialogue, corners: list[Place]) -> Facts:
    """Fly through places, sending each next one 5 m before the present one."""
    whole, sent = Leg(d, *corners[-1]), []
    accepted = True
    for corner in corners:
        leg = d.go(*corner, wait=0)
        last = corner == corners[-1]
        accepted &= bool(leg.acks) and set(leg.acks) == {"ACCEPTED"}
        sent.append(d.now)
        d.wait(partial(_there, leg, last), 60)
    d.listen(1)
    between = min(s.speed for s in whole.samples if sent[1] <= s.time <= sent[-1] + 1.0)
    path = [whole.start, *corners]
    return {
        "all_accepted": accepted,
        "arrive_s": whole.motion()["arrive_s"],
        "peak_speed_mps": max(s.speed for s in whole.samples),
        "slowest_between_targets_mps": between,
        "stops_between_targets": between < 0.5,
        "largest_path_deviation_m": max(_off_path((s.north, s.east), path) for s in whole.samples),
    }


def train_straight(d: Dialogue) -> Facts:
    """Six hops in a line: does it stop at each?"""
    return _train(d, [(20.0 * k, 0.0) for k in range(1, 7)])


def train_corners(d: Dialogue) -> Facts:
    """Six hops around right-angled corners."""
    return _train(d, [(20, 0), (20, 20), (40, 20), (40, 40), (60, 40), (60, 60)])


def reversal(d: Dialogue) -> Facts:
    """Half-way along a hop, back to the start: what does turning cost?"""
    leg = d.go(40, 0, wait=0)
    d.wait(lambda: d.here.north > 20, 40)
    at = d.here
    back = d.go(0, 0, wait=0)
    d.wait(lambda: d.here.north_speed < 0, 15)
    turned = d.now
    d.wait(lambda: back.settled, 60)
    return {
        "acks": leg.acks + back.acks,
        "speed_at_command_mps": at.speed,
        "stop_distance_m": max(s.north for s in leg.samples) - at.north,
        "until_turned_s": turned - back.began,
        "back_home_s": back.motion()["arrive_s"],
    }


def change_speed(d: Dialogue) -> Facts:
    """DO_CHANGE_SPEED, a reposition with a speed of its own, and speeds below zero."""

    def change(speed: float) -> list[str]:
        return d.long(mav.MAV_CMD_DO_CHANGE_SPEED, 1, speed, -1)

    def peak(leg: Leg) -> float:
        return float(leg.motion()["peak_speed_mps"])

    facts: Facts = {"change_speed_ack": change(3), "hop_at_3_peak_mps": peak(d.go(40, 0))}
    leg = d.go(0, 0, speed=2)
    facts |= {"param1_2_ack": leg.acks, "hop_with_param1_2_peak_mps": peak(leg)}
    facts["next_hop_without_param1_peak_mps"] = peak(d.go(40, 0))
    facts |= {"in_flight_ack": change(6), "hop_at_6_peak_mps": peak(d.go(0, 0))}
    return facts | {"negative_speed_ack": change(-2), "negative_one_ack": change(-1)}


def _level(d: Dialogue, height: float) -> bool:
    return abs(d.here.up - height) < 1.0


def altitude_step(d: Dialogue) -> Facts:
    """Ten metres up on the spot, and down again."""
    facts: Facts = {}
    for label, height, sign in (("up", 30.0, 1), ("down", 20.0, -1)):
        leg = d.go(0, 0, height=height, wait=0)
        facts[f"{label}_ack"] = leg.acks
        facts[f"{label}_reached"] = d.wait(partial(_level, d, height), 40)
        facts[f"{label}_arrive_s"] = d.now - leg.began
        d.listen(3)
        facts[f"{label}_peak_rate_mps"] = max(sign * s.climb for s in leg.samples)
    return facts


def heading(d: Dialogue) -> Facts:
    """Where the nose points after a hop with yaw NaN, and what a yaw of 2 means."""

    def points(degrees: float) -> bool:
        nose = d.latest["GLOBAL_POSITION_INT"].hdg / 100.0
        return bool(abs((nose - degrees + 180) % 360 - 180) < 15)

    d.go(0, 30)
    d.listen(1)
    facts: Facts = {"faces_east_target": points(90)}
    facts["yaw_2_ack"] = d.reposition(*d.point(0, 0), d.amsl(20), yaw=2.0)
    d.wait(lambda: math.hypot(d.here.north, d.here.east) < 1 and d.here.speed < 0.5, 40)
    d.listen(2)
    meanings = {"degrees": 2.0, "radians": math.degrees(2.0), "nothing: faces the target": 270.0}
    taken = next((meaning for meaning, degrees in meanings.items() if points(degrees)), "nothing")
    return facts | {"yaw_2_is_taken_as": taken}

"""The kinds of things that go wrong in the soak: how often each is drawn, for how long, and what it is told."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator

Options = Mapping[str, Any]


def _packets(rng: Generator) -> Options:
    rates = {"drop": 0.3, "duplicate": 0.3, "reorder": 0.3, "corrupt": 0.3, "delay_s": 0.3}
    chosen = rng.choice(list(rates), size=2, replace=False)
    return {str(name): float(rng.uniform(0.02, rates[str(name)])) for name in chosen}


def _jump(rng: Generator) -> Options:
    return {"north": float(rng.uniform(-80, 80)), "east": float(rng.uniform(-80, 80))}


def _wind(rng: Generator) -> Options:
    strength, towards = rng.uniform(3, 14), rng.uniform(0, 2 * np.pi)
    return {
        "north": float(strength * np.cos(towards)),
        "east": float(strength * np.sin(towards)),
        "gust": float(rng.uniform(0, 2)),
    }


def _sticks(rng: Generator) -> Options:
    return {"pitch": float(rng.uniform(-1, 1)), "roll": float(rng.uniform(-1, 1))}


def _push(rng: Generator) -> Options:
    return {"mode": "keep", "pitch": float(rng.choice([-0.9, 0.9]))}


def _nothing(rng: Generator) -> Options:
    return {}


_STREAMS = (
    "SYS_STATUS",
    "BATTERY_STATUS",
    "SYS_STATUS,BATTERY_STATUS",
    "GPS_RAW_INT",
    "ESTIMATOR_STATUS,EKF_STATUS_REPORT",
    "ATTITUDE",
    "EXTENDED_SYS_STATE",
    "GLOBAL_POSITION_INT",
    "HOME_POSITION",
    "RC_CHANNELS,MANUAL_CONTROL",
)
_LIES: tuple[
    tuple[str, str, float, int], ...
] = (  # message, field, value, how often (0: as long as it lasts)
    ("GLOBAL_POSITION_INT", "hdg", 65535, 0),
    ("GLOBAL_POSITION_INT", "vx", 32767, 0),
    ("GLOBAL_POSITION_INT", "time_boot_ms", 4294967295, 1),
    ("GLOBAL_POSITION_INT", "lat", 2147483647, 1),
    ("SYS_STATUS", "battery_remaining", -1, 0),
    ("ATTITUDE", "yaw", float("nan"), 0),
    ("ATTITUDE", "time_boot_ms", 4294967295, 1),
    ("EXTENDED_SYS_STATE", "landed_state", 0, 0),
    ("EXTENDED_SYS_STATE", "landed_state", 1, 0),
    ("HEARTBEAT", "type", 43, 0),
)


def _stream(rng: Generator) -> Options:
    return {"message": str(rng.choice(_STREAMS))}


def _lie(rng: Generator) -> Options:
    message, field, value, times = _LIES[int(rng.integers(len(_LIES)))]
    return {"message": message, "field": field, "value": value, "times": times}


_SHIFTS = (  # message, field, by how much in its own unit
    ("GLOBAL_POSITION_INT", "hdg", 9000.0),
    ("GLOBAL_POSITION_INT", "vx", 300.0),
    ("ATTITUDE", "yaw", 1.5),
    ("GPS_RAW_INT", "satellites_visible", -6.0),
)
_REFUSED = ("MAV_CMD_DO_REPOSITION", "MAV_CMD_DO_CHANGE_SPEED", "MAV_CMD_DO_SET_MODE")


def _shift(rng: Generator) -> Options:
    message, field, by = _SHIFTS[int(rng.integers(len(_SHIFTS)))]
    return {"message": message, "field": field, "by": by}


def _refusal(rng: Generator) -> Options:
    results = ["TEMPORARILY_REJECTED", "DENIED", "FAILED", "ACCEPTED"]
    return {"command": str(rng.choice(_REFUSED)), "result": str(rng.choice(results))}


def _metres(least: float, most: float, name: str) -> Callable[[Generator], Options]:
    """So many metres up or down."""
    return lambda rng: {name: float(rng.uniform(least, most) * rng.choice([-1.0, 1.0]))}


def _goal(rng: Generator) -> Options:
    return {"north": float(rng.uniform(20, 120)), "east": float(rng.uniform(-60, -20)), "up": 25.0}


def _velocity(rng: Generator) -> Options:
    return {"north": float(rng.uniform(-2, 2)), "east": float(rng.uniform(-2, 2))}


_CHARGE_STATES = (2, 3, 4)  # MAV_BATTERY_CHARGE_STATE: low, critical, an emergency


def _charge(rng: Generator) -> Options:
    field = {"message": "BATTERY_STATUS", "field": "charge_state"}
    return {**field, "value": float(rng.choice(_CHARGE_STATES)), "times": 0}


def _stranger(rng: Generator) -> Options:
    return {"way": str(rng.choice(["maps", "decisions", "half-open connections", "wishes"]))}


def _lying_detector(rng: Generator) -> Options:
    return {"way": str(rng.choice(["swapped", "nowhere", "far", "everywhere", "still", "pose"]))}


@dataclass(frozen=True)
class Kind:
    """How often a kind is drawn, for how long it lasts, what it is told, and whether the flight can go on after it."""

    weight: float
    seconds: tuple[float, float]
    options: Callable[[Generator], Options] = _nothing
    last: bool = False
    stops: str = ""  # who stops the aircraft by it: nothing of ours may move it until an operator says so
    named: bool = False  # and nobody can know of it before the autopilot names its target
    steady: bool = False  # the aircraft is as high as ever all the while


KINDS: dict[str, Kind] = {
    # the link
    "link_lost": Kind(2, (2, 40)),
    "packets": Kind(3, (10, 60), _packets),
    "acks_lost": Kind(1, (5, 40)),
    "garbage": Kind(1, (1, 5)),
    # the vehicle
    "not_flown": Kind(2, (5, 40)),
    "frozen": Kind(1, (2, 30)),
    "gps_lost": Kind(2, (1, 8)),
    "gps_jump": Kind(2, (3, 30), _jump),
    "ekf_bad": Kind(1, (1, 6)),
    "wind": Kind(2, (15, 60), _wind),
    "battery_drains": Kind(0.5, (30, 60), lambda rng: {"percent_per_s": float(rng.uniform(0.2, 0.6))}),
    "battery_critical": Kind(
        0.5, (10, 20), lambda rng: {"action": str(rng.choice(["return", "land", "warn"]))}, last=True
    ),
    "charge_state": Kind(0.5, (10, 20), _charge, last=True),
    "battery": Kind(0.5, (0, 0), lambda rng: {"percent": float(rng.uniform(10, 60))}),
    "reboot": Kind(0.5, (0, 0), last=True),
    # who is in charge
    "pilot": Kind(3, (2, 30), _sticks),
    "pilot_sticks": Kind(1, (2, 10), _push),
    "failsafe": Kind(1, (3, 10)),
    "fence_breach": Kind(1, (3, 10)),
    # others on the wire
    "second_autopilot": Kind(1, (10, 60)),
    "gcs_heartbeat": Kind(0.5, (10, 60)),
    "camera_heartbeat": Kind(0.5, (10, 60)),
    # the detector and the door
    "detector_silent": Kind(2, (5, 40)),
    "detector_repeats": Kind(1, (5, 40)),
    "bad_requests": Kind(1, (2, 10)),
    "strangers": Kind(1, (5, 30), _stranger),
    # the operator
    "operator_holds": Kind(1, (2, 20)),
    # news from the field
    "clue": Kind(1, (5, 20), lambda rng: {"bayes_factor": float(rng.choice([0.1, 20.0]))}),
    "exclude": Kind(1, (20, 60)),
    # our own process
    "stall": Kind(2, (0, 0), lambda rng: {"wall_s": float(rng.uniform(0.3, 5.0))}),
    "killed": Kind(2, (0, 0), lambda rng: {"go_on": bool(rng.random() < 0.4)}),
    "journal_locked": Kind(1, (5, 40)),
    "journal_slow": Kind(1, (10, 40), stops="the operator's hold"),
    "hangup": Kind(0.5, (1, 5)),
    # what the vehicle tells
    "one_way": Kind(1, (2, 20), lambda rng: {"carries": str(rng.choice(["down", "up"]))}),
    "stream_stops": Kind(2, (5, 40), _stream),
    "field_shifts": Kind(1, (5, 30), _shift),
    "command_refused": Kind(1, (5, 30), _refusal),
    "stream_freezes": Kind(2, (5, 40), _stream),
    "field": Kind(2, (5, 30), _lie),
    "second_battery": Kind(0.5, (10, 40), lambda rng: {"percent": float(rng.uniform(50, 90))}),
    "second_gps": Kind(0.5, (10, 40), lambda rng: {"fix": int(rng.choice([0, 1, 3]))}),
    "second_estimator": Kind(0.5, (10, 40), lambda rng: {"flags": 831}),
    "battery_unknown": Kind(1, (60, 90)),
    # what heights and places are counted from
    "amsl_corrected": Kind(1, (15, 40), _metres(7, 10, "metres"), steady=True),
    "home_moved": Kind(1, (15, 40), _metres(7, 10, "up"), steady=True),
    "home_datum": Kind(1, (15, 40), _metres(20, 47, "metres"), steady=True),
    "origin_moved": Kind(0.5, (10, 40), _metres(10, 100, "north"), steady=True),
    "distance_sensor": Kind(0.5, (10, 40), steady=True),
    "terrain_report": Kind(0.5, (10, 40), steady=True),
    "dead_reckoning": Kind(
        1, (4, 12), lambda rng: {"reckons_s": 30.0, "drift_mps": float(rng.uniform(0, 0.5))}
    ),
    # others who take it
    "gcs_goes": Kind(1, (15, 25), _goal, stops="a ground station's target", named=True),
    "gcs_altitude": Kind(
        1, (15, 25), lambda rng: {"by": 20.0}, stops="a ground station's altitude", named=True
    ),
    "gcs_speed": Kind(
        1, (10, 20), lambda rng: {"mps": float(rng.uniform(1, 6))}, stops="a ground station's speed"
    ),
    "gcs_pauses": Kind(1, (10, 20), stops="a ground station's pause", named=True),
    "gcs_velocity": Kind(1, (10, 20), _velocity, stops="a ground station's velocity", named=True),
    "second_service": Kind(
        1, (15, 40), lambda rng: {"every_s": 5.0, "component": int(rng.choice([191, 192]))}
    ),
    "failsafe_hold": Kind(1, (8, 12), lambda rng: {"then": str(rng.choice(["return", "recovers"]))}),
    "pilot_hold": Kind(1, (5, 15), lambda rng: {"way": str(rng.choice(["again", "flick"]))}),
    # a detector that lies, a clock that steps, a process that dies while a person has the aircraft
    "detector_lies": Kind(1, (5, 40), _lying_detector),
    "clock_steps": Kind(1, (5, 10), lambda rng: {"by_s": float(rng.choice([-45.0, 90.0, 3.5e7]))}),
    "killed_while_held": Kind(1, (10, 20), stops="the operator's hold"),
    "killed_while_yielded": Kind(1, (10, 20), stops="the pilot"),
}


OF_THE_MOCK = {"pilot_sticks": "pilot", "dead_reckoning": "gps_lost", "charge_state": "field"}
"""What the mock calls those of its kinds that have another name here."""

AT_BOOT: dict[str, Options] = {
    "none": {},
    "mavlink1": {"kind": "mavlink1", "at": 0.0},
    "no_landed_state": {"kind": "no_message", "message": "EXTENDED_SYS_STATE", "at": 0.0},
    "generic_multirotor": {"kind": "field", "message": "HEARTBEAT", "field": "type", "value": 43, "at": 0.0},
    "landed_state_sticks": {
        "kind": "field",
        "message": "EXTENDED_SYS_STATE",
        "field": "landed_state",
        "value": 3,
        "after_takeoff": 1.0,
    },
    "arming_refused": {"kind": "arming_refused", "at": 0.0, "seconds": 20.0},
    "pilot_arms_with_it": {"kind": "pilot", "after_arming": 0.0, "seconds": 2.0},
    "unknown_battery": {"kind": "battery_unknown", "at": 0.0, "seconds": 30.0},
    "one_way_from_the_start": {"kind": "one_way", "at": 0.0, "seconds": 20.0},
    "link_lost_in_the_climb": {"kind": "link_lost", "after_arming": 2.0, "seconds": 8.0},
    "gps_lost_in_the_climb": {"kind": "gps_lost", "after_arming": 3.0, "seconds": 6.0},
    "pilot_before_the_launch": {"kind": "pilot", "at": 0.0, "seconds": 25.0},
    "pilot_in_the_climb": {"kind": "pilot", "after_arming": 3.0, "seconds": 4.0},
}
"""What is so from the start, as the mock's file of faults has it."""

WITH_A_HOLD = frozenset({"operator_holds", "journal_slow", "killed_while_held", "killed_while_yielded"})
"""Kinds that stop the aircraft themselves, or let its pilot do so, before anything goes wrong."""

GROUNDS: dict[str, str] = {"no_landed_state": "does not tell whether it is in the air"}
"""With these the aircraft must not leave the ground, and the service must say why: these words."""

EVERY: frozenset[str] = frozenset({*KINDS, *AT_BOOT})
"""All of them."""

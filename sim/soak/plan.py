"""What goes wrong in a flight, and when: drawn from the flight's seed, so that a seed is a flight.

Times are in seconds of the vehicle's clock, but for those of our own process (`wall_s`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.random import Generator

Options = Mapping[str, Any]


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong: `wait_s` after the last one was over, for `seconds`."""

    kind: str
    wait_s: float
    seconds: float
    options: Options = field(default_factory=dict)


@dataclass(frozen=True)
class Plan:
    """One flight."""

    seed: int
    flavor: str
    target: tuple[float, float] | None
    faults: tuple[Fault, ...]


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


@dataclass(frozen=True)
class Kind:
    """How often a kind is drawn, for how long it lasts, what it is told, and whether the flight can go on after it."""

    weight: float
    seconds: tuple[float, float]
    options: Callable[[Generator], Options] = _nothing
    last: bool = False


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
    # the operator
    "operator_holds": Kind(1, (2, 20)),
    # our own process
    "stall": Kind(2, (0, 0), lambda rng: {"wall_s": float(rng.uniform(0.3, 5.0))}),
    "killed": Kind(2, (0, 0)),
}


def draw_plan(seed: int, ground: Mapping[str, float], faults: int) -> Plan:
    """The flight of a seed: `faults` things that go wrong over a ground (south, west, north, east in degrees)."""
    rng = np.random.default_rng(seed)
    flavor = str(rng.choice(["px4", "ardupilot"]))
    target = None
    if rng.random() < 0.2:
        lat, lon = rng.uniform((ground["south"], ground["west"]), (ground["north"], ground["east"]))
        target = (float(lat), float(lon))
    names = list(KINDS)
    weights = np.array([KINDS[name].weight for name in names])
    drawn: list[Fault] = []
    for _ in range(faults):
        name = str(rng.choice(names, p=weights / weights.sum()))
        kind = KINDS[name]
        wait, lasts = float(rng.uniform(4, 25)), float(rng.uniform(*kind.seconds))
        drawn.append(Fault(name, wait, lasts, kind.options(rng)))
        if kind.last:
            break
    return Plan(seed, flavor, target, tuple(drawn))

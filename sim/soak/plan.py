"""What goes wrong in a flight, and when: drawn from the flight's seed, so that a seed is a flight.

Times are in seconds of the vehicle's clock, but for those of our own process (`wall_s`).
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, field, replace

import numpy as np

from sim.soak.kinds import AT_BOOT, EVERY, GROUNDS, KINDS, WITH_A_HOLD, Options

NUMBERS, SHARES = (1, 2, 3), (0.7, 0.15, 0.15)
"""How many aircraft fly, and how often."""
SEARCH, HOLD, HOME = "search", "hold", "home"
"""When a fault comes: while the aircraft searches, while an operator holds it, on its way home."""
_HELD, _HOMEWARD = 0.15, 0.4
"""How many of the faults come during a hold, and how many flights have their last one on the way home."""


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong: `wait_s` after the last one was over, for `seconds`, and in what `moment`."""

    kind: str
    wait_s: float
    seconds: float
    options: Options = field(default_factory=dict)
    moment: str = SEARCH


@dataclass(frozen=True)
class Plan:
    """One flight."""

    seed: int
    flavor: str
    target: tuple[float, float] | None
    faults: tuple[Fault, ...]
    at_boot: str = "none"  # what is so from the start
    hill: bool = False  # in the field, and a height model of it
    aircraft: int = 1  # that fly the search; the faults befall the first


def draw_plan(seed: int, ground: Mapping[str, float], faults: int, kinds: Set[str] = EVERY) -> Plan:
    """The flight of a seed: `faults` things that go wrong over a ground (south, west, north, east in degrees).

    Only `kinds` are drawn.
    """
    rng = np.random.default_rng(seed)
    flavor = str(rng.choice(["px4", "ardupilot"]))
    target = None
    if rng.random() < 0.2:
        target = _place(rng, ground)
    names = [name for name in KINDS if name in kinds]
    weights = np.array([KINDS[name].weight for name in names])
    drawn: list[Fault] = []
    for _ in range(faults if names else 0):
        name = str(rng.choice(names, p=weights / weights.sum()))
        kind = KINDS[name]
        wait, lasts = float(rng.uniform(4, 25)), float(rng.uniform(*kind.seconds))
        held = rng.random() < _HELD and name not in WITH_A_HOLD
        drawn.append(Fault(name, wait, lasts, kind.options(rng), HOLD if held else SEARCH))
        if kind.last:
            break
    if drawn and rng.random() < _HOMEWARD and drawn[-1].kind not in WITH_A_HOLD:
        drawn[-1] = replace(drawn[-1], moment=HOME)
    if target is None and any(fault.kind in ("detector_lies", "clock_steps") for fault in drawn):
        target = _place(rng, ground)  # so that there is something to be wrong about
    at_boot, hill = _at_boot(rng, kinds), bool(rng.random() < 0.5)
    number = 1 if at_boot in GROUNDS else int(rng.choice(NUMBERS, p=SHARES))
    return Plan(seed, flavor, target, tuple(drawn), at_boot, hill, number)


def _place(rng: np.random.Generator, ground: Mapping[str, float]) -> tuple[float, float]:
    lat, lon = rng.uniform((ground["south"], ground["west"]), (ground["north"], ground["east"]))
    return float(lat), float(lon)


def _at_boot(rng: np.random.Generator, kinds: Set[str]) -> str:
    """Half of all flights begin as they should, unless only such are wanted that do not."""
    odd = [name for name in AT_BOOT if name in kinds and name != "none"]
    if not odd or ("none" in kinds and rng.random() < 0.5):
        return "none"
    return str(rng.choice(odd))

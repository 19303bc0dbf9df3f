"""What is known of the batteries together: the lowest of all, and unknown when one of them has fallen silent.

SYS_STATUS speaks of the first battery too, so either of the two messages may be missing. A further battery that has
told its level, and does not any longer, makes the level of all unknown: it may be the lowest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

CHARGE_STATES = ("", "ok", "low", "critical", "emergency", "failed", "unhealthy", "charging")
"""MAV_BATTERY_CHARGE_STATE."""


@dataclass(frozen=True, slots=True)
class Battery:
    """One battery as one message has told it; None: unknown."""

    number: int = 0
    percent: float | None = None
    voltage_v: float | None = None
    current_a: float | None = None
    consumed_mah: float | None = None
    charge_state: int = 0
    """MAV_BATTERY_CHARGE_STATE; 0: not told."""
    had_percent: bool = False
    """It has told its level at least once."""
    old: bool = False
    """Told too long ago to be believed."""


@dataclass(frozen=True, slots=True)
class Charge:
    """All batteries together."""

    percent: float | None = None
    voltage_v: float | None = None
    current_a: float | None = None
    consumed_mah: float | None = None
    state: str = ""


def together(told: Iterable[Battery]) -> Charge:
    """The lowest level and voltage, the sum of the currents, the worst state."""
    everything = list(told)
    fresh = [battery for battery in everything if not battery.old]
    lost = any(
        battery.had_percent and (battery.old or battery.percent is None)
        for battery in everything
        if battery.number > 0
    )
    percents = [battery.percent for battery in fresh if battery.percent is not None]
    voltages = [battery.voltage_v for battery in fresh if battery.voltage_v is not None]
    states = [battery.charge_state for battery in fresh if battery.charge_state < 7]
    return Charge(
        percent=None if lost or not percents else min(percents),
        voltage_v=min(voltages, default=None),
        current_a=_sum(fresh, "current_a"),
        consumed_mah=_sum(fresh, "consumed_mah"),
        state=CHARGE_STATES[max(states, default=0)],
    )


def _sum(batteries: list[Battery], name: str) -> float | None:
    """Of what each battery says once: the first is told by two messages, of which the larger counts."""
    each: dict[int, float] = {}
    for battery in batteries:
        value: float | None = getattr(battery, name)
        if value is not None:
            each[battery.number] = max(value, each.get(battery.number, 0.0))
    return sum(each.values()) if each else None

"""Faults: what can go wrong in flight, from a TOML file or told over the control socket.

A file has one `[[fault]]` table for each:

    [[fault]]
    kind = "gps_lost"
    at = 90.0            # seconds after boot, or `after_takeoff = 20.0`
    seconds = 15.0       # then it is over; without it, it stays

`KINDS` says which kinds there are and what else each can be told.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sim.autopilot.fault_kinds import KINDS, Options

if TYPE_CHECKING:
    from sim.autopilot.core import Autopilot

_TIMES = ("at", "after_takeoff", "seconds")


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: its kind, when it begins (None: now) and for how long, and what it was told besides."""

    kind: str
    options: Options
    at: float | None = None
    after_takeoff: float | None = None
    seconds: float | None = None

    @staticmethod
    def of(table: Mapping[str, Any]) -> Fault:
        """Read a fault from a table; ValueError says what is wrong with it."""
        kind = table.get("kind")
        if not isinstance(kind, str) or kind not in KINDS:
            raise ValueError(f"no fault of kind {kind!r}; there are: {', '.join(sorted(KINDS))}")
        defaults = KINDS[kind].options
        options: Options = dict(defaults)
        times: dict[str, float] = {}
        for key, value in table.items():
            if key == "kind":
                continue
            if key in _TIMES:
                times[key] = float(_checked(kind, key, value, 0.0))
            elif key in defaults:
                options[key] = _checked(kind, key, value, defaults[key])
                choices = KINDS[kind].choices.get(key)
                if choices is not None and value not in choices:
                    raise ValueError(f"'{key}' of a fault of kind '{kind}' is one of {', '.join(choices)}")
            else:
                known = ", ".join([*defaults, *_TIMES])
                raise ValueError(f"a fault of kind '{kind}' has no '{key}'; it has: {known}")
        return Fault(kind, options, **times)


def _checked(kind: str, key: str, value: Any, default: Any) -> Any:
    wanted = (int, float) if isinstance(default, float) else type(default)
    if isinstance(value, bool) or not isinstance(value, wanted):
        raise ValueError(f"'{key}' of a fault of kind '{kind}' should be like {default!r}, not {value!r}")
    return float(value) if isinstance(default, float) else value


def read_faults(path: Path) -> list[Fault]:
    """The faults of a TOML file; ValueError names the file and what is wrong."""
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8")).get("fault", [])
        return [Fault.of(table) for table in tables]
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, AttributeError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from None


@dataclass(slots=True)
class _Active:
    fault: Fault
    until: float | None
    step: Callable[[], None] | None
    undo: Callable[[], None] | None


class Faults:
    """The faults of one mock: those to come and those that are there."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._coming: list[Fault] = []
        self._active: list[_Active] = []
        self._took_off_at: float | None = None
        self._reboot_at: float | None = None

    @property
    def active(self) -> list[str]:
        """The kinds that are there now."""
        return [each.fault.kind for each in self._active]

    def add(self, fault: Fault) -> None:
        """Let a fault come when its time comes, or now."""
        if fault.at is None and fault.after_takeoff is None:
            self._begin(fault)
        else:
            self._coming.append(fault)

    def clear(self, kind: str | None = None) -> None:
        """End the faults of a kind, or all."""
        self._coming = [each for each in self._coming if kind not in (None, each.kind)]
        for each in [each for each in self._active if kind in (None, each.fault.kind)]:
            self._end(each)

    def reboot_soon(self) -> None:
        """Reboot once the acknowledgement is out."""
        self._reboot_at = self._autopilot.clock + 0.5

    def tick(self) -> None:
        """Ten times a second: begin, go on, end."""
        autopilot, now = self._autopilot, self._autopilot.clock
        if self._reboot_at is not None and now >= self._reboot_at:
            self._reboot_at = None
            autopilot.reboot()
        if self._took_off_at is None and autopilot.vehicle.flying:
            self._took_off_at = now
        for fault in tuple(self._coming):
            since, wait = (
                (0.0, fault.at) if fault.at is not None else (self._took_off_at, fault.after_takeoff)
            )
            if since is not None and wait is not None and now >= since + wait:
                self._coming.remove(fault)
                self._begin(fault)
        for each in tuple(self._active):
            if each.until is not None and now >= each.until:
                self._end(each)
            elif each.step is not None:
                each.step()

    def _begin(self, fault: Fault) -> None:
        autopilot, kind = self._autopilot, KINDS[fault.kind]
        kind.begin(autopilot, fault.options)
        step = kind.step
        undo = kind.end
        if step is None and undo is None:
            return  # done with at once
        until = None if fault.seconds is None else autopilot.clock + fault.seconds
        self._active.append(
            _Active(
                fault,
                until,
                None if step is None else lambda: step(autopilot, fault.options),
                None if undo is None else lambda: undo(autopilot, fault.options),
            )
        )

    def _end(self, each: _Active) -> None:
        self._active.remove(each)
        if each.undo is not None:
            each.undo()


__all__ = ["KINDS", "Fault", "Faults", "read_faults"]

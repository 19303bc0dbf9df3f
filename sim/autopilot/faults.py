"""Faults: what can go wrong in flight, from a TOML file or told over the control socket.

A file has one `[[fault]]` table for each:

    [[fault]]
    kind = "gps_lost"
    at = 90.0            # seconds after boot, or `after_arming = 0.0`, or `after_takeoff = 20.0`
    seconds = 15.0       # then it is over; without it, it stays

`roisearch-sim autopilot --list-faults` says which kinds there are and what else each can be told.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim.autopilot.fault_kinds import KINDS, Options
from sim.autopilot.host import Host

_TIMES = ("at", "after_arming", "after_takeoff", "seconds")


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: its kind, when it begins (None: now) and for how long, and what it was told besides."""

    kind: str
    options: Options
    at: float | None = None
    after_arming: float | None = None
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
        KINDS[kind].check(options)
        return Fault(kind, options, **times)


def _checked(kind: str, key: str, value: Any, default: Any) -> Any:
    wanted = (int, float) if isinstance(default, float) else type(default)
    if isinstance(value, bool) or not isinstance(value, wanted):
        raise ValueError(f"'{key}' of a fault of kind '{kind}' should be like {default!r}, not {value!r}")
    return float(value) if isinstance(default, float) else value


def describe() -> str:
    """Every kind of fault with what it can be told, for whoever writes a file of them."""
    lines = [
        __doc__.partition("\n\n`")[0].strip(),
        "",
        "The kinds, with what each can be told and the defaults:",
    ]
    for name, kind in sorted(KINDS.items()):
        lines += ["", f"{name}: {kind.about}"]
        for option, default in kind.options.items():
            choices = f"  # {' | '.join(kind.choices[option])}" if option in kind.choices else ""
            shown = str(default) if isinstance(default, int | float) else f'"{default}"'
            lines.append(f"    {option} = {shown}{choices}")
    return "\n".join(lines)


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

    def __init__(self, autopilot: Host) -> None:
        self._autopilot = autopilot
        self._coming: list[Fault] = []
        self._active: list[_Active] = []
        self._armed_at: float | None = None
        self._took_off_at: float | None = None

    @property
    def active(self) -> list[str]:
        """The kinds that are there now."""
        return [each.fault.kind for each in self._active]

    def add(self, fault: Fault) -> None:
        """Let a fault come when its time comes, or now."""
        if fault.at is fault.after_arming is fault.after_takeoff is None:
            self._begin(fault)
        else:
            self._coming.append(fault)

    def clear(self, kind: str | None = None) -> None:
        """End the faults of a kind, or all."""
        self._coming = [each for each in self._coming if kind not in (None, each.kind)]
        for each in [each for each in self._active if kind in (None, each.fault.kind)]:
            self._end(each)

    def tick(self) -> None:
        """Ten times a second: begin, go on, end."""
        autopilot, now = self._autopilot, self._autopilot.clock
        if self._armed_at is None and autopilot.vehicle.armed:
            self._armed_at = now
        if self._took_off_at is None and autopilot.vehicle.flying:
            self._took_off_at = now
        for fault in tuple(self._coming):
            if self._is_due(fault, now):
                self._coming.remove(fault)
                self._begin(fault)
        for each in tuple(self._active):
            if each.until is not None and now >= each.until:
                self._end(each)
            elif each.step is not None:
                each.step()

    def _is_due(self, fault: Fault, now: float) -> bool:
        waits = (
            (0.0, fault.at),
            (self._armed_at, fault.after_arming),
            (self._took_off_at, fault.after_takeoff),
        )
        return any(since is not None and wait is not None and now >= since + wait for since, wait in waits)

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

"""When a fact about the mock agrees with the same fact about the real autopilot.

The ending of a fact's name is its unit and says how exact two flights of one real vehicle are: a rate
(`_hz`) within a factor of two, the others within an absolute or a relative slack, whichever is wider.
A fact without a unit (acknowledgements, sequences, flags) must be equal.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

RECORDS = Path(__file__).parent / "records"
SLACK: dict[str, tuple[float, float]] = {  # unit: (absolute, share of the recorded value)
    "_mps2": (1.0, 0.50),
    "_mps": (0.5, 0.25),
    "_m": (1.0, 0.30),
    "_s": (1.5, 0.30),
}

Facts = dict[str, Any]


def record(flavor: str) -> dict[str, Facts]:
    """The facts of the real autopilot by exchange, in the order they were recorded."""
    text = (RECORDS / f"{flavor}.json").read_text(encoding="utf-8")
    exchanges: dict[str, Facts] = json.loads(text)["exchanges"]
    return exchanges


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def agrees(name: str, real: Any, mock: Any) -> bool:
    """Is the mock's value of a fact as good as the real one's?"""
    if not (_is_number(real) and _is_number(mock)):
        return bool(real == mock)
    if name.endswith("_hz"):
        return bool(max(real, mock) <= 0.05 if min(real, mock) <= 0 else 0.5 <= mock / real <= 2.0)
    for unit, (absolute, share) in SLACK.items():
        if name.endswith(unit):
            return bool(abs(mock - real) <= max(absolute, share * abs(real)) + 1e-9)
    return bool(real == mock)


def differences(real: Mapping[str, Any], mock: Mapping[str, Any]) -> Iterator[str]:
    """One line for each recorded fact that the mock lacks or gets wrong."""
    for name, value in real.items():
        if name not in mock:
            yield f"{name}: missing, the real one has {value!r}"
        elif not agrees(name, value, mock[name]):
            yield f"{name}: {mock[name]!r}, the real one has {value!r}"

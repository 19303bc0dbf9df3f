"""What a mock's own messages go through on their way out: here faults change them, hold them still or swallow them."""

from __future__ import annotations

import copy
import struct
from collections.abc import Callable
from typing import Any

from sim.autopilot.dialect import M

Rule = Callable[[Any], Any]
"""From a message to what is said instead of it, or None: nothing. A rule never changes the message it is given."""

_NAMES = {cls.msgname: cls for cls in M.mavlink_map.values()}
_CODES = {"uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I", "int32_t": "i",
          "uint64_t": "Q", "int64_t": "q"}  # fmt: skip
_STAMPS = ("time_boot_ms", "time_usec", "time_unix_usec")


class Voice:
    """The rules that are in force, each under the key of whoever laid it down."""

    def __init__(self) -> None:
        self._rules: dict[object, Rule] = {}

    def put(self, key: object, rule: Rule) -> None:
        """Let a rule be in force."""
        self._rules[key] = rule

    def drop(self, key: object) -> None:
        """Take a rule back."""
        self._rules.pop(key, None)

    def utter(self, message: Any) -> Any:
        """What is said instead of a message; None: nothing."""
        for rule in tuple(self._rules.values()):
            message = rule(message)
            if message is None:
                return None
        return message


def names_of(text: str) -> frozenset[str]:
    """The messages in a list with commas; ValueError names one that does not exist."""
    names = frozenset(each.strip() for each in text.split(","))
    if unknown := sorted(names - set(_NAMES)):
        raise ValueError(f"MAVLink has no message '{unknown[0]}'")
    return names


def number_of(name: str) -> int:
    """The number of a message."""
    return int(_NAMES[name].id)


def fitting(name: str, field: str, value: float) -> float:
    """A value as a field of a message can carry it; ValueError says why it cannot."""
    (message,) = names_of(name)
    fields = dict(zip(_NAMES[message].fieldnames, _NAMES[message].fieldtypes, strict=True))
    kind = fields.get(field)
    if kind is None:
        raise ValueError(f"{message} has no field '{field}'; it has: {', '.join(fields)}")
    if kind in ("float", "double"):
        return value
    try:
        whole = int(value)
        struct.pack(f"<{_CODES[kind]}", whole)
    except (KeyError, ValueError, OverflowError, struct.error):
        raise ValueError(f"{message}.{field} is a {kind} and cannot be {value:g}") from None
    return whole


def in_mavlink1(message: Any, codec: Any) -> bytes | None:
    """The frame of a message in the first version of the protocol; None when it does not exist there."""
    from pymavlink.dialects.v10 import ardupilotmega as old  # only here: it takes a moment to load

    cls = getattr(old, type(message).__name__, None)
    if cls is None:
        return None
    writer = old.MAVLink(None, srcSystem=codec.srcSystem, srcComponent=codec.srcComponent)
    writer.seq = codec.seq
    fields = (getattr(message, field) for field in cls.fieldnames)
    frame: bytes = cls(*(each.encode() if isinstance(each, str) else each for each in fields)).pack(writer)
    return frame


def silence(names: frozenset[str]) -> Rule:
    """Some messages are not sent."""
    return lambda message: None if message.get_type() in names else message


def still(names: frozenset[str], *, stamps_move: bool) -> Rule:
    """Some messages say for ever what they say now; their time stamps may go on."""
    kept: dict[str, Any] = {}

    def rule(message: Any) -> Any:
        name = message.get_type()
        if name not in names:
            return message
        old = copy.copy(kept.setdefault(name, message))
        if stamps_move:
            for stamp in _STAMPS:
                if hasattr(message, stamp):
                    setattr(old, stamp, getattr(message, stamp))
        return old

    return rule


def replaced(name: str, change: Callable[[Any], None], *, times: int = 0) -> Rule:
    """A message is changed; `times`: only so often, 0 always."""
    left = times

    def rule(message: Any) -> Any:
        nonlocal left
        if message.get_type() != name or left < 0:
            return message
        if times:
            left -= 1
            if left == 0:
                left = -1
        other = copy.copy(message)
        change(other)
        return other

    return rule


def put_field(field: str, value: float) -> Callable[[Any], None]:
    """Put a value into a field; into every place of an array."""

    def change(message: Any) -> None:
        old = getattr(message, field)
        setattr(message, field, [value] * len(old) if isinstance(old, list) else value)

    return change


def shift_field(field: str, by: float) -> Callable[[Any], None]:
    """Add to a field."""
    return lambda message: setattr(
        message, field, type(getattr(message, field))(getattr(message, field) + by)
    )

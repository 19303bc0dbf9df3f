"""Parameters and their protocol's encoding."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from sim.autopilot.dialect import M

REAL32: int = M.MAV_PARAM_TYPE_REAL32
INT32: int = M.MAV_PARAM_TYPE_INT32
INT16: int = M.MAV_PARAM_TYPE_INT16
INT8: int = M.MAV_PARAM_TYPE_INT8


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter with its default value; `kind` is MAV_PARAM_TYPE."""

    name: str
    kind: int
    value: float


def real(name: str, value: float) -> Parameter:
    """A REAL32 parameter."""
    return Parameter(name, REAL32, value)


def whole(name: str, value: int, kind: int = INT32) -> Parameter:
    """An integer parameter."""
    return Parameter(name, kind, value)


class ParameterStore:
    """All parameters in the order of their names, which gives each its index."""

    def __init__(self, table: Sequence[Parameter]) -> None:
        self._table = sorted(table, key=lambda each: each.name)
        self._index = {each.name: k for k, each in enumerate(self._table)}
        self._values = [each.value for each in self._table]

    def __len__(self) -> int:
        return len(self._table)

    def index(self, name: str) -> int | None:
        """Index of a name; None if there is no such parameter."""
        return self._index.get(name)

    def at(self, index: int) -> Parameter:
        """The parameter at an index with its present value."""
        each = self._table[index]
        return Parameter(each.name, each.kind, self._values[index])

    def __getitem__(self, name: str) -> float:
        return self._values[self._index[name]]

    def set(self, name: str, value: float) -> bool:
        """Change a value; True if it is another one than before."""
        index = self._index[name]
        changed = self._values[index] != value
        self._values[index] = value
        return changed


def bits_to_whole(value: float) -> int:
    """The integer whose 32 bits were sent in a float field."""
    number: int = struct.unpack("<i", struct.pack("<f", value))[0]
    return number


def whole_to_bits(value: int) -> float:
    """An integer's 32 bits as the float that carries them."""
    number: float = struct.unpack("<f", struct.pack("<i", value))[0]
    return number

"""The JSON body of a journal row, read field by field: what is missing or of another type is an error that names it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from service.errors import shown
from service.geometry import Cell


@dataclass(frozen=True)
class Body:
    """The fields of a JSON object. Every reader raises ValueError when its field is not what it reads."""

    fields: Mapping[str, Any]

    @classmethod
    def of(cls, value: object) -> Body:
        """The body that a JSON value is."""
        if not isinstance(value, Mapping):
            raise ValueError(f"{shown(value)} has no fields")
        return cls(value)

    def get(self, name: str, default: object = None) -> Any:
        """A field as it is, or `default` when it is missing."""
        return self.fields.get(name, default)

    def text(self, name: str) -> str:
        """A text."""
        value = self._field(name)
        if not isinstance(value, str):
            raise _wrong(name, value, "a text")
        return str(value)

    def text_or_none(self, name: str) -> str | None:
        """A text, or None when it is missing or null."""
        return None if self.fields.get(name) is None else self.text(name)

    def number(self, name: str) -> float:
        """A number."""
        return _number(name, self._field(name))

    def number_or_none(self, name: str) -> float | None:
        """A number, or None when it is missing or null."""
        return None if self.fields.get(name) is None else self.number(name)

    def count_or_none(self, name: str) -> int | None:
        """A whole number, or None when it is missing or null."""
        value = self.number_or_none(name)
        if value is not None and value != int(value):
            raise _wrong(name, value, "a whole number")
        return None if value is None else int(value)

    def count(self, name: str) -> int:
        """A whole number."""
        value = self.count_or_none(name)
        if value is None:
            raise _wrong(name, None, "a whole number")
        return value

    def flag(self, name: str) -> bool:
        """True or false."""
        value = self._field(name)
        if not isinstance(value, bool):
            raise _wrong(name, value, "true or false")
        return value

    def numbers(self, name: str) -> tuple[float, ...]:
        """A list of numbers."""
        return tuple(_number(name, each) for each in self._list(name))

    def rows(self, name: str) -> list[tuple[float, ...]]:
        """A list of lists of numbers."""
        return [Body({name: each}).numbers(name) for each in self._list(name)]

    def texts(self, name: str) -> list[str]:
        """A list of texts."""
        return [Body({name: each}).text(name) for each in self._list(name)]

    def cell(self, name: str) -> Cell:
        """A cell of the grid: row and column."""
        return _cell(name, self._field(name))

    def cells(self, name: str) -> list[Cell]:
        """A list of cells."""
        return [_cell(name, each) for each in self._list(name)]

    def place_or_none(self, name: str) -> tuple[float, float] | None:
        """Latitude and longitude, or None when it is missing or null."""
        if self.fields.get(name) is None:
            return None
        lat, lon = self.numbers(name)
        return lat, lon

    def body(self, name: str) -> Body:
        """An object."""
        return Body.of(self._field(name))

    def body_or_none(self, name: str) -> Body | None:
        """An object, or None when it is missing or null."""
        return None if self.fields.get(name) is None else self.body(name)

    def bodies(self, name: str) -> list[Body]:
        """A list of objects; empty when it is missing."""
        return [Body.of(each) for each in self._list(name)] if name in self.fields else []

    def _field(self, name: str) -> Any:
        if name not in self.fields:
            raise ValueError(f"it has no {name}")
        return self.fields[name]

    def _list(self, name: str) -> list[Any]:
        value = self._field(name)
        if not isinstance(value, list | tuple):
            raise _wrong(name, value, "a list")
        return list(value)


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _wrong(name, value, "a number")
    return float(value)


def _cell(name: str, value: object) -> Cell:
    match value:
        case [int(row), int(col)] | (int(row), int(col)):
            return row, col
    raise _wrong(name, value, "a cell")


def _wrong(name: str, value: object, right: str) -> ValueError:
    return ValueError(f"its {name} is {shown(value)}, not {right}")

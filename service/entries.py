"""The rows of a run where they stand in its journal: numbered, timed, of an aircraft, and understood.

A kind that is not known is an `UnknownRow`, which nobody has to mind; a body that is not what its kind has is damage,
and is refused in one sentence that names the row.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from service.config import ONLY
from service.errors import BadInput
from service.journal import Row, read_last, read_rows
from service.rowbody import Body
from service.rows import KnownRow

AIRCRAFT = "aircraft"
"""The field with the name of a row's aircraft."""
_BY_KIND: dict[str, type[KnownRow]] = {each.kind: each for each in get_args(KnownRow)}


@dataclass(frozen=True)
class UnknownRow:
    """A row of a kind that this version does not know."""

    kind: str
    fields: Mapping[str, Any]

    def body(self) -> dict[str, Any]:
        return dict(self.fields)


@dataclass(frozen=True)
class Entry:
    """A row where it stands in its journal: its number, when it was written (seconds since the epoch), what it says,
    and which aircraft it is of; empty: of the only one, or of none."""

    seq: int
    time: float
    said: KnownRow | UnknownRow
    aircraft: str = ""


@dataclass(frozen=True)
class AircraftRow:
    """A row of one of several aircraft, as it goes to the journal: the same with its name."""

    said: KnownRow
    aircraft: str

    @property
    def kind(self) -> str:
        """Of the row."""
        return self.said.kind

    def body(self) -> dict[str, Any]:
        return {**self.said.body(), AIRCRAFT: self.aircraft}


def of_aircraft(said: KnownRow, aircraft: str) -> KnownRow | AircraftRow:
    """A row with the name of its aircraft; as it is where there is only one, which has no name."""
    return AircraftRow(said, aircraft) if aircraft else said


def of_whom(aircraft: str, first: str) -> str:
    """The name of the aircraft that rows with this name are of, where the first one is called `first`: rows of a time
    when that flew alone have none, and where that is how it flies now, it was the first by number beside others."""
    return first if not aircraft or (not first and aircraft == ONLY) else aircraft


@contextlib.contextmanager
def understanding(journal: Path, seq: int, kind: str) -> Iterator[None]:
    """Say which row it was that could not be understood, or be applied to the ground of this run; raises BadInput."""
    try:
        yield
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise BadInput(f"{journal}: row {seq} is no {kind} that this version knows ({error})") from error


def understood(row: Row, journal: Path) -> Entry:
    """The value of a row. Raises BadInput, which names the row, when its body is not what its kind has."""
    known = _BY_KIND.get(row.kind)
    with understanding(journal, row.seq, row.kind):
        body = Body.of(row.body)
        said = UnknownRow(row.kind, body.fields) if known is None else known.read(body, row.time)
        return Entry(row.seq, row.time, said, body.text_or_none(AIRCRAFT) or "")


def read_entries(journal: Path, *kinds: type[KnownRow]) -> Iterator[Entry]:
    """What a journal tells, in its order, of the given kinds or all; raises BadInput when it cannot be understood."""
    for row in read_rows(journal, *(each.kind for each in kinds)):
        yield understood(row, journal)


def read_last_entries(
    journal: Path, kind: type[KnownRow], count: int, before: float | None = None
) -> list[Entry]:
    """The last rows of a kind, the newest first, or the last until a time; raises BadInput like `read_entries`."""
    return [understood(row, journal) for row in read_last(journal, kind.kind, count, before)]


def as_json(row: KnownRow | AircraftRow) -> str:
    """A row's body as the journal keeps it; floats keep every bit."""
    return json.dumps(row.body())

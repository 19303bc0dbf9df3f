"""The judge over the journal: is everything there that was acknowledged, once, and does it add up to what was told?"""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from roisearch import Belief
from service import timebase
from service.area import build_grid, read_area  # the search starts from the prior that the service lays
from service.entries import UnknownRow, read_entries
from service.errors import BadInput
from sim.soak import ground

_MAY_STOP = {"HOLDING", "FOUND", "CONFIRMING", "SEARCHING"}
"""CONFIRMING for another look at a suspect, SEARCHING where the ground forbids a leg by now: it is planned anew."""
_READ_ELSEWHERE = {timebase.ROW}  # how the clocks stood
_WRONG_CELLS = 2.0
_MOST_STOPS = 4  # in a hold: the one at its beginning, and again when one may have been lost
_MAY_MOVE = {"TAKEOFF", "SEARCHING", "CONFIRMING", "RETURNING"}
Told = tuple[int, str]
"""What the door told at one moment: how many reports were in, and the belief's digest."""


@dataclass(frozen=True)
class Row:
    """One row of a journal."""

    seq: int
    kind: str
    key: str | None
    body: dict[str, Any]


def rows_of(journal: Path) -> list[Row]:
    """All rows in order, read with nothing but SQLite."""
    database = sqlite3.connect(f"file:{journal}?mode=ro", uri=True)
    try:
        query = "SELECT seq, kind, key, body FROM events ORDER BY seq"
        return [Row(seq, kind, key, json.loads(body)) for seq, kind, key, body in database.execute(query)]
    finally:
        database.close()


@dataclass(frozen=True)
class Target:
    """Where the target is, and the ids of the reports that saw it."""

    place: ground.LatLon
    seen_in: frozenset[str]


def audit(
    folder: Path,
    acknowledged: set[str],
    told: Iterable[Told],
    target: Target | None = None,
    *,
    refuses: bool = False,
) -> list[str]:
    """What is wrong with the journal of a run's folder, as sentences.

    Args:
        acknowledged: the ids of reports that the door has accepted.
        told: what the door has told of its belief.
        target: of the flight, if it had one.
        refuses: whether the autopilot refused orders: then it is told to stop as often as it takes.
    """
    rows = rows_of(folder / "journal.sqlite")
    return [
        *_readable(folder / "journal.sqlite"),
        *_numbered(rows),
        *_complete(rows, acknowledged),
        *(
            wrong
            for name in _aircraft(rows)
            for wrong in _moves([row for row in rows if _of(row) == name], refuses)
        ),
        *_adds_up(folder, rows, told),
        *_believes_the_true(folder, rows, target),
    ]


def wrongly_found(folder: Path, target: ground.LatLon | None) -> list[str]:
    """Whether a run's report says that the target was found where it is not, or where there is none."""
    report = folder / "report.json"
    found: Any = json.loads(report.read_text(encoding="utf-8")) if report.exists() else {}
    if found.get("outcome") != "found":
        return []
    if target is None:
        return ["found what is not there"]
    east, north = ground.metres((found["position"]["lat"], found["position"]["lon"]))
    away = math.dist((east, north), ground.metres(target))
    return [f"found {away:.0f} m from the target"] if away > _WRONG_CELLS * ground.CELL_M else []


def _readable(journal: Path) -> list[str]:
    """The one judgement that is the service's own: whether it can go on from what it has written."""
    try:
        for entry in read_entries(journal):
            if isinstance(entry.said, UnknownRow) and entry.said.kind not in _READ_ELSEWHERE:
                return [f"row {entry.seq} is of a kind that nobody reads: {entry.said.kind}"]
    except BadInput as error:
        return [str(error)]
    return []


def _numbered(rows: list[Row]) -> list[str]:
    if [row.seq for row in rows] == list(range(1, len(rows) + 1)):
        return []
    return ["rows are missing in the journal: they are not numbered one after another"]


def _complete(rows: list[Row], acknowledged: set[str]) -> list[str]:
    ids = [row.body["report"]["id"] for row in rows if row.kind == "report"]
    found = []
    if lost := acknowledged - set(ids):
        found.append(f"{len(lost)} acknowledged reports are not in the journal, such as {min(lost)}")
    if len(ids) != len(set(ids)):
        found.append(f"{len(ids) - len(set(ids))} reports are in the journal twice")
    return found


def _of(row: Row) -> str:
    """The name of the aircraft that a row is of; empty: of the only one, or of none."""
    return str(row.body.get("aircraft", ""))


def _aircraft(rows: list[Row]) -> list[str]:
    """All names that there are."""
    return sorted({_of(row) for row in rows})


def _moves(rows: list[Row], refuses: bool) -> list[str]:
    """Of one aircraft's rows: waypoints only in states that may move, few stops in a hold, no gap in the states."""
    found = []
    state, stops = "WAITING", 0
    given_up = {
        last.seq for last, row in pairwise(rows) if row.kind == "transition" and row.body["to"] == "ABORTED"
    }
    for row in rows:
        if row.kind == "command" and row.seq in given_up:
            continue  # what stops the aircraft goes out before the end is written down
        if row.kind == "transition":
            before = row.body["from"]
            if before not in (state, "WAITING"):  # a process that goes on with the run starts from there
                found.append(f"row {row.seq}: a transition from {before} in {state}")
            state, stops = row.body["to"], 0
        elif row.kind == "command":
            command = row.body["command"]
            stops = 0 if command == "reposition" else stops + (command == "hold")
            many = stops > _MOST_STOPS and state != "CONFIRMING" and not refuses
            if command == "hold" and (state not in _MAY_STOP or many):
                found.append(f"row {row.seq}: stop {stops} in {state}")
            elif command == "reposition" and state not in _MAY_MOVE:
                found.append(f"row {row.seq}: a waypoint in {state}")
    return found


def _believes_the_true(folder: Path, rows: list[Row], target: Target | None) -> list[str]:
    """A report that saw the target never lowers what is believed of the target's own cell."""
    if target is None:
        return []
    grid = build_grid(read_area(folder / "area.geojson"), ground.CELL_M)
    belief = Belief(grid.prior, searchable=grid.searchable, outside=grid.outside)
    cells, inside = grid.frame.locate([target.place])
    if not inside[0]:
        return []
    found = []
    for row in rows:
        if row.kind != "report" or (seen := row.body["observation"]) is None:
            continue
        before = float(belief.mass_at(cells)[0])
        _observe(belief, seen)
        after, name = float(belief.mass_at(cells)[0]), row.body["report"]["id"]
        if name in target.seen_in and after < before * (1.0 - 1e-9):
            found.append(
                f"row {row.seq}: report {name} saw the target, and lowered its cell from {before:.3%} to {after:.3%}"
            )
    return found[:3]


def _observe(belief: Belief, seen: dict[str, Any]) -> None:
    cells = np.array(seen["cells"], dtype=np.int64).reshape(-1, 2)
    belief.observe(
        cells, np.array(seen["hits"], dtype=np.bool_), np.array(seen["p_tp"]), np.array(seen["p_tn"])
    )


def _adds_up(folder: Path, rows: list[Row], told: Iterable[Told]) -> list[str]:
    """Reports alone make the belief, in flights without a clue: what is believed anew for one is not judged here."""
    if any(row.kind == "news" and row.body["role"] == "clue" for row in rows):
        return []
    grid = build_grid(read_area(folder / "area.geojson"), ground.CELL_M)
    belief = Belief(grid.prior, searchable=grid.searchable, outside=grid.outside)
    digests = [belief.digest()]
    for row in rows:
        if row.kind == "report":
            if (seen := row.body["observation"]) is not None:
                _observe(belief, seen)
            digests.append(belief.digest())
    found = []
    for count, digest in told:
        if count >= len(digests):
            found.append(f"{count} reports were told, {len(digests) - 1} are in the journal")
        elif digests[count] != digest:
            found.append(f"the belief after {count} reports is not the one that the journal adds up to")
    total = float(belief.probability().sum()) + belief.outside
    if not math.isclose(total, 1.0, abs_tol=1e-9):
        found.append(f"the belief at the end sums to {total!r}")
    return found[:3]

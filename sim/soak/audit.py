"""The judge over the journal: is everything there that was acknowledged, once, and does it add up to what was told?"""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from roisearch import Belief
from service.area import build_grid, read_area  # the search starts from the prior that the service lays
from sim.soak import ground

_MAY_STOP = {"HOLDING", "FOUND", "CONFIRMING"}  # the last for another look at a suspect
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


def audit(folder: Path, acknowledged: set[str], told: Iterable[Told]) -> list[str]:
    """What is wrong with the journal of a run's folder, as sentences.

    Args:
        acknowledged: the ids of reports that the door has accepted.
        told: what the door has told of its belief.
    """
    rows = rows_of(folder / "journal.sqlite")
    return [*_numbered(rows), *_complete(rows, acknowledged), *_moves(rows), *_adds_up(folder, rows, told)]


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


def _moves(rows: list[Row]) -> list[str]:
    """No waypoint but in a state that may move, few stops in a hold, and no gap in the states."""
    found = []
    state, stops = "WAITING", 0
    for row in rows:
        if row.kind == "transition":
            before = row.body["from"]
            if before not in (state, "WAITING"):  # a process that goes on with the run starts from there
                found.append(f"row {row.seq}: a transition from {before} in {state}")
            state, stops = row.body["to"], 0
        elif row.kind == "command":
            command = row.body["command"]
            stops += command == "hold"
            if command == "hold" and (
                state not in _MAY_STOP or (stops > _MOST_STOPS and state != "CONFIRMING")
            ):
                found.append(f"row {row.seq}: stop {stops} in {state}")
            elif command == "reposition" and state not in _MAY_MOVE:
                found.append(f"row {row.seq}: a waypoint in {state}")
    return found


def _adds_up(folder: Path, rows: list[Row], told: Iterable[Told]) -> list[str]:
    grid = build_grid(read_area(folder / "area.geojson"), ground.CELL_M)
    belief = Belief(grid.prior, searchable=grid.searchable, outside=grid.outside)
    digests = [belief.digest()]
    for row in rows:
        if row.kind == "report":
            if (seen := row.body["observation"]) is not None:
                cells = np.array(seen["cells"], dtype=np.int64).reshape(-1, 2)
                hits = np.array(seen["hits"], dtype=np.bool_)
                belief.observe(cells, hits, np.array(seen["p_tp"]), np.array(seen["p_tn"]))
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

"""Going on with a search from its journal: the same belief to the last bit, no report lost or counted twice."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from service.area import Grid, SearchArea
from service.config import Settings, changed_settings
from service.errors import BadInput
from service.evidence.intake import Intake
from service.evidence.observe import Observation
from service.evidence.verdict import ROW as VERDICT
from service.journal import Row, read_last, read_meta, read_rows
from service.search import Search
from service.survey import AREA, JOURNAL, PRIOR, survey


def stored_settings(journal: Path, changed: dict[str, Any]) -> Settings:
    """The settings that a run was started with, but for those `changed` ('section.key': value; None: as stored)."""
    return changed_settings(read_meta(journal, "settings"), changed, str(journal))


def stored_run(folder: Path) -> tuple[Settings, SearchArea, Grid, list[Row]]:
    """What a run's folder holds, under way or over: settings, area, grid, and the journal as it is now.

    Raises BadInput when it holds no run that has begun, or its journal is of another grid.
    """
    journal = folder / JOURNAL
    settings = stored_settings(journal, {})
    prior = folder / PRIOR
    area, grid = survey(folder / AREA, prior if prior.exists() else None, settings)
    if read_meta(journal, "grid") != grid.frame.to_dict():
        raise BadInput(f"{folder}: its journal is of another grid than its area file makes")
    rows = list(read_rows(journal))
    if not rows:
        raise BadInput(f"{folder}: its journal is empty; nothing has happened yet that could be shown")
    return settings, area, grid, rows


def last_transition(journal: Path) -> dict[str, str] | None:
    """The last change of state in a journal (`from`, `event`, `to`, `reason`), or None before the first."""
    rows = read_last(journal, "transition", 1)
    return rows[0].body if rows else None


def retrace(row: Row, search: Search) -> None:
    """Apply what a journal row says about the ground, if anything, to a search; rows come in their order."""
    if row.kind == VERDICT:
        down, across = row.body["cell"]
        said = Observation.from_dict(row.body["observation"])
        search.judge((down, across), said, confirmed=row.body["confirmed"])
    elif row.kind == "report" and row.body["observation"] is not None:
        search.apply(Observation.from_dict(row.body["observation"]))


@contextlib.contextmanager
def _knowing(journal: Path, row: Row) -> Iterator[None]:
    """Say which row it was that could not be understood."""
    try:
        yield
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise BadInput(
            f"{journal}: row {row.seq} is no {row.kind} that this version knows ({error})"
        ) from error


def replay(
    journal: Path,
    search: Search,
    intake: Intake,
    told: Callable[[float, float], None] = lambda time, pos: None,
) -> int:
    """Apply the journalled observations and verdicts to a fresh search, in their order, and take up the passes that
    were going on: what hovers over a cell has looked at it once, whether or not the service was killed meanwhile.

    `told` hears the time of each row and the POS after it. Returns how many reports there were.
    """
    ids = set()
    recent: deque[Row] = deque()
    for row in read_rows(journal, "report", VERDICT):
        with _knowing(journal, row):
            retrace(row, search)
            if row.kind == "report":
                ids.add(row.body["report"]["id"])
                recent.append(row)
                while recent[0].time < row.time - intake.history_s:
                    recent.popleft()
        told(row.time, search.record.pos)
    for row in recent:
        with _knowing(journal, row):
            intake.recall(row)
    intake.remember(ids)
    intake.accepted = len(ids)
    return len(ids)

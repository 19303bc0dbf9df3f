"""Going on with a search from its journal: the same belief to the last bit, no report lost or counted twice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from service.config import Settings, changed_settings
from service.evidence import Observation
from service.intake import Intake
from service.journal import read_meta, read_rows
from service.search import Search


def stored_settings(journal: Path, changed: dict[str, Any]) -> Settings:
    """The settings that a run was started with, but for those `changed` ('section.key': value; None: as stored)."""
    return changed_settings(read_meta(journal, "settings"), changed, str(journal))


def replay(
    journal: Path,
    search: Search,
    intake: Intake,
    told: Callable[[float, float], None] = lambda time, pos: None,
) -> int:
    """Apply the journalled observations to a fresh search, in their order; returns how many reports there were.

    `told` hears the time of each observation and the POS after it.
    """
    ids = set()
    for row in read_rows(journal, "report"):
        ids.add(row.body["report"]["id"])
        if row.body["observation"] is not None:
            search.apply(Observation.from_dict(row.body["observation"]))
            told(row.time, search.record.pos)
    intake.remember(ids)
    intake.accepted = len(ids)
    return len(ids)

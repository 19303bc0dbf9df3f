"""The results of a campaign as typed tables, for whoever works on with them.

from sim.trials.table import load
trials = load("campaign")
mine = trials.searches[trials.searches["planner"] == "index"]
print(mine["steps"][mine["found"]].mean())
pandas.DataFrame(trials.searches)      # or polars, or whatever reads a structured array
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.trials.campaign import BOUND, CURVE, SEARCH

Row = dict[str, Any]
_QUANTILES = ("p5", "p25", "p50", "p75", "p95")


@dataclass(frozen=True, eq=False)
class Trials:
    """A campaign's folder as structured arrays, a row for each result that is there, in the order of their trials.

    Attributes:
        campaign: the settings, as in campaign.json.
        searches: planner, fov, trial, found, steps (at most the cap), seen (part of the map), false_alarms,
            target_row, target_col, in_region, regions, plan_ms (mean of its decisions), slowest_ms, seconds.
        curves: planner, fov, trial, expected (steps), left (probability), steps, p5 .. p95 (steps; NaN where the
            curve ends before), plan_ms, slowest_ms, seconds.
        bounds: fov, trial, expected, teleport, p5 .. p95.
        detection: the detection curves, by (planner, fov, trial): float, at the steps that
            `sim.trials.trial.grid` gives.
    """

    campaign: dict[str, Any]
    searches: NDArray[np.void]
    curves: NDArray[np.void]
    bounds: NDArray[np.void]
    detection: dict[tuple[str, str, int], NDArray[np.float64]]

    def planners(self) -> tuple[str, ...]:
        """The planners of the campaign, as they were named."""
        return tuple(self.campaign["planners"])


def load(folder: str | Path) -> Trials:
    """The results in a campaign's folder, also while it is being worked on.

    Raises:
        ValueError: it holds no campaign, or a line of its journal is damaged; one sentence that names the file.
    """
    folder = Path(folder)
    try:
        campaign = json.loads((folder / "campaign.json").read_text(encoding="utf-8"))
        text = (folder / "journal.jsonl").read_bytes()
    except (OSError, ValueError) as error:
        raise ValueError(f"{folder} holds no campaign that can be read: {error}") from None
    results: dict[tuple[str, str, str, int], Row] = {}
    for number, line in enumerate(text[: text.rfind(b"\n") + 1].splitlines(), 1):
        try:
            result = json.loads(line)
            results[result["kind"], result["planner"], result["fov"], result["trial"]] = result
        except (ValueError, KeyError, TypeError):
            raise ValueError(f"line {number} of {folder / 'journal.jsonl'} is damaged") from None
    place = {name: number for number, name in enumerate(campaign["planners"])}
    rows = sorted(results.values(), key=lambda r: (r["trial"], r["fov"], place.get(r["planner"], -1)))
    named = max((len(name) for name in place), default=1)
    try:
        return Trials(
            campaign=campaign,
            searches=_table((r for r in rows if r["kind"] == SEARCH), named, _SEARCH),
            curves=_table((r for r in rows if r["kind"] == CURVE), named, _CURVE),
            bounds=_table((r for r in rows if r["kind"] == BOUND), named, _BOUND),
            detection={
                (r["planner"], r["fov"], r["trial"]): np.array(r["curve"], dtype=np.float64)
                for r in rows
                if r["kind"] == CURVE
            },
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(
            f"{folder / 'journal.jsonl'} holds a result that lacks something: {error!r}"
        ) from None


Column = tuple[str, str, Callable[[Row], Any]]


def _of(key: str, kind: str = "f8") -> Column:
    return key, kind, lambda row: row[key]


def _timed(key: str) -> Column:
    return key, "f8", lambda row: row["timing"].get(key, np.nan)


def _quantile(number: int) -> Column:
    def get(row: Row) -> float:
        value = row["quantiles"][number]
        return np.nan if value is None else float(value)

    return _QUANTILES[number], "f8", get


_WHO: tuple[Column, ...] = (_of("planner", "U"), _of("fov", "U16"), _of("trial", "i8"))
_TIMES: tuple[Column, ...] = (_timed("plan_ms"), _timed("slowest_ms"), _timed("seconds"))
_SPREAD: tuple[Column, ...] = tuple(_quantile(number) for number in range(len(_QUANTILES)))
_SEARCH: tuple[Column, ...] = (
    *_WHO,
    _of("found", "?"),
    _of("steps", "i8"),
    _of("seen"),
    _of("false_alarms", "i8"),
    ("target_row", "i8", lambda row: row["target"][0]),
    ("target_col", "i8", lambda row: row["target"][1]),
    _of("in_region", "?"),
    _of("regions", "i8"),
    *_TIMES,
)
_CURVE: tuple[Column, ...] = (*_WHO, _of("expected"), _of("left"), _of("steps", "i8"), *_SPREAD, *_TIMES)
_BOUND: tuple[Column, ...] = (*_WHO[1:], _of("expected"), _of("teleport"), *_SPREAD, _timed("seconds"))


def _table(rows: Iterable[Row], named: int, columns: tuple[Column, ...]) -> NDArray[np.void]:
    kinds = [(name, f"U{named}" if kind == "U" else kind) for name, kind, _ in columns]
    return np.array([tuple(get(row) for _, _, get in columns) for row in rows], dtype=kinds)

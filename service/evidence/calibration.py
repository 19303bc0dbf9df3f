"""What a detector's score is worth: from a score to a likelihood ratio, from a threshold to p_tp and p_tn.

A CSV file with a header, made from frames whose truth is known, scored by the best of each pass. Two forms:

`score,likelihood_ratio`: P(score | target there) / P(score | not there) of a hit with that score. Between two rows the
logarithm of the ratio is interpolated, beyond the first and last row it stays. What a miss is worth comes from the
settings, p_tp and p_tn.

`score,p_tp,p_tn`: what the detector achieves when it reports from that score on (its ROC). A hit with a score between
two rows is then worth what it adds: (p_tp - p_tp') / (p_tn' - p_tn), and one above the last row p_tp / (1 - p_tn).
Where that falls from one step to the next, the two are taken together: a higher score is never worth less (this is
the upper hull of the ROC). A miss is worth what it is at the report's threshold, interpolated; without a threshold,
and below the first row, what it is at the first row.
"""

from __future__ import annotations

import csv
import math
from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from service.config import Settings
from service.errors import BadInput

_FORMS = ({"score", "likelihood_ratio"}, {"score", "p_tp", "p_tn"})
_MOST_BYTES = 1 << 20


@dataclass(frozen=True)
class Calibration:
    """`scores` rise and `log_ratios` do not fall, one for each. `points` are (p_tp, p_tn) at each threshold of
    `thresholds`, when the table is a ROC; its ratios hold from their score up to the next."""

    scores: tuple[float, ...]
    log_ratios: tuple[float, ...]
    thresholds: tuple[float, ...] = ()
    points: tuple[tuple[float, float], ...] = ()

    def ratio(self, score: float) -> float:
        """The likelihood ratio of a hit with this score."""
        if self.points:
            return math.exp(self.log_ratios[max(0, bisect_right(self.scores, score) - 1)])
        return math.exp(float(np.interp(score, self.scores, self.log_ratios)))

    def at(self, threshold: float | None) -> tuple[float, float] | None:
        """p_tp and p_tn of a look by a detector that reports from this score on; None when the table has none."""
        if not self.points:
            return None
        if threshold is None:
            return self.points[0]
        p_tp, p_tn = zip(*self.points, strict=True)
        there, absent = (np.interp(threshold, self.thresholds, column) for column in (p_tp, p_tn))
        return float(there), float(absent)


def calibration_of(settings: Settings) -> Calibration | None:
    """The calibration that the settings name, if they do; raises BadInput."""
    file = settings.sensor.calibration_file
    return read_calibration(file) if file else None


def read_calibration(path: str) -> Calibration:
    """The table in a file. Raises BadInput with the line that is wrong and what would be right."""
    columns = _columns(path)
    scores = columns["score"]
    for number, (before, after) in enumerate(pairwise(scores), start=3):
        if after <= before:
            raise BadInput(
                f"{path}, line {number}: the score {after:g} does not rise above {before:g}; sort the rows"
            )
    if "likelihood_ratio" in columns:
        return _of_ratios(path, scores, columns["likelihood_ratio"])
    return _of_roc(path, scores, list(zip(columns["p_tp"], columns["p_tn"], strict=True)))


def _of_ratios(path: str, scores: list[float], ratios: list[float]) -> Calibration:
    for number, ratio in enumerate(ratios, start=2):
        if ratio <= 0.0:
            raise BadInput(f"{path}, line {number}: a likelihood_ratio is above 0, not {ratio:g}")
        if number > 2 and ratio < ratios[number - 3]:
            raise BadInput(
                f"{path}, line {number}: the likelihood_ratio falls from {ratios[number - 3]:g} to {ratio:g}, so a "
                "higher score would be worth less; take such rows together"
            )
    return Calibration(tuple(scores), tuple(math.log(ratio) for ratio in ratios))


def _of_roc(path: str, scores: list[float], points: list[tuple[float, float]]) -> Calibration:
    for number, (p_tp, p_tn) in enumerate(points, start=2):
        if not (0.0 < p_tp < 1.0 and 0.0 < p_tn < 1.0):
            raise BadInput(
                f"{path}, line {number}: p_tp and p_tn are between 0 and 1, not {p_tp:g} and {p_tn:g}"
            )
        if number > 2 and (p_tp > points[number - 3][0] or p_tn < points[number - 3][1]):
            raise BadInput(f"{path}, line {number}: with a higher score p_tp cannot rise nor p_tn fall")
    steps: list[tuple[float, float, float]] = []  # from which score, share of hits, share of false alarms
    for score, (p_tp, p_tn), (next_tp, next_tn) in zip(
        scores, points, [*points[1:], (0.0, 1.0)], strict=True
    ):
        steps.append((score, p_tp - next_tp, next_tn - p_tn))
        while len(steps) > 1 and steps[-1][1] * steps[-2][2] <= steps[-2][1] * steps[-1][2]:
            _, hits, alarms = steps.pop()
            start, hits_before, alarms_before = steps.pop()
            steps.append((start, hits_before + hits, alarms_before + alarms))
    for score, hits, alarms in steps:
        if hits <= 0.0 or alarms <= 0.0:
            what = "no false alarm" if alarms <= 0.0 else "no target"
            raise BadInput(
                f"{path}: {what} was seen with scores from {score:g} on, so a hit there would prove everything or "
                "nothing; take rows together, or count half a case more"
            )
    ratios = tuple(math.log(hits / alarms) for _, hits, alarms in steps)
    return Calibration(tuple(step[0] for step in steps), ratios, tuple(scores), tuple(points))


def _columns(path: str) -> dict[str, list[float]]:
    """The file's columns by name."""
    try:
        with Path(path).open(encoding="utf-8", newline="") as stream:
            rows = [row for row in csv.reader(stream.read(_MOST_BYTES).splitlines()) if row]
    except (OSError, ValueError) as error:  # ValueError: not UTF-8
        raise BadInput(f"{path}: the calibration cannot be read ({error}); give a CSV file") from error
    except csv.Error as error:
        raise BadInput(f"{path}: is not CSV: {error}") from error
    names = [name.strip() for name in rows[0]] if rows else []
    if set(names) not in _FORMS or len(names) != len(set(names)):
        raise BadInput(
            f"{path}: the first line names the columns, 'score,likelihood_ratio' or 'score,p_tp,p_tn', "
            f"not '{','.join(names)[:80]}'"
        )
    if len(rows) < 2:
        raise BadInput(f"{path}: there are no rows below the names of the columns")
    columns: dict[str, list[float]] = {name: [] for name in names}
    for number, row in enumerate(rows[1:], start=2):
        try:
            values = [float(cell) for cell in row]
            if len(values) != len(names) or not all(map(math.isfinite, values)):
                raise ValueError
        except ValueError:
            raise BadInput(
                f"{path}, line {number}: '{','.join(row)[:80]}' is not {len(names)} numbers"
            ) from None
        for name, value in zip(names, values, strict=True):
            columns[name].append(value)
    if min(columns["score"]) < 0.0 or max(columns["score"]) > 1.0:
        raise BadInput(f"{path}: scores lie between 0 and 1")
    return columns

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
_MOST_RATIO = 1e6  # what one hit can prove; far more, and 1 - p_tn is nothing


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
    lines, columns = _columns(path)
    scores = columns["score"]
    for line, (before, after) in zip(lines[1:], pairwise(scores), strict=True):
        if after <= before:
            raise BadInput(
                f"{path}, line {line}: the score {after:g} does not rise above {before:g}; sort the rows"
            )
    if "likelihood_ratio" in columns:
        return _of_ratios(path, lines, scores, columns["likelihood_ratio"])
    return of_roc(path, lines, scores, list(zip(columns["p_tp"], columns["p_tn"], strict=True)))


def _of_ratios(path: str, lines: list[int], scores: list[float], ratios: list[float]) -> Calibration:
    for line, before, ratio in zip(lines, [0.0, *ratios], ratios, strict=False):
        if not 1.0 / _MOST_RATIO <= ratio <= _MOST_RATIO:
            raise BadInput(
                f"{path}, line {line}: a likelihood_ratio is above 0, from {1.0 / _MOST_RATIO:g} to {_MOST_RATIO:g}, "
                f"not {ratio:g}"
            )
        if ratio < before:
            raise BadInput(
                f"{path}, line {line}: the likelihood_ratio falls from {before:g} to {ratio:g}, so a "
                "higher score would be worth less; take such rows together"
            )
    return Calibration(tuple(scores), tuple(math.log(ratio) for ratio in ratios))


def of_roc(
    path: str, lines: list[int], scores: list[float], points: list[tuple[float, float]]
) -> Calibration:
    for line, before, (p_tp, p_tn) in zip(lines, [(1.0, 0.0), *points], points, strict=False):
        if not (0.0 < p_tp < 1.0 and 0.0 < p_tn < 1.0):
            raise BadInput(
                f"{path}, line {line}: p_tp and p_tn are between 0 and 1, not {p_tp:g} and {p_tn:g}"
            )
        if p_tp > before[0] or p_tn < before[1]:
            raise BadInput(f"{path}, line {line}: with a higher score p_tp cannot rise nor p_tn fall")
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
        if not 1.0 / _MOST_RATIO <= hits / alarms <= _MOST_RATIO:
            raise BadInput(
                f"{path}: a hit with scores from {score:g} on would be worth a likelihood ratio of {hits / alarms:g}, "
                f"which no count of cases shows; it is from {1.0 / _MOST_RATIO:g} to {_MOST_RATIO:g}"
            )
    ratios = tuple(math.log(hits / alarms) for _, hits, alarms in steps)
    return Calibration(tuple(step[0] for step in steps), ratios, tuple(scores), tuple(points))


def _columns(path: str) -> tuple[list[int], dict[str, list[float]]]:
    """Which line of the file each row is, from 1, and the file's columns by name."""
    try:
        with Path(path).open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise BadInput(f"{path}: the calibration has more than {_MOST_BYTES} bytes; give a shorter table")
        reader = csv.reader(data.decode("utf-8-sig").splitlines())
        numbered = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
        lines, rows = [number for number, _ in numbered], [row for _, row in numbered]
    except OSError as error:
        raise BadInput(
            f"{path}: the calibration cannot be read ({error.strerror}); give a CSV file"
        ) from error
    except UnicodeDecodeError:
        raise BadInput(f"{path}: the calibration is no text in UTF-8; give a CSV file") from None
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
    for line, row in zip(lines[1:], rows[1:], strict=True):
        try:
            values = [float(cell) for cell in row]
            if len(values) != len(names) or not all(map(math.isfinite, values)):
                raise ValueError
        except ValueError:
            raise BadInput(
                f"{path}, line {line}: '{','.join(row)[:80]}' is not {len(names)} numbers"
            ) from None
        for name, value in zip(names, values, strict=True):
            columns[name].append(value)
    if min(columns["score"]) < 0.0 or max(columns["score"]) > 1.0:
        raise BadInput(f"{path}: scores lie between 0 and 1")
    return lines[1:], columns

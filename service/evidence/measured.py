"""From scored frames with the truth beside them to what a detector is worth: p_tp, p_tn, and a calibration table.

Frames of one pass agree with each other, so a pass counts once, by its best score (see `service.evidence.passes`).
Rates are counted with half a case more on either side (Jeffreys' prior), so that none is 0 or 1, and told with the
interval that holds them with 95 %.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scipy.stats import beta

from service.area.faults import refuse
from service.errors import BadInput

_THERE = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}
_LEAST_IN_STEP = 3  # cases of each kind between two rows of the table: fewer tell a ratio by luck
_MOST_BYTES = 1 << 26
_MOST_TOLD = 10  # lines that are wrong


@dataclass(frozen=True)
class Scored:
    """One pass over a place: whether the target was there, and the best score reported, None when nothing was."""

    there: bool
    score: float | None


@dataclass(frozen=True)
class Rate:
    """A share of so many cases, and the interval that holds it with 95 %."""

    value: float
    low: float
    high: float
    cases: int

    @classmethod
    def of(cls, hits: int, cases: int) -> Rate:
        """From a count."""
        a, b = hits + 0.5, cases - hits + 0.5
        return cls(a / (a + b), float(beta.ppf(0.025, a, b)), float(beta.ppf(0.975, a, b)), cases)


@dataclass(frozen=True)
class Measured:
    """What a detector achieves when it reports from `threshold` on."""

    threshold: float
    p_tp: Rate
    p_tn: Rate


def at_threshold(passes: Sequence[Scored], threshold: float) -> Measured:
    """The rates of reporting from a score on."""
    counts = {True: [0, 0], False: [0, 0]}
    for one in passes:
        counts[one.there][0] += one.score is not None and one.score >= threshold
        counts[one.there][1] += 1
    alarms, absent = counts[False]
    return Measured(threshold, Rate.of(*counts[True]), Rate.of(absent - alarms, absent))


def table(passes: Sequence[Scored]) -> list[Measured]:
    """Rows of a calibration, the lowest score first, each with enough cases of both kinds above the next row's."""
    scores = sorted({one.score for one in passes if one.score is not None}, reverse=True)
    rows, there, absent = [], 0, 0
    for score in scores:
        there += sum(one.there for one in passes if one.score == score)
        absent += sum(not one.there for one in passes if one.score == score)
        if there >= _LEAST_IN_STEP and absent >= _LEAST_IN_STEP:
            rows.append(score)
            there = absent = 0
    if scores and rows:
        rows[-1] = scores[-1]  # what is left below has too few cases for a row of its own
    return [at_threshold(passes, score) for score in reversed(rows or scores[-1:])]


def write_table(rows: Iterable[Measured], path: Path) -> None:
    """Write the rows as a file for sensor.calibration_file; raises BadInput."""
    lines = ["score,p_tp,p_tn", *(f"{r.threshold:g},{r.p_tp.value:.6f},{r.p_tn.value:.6f}" for r in rows)]
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror})") from error


def read_scored(path: Path) -> list[Scored]:
    """The passes in a CSV file with the columns `score` and `there`, and `pass` where several rows are one pass.

    Raises BadInput with the line that is wrong, or when there is no case of either kind.
    """
    if not path.is_file():
        raise BadInput(f"{path}: there is no such file; give a CSV file of scored frames")
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise BadInput(f"{path}: is larger than {_MOST_BYTES >> 20} MB; give the best score of each pass")
        reader = _rows(path)
        names = set(reader.fieldnames or ())
        if not {"score", "there"} <= names:
            raise BadInput(
                f"{path}: the first line names the columns, 'score,there' or 'pass,score,there', not "
                f"'{','.join(reader.fieldnames or ())[:80]}'"
            )
        passes: dict[tuple[str, bool], float | None] = {}
        wrong: list[str] = []
        for row in reader:
            name = row["pass"] if "pass" in names else str(reader.line_num)
            try:
                one = _scored(f"line {reader.line_num}", row)
            except BadInput as error:
                wrong.append(str(error))
                continue
            before = passes.get((name, one.there))
            best = (
                one.score if before is None else max(before, one.score if one.score is not None else before)
            )
            passes[name, one.there] = best
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BadInput(f"{path}: the scored frames cannot be read ({error}); give a CSV file") from error
    if len(wrong) > _MOST_TOLD:
        wrong[_MOST_TOLD - 1 :] = [f"and {len(wrong) - _MOST_TOLD + 1} more lines"]
    refuse(str(path), wrong)
    found = [Scored(there, score) for (_, there), score in passes.items()]
    for kind, words in ((True, "with the target there"), (False, "without the target")):
        if not any(one.there is kind for one in found):
            raise BadInput(f"{path}: has no pass {words}; both kinds are needed to tell p_tp and p_tn")
    return found


def _rows(path: Path) -> csv.DictReader[str]:
    """The rows of a table, with commas, semicolons or tabs between columns, as spreadsheets write them."""
    data = path.read_bytes()
    if data.startswith(b"PK"):
        raise BadInput(f"{path}: this is a spreadsheet; save it as CSV")
    marked = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    lines = data.decode("utf-16" if marked else "utf-8-sig").splitlines()
    head = lines[0] if lines else ""
    reader = csv.DictReader(lines, delimiter=max(",;\t", key=head.count))
    reader.fieldnames = [name.strip().lower() for name in reader.fieldnames or ()]
    return reader


def _scored(where: str, row: dict[str, str]) -> Scored:
    there = _THERE.get((row["there"] or "").strip().lower())
    if there is None:
        raise BadInput(
            f"{where}: there is 1 or 0, whether the target was there, not '{(row['there'] or '')[:20]}'"
        )
    told = (row["score"] or "").strip()
    if not told:
        return Scored(there, None)
    try:
        score = float(told.replace(",", "."))  # half of Europe's spreadsheets
    except ValueError:
        score = math.nan
    if not 0.0 <= score <= 1.0:
        percent = "; divide per cent by 100" if 1.0 < score <= 100.0 else ""
        raise BadInput(
            f"{where}: a score lies between 0 and 1, or is left empty where nothing was reported, not "
            f"'{told[:20]}'{percent}"
        )
    return Scored(there, score)

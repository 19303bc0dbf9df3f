"""`roisearch-service calibrate FILE`: what a detector is worth, from scored frames with the truth beside them.

FILE is CSV with the columns score,there (and pass, where several frames are one pass over a place): the detector's
score, empty where it reported nothing, and whether the target was there, 1 or 0.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from service.errors import BadInput, Parser

if TYPE_CHECKING:
    from service.evidence.measured import Measured, Rate


def main(arguments: list[str]) -> int:
    """Measure, and write what was asked for."""
    parser = Parser(
        prog="roisearch-service calibrate", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("file", metavar="FILE", type=Path)
    parser.add_argument(
        "--threshold",
        type=_score,
        default=0.0,
        metavar="SCORE",
        help="the score from which on it reports (0)",
    )
    parser.add_argument("--table", type=Path, metavar="CSV", help="write a table for sensor.calibration_file")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="draw the rates and how sure they are")
    options = parser.parse_args(arguments)
    from service.evidence.measured import at_threshold, read_scored, table, write_table

    passes = read_scored(options.file)
    now = at_threshold(passes, options.threshold)
    print(f"{len(passes)} passes, {now.p_tp.cases} with the target there, {now.p_tn.cases} without")
    print(f"p_tp = {_told(now.p_tp)}")
    print(f"p_tn = {_told(now.p_tn)}")
    if now.p_tp.value <= 1.0 - now.p_tn.value:
        print("this detector reports the target no more often where it is: its hits say nothing")
    rows = table(passes)
    if options.table is not None:
        if not rows:
            raise BadInput(f"{options.file}: no pass has a score, so there is no table to make")
        write_table(rows, options.table)
        print(f"{options.table}: {len(rows)} row{'s' * (len(rows) != 1)}; set sensor.calibration_file to it")
    if options.picture is not None:
        _draw(rows or [now], options.picture)
        print(f"{options.picture}: p_tp and p_tn by threshold, with 95 % intervals")
    return 0


def _score(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"'{text}' is no score between 0 and 1")
    return value


def _told(rate: Rate) -> str:
    passes = "1 pass" if rate.cases == 1 else f"{rate.cases} passes"
    return f"{rate.value:.3f} (95 %: {rate.low:.3f} to {rate.high:.3f}, from {passes})"


def _draw(rows: Sequence[Measured], path: Path) -> None:
    """Both rates over the threshold, with their intervals."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.add_subplot()
    scores = [row.threshold for row in rows]
    for name, colour, rates in (
        ("p_tp: reported where it is", "#1b6ca8", [row.p_tp for row in rows]),
        ("p_tn: not reported where it is not", "#c2571a", [row.p_tn for row in rows]),
    ):
        axes.plot(scores, [rate.value for rate in rates], "o-", color=colour, label=name)
        axes.fill_between(
            scores, [rate.low for rate in rates], [rate.high for rate in rates], color=colour, alpha=0.2
        )
    axes.set(xlabel="reports from this score on", ylabel="share of passes", ylim=(0.0, 1.0))
    axes.legend(loc="lower center")
    try:
        figure.savefig(path, dpi=150)
    except (OSError, ValueError) as error:
        raise BadInput(
            f"{path}: the picture cannot be written ({error}); give a .png in a folder of yours"
        ) from error

"""The page of the campaign with a target that walks: a table, whether the aim was met, where knowing loses, and
curves."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim.trials.campaign import Job
from sim.trials.figures import draw_means
from sim.trials.flight import CELL_M, HELD_OUT, P_TP, SPEED_MPS
from sim.trials.journal import write_whole
from sim.trials.summary import ratio
from sim.trials.walking import FIRST_S, KNOWS, POINTS, STILL, WalkingCampaign

Results = Mapping[Job, dict[str, Any]]
ByWay = dict[str, dict[int, dict[str, Any]]]
AIM = 0.15
PICTURE = "walking.png"


@dataclass(frozen=True)
class Measure:
    """What flights are compared by: its `title` in the table, how it is told in a sentence (`words`), its value of a
    result, how that is printed, and whether less of it is better."""

    title: str
    words: str
    value: Callable[[Mapping[str, Any]], float]
    form: str
    less_is_better: bool

    def loses(self, a: float, b: float) -> bool:
        """Whether `a` is worse than `b`."""
        return a > b if self.less_is_better else a < b


def measures(campaign: WalkingCampaign) -> dict[str, Measure]:
    """By their keys in summary.json, in the order of the table."""

    def at(i: int) -> Callable[[Mapping[str, Any]], float]:
        return lambda result: float(result["found"][i])

    told = {
        "mean": Measure("E[T], s", "expected time", lambda result: result["expected"], ".0f", True),
        "first": Measure(
            f"E[T] in {FIRST_S / 3600.0:g} h, s",
            f"expected time restricted to {FIRST_S / 3600.0:g} h",
            lambda result: result["first"],
            ".0f",
            True,
        ),
        "end": Measure(
            f"found in {campaign.hours:g} h",
            f"what is found in {campaign.hours:g} h",
            lambda result: result["end"],
            ".3f",
            False,
        ),
    }
    for i, minutes in enumerate(campaign.minutes):
        name = f"{minutes:g} min"
        told[name] = Measure(f"found in {name}", f"what is found in {name}", at(i), ".3f", False)
    return told


def flown_by(campaign: WalkingCampaign, results: Results) -> tuple[list[int], ByWay]:
    """The priors that all ways have flown, and each way's results by prior."""
    told: ByWay = {
        way: {job.trial: each for job, each in results.items() if job.planner == way}
        for way in campaign.planners
    }
    return sorted(set.intersection(*(set(each) for each in told.values()))), told


def summarise(campaign: WalkingCampaign, results: Results) -> dict[str, Any]:
    """Means over the priors that all have flown, and each way beside the one that takes the target as still."""
    seeds, told = flown_by(campaign, results)
    rows = []
    for way in campaign.planners if seeds else ():
        row: dict[str, Any] = {"way": way}
        for name, measure in measures(campaign).items():
            own = np.array([measure.value(told[way][seed]) for seed in seeds])
            row[name] = float(own.mean())
            if STILL in told and way != STILL:
                to = np.array([measure.value(told[STILL][seed]) for seed in seeds])
                row[f"{name} to still"] = _plain(ratio(own, to))
                lost = zip(seeds, own, to, strict=True)
                row[f"{name} lost"] = [seed for seed, a, b in lost if measure.loses(a, b)]
        rows.append(row)
    return {"seeds": seeds, "rows": rows}


def _plain(pair: tuple[float, float]) -> list[float | None]:
    return [None if math.isnan(each) else each for each in pair]


def write_walking_report(campaign: WalkingCampaign, results: Results, folder: Path, command: str) -> str:
    """Write WALKING.md, summary.json and the picture; the text of the page."""
    summary = summarise(campaign, results)
    write_whole(folder / "summary.json", json.dumps(summary, indent=1) + "\n")
    text = page(campaign, summary, command)
    write_whole(folder / "WALKING.md", text)
    if summary["seeds"]:
        seeds, told = flown_by(campaign, results)
        curves = {
            way: np.mean([told[way][seed]["curve"] for seed in seeds], axis=0) for way in campaign.planners
        }
        minutes = np.linspace(0.0, 60.0 * campaign.hours, POINTS)
        draw_means(minutes, curves, campaign.minutes, folder / PICTURE)
    return text


def page(campaign: WalkingCampaign, summary: Mapping[str, Any], command: str) -> str:
    """WALKING.md."""
    told = measures(campaign)
    head = ["way", *(each for measure in told.values() for each in (measure.title, "than still"))]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    lines += ["| " + " | ".join(_cells(row, told)) + " |" for row in summary["rows"]]
    parts = [
        "# A target that walks: knowing it, beside taking it as still",
        f"    {command}",
        _about(campaign, summary),
    ]
    if summary["seeds"]:
        parts += [
            "\n".join(lines),
            f"![What is found by when]({PICTURE})",
            "\n".join(_verdicts(summary, told)),
        ]
    return "\n\n".join(parts) + "\n"


def _cells(row: Mapping[str, Any], told: Mapping[str, Measure]) -> list[str]:
    cells = [row["way"]]
    for name, measure in told.items():
        cells.append(format(row[name], measure.form))
        cells.append(_than(row.get(f"{name} to still")))
    return cells


def _than(pair: Sequence[float | None] | None) -> str:
    if pair is None:
        return ""
    value, error = pair
    return f"{value:+.1%}" + ("" if error is None else f" ± {100 * error:.1f}")


def _about(campaign: WalkingCampaign, summary: Mapping[str, Any]) -> str:
    last, seeds = campaign.seed + campaign.trials - 1, summary["seeds"]
    walk = campaign.walk()
    stops = "" if walk.stops_per_hour == 0.0 else f", stops for good {walk.stops_per_hour:g} times an hour"
    held_out = ", not used while developing" if campaign.seed >= HELD_OUT else ""
    side, hours = campaign.side, campaign.hours
    return (
        f"{len(seeds)} priors of {campaign.trials} are complete, of the seeds {campaign.seed} to {last}{held_out}: the "
        f"paper's kind on {side} x {side} cells of {CELL_M:g} m. The aircraft flies at {SPEED_MPS:g} m/s to eight "
        "neighbours, without time for turns, from the north-west corner; p_tp "
        f"= {P_TP:g}, no false alarms, {campaign.stride} cells are flown for a decision. The target walks at "
        f"{walk.speed_mps:g} m/s, straight for {walk.straight_s:g} s on average{stops}. E[T] is the expected time to "
        f"the first detection, restricted to {hours:g} h (and to the first, where it says so): exact over all targets "
        "and all their walks (forward filtering), so the only spread is that between priors. *than still*: the ratio "
        "of means less one, beside the planner that takes the target as still, ± one standard error in percent "
        "points. *teleport*: each look where most is undetected at that moment, without a way between looks; nobody "
        "can fly that."
    )


def _verdicts(summary: Mapping[str, Any], told: Mapping[str, Measure]) -> list[str]:
    row: Mapping[str, Any] = next((each for each in summary["rows"] if each["way"] == KNOWS), {})
    if "mean to still" not in row:
        return []
    less = -row["mean to still"][0]
    met = "met" if less >= AIM else "MISSED"
    lines = [
        f"- at least {AIM:.0%} less expected time than the planner that takes the target as still: {less:.1%}: {met}"
    ]
    for name, measure in told.items():
        lost = row[f"{name} lost"]
        where = f": seeds {', '.join(map(str, lost))}" if lost else ""
        lines.append(
            f"- by {measure.words}, knowing loses on {len(lost)} of {len(summary['seeds'])} priors{where}"
        )
    return lines

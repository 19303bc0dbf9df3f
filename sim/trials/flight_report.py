"""The report of flights in seconds: tables, figures, and a page that says first where the default loses."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.trials.campaign import Job
from sim.trials.flight import (
    DEFAULT,
    FLIGHT,
    IN_STEPS,
    LEAST,
    MORE,
    PAPER,
    PLANNERS,
    SHARES,
    FlightCampaign,
    grid,
)
from sim.trials.journal import write_whole
from sim.trials.summary import ratio

Results = Mapping[Job, dict[str, Any]]
Table = dict[str, dict[int, dict[str, Any]]]
Values = Mapping[int, NDArray[np.float64]]
PEER = "survey"
NAMES = {IN_STEPS: "default in steps", DEFAULT: "**default**"}
MEASURES = ("first true detection", "until FOUND", *(f"POS {share:.0%}" for share in SHARES))
EXPECTED, FOUND = 0, 1


def write_flight_report(
    campaign: FlightCampaign, results: Results, folder: Path, command: str
) -> list[dict[str, Any]]:
    """Write FLIGHT.md, summary.json and the figures; the rows of the summary."""
    rows = summarise(campaign, results)
    write_whole(folder / "summary.json", json.dumps(rows, indent=1) + "\n")
    figures = draw(campaign, results, folder)
    write_whole(folder / "FLIGHT.md", page(campaign, rows, figures, command, len(results)))
    return rows


def values_of(told: Mapping[str, Any]) -> NDArray[np.float64]:
    """The measures of one flight, [len(MEASURES)]; infinite where a share was not reached."""
    to = [math.inf if value is None else float(value) for value in told["to"]]
    return np.array([told["expected"], told.get("until_found", math.nan), *to])


def summarise(campaign: FlightCampaign, results: Results) -> list[dict[str, Any]]:
    """One row for each scene, p_tn, aircraft and planner.

    Means are over the seeds that it has flown; two planners are compared over the seeds that both have flown.
    """
    rows: list[dict[str, Any]] = []
    for scene, p_tn in campaign.conditions():
        flown = _flown(campaign, results, f"{scene} {p_tn:g}")
        least = {job.trial: told for job, told in results.items() if job.kind == LEAST and job.fov == scene}
        for number, acceleration in enumerate(campaign.accelerations):
            measured = {
                planner: {
                    seed: values_of(told["aircraft"][number])
                    for seed, told in tellings.items()
                    if seed in least
                }
                for planner, tellings in flown.items()
            }
            for planner, values in measured.items():
                if not values:
                    continue
                tellings = [flown[planner][seed]["aircraft"][number] for seed in values]
                bounds = np.array([least[seed]["aircraft"][number]["expected"] for seed in values])
                means = np.mean(list(values.values()), axis=0)
                rows.append({
                    "scene": scene, "p_tn": p_tn, "acceleration": acceleration, "planner": planner,
                    "seeds": len(values), "means": means.tolist(),
                    "above_bound": float(means[EXPECTED] / bounds.mean() - 1.0),
                    "above_proven": _above_proven(values, least, number),
                    "wrong": sum(told["wrong"] for told in tellings),
                    "sequels": sum(len(told["after"]) for told in tellings),
                    "of_peer": _against(values, measured.get(PEER, {})),
                    "default_of_it": _against(measured.get(DEFAULT, {}), values),
                })  # fmt: skip
    return rows


def _above_proven(values: Values, least: Mapping[int, Mapping[str, Any]], aircraft: int) -> float | None:
    """How far the first true detection is above the bound that counts travel, over the seeds that have one."""
    proven = {seed: least[seed]["aircraft"][aircraft].get("proven") for seed in values}
    pairs = [(values[seed][EXPECTED], bound) for seed, bound in proven.items() if bound is not None]
    return (
        float(np.sum([value for value, _ in pairs]) / np.sum([bound for _, bound in pairs]) - 1.0)
        if pairs
        else None
    )


def _flown(campaign: FlightCampaign, results: Results, condition: str) -> Table:
    """The results under one condition, by planner and seed."""
    flown: Table = {planner: {} for planner in campaign.planners}
    for job, result in results.items():
        if job.kind == FLIGHT and job.fov == condition and job.planner in flown:
            flown[job.planner][job.trial] = result
    return flown


def _against(values: Values, others: Values) -> list[tuple[float | None, float | None]]:
    """Each measure's ratio of means over the seeds of both, and its standard error; None where it cannot be said."""
    seeds = sorted(set(values) & set(others))
    if not seeds:
        return [(None, None)] * len(MEASURES)
    pairs: list[tuple[float | None, float | None]] = []
    for measure in range(len(MEASURES)):
        mine, theirs = (np.array([each[seed][measure] for seed in seeds]) for each in (values, others))
        if not (np.isfinite(mine).all() and np.isfinite(theirs).all()):
            pairs.append((None, None))
            continue
        quotient, error = ratio(mine, theirs)
        pairs.append((quotient + 1.0, None if math.isnan(error) else error))
    return pairs


def page(
    campaign: FlightCampaign, rows: Sequence[dict[str, Any]], figures: Sequence[str], command: str, done: int
) -> str:
    """FLIGHT.md."""
    whole = done >= len(campaign.jobs())
    parts = [
        "# Seconds of flight: the default beside what a team can fly for nothing",
        f"    {command}",
        _about(campaign, whole),
        "## Where the default loses",
        losses(rows),
        "## The targets",
        targets(rows),
    ]
    for scene in campaign.scenes:
        mine = [row for row in rows if row["scene"] == scene]
        if mine:
            parts += [f"## {_named(scene)}", _table(mine)]
            parts += [
                f"![F(t), {_named(scene)}]({name})" for name in figures if name.endswith(f"-{scene}.png")
            ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _named(scene: str) -> str:
    rows, cols = (21, 21) if scene == "uniform" else (20, 20)
    return {
        "uniform": f"Uniform, {rows} x {cols} cells",
        "L": "Uniform over an L, three quarters of 20 x 20 cells",
        "trail": "A trail over 40 x 40 cells",
        "height": "The paper's priors, equal height",
        "mass": "The paper's priors, equal mass",
        "drawn": "The paper's priors, drawn heights",
    }[scene]


def _about(campaign: FlightCampaign, whole: bool) -> str:
    size = f"{campaign.side} x {campaign.side}"
    missing = "" if whole else " **Not complete: the tables say how many seeds; the same command continues.**"
    return (
        f"Seeds {campaign.seed} to {campaign.seed + campaign.trials - 1}, not used while developing.{missing} Cells of "
        f"25 m, 8 m/s, corners cut by 5 m, p_tp = 0.9, a point field of view, from a stand. The paper's priors are on "
        f"{size} cells, their hills as wide beside the map as the paper's. *First true detection*: the mean of its "
        "time over all targets and all true detections, exact for the looks and false alarms of the flight. *Until "
        "FOUND*: the time until the target's cell is 0.999 probable, of a flight with the target in it "
        f"({campaign.sequels} targets a flight, over the areas {MORE} times as many). *POS*: when the probability "
        "of success is reached. A flight ends when "
        f"less than {campaign.stop_below:g} is undetected; the rest counts as found at the end of the clock, which is "
        "the same for all. A planner that knows no motion flies the same cells with every aircraft. *x of survey*: "
        "the ratio of means over the seeds that both have flown, ± one standard error. *above the bound*: of the first "
        "true detection, above the release bound in seconds, which no flight can beat; *above the proven one*: above "
        f"the bound that counts travel and turns as well, over {campaign.slow} seeds at most."
    )


def losses(rows: Sequence[dict[str, Any]]) -> str:
    """Every measure in which another planner is ahead of the default, by over half a thousandth; the worst first."""
    found: list[tuple[float, str]] = []
    for row in rows:
        if row["planner"] == DEFAULT:
            continue
        for measure, (value, error) in zip(MEASURES, row["default_of_it"], strict=True):
            if measure == MEASURES[FOUND] and row["p_tn"] == 1.0:
                continue  # the same as the first true detection
            if value is not None and value > 1.0005:
                doubt = "" if error is None else f" ± {error:.3f}"
                where = f"{row['scene']}, p_tn {row['p_tn']:g}, {row['acceleration']:g} m/s2"
                peer = NAMES.get(row["planner"], f"`{row['planner']}`")
                found.append((value, f"{value:.3f}{doubt} of {peer}: {where}, {measure}"))
    if not found:
        return "Nowhere among these planners, scenes and measures."
    return "\n".join(f"- {text}" for _, text in sorted(found, reverse=True))


def targets(rows: Sequence[dict[str, Any]]) -> str:
    """What was aimed at beside what was measured."""
    lines = ["| aim | worst | met |", "|---|---|---|"]

    def judge(aim: str, most: float, peers: Sequence[str], scenes: Sequence[str], measure: int = EXPECTED,
              acceleration: float | None = None) -> None:  # fmt: skip
        known = [
            (row["default_of_it"][measure][0], f"{row['scene']}, p_tn {row['p_tn']:g}, {row['acceleration']:g} m/s2")
            for row in rows
            if row["planner"] in peers and row["scene"] in scenes and row["default_of_it"][measure][0] is not None
            and acceleration in (None, row["acceleration"])
        ]  # fmt: skip
        if known:
            value, where = max(known)
            lines.append(
                f"| {aim} ≤ {most:.2f} | {value:.3f}: {where} | {'yes' if value <= most else '**no**'} |"
            )

    areas = ("uniform", "L")
    judge("uniform and L, first true detection, of `survey`", 1.0, [PEER], areas)
    judge("uniform and L, until FOUND, of `survey`", 1.0, [PEER], areas, FOUND)
    for number, share in enumerate(SHARES):
        judge(f"uniform and L, POS {share:.0%}, of `survey`", 1.03, [PEER], areas, 2 + number)
    for acceleration, most in ((1.5, 0.9), (3.0, 0.94)):
        aim = f"the paper's priors, {acceleration:g} m/s2, of the default in steps"
        judge(aim, most, [IN_STEPS], tuple(PAPER), EXPECTED, acceleration)
    others = [planner for planner in PLANNERS if planner != DEFAULT]
    judge("the paper's priors, of every other planner", 1.0, others, tuple(PAPER))
    return "\n".join(lines)


def _table(rows: Sequence[dict[str, Any]]) -> str:
    head = ["p_tn", "m/s2", "planner", "seeds", "first true detection, s", "above the bound", "above the proven one",
            "of survey",
            "until FOUND, s", "of survey", *(f"POS {share:.0%}, s" for share in SHARES), "wrongly FOUND"]  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for row in rows:
        means, peer = row["means"], row["of_peer"]
        cells = [
            f"{row['p_tn']:g}", f"{row['acceleration']:g}", NAMES.get(row["planner"], row["planner"]),
            str(row["seeds"]), f"{means[EXPECTED]:.0f}", f"{row['above_bound']:+.1%}",
            "-" if row["above_proven"] is None else f"{row['above_proven']:+.1%}", _ratio(peer, EXPECTED),
            f"{means[FOUND]:.0f}", _ratio(peer, FOUND),
            *(f"{value:.0f}" if math.isfinite(value) else "never" for value in means[2:]),
            f"{row['wrong']} of {row['sequels']}" if row["sequels"] else "-",
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _ratio(pairs: Sequence[tuple[float | None, float | None]], measure: int) -> str:
    value, error = pairs[measure]
    if value is None:
        return "-"
    return f"{value:.3f}" + ("" if error is None else f" ± {error:.3f}")


def draw(campaign: FlightCampaign, results: Results, folder: Path) -> list[str]:
    """A picture a scene: mean F(t) of each planner under the bound, a panel for each p_tn; the files' names."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    colours = dict(zip(campaign.planners, plt.get_cmap("tab10").colors, strict=False))  # type: ignore[attr-defined]
    names = []
    for scene in campaign.scenes:
        chances = [p_tn for name, p_tn in campaign.conditions() if name == scene]
        figure, panels = plt.subplots(
            1,
            len(chances),
            figsize=(4.6 * len(chances), 3.6),
            sharey=True,
            squeeze=False,
            layout="constrained",
        )
        for panel, p_tn in zip(panels[0], chances, strict=True):
            flown = _flown(campaign, results, f"{scene} {p_tn:g}")
            least = [told for job, told in results.items() if job.kind == LEAST and job.fov == scene]
            if least:
                curve = np.mean([told["aircraft"][0]["curve"] for told in least], axis=0)
                panel.plot(grid(scene) / 60.0, curve, "k--", lw=1, label="release bound")
            for planner, told in flown.items():
                if told:
                    curve = np.mean([each["aircraft"][0]["curve"] for each in told.values()], axis=0)
                    width = 2.0 if planner == DEFAULT else 1.2
                    panel.plot(grid(scene) / 60.0, curve, color=colours[planner], lw=width, label=planner)
            panel.set_xscale("log")
            panel.set_xlabel("minutes")
            panel.set_title(f"p_tn = {p_tn:g}", fontsize=10)
            panel.grid(alpha=0.3)
        panels[0][0].set_ylabel(f"F(t), {campaign.accelerations[0]:g} m/s2")
        panels[0][-1].legend(frameon=False, fontsize=8, loc="lower right")
        name = f"flight-{scene}.png"
        figure.savefig(folder / name, dpi=110, metadata={"Software": None})
        plt.close(figure)
        names.append(name)
    return names

"""The report of a campaign: CSV for machines, Markdown for people."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sim.trials import published
from sim.trials.campaign import BOUND, CURVE, SEARCH, Campaign, Job
from sim.trials.claims import weigh
from sim.trials.figures import draw
from sim.trials.journal import write_whole
from sim.trials.published import shown
from sim.trials.summary import PERCENTILES, summarise

Results = Mapping[Job, dict[str, Any]]
_SEARCH_COLUMNS = (
    "planner", "fov", "trial", "found", "steps", "seen", "false_alarms", "target_row", "target_col", "in_region",
    "regions",
)  # fmt: skip
_CURVE_COLUMNS = ("planner", "fov", "trial", "expected", "left", "steps", *PERCENTILES)
_BOUND_COLUMNS = ("fov", "trial", "expected", "teleport", "reference", *PERCENTILES)
_TIMING_COLUMNS = ("kind", "planner", "fov", "trial", "plan_ms", "slowest_ms", "seconds")


def write_report(campaign: Campaign, results: Results, folder: Path, command: str) -> dict[str, Any]:
    """Write everything that is made from the results; the summary.

    results.csv, curves.csv and bounds.csv are the same to the byte for the same settings; what was measured with a
    clock is in timings.csv and in summary.json under "time_per_step_ms".
    """
    summary = summarise(campaign, results)
    for name, kind, columns in (
        ("results.csv", SEARCH, _SEARCH_COLUMNS),
        ("curves.csv", CURVE, _CURVE_COLUMNS),
        ("bounds.csv", BOUND, _BOUND_COLUMNS),
    ):
        rows = [_flat(result) for job, result in _sorted(campaign, results) if job.kind == kind]
        if rows:
            write_whole(folder / name, _csv(columns, rows))
    timed = [
        {**result, **result["timing"]} for job, result in _sorted(campaign, results) if job.kind != BOUND
    ]
    write_whole(folder / "timings.csv", _csv(_TIMING_COLUMNS, timed))
    claims = [
        {"said": claim.said, "measured": claim.measured, "verdict": claim.verdict}
        for claim in weigh(campaign, results, summary)
    ]
    summary["claims"] = claims
    summary["jobs"] = {"done": len(results), "of": len(campaign.jobs())}
    write_whole(folder / "summary.json", json.dumps(summary, indent=1) + "\n")
    figures = draw(summary, folder)
    write_whole(folder / "report.md", _markdown(campaign, summary, figures, command))
    return summary


def _sorted(campaign: Campaign, results: Results) -> list[tuple[Job, dict[str, Any]]]:
    return [(job, results[job]) for job in campaign.jobs() if job in results]


def _flat(result: dict[str, Any]) -> dict[str, Any]:
    """Lists spread over columns."""
    row = dict(result)
    if "target" in row:
        row["target_row"], row["target_col"] = row["target"]
        row["found"], row["in_region"] = int(row["found"]), int(row["in_region"])
    if "quantiles" in row:
        row |= dict(zip(PERCENTILES, row["quantiles"], strict=True))
    if "reference" in row:
        row["reference"] = row["reference"]["expected"]
    return row


def _csv(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def percent(value: float | None, error: float | None = None) -> str:
    """A share above the bound: "+14 %", with its standard error when there is one."""
    if value is None:
        return "-"
    return f"{100 * value:+.0f} %" + (f" ± {100 * error:.0f}" if error is not None else "")


def _markdown(campaign: Campaign, summary: dict[str, Any], figures: list[Path], command: str) -> str:
    parts = ["# Trials", _about(campaign, summary, command)]
    names = {path.stem: path.name for path in figures}

    def picture(stem: str, title: str) -> str:
        return f"![{title}]({names[stem]})" if stem in names else ""

    if any(row["sampled"] for row in summary["scenarios"]):
        parts += ["## Steps to find the target", _sampled_table(summary)]
        parts += [
            picture("steps-by-planner", "Steps by planner"),
            picture("steps-by-fov", "Steps by field of view"),
        ]
    if any(row["curve"] for row in summary["scenarios"]):
        parts += ["## Detection curves", _curve_text(campaign), _curve_table(summary)]
        parts += [picture("detection-curves", "Detection curves")]
    parts += [
        "## Time per step",
        _time_text(),
        _time_table(summary),
        picture("time-per-step", "Time per step"),
    ]
    if summary["claims"]:
        parts += ["## The paper's claims", _claims_table(summary["claims"])]
    return "\n\n".join(part for part in parts if part) + "\n"


def _about(campaign: Campaign, summary: dict[str, Any], command: str) -> str:
    where = "one given map" if campaign.prior else "the paper's random priors"
    rule = {
        "hit": "A search ends at the first true hit.",
        "covered": "A search ends when the target is first in view (the rule behind the published numbers), "
        "so the bounds are those of a perfect detector.",
    }[campaign.found]
    lines = [
        f"`{command}`",
        f"{campaign.trials} searches and {campaign.curves} detection curves for each planner and field of view, on "
        f"{where}, {campaign.shape[0]} x {campaign.shape[1]} cells, start {campaign.start}, p_tp {campaign.p_tp}, p_tn "
        f"{campaign.p_tn}, at most {campaign.cap} steps, seed {campaign.seed}, preset {campaign.preset}. {rule}",
        "*x % above the bound* compares the mean steps with the mean E[T] that no searcher can beat on the same "
        "priors (release bound for the point FOV, multi-cell bound for the others); ± is one standard error.",
    ]
    if not campaign.deterministic:
        lines.append(
            f"Planners had {1e3 * campaign.deadline_s:g} ms a step, so another machine gives other numbers."  # type: ignore[operator]
        )
    done, of = summary["jobs"]["done"], summary["jobs"]["of"]
    if done < of:
        lines.append(f"**Not complete: {done} of {of} jobs are done; the same command continues.**")
    return "\n\n".join(lines)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    marks = ["---"] + ["---:"] * (len(head) - 1)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [head, marks, *rows])


def _sampled_table(summary: dict[str, Any]) -> str:
    rows = []
    for scenario in summary["scenarios"]:
        row = scenario["sampled"]
        if row:
            steps = [f"{row['steps'][key]:.0f}" for key in (*PERCENTILES, "mean")]
            above = percent(row["above_bound"], row["above_bound_error"])
            rows.append(
                [shown(scenario["planner"]), scenario["fov"], f"{row['found']} of {row['trials']}", *steps, above,
                 f"{row['seen_median']:.1%}"]
            )  # fmt: skip
    head = ["planner", "FOV", "found", "5 %", "25 %", "median", "75 %", "95 %", "mean", "above the bound"]
    return _table([*head, "map seen, median"], rows)


def _curve_text(campaign: Campaign) -> str:
    return (
        "F(t) is the probability that the target is detected within t steps, over all targets at once: a ruler "
        f"without the luck of the draw. Runs end when less than {campaign.tail:g} is undetected, which then counts as "
        "never detected."
    )


def _curve_table(summary: dict[str, Any]) -> str:
    rows = []
    with_reference = any(row["curve"] and "above_reference" in row["curve"] for row in summary["scenarios"])
    for scenario in summary["scenarios"]:
        row = scenario["curve"]
        if row:
            above = percent(row["above_bound"], row["above_bound_error"])
            cells = [
                shown(scenario["planner"]),
                scenario["fov"],
                str(row["priors"]),
                f"{row['expected']:.0f}",
                above,
            ]
            rows.append(cells + ([percent(row.get("above_reference"))] if with_reference else []))
    for fov, bounds in summary["bounds"].items():
        bound = (bounds or {}).get("curve")
        if bound:
            cells = ["*bound*", fov, str(bound["priors"]), f"{bound['expected']:.0f}", ""]
            rows.append(cells + ([""] if with_reference else []))
            if "reference" in bound:
                cells = ["*teleporting reference*", fov, str(bound["priors"]), f"{bound['reference']:.0f}"]
                rows.append([*cells, percent(bound["reference"] / bound["expected"] - 1.0), ""])
    head = ["planner", "FOV", "priors", "E[T]", "above the bound"]
    return _table(head + (["above the teleporting reference"] if with_reference else []), rows)


def _time_text() -> str:
    return (
        "Milliseconds of planning per step: each search's mean, percentiles over the searches; *slowest* is the "
        "slowest single step. In brackets, the published percentiles (point FOV)."
    )


def _time_table(summary: dict[str, Any]) -> str:
    rows = []
    for scenario in summary["scenarios"]:
        times = scenario["time_per_step_ms"]
        if not times:
            continue
        theirs = published.time_per_step(scenario["planner"]) if scenario["fov"] == "point" else None
        cells = [
            f"{times[key]:.3f}" + (f" ({theirs[i]:.2f})" if theirs else "")
            for i, key in enumerate(PERCENTILES)
        ]
        rows.append([shown(scenario["planner"]), scenario["fov"], *cells, f"{times['slowest']:.1f}"])
    return _table(["planner", "FOV", "5 %", "25 %", "median", "75 %", "95 %", "slowest"], rows)


def _claims_table(claims: Sequence[Mapping[str, str]]) -> str:
    rows = [[claim["said"], claim["measured"], f"**{claim['verdict']}**"] for claim in claims]
    return _table(["the paper says", "measured", "verdict"], rows).replace("---:", "---")

"""The figures of a campaign, as PNG: the paper's two and its table, and the detection curves with the bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from sim.trials import published
from sim.trials.published import shown
from sim.trials.summary import PERCENTILES

_INK, _SOFT, _GRID = "#222222", "#707070", "#e4e4e4"
_PUBLISHED = "#b0122b"
_COLOURS = {
    "puct-regions-lite": "#1f6fb4",
    "puct-regions": "#2a9d63",
    "puct": "#8e5bb5",
    "direct-policy-search": "#d17a22",
    "greedy": "#7d7d7d",
    "index": "#c2418d",
    "coverage": "#8a6d3b",
    "spiral": "#3aa6b9",
}
_SPARE = ("#4c566a", "#a3be8c", "#d08770", "#5e81ac", "#bf616a")
_STYLE = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": _SOFT,
    "axes.labelcolor": _INK,
    "xtick.color": _SOFT,
    "ytick.color": _SOFT,
    "text.color": _INK,
    "figure.dpi": 110,
    "savefig.dpi": 110,
}


def draw(summary: dict[str, Any], folder: Path) -> list[Path]:
    """Draw every figure that the summary has numbers for; the files written, in the order to be read."""
    files = []
    with plt.style.context(_STYLE):
        fovs = summary["campaign"]["fovs"]
        sampled = [row for row in summary["scenarios"] if row["sampled"]]
        if sampled:
            first = [row for row in sampled if row["fov"] == fovs[0]]
            files.append(_save(_steps_by_planner(first, summary), folder / "steps-by-planner.png"))
            if len(fovs) > 1:
                files.append(_save(_steps_by_fov(sampled, summary), folder / "steps-by-fov.png"))
        timed = [row for row in summary["scenarios"] if row["time_per_step_ms"] and row["fov"] == fovs[0]]
        if timed:
            files.append(_save(_time_table(timed), folder / "time-per-step.png"))
        if any(row["curve"] for row in summary["scenarios"]):
            files.append(_save(_curves(summary), folder / "detection-curves.png"))
    return files


def _save(figure: Figure, path: Path) -> Path:
    figure.savefig(path, bbox_inches="tight", pad_inches=0.15, metadata={"Software": None})
    plt.close(figure)
    return path


def colour(spec: str, specs: Sequence[str]) -> str:
    """The colour of a planner: its own, or a spare one for a second variant of it."""
    name = published.base_name(spec)
    before = [s for s in specs[: list(specs).index(spec)] if published.base_name(s) == name]
    if not before and name in _COLOURS:
        return _COLOURS[name]
    return _SPARE[list(specs).index(spec) % len(_SPARE)]


def _bar(axes: Axes, at: float, steps: dict[str, float], shade: str) -> None:
    """One percentile bar: a line from 5 to 95, a block from 25 to 75, a cut at the median with its number."""
    p5, p25, p50, p75, p95 = (steps[key] for key in PERCENTILES)
    axes.plot([p5, p95], [at, at], color=shade, lw=1.6, solid_capstyle="butt", zorder=2)
    for end in (p5, p95):
        axes.plot([end, end], [at - 0.13, at + 0.13], color=shade, lw=1.6, zorder=2)
    axes.barh(at, p75 - p25, left=p25, height=0.42, color=shade, alpha=0.85, zorder=3)
    axes.plot([p50, p50], [at - 0.21, at + 0.21], color="white", lw=2.2, zorder=4)
    axes.text(
        p50, at + 0.27, f"{p50:,.0f}".replace(",", " "), ha="center", va="bottom", fontsize=8.5, zorder=5
    )


def _step_axis(axes: Axes, cap: int) -> None:
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.set_xlim(max(low, 1.0), max(high, 1.15 * cap) if high > 0.5 * cap else high)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.0f}".replace(",", " ")))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(axis="x", which="major", color=_GRID, zorder=0)
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0, labelcolor=_INK)
    axes.tick_params(axis="x", which="both", length=3)
    axes.spines["left"].set_visible(False)
    axes.set_xlabel("steps until the target is found (logarithmic)")


def _rule(rows: list[dict[str, Any]], summary: dict[str, Any]) -> str:
    c = summary["campaign"]
    trials = min(row["sampled"]["trials"] for row in rows)
    ends = {"covered": "found when in view", "hit": "found at the first true hit"}[c["found"]]
    return f"{trials} trials each, {c['shape'][0]} x {c['shape'][1]} cells, at most {c['cap']} steps, {ends}"


def _title(axes: Axes, title: str, below: str) -> None:
    axes.set_title(title, loc="left", fontsize=12.5, fontweight="bold", pad=20)
    axes.text(0.0, 1.0, below, transform=axes.transAxes, va="bottom", fontsize=8.5, color=_SOFT)


def _steps_by_planner(rows: list[dict[str, Any]], summary: dict[str, Any]) -> Figure:
    """The paper's figure 'steps by algorithm'; what the text says of the published one in red."""
    specs = summary["campaign"]["planners"]
    figure, axes = plt.subplots(figsize=(8.6, 0.72 * len(rows) + 1.7))
    for at, row in enumerate(reversed(rows)):
        _bar(axes, at, row["sampled"]["steps"], colour(row["planner"], specs))
    axes.set_yticks(range(len(rows)), [shown(row["planner"]) for row in reversed(rows)])
    axes.set_ylim(-0.6, len(rows) - 0.25)
    marks = _published_marks(
        {row["planner"]: row["sampled"]["steps"] for row in rows}, summary["campaign"]["cap"]
    )
    for planner, value in marks:
        at = len(rows) - 1 - [row["planner"] for row in rows].index(planner)
        axes.plot(value, at - 0.36, marker="D", ms=6, mfc="none", mec=_PUBLISHED, mew=1.5, ls="", zorder=6)
    _step_axis(axes, summary["campaign"]["cap"])
    bound = summary["bounds"][rows[0]["fov"]]
    handles = [
        Line2D([], [], color=_SOFT, lw=7, alpha=0.85, label="25-75 %, median cut"),
        Line2D([], [], color=_SOFT, lw=1.6, label="5-95 %"),
    ]
    if bound:
        axes.axvline(bound["expected"], color=_INK, lw=1.1, ls=(0, (4, 3)), zorder=1)
        handles.append(Line2D([], [], color=_INK, lw=1.1, ls=(0, (4, 3)), label="mean of the bound"))
    if marks:
        handles.append(
            Line2D(
                [],
                [],
                marker="D",
                ls="",
                mfc="none",
                mec=_PUBLISHED,
                mew=1.5,
                label="published median, see note",
            )
        )
    _legend(axes, handles)
    _title(axes, f"Steps by planner, {rows[0]['fov']} FOV", _rule(rows, summary))
    if marks:
        _note(
            axes,
            "Published medians are printed only in relation to another planner, so they stand relative to ours: "
            "Lite 61 % above Regions,\nGreedy 6934 steps above PUCT but not beyond the limit, DPS at the limit (over "
            "half of its trials).",
        )
    return figure


def _note(axes: Axes, text: str) -> None:
    axes.annotate(
        text, (0, 0), xycoords="axes fraction", xytext=(0, -66), textcoords="offset points", fontsize=8, color=_SOFT,
        va="top",
    )  # fmt: skip


def _legend(axes: Axes, handles: list[Line2D]) -> None:
    axes.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(0.0, -0.0), borderaxespad=3.6, ncols=len(handles),
        frameon=False, fontsize=8.5, columnspacing=1.6, handlelength=1.8,
    )  # fmt: skip


def _published_marks(steps: dict[str, dict[str, float]], cap: int) -> list[tuple[str, float]]:
    """Where the published medians lie as far as the paper's text says it, relative to ours."""
    marks = []
    if "puct-regions-lite" in steps and "puct-regions" in steps:
        marks.append(("puct-regions-lite", (1 + published.LITE_MORE_STEPS) * steps["puct-regions"]["p50"]))
    if "greedy" in steps and "puct" in steps:
        marks.append(("greedy", min(steps["puct"]["p50"] + published.GREEDY_ABOVE_PUCT, float(cap))))
    if "direct-policy-search" in steps:
        marks.append(("direct-policy-search", float(cap)))
    return marks


def _steps_by_fov(rows: list[dict[str, Any]], summary: dict[str, Any]) -> Figure:
    """The paper's figure 'steps by FOV', for its Lite planner or, without it, the first one."""
    specs = summary["campaign"]["planners"]
    chosen = "puct-regions-lite" if "puct-regions-lite" in specs else specs[0]
    mine = [row for row in rows if row["planner"] == chosen]
    figure, axes = plt.subplots(figsize=(8.6, 0.72 * len(mine) + 1.7))
    shade = colour(chosen, specs)
    for at, row in enumerate(reversed(mine)):
        _bar(axes, at, row["sampled"]["steps"], shade)
        bound = summary["bounds"][row["fov"]]
        if bound:
            axes.plot(
                [bound["expected"]] * 2, [at - 0.3, at + 0.3], color=_INK, lw=1.4, ls=(0, (2, 1.5)), zorder=5
            )
    point = next((row for row in mine if row["fov"] == "point"), None)
    handles = [
        Line2D([], [], color=shade, lw=7, alpha=0.85, label="25-75 %, median cut"),
        Line2D([], [], color=shade, lw=1.6, label="5-95 %"),
        Line2D([], [], color=_INK, lw=1.4, ls=(0, (2, 1.5)), label="mean of the bound"),
    ]
    if point is not None:
        for at, row in enumerate(reversed(mine)):
            if row["fov"] != "point":
                value = published.MULTI_CELL_P95 * point["sampled"]["steps"]["p95"]
                axes.plot(value, at - 0.36, marker="D", ms=6, mfc="none", mec=_PUBLISHED, mew=1.5, zorder=6)
        label = "published 95 %: a quarter of the point's"
        handles.append(Line2D([], [], marker="D", ls="", mfc="none", mec=_PUBLISHED, mew=1.5, label=label))
    axes.set_yticks(range(len(mine)), [row["fov"] for row in reversed(mine)])
    axes.set_ylim(-0.6, len(mine) - 0.25)
    _step_axis(axes, summary["campaign"]["cap"])
    _legend(axes, handles)
    _title(axes, f"Steps by field of view, {shown(chosen)}", _rule(mine, summary))
    return figure


def _time_table(rows: list[dict[str, Any]]) -> Figure:
    """The paper's table 'time per step': ours beside the published numbers."""
    heads = ["5 %", "25 %", "median", "75 %", "95 %"]
    figure, axes = plt.subplots(figsize=(9.6, 0.62 * len(rows) + 1.35))
    axes.axis("off")
    axes.set_xlim(0, 1)
    axes.set_ylim(-len(rows) - 0.2, 1.5)
    columns = [0.39 + 0.10 * i for i in range(5)]
    axes.text(1.0, 0.35, "median ratio", ha="right", fontsize=9.5, color=_SOFT)
    for x, head in zip(columns, heads, strict=True):
        axes.text(x + 0.07, 0.35, head, ha="right", fontsize=9.5, color=_SOFT)
    axes.axhline(0.1, color=_INK, lw=1.0)
    for number, row in enumerate(rows):
        y = -0.45 - number
        times = row["time_per_step_ms"]
        name = row["planner"]
        axes.text(0.0, y - 0.17, shown(name), fontsize=10, va="center")
        theirs = published.time_per_step(name)
        axes.text(0.27, y, "ours", fontsize=9, va="center")
        axes.text(0.27, y - 0.4, "published", fontsize=9, va="center", color=_PUBLISHED)
        for i, (x, key) in enumerate(zip(columns, PERCENTILES, strict=True)):
            axes.text(x + 0.07, y, f"{times[key]:.3f}", ha="right", va="center", fontsize=10)
            value = f"{theirs[i]:.2f}" if theirs else "-"
            axes.text(x + 0.07, y - 0.4, value, ha="right", va="center", fontsize=9.5, color=_PUBLISHED)
        if theirs:
            axes.text(1.0, y - 0.2, f"{theirs[2] / times['p50']:.0f}", ha="right", va="center", fontsize=10.5)
        axes.axhline(y - 0.68, color=_GRID, lw=0.8)
    axes.set_title(
        f"Time per step [ms], {rows[0]['fov']} FOV", loc="left", fontsize=12.5, fontweight="bold", pad=-4
    )
    return figure


def _curves(summary: dict[str, Any]) -> Figure:
    """Mean detection curve of each planner, a panel a field of view, under the bound."""
    specs = summary["campaign"]["planners"]
    steps = np.maximum(np.array(summary["grid"], dtype=np.float64), 1.0)
    fovs = [fov for fov in summary["campaign"]["fovs"] if any(_with_curve(summary, fov))]
    figure, panels = plt.subplots(
        1, len(fovs), figsize=(max(4.1 * len(fovs), 6.6), 4.4), sharey=True, squeeze=False
    )
    for axes, fov in zip(panels[0], fovs, strict=True):
        bound = (summary["bounds"][fov] or {}).get("curve")
        if bound:
            axes.fill_between(steps, bound["detected"], 1.0, color="#f1f1f1", lw=0, zorder=0)
            axes.plot(steps, bound["detected"], color=_INK, lw=1.8)
            if "reference_detected" in bound:
                axes.plot(steps, bound["reference_detected"], color=_INK, lw=1.1, ls=(0, (4, 3)))
        for row in _with_curve(summary, fov):
            axes.plot(steps, row["curve"]["detected"], color=colour(row["planner"], specs), lw=1.8)
        axes.set_xscale("log")
        axes.set_xlim(10, steps[-1])
        axes.set_ylim(0, 1.0)
        axes.grid(color=_GRID, zorder=0)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.0f}".replace(",", " ")))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("steps t (logarithmic)")
        axes.set_title(f"{fov} FOV", loc="left", fontsize=10.5)
    panels[0][0].set_ylabel("F(t), probability of detection within t steps")
    panels[0][0].yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{100 * y:.0f} %"))
    handles = [Line2D([], [], color=_INK, lw=1.8, label="bound: no searcher is above")]
    if any("reference_detected" in (summary["bounds"][fov] or {}).get("curve", {}) for fov in fovs):
        handles.append(
            Line2D(
                [], [], color=_INK, lw=1.1, ls=(0, (4, 3)), label="teleporting searcher, same false alarms"
            )
        )
    drawn = {row["planner"] for fov in fovs for row in _with_curve(summary, fov)}
    handles += [Line2D([], [], color=colour(s, specs), lw=1.8, label=shown(s)) for s in specs if s in drawn]
    figure.suptitle(
        "Detection curves, mean over the priors", x=0.01, ha="left", fontsize=12.5, fontweight="bold"
    )
    columns = min(len(handles), 2 * len(fovs) + 1)
    figure.tight_layout(rect=(0, 0.02 + 0.05 * (-(-len(handles) // columns)), 1, 1.0))
    figure.legend(handles=handles, loc="lower left", ncols=columns, frameon=False, fontsize=8.5)
    return figure


def draw_means(
    minutes: NDArray[np.float64],
    curves: Mapping[str, NDArray[np.float64]],
    marks: Sequence[float],
    path: Path,
) -> None:
    """Draw `curves`, what was found by each of `minutes`, float [n] each, with lines at `marks`, minutes."""
    with plt.style.context(_STYLE):
        figure, axes = plt.subplots(figsize=(7.2, 4.0))
        for shade, (name, curve) in zip(_SPARE, curves.items(), strict=False):
            axes.plot(minutes, curve, color=shade, lw=1.8, label=name)
        for mark in marks:
            axes.axvline(mark, color=_SOFT, lw=0.9, ls=(0, (4, 3)))
        axes.set_xlim(0, minutes[-1])
        axes.set_ylim(0, 1.0)
        axes.grid(color=_GRID, zorder=0)
        axes.set_xlabel("minutes")
        axes.set_ylabel("F(t), probability of detection")
        axes.legend(loc="lower right", frameon=False)
        _save(figure, path)


def _with_curve(summary: dict[str, Any], fov: str) -> list[dict[str, Any]]:
    return [row for row in summary["scenarios"] if row["fov"] == fov and row["curve"]]

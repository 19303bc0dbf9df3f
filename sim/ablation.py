"""`roisearch-sim ablation`: what each part of the default planner is worth, by the exact detection curve.

Every variant flies the same held-out priors from the paper's start, planning at every step; only a path
that was given without thinking is flown to its end before the next plan, when no false alarm can end it.
E[T] is restricted to the cap of 40 000 steps and set against what the prior allows: the release bound with
a point field of view, the multi-cell bound with another one. With a point field of view and false alarms
it is set against the teleporting reference (`roisearch.bounds`). Both sides are averaged over the same
number of draws, seeded alike. With `--motion` all of it is in seconds of flight: the default is then the planner of
tours, with its settings, a planner that knows no motion flies its cells with the same aircraft, E[T] is restricted to
the time of a straight flight over as many cells as the map has, and the release bound in seconds is what it is set
against. The results are kept in the folder: the same command goes on where it stopped.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import itertools
import json
import shlex
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import PLANNERS, Belief, Decision, FieldOfView, Motion, Planner, SearchState, make_planner
from roisearch.bounds import (
    expected_seconds,
    expected_time,
    multi_cell,
    release,
    release_seconds,
    teleport_reference,
)
from roisearch.planners.base import Progress
from roisearch.planners.lookahead.settings import LookaheadSettings
from roisearch.planners.tour.settings import TourSettings
from service.errors import Parser
from sim import ruler_seconds
from sim.ruler import Ruler, detection_curve
from sim.scenario import EQUAL, PAPER_SHAPE, PAPER_START, PAPER_STEPS, paper_prior
from sim.trials.flight import CELL_M, SPEED_MPS

P_TP = 0.9
VARIANTS = "iterations=0 iterations=1,horizon=3000 iterations=16,horizon=5000"
SHARES = (50.0, 95.0, 99.9, 100.0)
"""Percentiles of the time that a decision takes; the last is the slowest."""
DEFAULT = "puct-regions-lite"
KEY = ("variant", "fov", "p_tn", "equal", "side", "motion", "deadline_ms", "stop_below", "seed", "draw")
"""The fields that tell one result from another."""
FIELDS = (*KEY, "expected", "reference", "steps", "first_cpu_ms", "first_wall_ms",
          *(f"cpu_ms_{p:g}" for p in SHARES), *(f"wall_ms_{p:g}" for p in SHARES))  # fmt: skip
LEAST_SIDE = 20
COLOURS = ("#b0b0b0", "#d08c3a", "#1f6f8b", "#7a3b8f", "#3b8f4a")
Row = dict[str, str]


class Clocked:
    """A planner whose decisions are timed: processor time of the thread, and time by the clock."""

    def __init__(self, planner: Planner) -> None:
        self.planner, self.name = planner, planner.name
        self.times: list[tuple[float, float]] = []

    def plan(
        self, belief: Belief, state: SearchState, rng: np.random.Generator, *, deadline_s: float | None = None
    ) -> Decision:
        """As the planner's."""
        cpu, wall = time.thread_time(), time.perf_counter()
        decision = self.planner.plan(belief, state, rng, deadline_s=deadline_s)
        self.times.append((time.thread_time() - cpu, time.perf_counter() - wall))
        return decision

    def warm_up(self, progress: Progress | None = None) -> None:
        """As the planner's."""
        self.planner.warm_up(progress)

    def milliseconds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Of the first decision, [2], and of the others by `SHARES`, [shares, 2]; processor, clock."""
        times = 1000.0 * np.array(self.times)
        return times[0], np.percentile(times[1:] if len(times) > 1 else times, SHARES, axis=0)


def motion_of(options: argparse.Namespace) -> Motion | None:
    """The aircraft of `--motion`; None: in steps."""
    if options.motion is None:
        return None
    return Motion(cell_m=CELL_M, speed_mps=SPEED_MPS, acceleration_mps2=options.motion)


def planner_named(name: str, fov: FieldOfView, motion: Motion | None = None) -> Planner:
    """A planner by its name, or the default with settings such as `iterations=4,horizon=1000`.

    Raises:
        ValueError: when there is no such planner or setting, in one sentence.
    """
    shared = {"fov": fov} if motion is None else {"fov": fov, "motion": motion}
    if name in PLANNERS:
        return make_planner(name, **shared)
    kind = LookaheadSettings if motion is None or not fov.is_point else TourSettings
    types = {field.name: str(field.type) for field in dataclasses.fields(kind)}
    values: dict[str, Any] = {}
    for part in name.split(","):
        key, _, value = part.partition("=")
        if key not in types:
            raise ValueError(f"'{key}' is neither a planner nor one of the settings {', '.join(types)}")
        values[key] = float(value) if types[key] == "float" else int(value)
    return make_planner(DEFAULT, **shared, **values)


def field_of_view(name: str, p_tn: float) -> FieldOfView:
    """point, donut or wide-angle."""
    made = {"point": FieldOfView.point, "donut": FieldOfView.donut, "wide-angle": FieldOfView.wide_angle}
    return made[name](P_TP, p_tn)


def cap_of(motion: Motion, cells: int) -> float:
    """The seconds to which E[T] is restricted: those of a straight cell for each on the map."""
    return cells * motion.cell_m / motion.speed_mps


def reference_time(
    prior: NDArray[np.float64], fov: FieldOfView, p_tn: float, seed: tuple[int, int], motion: Motion | None
) -> float:
    """E[T] of what the result is set against, which `reference_named` says; see the module's text."""
    if motion is not None:
        times, found = release_seconds(prior, PAPER_START, P_TP, motion, cap_of(motion, prior.size))
        return expected_seconds(times, found, cap_of(motion, prior.size))
    if not fov.is_point:
        return expected_time(multi_cell(prior, PAPER_START, fov, P_TP, PAPER_STEPS))
    if p_tn == 1.0:
        return expected_time(release(prior, PAPER_START, P_TP, PAPER_STEPS))
    rng = np.random.default_rng(seed)
    return expected_time(teleport_reference(prior, P_TP, p_tn, PAPER_STEPS, rng, draws=1))


def reference_named(options: argparse.Namespace) -> str:
    """What `reference_time` is the time of."""
    teleports = options.fov == "point" and options.p_tn < 1.0 and options.motion is None
    return "the teleporting reference" if teleports else "the bound"


def fly(variant: str, seed: int, draw: int, options: argparse.Namespace) -> Row:
    """One search of one prior: its row of the results."""
    fov, motion = field_of_view(options.fov, options.p_tn), motion_of(options)
    prior = paper_prior(np.random.default_rng(seed), (options.side, options.side), equal=options.equal)
    planner = Clocked(
        planner_named(variant, fov, motion)
    )  # a new one: it takes its regions from the first belief
    follow = variant not in PLANNERS and options.p_tn == 1.0
    rng = np.random.default_rng((seed, draw))
    if motion is None:
        deadline = None if options.deadline_ms is None else options.deadline_ms / 1000.0
        ruler = Ruler(P_TP, options.p_tn, fov, deadline, options.stop_below, follow)
        expected = expected_time(detection_curve(planner, prior, PAPER_START, PAPER_STEPS, ruler, rng))
    else:
        how = ruler_seconds.How(
            PAPER_START, fov=fov, steps=PAPER_STEPS, stop_below=options.stop_below, follow=follow
        )
        expected = ruler_seconds.fly(planner, prior, motion, rng, how).expected(cap_of(motion, prior.size))
    first, others = planner.milliseconds()
    numbers = [expected, reference_time(prior, fov, options.p_tn, (seed, draw), motion)]
    clocks = [*first, *others[:, 0], *others[:, 1]]
    texts = [*key_of(variant, seed, draw, options), *(f"{x:.3f}" for x in numbers), str(len(planner.times)),
             *(f"{x:.4f}" for x in clocks)]  # fmt: skip
    return dict(zip(FIELDS, texts, strict=True))


def key_of(variant: str, seed: int, draw: int, options: argparse.Namespace) -> tuple[str, ...]:
    """The values of `KEY`."""
    return (variant, options.fov, f"{options.p_tn:g}", options.equal, str(options.side), f"{options.motion or 0:g}",
            f"{options.deadline_ms or 0:g}", f"{options.stop_below:g}", str(seed), str(draw))  # fmt: skip


def averaged(rows: list[Row]) -> NDArray[np.float64]:
    """E[T] and its reference for each prior, float [priors, 2], the mean over the draws."""
    seeds = sorted({int(row["seed"]) for row in rows})
    return np.array([
        np.mean([(float(r["expected"]), float(r["reference"])) for r in rows if int(r["seed"]) == seed], axis=0)
        for seed in seeds
    ])  # fmt: skip


def above(times: NDArray[np.float64]) -> dict[str, float]:
    """How far above the reference: the ratio of sums and the mean of ratios, with one standard error each."""
    n = len(times)
    ours, theirs = times[:, 0], times[:, 1]
    ratio, ratios = ours.sum() / theirs.sum(), ours / theirs
    spare = np.sqrt(n / max(1, n - 1))
    return {
        "priors": n,
        "expected": float(ours.mean()),
        "reference": float(theirs.mean()),
        "ratio_of_sums": float(ratio - 1.0),
        "ratio_of_sums_error": float(spare * np.sqrt(((ours - ratio * theirs) ** 2).sum()) / theirs.sum()),
        "mean_of_ratios": float(ratios.mean() - 1.0),
        "mean_of_ratios_error": float(spare * ratios.std() / np.sqrt(n)),
    }


def summary_of(rows: list[Row]) -> dict[str, Any]:
    """One variant in numbers. Percentiles of decision times are the median and the worst over the priors."""
    found: dict[str, Any] = above(averaged(rows))
    for clock in ("cpu", "wall"):
        for p in SHARES:
            values = [float(row[f"{clock}_ms_{p:g}"]) for row in rows]
            found[f"{clock}_ms_{p:g}"] = float(np.max(values) if p == 100.0 else np.median(values))
        found[f"first_{clock}_ms"] = float(np.median([float(row[f"first_{clock}_ms"]) for row in rows]))
    return found


def report(rows: list[Row], options: argparse.Namespace, command: str) -> str:
    """The results as Markdown."""
    how = "" if options.motion is None else (
        f"in seconds of flight, cells of {CELL_M:g} m, {SPEED_MPS:g} m/s, {options.motion:g} m/s2, "
    )  # fmt: skip
    lines = [
        f"{options.fov} field of view, p_tp = {P_TP:g}, p_tn = {options.p_tn:g}, {options.side} x {options.side} "
        f"cells, start {PAPER_START}, {how}at most {PAPER_STEPS} steps; one standard error after ±.", "",
        f"    {command}", "",
        f"| planner | priors | E[T] | of {reference_named(options)} | above it: ratio of sums | mean of ratios "
        "| decision, processor ms: 50, 95, 99.9 %, most | by the clock | the first |",
        "|---" * 9 + "|",
    ]  # fmt: skip
    for variant in options.variants.split():
        own = [row for row in rows if row["variant"] == variant]
        if not own:
            continue
        s = summary_of(own)
        clocks = [", ".join(f"{s[f'{c}_ms_{p:g}']:.2f}" for p in SHARES) for c in ("cpu", "wall")]
        lines.append(
            f"| `{variant}` | {s['priors']} | {s['expected']:.0f} | {s['reference']:.0f} "
            f"| {s['ratio_of_sums']:.1%} ± {100 * s['ratio_of_sums_error']:.1f} "
            f"| {s['mean_of_ratios']:.1%} ± {100 * s['mean_of_ratios_error']:.1f} "
            f"| {clocks[0]} | {clocks[1]} | {s['first_cpu_ms']:.0f} |"
        )
    return "\n".join(lines) + "\n"


def plot(rows: list[Row], variants: list[str], reference: str, path: Path) -> None:
    """Each prior's E[T] above its reference, so named; the priors in the order of the first variant's."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panel = plt.subplots(figsize=(9, 4), layout="constrained")
    order: dict[int, int] = {}
    styles = itertools.cycle(itertools.product("os^D", COLOURS))
    for variant, (marker, colour) in zip(variants, styles, strict=False):
        own = [row for row in rows if row["variant"] == variant]
        seeds = sorted({int(row["seed"]) for row in own})
        times = averaged(own)
        percent = 100.0 * (times[:, 0] / times[:, 1] - 1.0)
        if not order:
            order = {seed: place for place, seed in enumerate(np.array(seeds)[np.argsort(percent)].tolist())}
        places = [order[seed] for seed in seeds if seed in order]
        values = [value for seed, value in zip(seeds, percent, strict=True) if seed in order]
        panel.plot(
            places, values, marker, ms=4, color=colour, label=f"{variant}: mean {np.mean(percent):.1f} %"
        )
    panel.set_xlabel("prior, in the order of the first planner")
    panel.set_ylabel(f"E[T] above {reference}, %")
    panel.grid(alpha=0.3)
    panel.legend(frameon=False)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(prog="roisearch-sim ablation", description=__doc__)
    p.add_argument("--variants", default=VARIANTS, help="planners, or settings of the default, with spaces "
                   f"between (default '{VARIANTS}')")  # fmt: skip
    p.add_argument("--first", type=int, default=5000, help="seed of the first prior (default 5000)")
    p.add_argument("--priors", type=int, default=40, help="how many (default 40)")
    p.add_argument("--fov", choices=("point", "donut", "wide-angle"), default="point")
    p.add_argument("--p-tn", type=float, default=1.0, help="P(no hit | target not there) (default 1)")
    p.add_argument("--draws", type=int, default=1, help="draws of false alarms for each prior (default 1)")
    p.add_argument("--equal", choices=EQUAL, default="height", help="what the Gaussians share")
    p.add_argument("--side", type=int, default=PAPER_SHAPE[0], help="cells on a side (default 200)")
    p.add_argument("--motion", type=float, metavar="MPS2", help="fly in seconds, with an aircraft of this acceleration "
                   f"on cells of {CELL_M:g} m at {SPEED_MPS:g} m/s")  # fmt: skip
    p.add_argument("--deadline-ms", type=float, help="handed to plan() at every step (not repeatable)")
    p.add_argument("--stop-below", type=float, default=5e-5, help="undetected mass at which F is held")
    p.add_argument("--out", type=Path, default=Path("ablation"), help="folder of the results")
    return p


def main(arguments: list[str]) -> int:
    """Fly what is missing, then write the table, the summary and the figure; 2 for bad input."""
    options = parser().parse_args(arguments)
    variants = options.variants.split()
    try:
        if options.motion is not None and options.deadline_ms is not None:
            raise ValueError("a deadline is for steps; with --motion leave --deadline-ms out")
        if options.motion is not None and options.fov != "point":
            raise ValueError(f"in seconds there is a bound for a point field of view, not for {options.fov}")
        if options.side < LEAST_SIDE:
            raise ValueError(
                f"the paper's priors need at least {LEAST_SIDE} cells on a side, not {options.side}"
            )
        for variant in variants:
            planner_named(variant, field_of_view(options.fov, options.p_tn), motion_of(options)).warm_up()
    except ValueError as error:
        print(f"roisearch-sim ablation: {error}", file=sys.stderr)
        return 2
    options.out.mkdir(parents=True, exist_ok=True)
    results = options.out / "results.csv"
    kept: dict[tuple[str, ...], Row] = {}
    if results.exists():
        with results.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            if tuple(reader.fieldnames or ()) != FIELDS:
                print(
                    f"roisearch-sim ablation: {results} has other columns; give another --out",
                    file=sys.stderr,
                )
                return 2
            kept = {tuple(row[name] for name in KEY): row for row in reader}
    else:
        results.write_text(",".join(FIELDS) + "\n", encoding="utf-8")
    rows: list[Row] = []
    for seed in range(options.first, options.first + options.priors):
        for draw in range(options.draws if options.p_tn < 1.0 else 1):
            for variant in variants:
                key = key_of(variant, seed, draw, options)
                if key not in kept:
                    kept[key] = fly(variant, seed, draw, options)
                    with results.open("a", newline="", encoding="utf-8") as file:
                        csv.DictWriter(file, FIELDS).writerow(kept[key])
                rows.append(kept[key])
                ratio = float(kept[key]["expected"]) / float(kept[key]["reference"])
                print(f"prior {seed} draw {draw} {variant}: {ratio - 1:.1%} above", flush=True)
    text = report(rows, options, shlex.join(["roisearch-sim", "ablation", *arguments]))
    (options.out / "ablation.md").write_text(text, encoding="utf-8")
    summary = {v: summary_of([row for row in rows if row["variant"] == v]) for v in variants}
    (options.out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    plot(rows, variants, reference_named(options), options.out / "above-bound.png")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""What each part of the sweep planner is worth, by the exact detection curve: `python -m sim.ablation --help`.

Every variant flies the same held-out priors, from the paper's start, with a point field of view and no
false alarms. E[T] is restricted to the cap of 40 000 steps and set against the release bound of the same
prior.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time

import numpy as np

from roisearch import FieldOfView, Planner
from roisearch.bounds import expected_time, release
from roisearch.planners.index import IndexPlanner
from roisearch.planners.sweep import SweepPlanner, SweepSettings
from sim.ruler import detection_curve
from sim.scenario import PAPER_START, PAPER_STEPS, paper_prior

P_TP = 0.9


def variants(names: str) -> dict[str, Planner]:
    """Planners by name: `index`, or settings such as `iterations=4,horizon=1000`; separated by spaces."""
    fov = FieldOfView.point(P_TP, 1.0)
    made: dict[str, Planner] = {}
    for name in names.split():
        if name == "index":
            made[name] = IndexPlanner(fov=fov)
            continue
        options = dict(part.split("=") for part in name.split(","))
        types = {field.name: field.type for field in dataclasses.fields(SweepSettings)}
        values = {key: float(v) if types[key] == "float" else int(v) for key, v in options.items()}
        made[name] = SweepPlanner(SweepSettings(**values), fov=fov)  # type: ignore[arg-type]
    return made


def main(arguments: list[str]) -> int:
    """Print a line for each prior and variant, and the means so far."""
    parser = argparse.ArgumentParser(prog="python -m sim.ablation", description=__doc__)
    parser.add_argument("--first", type=int, default=5000, help="seed of the first prior")
    parser.add_argument("--priors", type=int, default=40)
    parser.add_argument("--equal", default="height", help="what the Gaussians have in common: height or mass")
    parser.add_argument("--deadline-ms", type=float, help="handed to plan() at every step")
    parser.add_argument("--stop-below", type=float, default=2e-4, help="undetected mass at which F is held")
    parser.add_argument("--variants", default="index iterations=0 iterations=1 iterations=8")
    options = parser.parse_args(arguments)
    deadline = None if options.deadline_ms is None else options.deadline_ms / 1000.0
    planners = variants(options.variants)
    times = np.zeros((0, 1 + len(planners)))
    for seed in range(options.first, options.first + options.priors):
        prior = paper_prior(np.random.default_rng(seed), equal=options.equal)
        row = [expected_time(release(prior, PAPER_START, P_TP, PAPER_STEPS))]
        for name, planner in planners.items():
            began = time.process_time()
            curve = detection_curve(
                planner, prior, PAPER_START, P_TP, PAPER_STEPS, np.random.default_rng(seed),
                deadline_s=deadline, stop_below=options.stop_below,
            )  # fmt: skip
            row.append(expected_time(curve))
            steps = int(np.argmax(curve >= curve[-1]))
            spent = 1000.0 * (time.process_time() - began) / max(1, steps)
            print(
                f"prior {seed} {name}: E[T] {row[-1]:.0f}, bound {row[0]:.0f}, {spent:.2f} ms a step",
                flush=True,
            )
        times = np.vstack([times, row])
        for i, name in enumerate(planners, start=1):
            ratios = times[:, i] / times[:, 0]
            whole = times[:, i].sum() / times[:, 0].sum()
            print(
                f"  {len(times)} priors, {name}: {whole - 1:.1%} above the bound, "
                f"mean of ratios {ratios.mean() - 1:.1%}"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""`roisearch-sim trials`: run planners over many priors, and write down how they did."""

from __future__ import annotations

import argparse
import functools
import shlex
import sys
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from roisearch import PLANNERS
from service.errors import Parser
from sim.progress import Rest, bars, span
from sim.trials.battery_cli import is_battery
from sim.trials.battery_cli import main as battery
from sim.trials.campaign import (
    FOVS,
    PAPER_PLANNERS,
    PAPER_POINT_ONLY,
    PAPER_TRIALS,
    Campaign,
    Job,
    load_prior,
)
from sim.trials.fleet_cli import fly_fleets, is_fleet
from sim.trials.flight_cli import fly, is_flight
from sim.trials.forecast import Forecast
from sim.trials.journal import Journal, Refused, with_earlier_planners
from sim.trials.pool import executor, exit_code, run
from sim.trials.proven_cli import is_proven
from sim.trials.proven_cli import main as prove
from sim.trials.published import shown
from sim.trials.report import percent, write_report
from sim.trials.trial import run_job
from sim.trials.walking_cli import is_walking
from sim.trials.walking_cli import main as walking

_CURVES, _PAPER_CURVES = 40, 20
_BOUNDS = "bounds"


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="roisearch-sim trials",
        description="Search many random priors with each planner, and report steps, detection curves, times and how "
        "far above the bound they are. Run again with the same --out, it continues where it ended, and takes planners "
        "that are new to it.",
        epilog="Other campaigns, each with a --help of its own: --preset flight (seconds of flight), --preset battery "
        "(the end of a battery planned or cut off), --preset proven (the default in steps beside the bound that counts "
        "travel), --preset walking (a target that walks; with --optimum "
        "beside the best flight), "
        "--searchers N,.. (several searchers on one belief).",
    )
    p.add_argument(
        "--planners",
        metavar="A,B,..",
        help=f"NAME[@PRESET][:OPTION=VALUE].. each; names: {', '.join(PLANNERS)}, or package.module:Class",
    )
    p.add_argument("--fov", metavar="F,..", help=f"{', '.join(FOVS)} (default point)")
    p.add_argument(
        "--trials", type=int, metavar="N", help="sampled searches of each planner and FOV (default 100)"
    )
    p.add_argument(
        "--curves",
        type=int,
        metavar="N",
        help=f"detection curves of each (default: as many, at most {_CURVES}, with --preset paper {_PAPER_CURVES})",
    )
    p.add_argument(
        "--ruler",
        choices=("sampled", "curve", "both"),
        help="drawn targets, exact curves, or both (default sampled; with --curves or --preset paper both)",
    )
    p.add_argument("--seed", type=int, default=1, metavar="S", help="same seed, same numbers (default 1)")
    presets = ("default", "paper", "reference", "flight", "battery", "walking")
    p.add_argument("--preset", choices=presets, default="default",
                   help="of the tree searches; 'paper' also sets the paper's planners, FOVs (the baselines with the "
                   "point FOV only, as in the paper), trials, and --found covered, unless they are given; 'flight' is "
                   "another campaign: seconds of flight, see 'trials --preset flight --help'; and 'battery' and "
                   "'walking' are too: what one battery finds, and a target that walks")  # fmt: skip
    p.add_argument("--found", choices=("hit", "covered"), help="what ends a search: the first true hit (default), or "
                   "the target in view")  # fmt: skip
    p.add_argument(
        "--cap", type=int, default=40_000, metavar="STEPS", help="most steps of a search (default 40000)"
    )
    p.add_argument(
        "--iterations", type=int, metavar="N", help="of the tree searches, instead of the preset's"
    )
    p.add_argument("--deadline", type=float, metavar="S", help="seconds a decision may take (not repeatable)")
    p.add_argument("--p-tp", type=float, default=0.9, help="P(hit | target there) (default 0.9)")
    p.add_argument("--p-tn", type=float, default=0.9, help="P(no hit | target not there) (default 0.9)")
    p.add_argument(
        "--size", type=_pair, default=(200, 200), metavar="ROWS,COLS", help="of the map (default 200,200)"
    )
    p.add_argument("--start", type=_pair, default=(5, 5), metavar="ROW,COL", help="(default 5,5)")
    p.add_argument(
        "--prior", type=Path, metavar="FILE", help="search this map, .npy, or .npz with prior and flyable"
    )
    p.add_argument("--jobs", type=int, default=2, metavar="J", help="processes on this machine (default 2)")
    p.add_argument(
        "--scheduler", default="", metavar="URL", help="a Dask scheduler, such as tcp://host:8786, instead"
    )
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the results")
    return p


def _pair(text: str) -> tuple[int, int]:
    try:
        first, second = (int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not two numbers, such as 200,200") from None
    return first, second


def campaign_from(options: argparse.Namespace) -> Campaign:
    """The campaign that was asked for.

    Raises:
        ValueError: one sentence on what cannot be.
    """
    paper = options.preset == "paper"
    planners = options.planners.split(",") if options.planners else PAPER_PLANNERS if paper else None
    if planners is None:
        raise ValueError("--planners is missing: name one or more, separated by commas")
    fovs = options.fov.split(",") if options.fov else FOVS if paper else ("point",)
    first_fov_only = () if options.planners or options.fov or not paper else PAPER_POINT_ONLY
    trials = options.trials if options.trials is not None else PAPER_TRIALS if paper else 100
    ruler = options.ruler or ("both" if paper or options.curves else "sampled")
    curves = (
        options.curves if options.curves is not None else min(trials, _PAPER_CURVES if paper else _CURVES)
    )
    given: dict[str, Any] = load_prior(options.prior) if options.prior else {"shape": options.size}
    return Campaign(
        planners=tuple(planners),
        fovs=tuple(fovs),
        first_fov_only=first_fov_only,
        trials=0 if ruler == "curve" else trials,
        curves=0 if ruler == "sampled" else curves,
        seed=options.seed,
        found=options.found or ("covered" if paper else "hit"),
        preset=options.preset,
        cap=options.cap,
        iterations=options.iterations,
        deadline_s=options.deadline,
        p_tp=options.p_tp,
        p_tn=options.p_tn,
        start=options.start,
        **given,
    )


def main(arguments: list[str]) -> int:
    """Run it; 0 when all is done, 2 for bad input, 1 when a worker died, 130 when interrupted."""
    if is_flight(arguments):
        return fly(arguments)
    if is_battery(arguments):
        return battery(arguments)
    if is_proven(arguments):
        return prove(arguments)
    if is_walking(arguments):
        return walking(arguments)
    if is_fleet(arguments):
        return fly_fleets(arguments)
    options = parser().parse_args(arguments)
    console = Console()
    try:
        if options.jobs < 1:
            raise ValueError(f"--jobs must be at least 1, not {options.jobs}")
        campaign = with_earlier_planners(options.out, campaign_from(options))
        with Journal(options.out, campaign) as journal:
            return _work(campaign, journal, options, console, arguments)
    except (Refused, ValueError) as error:
        print(f"roisearch-sim trials: {error}", file=sys.stderr)
        return 2


def _work(
    campaign: Campaign, journal: Journal, options: argparse.Namespace, console: Console, arguments: list[str]
) -> int:
    """Do what is not done yet, then write the report, also of a part."""
    jobs = journal.left(campaign.jobs(), campaign)
    code, began, there = 0, time.monotonic(), len(journal.results)
    if journal.results and jobs:
        console.print(f"{len(journal.results)} results are there already")
    if jobs:
        code = exit_code(lambda: _run_all(campaign, journal, jobs, options, console), console)
    command = shlex.join(["roisearch-sim", "trials", *arguments])
    if journal.results:
        summary = write_report(campaign, journal.results, options.out, command)
        console.print(_table(summary))
        took = time.monotonic() - began
        done = len(journal.results) - there
        left = f" of {len(jobs)}" if code else ""
        console.print(
            f"{done}{left} jobs done in {span(took)}; report: {options.out / 'report.md'}", highlight=False
        )
    return code


def _run_all(
    campaign: Campaign, journal: Journal, jobs: list[Job], options: argparse.Namespace, console: Console
) -> None:
    """Run the jobs under progress bars: one for everything, one for each planner."""
    with (
        bars(console) as progress,
    ):
        if not options.scheduler:
            if not console.is_terminal:  # where there are no bars
                console.print("compiling what the planners need, which is kept for the next time")
            _compile(campaign, progress)
        with executor(options.jobs, options.scheduler) as (pool, workers):
            everything, rest = (
                progress.add_task(f"all, {workers} workers", total=len(jobs)),
                Rest(console, len(jobs)),
            )
            bar_of: dict[str, TaskID] = {}
            for name in [*campaign.planners, ""]:
                count = sum(job.planner == name for job in jobs)
                if count:
                    bar_of[name] = progress.add_task(f"  {shown(name) if name else _BOUNDS}", total=count)

            forecast = Forecast(jobs, workers)

            def done(job: Job, results: list[dict[str, Any]]) -> None:
                journal.add(results)
                if said := forecast.done(job, results):
                    console.print(said, highlight=False)
                progress.advance(everything)
                progress.advance(bar_of[job.planner])
                rest.advance()

            run(pool, workers, functools.partial(run_job, campaign), jobs, done)


def _compile(campaign: Campaign, progress: Progress) -> None:
    """Compile every kernel once, before the workers do it at the same time."""
    scenarios = campaign.scenarios()
    bar = progress.add_task("compiling", total=len(scenarios))
    for planner, fov in scenarios:
        campaign.warm_up(planner, fov)
        progress.advance(bar)
    progress.remove_task(bar)


def _table(summary: dict[str, Any]) -> Table:
    """The short of it, for the terminal."""
    table = Table("planner", "FOV", "found", "median", "mean", "E[T]", "above the bound", "ms a step")
    for row in summary["scenarios"]:
        sampled, curve, times = row["sampled"], row["curve"], row["time_per_step_ms"]
        best = curve or sampled
        table.add_row(
            shown(row["planner"]),
            row["fov"],
            f"{sampled['found']} of {sampled['trials']}" if sampled else "-",
            f"{sampled['steps']['p50']:.0f}" if sampled else "-",
            f"{sampled['steps']['mean']:.0f}" if sampled else "-",
            f"{curve['expected']:.0f}" if curve else "-",
            percent(best["above_bound"], best["above_bound_error"]),
            f"{times['p50']:.3f}" if times else "-",
        )
    return table

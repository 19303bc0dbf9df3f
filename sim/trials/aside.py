"""What the campaigns beside the paper's share on the command line: how they are run, resumed and refused."""

from __future__ import annotations

import argparse
import functools
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console

from sim.progress import Rest, bars, span
from sim.trials.campaign import Job
from sim.trials.journal import Journal, Refused
from sim.trials.pool import executor, exit_code, run

Campaign = TypeVar("Campaign", bound=Any)


def add_how(p: argparse.ArgumentParser, *, required: bool = True) -> None:
    """The flags that say where a campaign is run and kept; `required`: whether it has to be kept."""
    p.add_argument("--jobs", type=int, default=2, metavar="J", help="processes on this machine (default 2)")
    p.add_argument("--scheduler", default="", metavar="URL", help="a Dask scheduler instead")
    p.add_argument("--out", type=Path, required=required, metavar="DIR", help="folder of the results")


def in_its_journal(
    options: argparse.Namespace, make: Callable[[], Campaign], work: Callable[[Campaign, Journal], int]
) -> int:
    """Make a campaign and work on it with its journal; 2, and one line, for what cannot be."""
    try:
        if options.jobs < 1:
            raise ValueError(f"--jobs must be at least 1, not {options.jobs}")
        campaign = make()
        with Journal(options.out, campaign) as journal:
            return work(campaign, journal)
    except (Refused, ValueError) as error:
        print(f"roisearch-sim trials: {error}", file=sys.stderr)
        return 2


def fly_the_rest(
    campaign: Any,
    journal: Journal,
    options: argparse.Namespace,
    flown: Callable[..., list[dict[str, Any]]],
    console: Console,
) -> int:
    """Run `flown(campaign, job)` for what the journal does not have yet, under a progress bar; an exit code."""
    jobs = [job for job in campaign.jobs() if job not in journal.results]
    if journal.results and jobs:
        console.print(f"{len(journal.results)} results are there already")
    if not jobs:
        return 0
    began = time.monotonic()
    there = len(journal.results)
    code = exit_code(lambda: _run_all(campaign, journal, jobs, options, flown, console), console)
    done, took = len(journal.results) - there, span(time.monotonic() - began)
    console.print(f"{done} of {len(jobs)} flights in {took}", highlight=False)
    return code


def _run_all(
    campaign: Any,
    journal: Journal,
    jobs: Sequence[Job],
    options: argparse.Namespace,
    flown: Callable[..., list[dict[str, Any]]],
    console: Console,
) -> None:
    with (
        bars(console) as progress,
        executor(options.jobs, options.scheduler) as (pool, workers),
    ):
        bar, rest = (
            progress.add_task(f"flights, {workers} workers", total=len(jobs)),
            Rest(console, len(jobs)),
        )

        def done(job: Job, results: list[dict[str, Any]]) -> None:
            journal.add(results)
            progress.update(bar, advance=1, description=f"seed {job.trial}, {job.planner}, {job.fov}")
            rest.advance()

        run(pool, workers, functools.partial(flown, campaign), jobs, done)

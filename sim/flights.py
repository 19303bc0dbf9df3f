"""`roisearch-sim flights`: fly whole searches with the real service against the mock, and count how they end.

Each flight is a `roisearch-service` process with its own mock autopilot, detector and drawn target. A flight
counts as good when it ends FOUND and the reported position is within `--within` cells of the simulated target. A
flight may take as long as its search: the mock's battery and the limits of time and POS are out of the way.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

NO_LIMITS = {
    "ROISEARCH_DEMO_ENDURANCE_MIN": "600",
    "ROISEARCH_FLIGHT_MAX_FLIGHT_S": "36000",
    "ROISEARCH_SEARCH_STOP_AT_POS": "0.999999",
}


@dataclass(frozen=True)
class Flight:
    """One search to fly."""

    area: Path
    flavor: str
    seed: int


@dataclass(frozen=True)
class Result:
    """How it ended: the service's exit code and report (empty when there is none), and what it said last."""

    flight: Flight
    code: int
    report: dict[str, Any]
    said: str

    def error_cells(self) -> float | None:
        """Distance from the reported position to the target, in cells."""
        simulated = self.report.get("simulated") or {}
        error: float | None = simulated.get("error_cells")
        return error

    def good(self, within: float) -> bool:
        """True when the target was found where it is."""
        error = self.error_cells()
        return self.code == 0 and error is not None and error <= within


def fly(flight: Flight, runs: Path, speedup: float, extra: Sequence[str], patience_s: float) -> Result:
    """Fly one search in a process of its own."""
    runs = runs / f"{flight.area.stem}-{flight.flavor}-{flight.seed}"
    words = [sys.executable, "-m", "service", "--area", str(flight.area), "--flavor", flight.flavor]
    words += [
        "--seed",
        str(flight.seed),
        "--speedup",
        f"{speedup:g}",
        "--runs",
        str(runs),
        "--http",
        "127.0.0.1:0",
    ]
    try:
        done = subprocess.run(
            [*words, *extra],
            capture_output=True,
            text=True,
            timeout=patience_s,
            env={**os.environ, **NO_LIMITS},
        )
        code, said = done.returncode, (done.stdout + done.stderr).strip()
    except subprocess.TimeoutExpired as error:
        output = error.stdout or b""
        code, said = -1, output.decode(errors="replace") if isinstance(output, bytes) else output
    reports = sorted(runs.glob("*/report.json"))
    report = json.loads(reports[-1].read_text(encoding="utf-8")) if reports else {}
    return Result(flight, code, report, said[-2000:])


def table(results: Sequence[Result], within: float) -> Table:
    """One row per area and flavour."""
    groups: dict[tuple[str, str], list[Result]] = defaultdict(list)
    for result in results:
        groups[result.flight.area.stem, result.flight.flavor].append(result)
    shown = Table(
        "area", "autopilot", "found", "worst error [cells]", "median flight [min]", "hit → waypoint p99 [ms]"
    )
    for (area, flavor), group in sorted(groups.items()):
        errors = [error for result in group if (error := result.error_cells()) is not None]
        minutes = [result.report["flight_time_s"] / 60 for result in group if result.report]
        latencies = [
            result.report["hit_to_waypoint"]["p99_ms"]
            for result in group
            if result.report and result.report["hit_to_waypoint"]["samples"]
        ]
        shown.add_row(
            area,
            flavor,
            f"{sum(result.good(within) for result in group)} of {len(group)}",
            f"{max(errors):.2f}" if errors else "–",
            f"{np.median(minutes):.1f}" if minutes else "–",
            f"{np.median(latencies):.1f}" if latencies else "–",
        )
    return shown


def main(arguments: list[str]) -> int:
    """The command line; exits 0 when every flight was good, else 1."""
    parser = argparse.ArgumentParser(prog="roisearch-sim flights", description=__doc__.split("\n")[0])
    parser.add_argument("areas", nargs="+", type=Path, metavar="AREA", help="area files")
    parser.add_argument("--flavors", default="px4,ardupilot", help="mock autopilots, separated by commas")
    parser.add_argument("--seeds", type=int, default=20, help="how many seeds per area and flavour, from 1")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--speedup", type=float, default=20.0)
    parser.add_argument("--jobs", type=int, default=2, help="flights at a time")
    parser.add_argument(
        "--within", type=float, default=1.5, metavar="CELLS", help="largest error of a good flight"
    )
    parser.add_argument(
        "--patience", type=float, default=600.0, metavar="S", help="wall seconds a flight may take"
    )
    parser.add_argument("--out", type=Path, help="keep the run folders here (default: thrown away)")
    parser.add_argument("--config", type=Path, help="settings file for the service")
    options = parser.parse_args(arguments)
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    flights = [Flight(a, f, s) for s in seeds for a in options.areas for f in options.flavors.split(",")]
    extra = ["--config", str(options.config)] if options.config else []
    console = Console()
    results: list[Result] = []
    with (
        tempfile.TemporaryDirectory() as scratch,
        ThreadPoolExecutor(options.jobs) as pool,
        Progress(console=console) as progress,
    ):
        runs = options.out or Path(scratch)
        bar = progress.add_task(f"{len(flights)} flights", total=len(flights))
        jobs = [
            pool.submit(fly, flight, runs, options.speedup, extra, options.patience) for flight in flights
        ]
        began = time.monotonic()
        for job in as_completed(jobs):
            result = job.result()
            results.append(result)
            progress.advance(bar)
            if not result.good(options.within):
                console.print(f"{result.flight}: exit {result.code}, error {result.error_cells()} cells")
                console.print(result.said, highlight=False, markup=False)
    console.print(table(results, options.within))
    good = sum(result.good(options.within) for result in results)
    console.print(
        f"{good} of {len(results)} found within {options.within} cells, {time.monotonic() - began:.0f} s"
    )
    return 0 if good == len(results) else 1

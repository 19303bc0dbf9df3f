"""`roisearch-sim flights`: fly whole searches with the real service against the mock, and count how they end.

Each flight is a `roisearch-service` process with its own mock autopilot, detector and drawn target. A flight
counts as good when it ends FOUND and the reported position is within `--within` cells of the simulated target. A
flight may take as long as its search: the mock's battery and the limits of time and POS are out of the way.

`--no-target` flies searches of nothing, each until POS is 90 % of what can be reached, for several `--planners`: the
times to a POS and the mean speed then say which is sooner. On a busy machine a lower `--speedup` keeps the detector's
frames close together; how far apart they were is told.

`--ground` flies over three synthetic grounds instead (see `overground`), and judges what it kept clear of.
`--battery-min MIN [--trouble]` flies searches that take several batteries (see `sorties_campaign`), and
`--aircraft N [--trouble]` such with several aircraft (see `flights_together`).
"""

from __future__ import annotations

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
from rich.table import Table

from service.errors import Parser
from sim import flights_together, overground, sorties_campaign
from sim.flight_campaign import GOES_ON, add_flavors, add_options, check_areas, kept, planners, seeds_of
from sim.flight_times import GOALS, Times, times_of
from sim.progress import Rest, bars

NO_LIMITS = {
    "ROISEARCH_DEMO_ENDURANCE_MIN": "600",
    "ROISEARCH_FLIGHT_MAX_FLIGHT_S": "36000",
    "ROISEARCH_SEARCH_STOP_AT_POS": "0.999999",
}
NO_TARGET = {
    "ROISEARCH_DEMO_TARGET": "false",
    "ROISEARCH_SEARCH_STOP_AT_POS": "0.9",
    "ROISEARCH_SEARCH_ON_FOUND": "continue",
}


@dataclass(frozen=True)
class SearchFlight:
    """One search to fly."""

    area: Path
    flavor: str
    seed: int
    planner: str = "puct-regions-lite"
    target: bool = True
    config: Path | None = None


@dataclass(frozen=True)
class Result:
    """How it ended: the service's exit code and report (empty when there is none), and what it said last."""

    flight: SearchFlight
    code: int
    report: dict[str, Any]
    said: str
    times: Times | None = None

    def error_cells(self) -> float | None:
        """Distance from the reported position to the target, in cells."""
        simulated = self.report.get("simulated") or {}
        error: float | None = simulated.get("error_cells")
        return error

    def good(self, within: float) -> bool:
        """True when the target was found where it is; where there is none, when the search came to its end."""
        if not self.flight.target:
            return self.code == 3
        error = self.error_cells()
        return self.code == 0 and error is not None and error <= within


def flown(flight: SearchFlight, out: Path, speedup: float, patience_s: float) -> Result:
    """A flight's result: as it is kept in its folder, else flown and kept there. Raises BadInput."""
    runs = out / f"{flight.area.stem}-{flight.flavor}-{flight.planner}-{flight.seed}"
    return kept(
        runs, Result, lambda: fly(flight, runs, speedup, patience_s), lambda result: result.flight == flight
    )


def fly(flight: SearchFlight, runs: Path, speedup: float, patience_s: float) -> Result:
    """Fly one search in a process of its own."""
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
        "--planner",
        flight.planner,
    ]
    limits = NO_LIMITS if flight.target else {**NO_LIMITS, **NO_TARGET}
    try:
        done = subprocess.run(
            [*words, *(["--config", str(flight.config)] if flight.config else [])],
            capture_output=True,
            text=True,
            timeout=patience_s,
            env={**os.environ, **limits},
        )
        code, said = done.returncode, (done.stdout + done.stderr).strip()
    except subprocess.TimeoutExpired as error:
        output = error.stdout or b""
        code, said = -1, output.decode(errors="replace") if isinstance(output, bytes) else output
    reports = sorted(runs.glob("*/report.json"))
    report = json.loads(reports[-1].read_text(encoding="utf-8")) if reports else {}
    times = times_of(reports[-1].parent) if reports else None
    return Result(flight, code, report, said[-2000:], times)


def table(results: Sequence[Result], within: float) -> Table:
    """One row per area, flavour and planner."""
    groups: dict[tuple[str, str, str], list[Result]] = defaultdict(list)
    for result in results:
        groups[result.flight.area.stem, result.flight.flavor, result.flight.planner].append(result)
    shown = Table(
        "area", "autopilot", "planner", "good", "worst error [cells]", "median flight [min]",
        "median s to POS 50 / 75 / 90 %", "mean speed [m/s]", "frames every [s]", "hit → waypoint p99 [ms]",
    )  # fmt: skip
    for (area, flavor, planner), group in sorted(groups.items()):
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
            planner,
            f"{sum(result.good(within) for result in group)} of {len(group)}",
            f"{max(errors):.2f}" if errors else "–",
            f"{np.median(minutes):.1f}" if minutes else "–",
            *_pace(group),
            f"{np.median(latencies):.1f}" if latencies else "–",
        )
    return shown


def _pace(group: Sequence[Result]) -> tuple[str, str, str]:
    """Times to a POS (of those that got there, when most did), mean speed, and seconds from frame to frame."""
    times = [result.times for result in group if result.times is not None]
    said = []
    for goal in range(len(GOALS)):
        reached = [seconds for each in times if (seconds := each.reached[goal]) is not None]
        said.append(f"{np.median(reached):.0f}" if 2 * len(reached) > len(group) else "–")
    speeds = [each.mean_mps for each in times if each.mean_mps is not None]
    frames = [each.frame_s for each in times if each.frame_s is not None]
    return (
        " / ".join(said),
        f"{np.mean(speeds):.2f}" if speeds else "–",
        f"{np.median(frames):.2f}" if frames else "–",
    )


def main(arguments: list[str]) -> int:
    """The command line; exits 0 when every flight was good, else 1."""
    if "--ground" in arguments:
        return overground.main([word for word in arguments if word != "--ground"])
    if any(word.split("=")[0] == "--battery-min" for word in arguments):
        return sorties_campaign.main(arguments)
    if any(word.split("=")[0] == "--aircraft" for word in arguments):
        return flights_together.main(arguments)
    parser = Parser(
        prog="roisearch-sim flights",
        description=__doc__.split("\n")[0],
        epilog=f"{GOES_ON} Other campaigns, each with a --help of its own: --ground (over hills that are hard to "
        "fly over), --battery-min MIN [--trouble] (over several batteries, with kills and another aircraft between), "
        "--aircraft N [--trouble] (several aircraft on one search, one of which loses its link).",
    )
    parser.add_argument("areas", nargs="+", type=Path, metavar="AREA", help="area files")
    add_flavors(parser, jobs=2)
    add_options(parser, "area and flavour", speedup=20.0, patience_s=600.0)
    parser.add_argument(
        "--within", type=float, default=1.5, metavar="CELLS", help="largest error of a good flight"
    )
    parser.add_argument(
        "--planners", type=planners, default="puct-regions-lite", help="planners, separated by commas"
    )
    parser.add_argument(
        "--no-target", action="store_true", help="nothing to find: times to POS 50, 75 and 90 %%"
    )
    parser.add_argument("--config", type=Path, help="settings file for the service")
    options = parser.parse_args(arguments)
    check_areas(parser, options.areas)
    flights = [
        SearchFlight(area, flavor, seed, planner, not options.no_target, options.config)
        for seed in seeds_of(options)
        for area in options.areas
        for flavor in options.flavors.split(",")
        for planner in options.planners.split(",")
    ]
    console = Console()
    results: list[Result] = []
    with (
        tempfile.TemporaryDirectory() as scratch,
        ThreadPoolExecutor(options.jobs) as pool,
        bars(console) as progress,
    ):
        runs = options.out or Path(scratch)
        bar, rest = progress.add_task("flights", total=len(flights)), Rest(console, len(flights))
        jobs = [pool.submit(flown, flight, runs, options.speedup, options.patience) for flight in flights]
        began = time.monotonic()
        for job in as_completed(jobs):
            result = job.result()
            results.append(result)
            progress.advance(bar)
            rest.advance()
            if not result.good(options.within):
                console.print(f"{result.flight}: exit {result.code}, error {result.error_cells()} cells")
                console.print(result.said, highlight=False, markup=False)
    console.print(table(results, options.within))
    good = sum(result.good(options.within) for result in results)
    what = "searched to the end" if options.no_target else f"found within {options.within} cells"
    console.print(f"{good} of {len(results)} {what}, {time.monotonic() - began:.0f} s")
    return 0 if good == len(results) else 1

"""`roisearch-sim flights --ground`: whole searches over three grounds of ours that are hard to fly over.

Each flight is a `roisearch-service` beside a mock autopilot that knows the ground and crashes into it, with a target
drawn from the prior. It is good when it ends FOUND, home, and the mock itself was never nearer to the ground below it
than `flight.clearance_m` less the position error, away from where it took off.

With `--out` the same command goes on: a flight whose result is there is not flown again.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from service.errors import Parser
from sim.autopilot.control import Control
from sim.autopilot.process import AutopilotProcess
from sim.flight_campaign import GOES_ON, add_flavors, add_options, kept, seeds_of
from sim.grounds import GROUNDS, latlon, write
from sim.progress import Rest, bars
from sim.soak.process import Process
from sim.target import draw_target

ALTITUDE_M, CLEARANCE_M, POSITION_ERROR_M = 40.0, 15.0, 5.0
SETTINGS = f"""
[flight]
altitude_m = {ALTITUDE_M:g}
clearance_m = {CLEARANCE_M:g}
max_flight_s = 36000
[ground]
position_error_m = {POSITION_ERROR_M:g}
[search]
stop_at_pos = 0.999999
"""
_LEAST_M = CLEARANCE_M - POSITION_ERROR_M


@dataclass(frozen=True)
class OverGround:
    """How a flight over a ground ended."""

    ground: str
    flavor: str
    seed: int
    code: int
    report: dict[str, Any]
    least_m: float
    crashed: bool
    said: str

    @property
    def good(self) -> bool:
        """Found, and clear of the ground all the time."""
        return self.code == 0 and not self.crashed and self.least_m >= _LEAST_M


def fly(name: str, flavor: str, seed: int, folder: Path, speedup: float, patience_s: float) -> OverGround:
    """Fly one search."""
    ground = GROUNDS[name]
    area, dem = write(ground, folder)
    settings, lockstep = folder / "settings.toml", folder / "time"
    settings.write_text(f'{SETTINGS}[link]\nlockstep = "{lockstep}"\n', encoding="utf-8")
    lat, lon = latlon(*ground.launch)
    target = _target(area, dem, settings, seed)
    options = [f"--home={lat:.7f},{lon:.7f},{ground.launch_amsl_m():.1f}", "--ground", str(dem)]
    options += [
        "--seed",
        str(seed),
        "--endurance",
        "600",
        "--control",
        "127.0.0.1:0",
        "--lockstep",
        str(lockstep),
    ]
    with AutopilotProcess(flavor, speedup=speedup, options=options) as mock:
        assert mock.control is not None
        words = ["service", "--area", str(area), "--ground", str(dem), "--config", str(settings), "--takeoff"]
        words += ["--connect", mock.url.replace("udpin", "udpout"), "--speedup", f"{speedup:g}"]
        words += ["--runs", str(folder / "runs"), "--http", "127.0.0.1:0", "--seed", str(seed)]
        with _running(words) as service, Control(mock.control) as control:
            url = service.wait_for(r"listening on (http://\S+)", patience_s)[1]
            seen = [
                "sim",
                "detector",
                "--attached",
                "--service",
                url,
                "--target",
                f"{target[0]:.7f},{target[1]:.7f}",
                *("--ground", str(dem), "--home", f"{lat:.7f},{lon:.7f}", "--lockstep", str(lockstep)),
            ]
            with _running([*seen, "--seed", str(seed)]):
                code = service.exit_code(patience_s)
            state = control.state()
            said = service.said
    reports = sorted((folder / "runs").glob("*/report.json"))
    report = json.loads(reports[-1].read_text(encoding="utf-8")) if reports else {}
    least = state["least_clearance"]
    return OverGround(
        name, flavor, seed, code, report, np.inf if least is None else least, state["crashed"], said
    )


def _target(area: Path, dem: Path, settings: Path, seed: int) -> tuple[float, float]:
    """A place drawn from the prior over what can be flown."""
    from service.config import read_settings
    from service.survey import survey

    read = read_settings(settings, environment={}, flags={"ground.file": [str(dem)]})
    _, grid = survey(area, None, read)
    reachable = np.where(grid.flyable, grid.prior, 0.0)
    where = draw_target(reachable / reachable.sum(), np.random.default_rng(seed))
    lat, lon = grid.frame.to_latlon(np.array([where]) - 0.5)[0]
    return float(lat), float(lon)


@contextmanager
def _running(words: list[str]) -> Iterator[Process]:
    process = Process(words)
    try:
        yield process
    finally:
        process.stop()


def table(results: list[OverGround]) -> Table:
    """One row for each ground and flavour."""
    groups: dict[tuple[str, str], list[OverGround]] = defaultdict(list)
    for result in results:
        groups[result.ground, result.flavor].append(result)
    shown = Table("ground", "autopilot", "found and clear", "least clearance [m]", "median flight [min]")
    for (ground, flavor), group in sorted(groups.items()):
        minutes = [each.report["flight_time_s"] / 60.0 for each in group if each.report]
        shown.add_row(
            ground,
            flavor,
            f"{sum(each.good for each in group)} of {len(group)}",
            f"{min(each.least_m for each in group):.1f}",
            f"{np.median(minutes):.1f}" if minutes else "\u2013",
        )
    return shown


def main(arguments: list[str]) -> int:
    """The command line; exits 0 when every flight was good, else 1."""
    parser = Parser(
        prog="roisearch-sim flights --ground",
        description=__doc__.split("\n")[0],
        epilog=GOES_ON,
    )
    parser.add_argument("--grounds", default=",".join(GROUNDS), help="which, separated by commas")
    add_flavors(parser, jobs=2)
    add_options(parser, "ground and flavour", speedup=20.0, patience_s=1800.0)
    options = parser.parse_args(arguments)
    console = Console()
    results: list[OverGround] = []
    with (
        tempfile.TemporaryDirectory() as scratch,
        ThreadPoolExecutor(options.jobs) as pool,
        bars(console) as progress,
    ):

        def flown(ground: str, flavor: str, seed: int) -> OverGround:
            folder = (options.out or Path(scratch)) / f"{ground}-{flavor}-{seed}"
            speed = options.speedup, options.patience
            return kept(folder, OverGround, lambda: fly(ground, flavor, seed, folder, *speed))

        jobs = [
            pool.submit(flown, ground, flavor, seed)
            for seed in seeds_of(options)
            for ground in options.grounds.split(",")
            for flavor in options.flavors.split(",")
        ]
        began, bar, rest = (
            time.monotonic(),
            progress.add_task("flights", total=len(jobs)),
            Rest(console, len(jobs)),
        )
        for job in as_completed(jobs):
            result = job.result()
            results.append(result)
            progress.advance(bar)
            rest.advance()
            console.print(
                f"{result.ground} {result.flavor} seed {result.seed}: exit {result.code}, least clearance "
                f"{result.least_m:.1f} m{', crashed' if result.crashed else ''}"
            )
            if not result.good:
                console.print(result.said[-3000:], highlight=False, markup=False)
    console.print(table(results))
    good = sum(result.good for result in results)
    console.print(
        f"{good} of {len(results)} found and at least {_LEAST_M:g} m clear of the ground (clearance_m "
        f"{CLEARANCE_M:g} less a position error of {POSITION_ERROR_M:g}), {time.monotonic() - began:.0f} s"
    )
    return 0 if good == len(results) else 1

"""`roisearch-sim climbing`: what it is worth that the plan knows how long climbs and descents take.

Over the synthetic grounds of `grounds`, on the cells that the service lays over them, the default planner is flown over
drawn priors twice: once told at which height each cell is flown over, once as if the ground were flat. Both flights are
timed by the same motion with these heights, and so is a survey. No alarms: what is compared is where the plan leads.

`--flown DIR` compares the motion with flights instead: those that `roisearch-sim flights --ground --out DIR` has kept.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from roisearch import FieldOfView, Motion, make_planner
from roisearch.decision import Cell
from service.errors import Parser
from sim.grounds import GROUNDS, write
from sim.overground import ALTITUDE_M, CLEARANCE_M, POSITION_ERROR_M, SETTINGS
from sim.ruler_seconds import How, TimedFlight, fly

KNOWS, IGNORES, SURVEY = "knows the climb", "takes it as flat", "survey"
SHARES = (0.5, 0.75, 0.9)
CAP_S = 7200.0
RATES = {"settings": (2.0, 1.0), "px4": (3.0, 1.5), "ardupilot": (2.5, 1.5)}
"""Climb and descent, m/s: the defaults of the settings and of the autopilots' parameters."""


@dataclass(frozen=True, eq=False)
class HillyGround:
    """Cells over a ground: where it is flown, how high over each, from where, and how."""

    flyable: NDArray[np.bool_]
    heights: NDArray[np.float64]
    start: tuple[int, int]
    motion: Motion


def world_of(name: str, rates: str) -> tuple[HillyGround, Any]:
    """The cells and heights as the service has them over one of `GROUNDS`, and its grid."""
    from service.config import read_settings
    from service.ground.flown import flown_heights
    from service.motion import motion_of
    from service.survey import survey

    with tempfile.TemporaryDirectory() as scratch:
        area, dem = write(GROUNDS[name], Path(scratch))
        file = Path(scratch) / "settings.toml"
        file.write_text(SETTINGS, encoding="utf-8")
        settings = read_settings(file, environment={}, flags={"ground.file": [str(dem)]})
        _, grid = survey(area, None, settings)
    heights = flown_heights(grid, settings.flight)
    assert heights is not None
    up, down = RATES[rates]
    motion = replace(motion_of(settings.flight, grid.frame.cell_m), climb_mps=up, descent_mps=down)
    return HillyGround(grid.flyable, heights, grid.start, motion), grid


@dataclass(frozen=True)
class Compared:
    """What the search of a flight took from its first frame to its last, in seconds: as flown, and as reckoned over the
    cells that it entered, with and without heights."""

    flown_s: float
    reckoned_s: float
    flat_s: float


def compared(folder: Path, world: HillyGround, grid: Any) -> Compared:
    """A kept flight against the motion. Raises BadInput when its journal cannot be read."""
    from service.journal import read_rows

    (run,) = sorted((folder / "runs").glob("*/journal.sqlite"))[-1:]
    ends = [
        row.time
        for row in read_rows(run, "transition")
        if row.body["to"] in ("FOUND", "CONFIRMING", "RETURNING")
    ]
    poses = [(row.time, row.body["pose"][:2]) for row in read_rows(run, "report") if row.body["pose"]]
    until = min(ends, default=np.inf)
    seen = [(time, tuple(grid.frame.to_cells([place])[0].tolist())) for time, place in poses if time <= until]
    path, times = entered([cell for _, cell in seen], [time for time, _ in seen])
    rows, cols = np.clip(np.array(path).T, 0, np.array(world.heights.shape)[:, None] - 1)
    full = world.motion.speed_mps
    flat, over = (
        float(world.motion.arrivals(path[1:], path[0], speed_mps=full, heights=heights)[-1])
        for heights in (None, world.heights[rows, cols])
    )
    return Compared(times[-1] - times[0], over, flat)


def entered(cells: Sequence[Cell], times: Sequence[float]) -> tuple[list[Cell], list[float]]:
    """The cells that were entered one after the other, those between two frames put in, and when."""
    path, when = [cells[0]], [times[0]]
    for cell, time in zip(cells, times, strict=True):
        while cell != path[-1]:
            row, col = path[-1]
            path.append((row + int(np.sign(cell[0] - row)), col + int(np.sign(cell[1] - col))))
            when.append(time)
    return path, when


def drawn_prior(world: HillyGround, rng: np.random.Generator) -> NDArray[np.float64]:
    """Three hills of equal mass, 1.5 cells wide, at drawn places, and a tenth of the mass everywhere."""
    rows, cols = np.indices(world.flyable.shape)
    places = np.argwhere(world.flyable)
    prior = np.full(world.flyable.shape, 0.1 / world.flyable.sum())
    for row, col in places[rng.choice(len(places), 3, replace=False)]:
        hill = np.exp(-((rows - row) ** 2 + (cols - col) ** 2) / (2.0 * 1.5**2)) * world.flyable
        prior += 0.3 * hill / hill.sum()
    prior = np.where(world.flyable, prior, 0.0)
    return np.asarray(prior / prior.sum())


def flown(world: HillyGround, prior: NDArray[np.float64], who: str, seed: int) -> TimedFlight:
    """One flight over a prior, timed with the heights."""
    fov = FieldOfView.point(0.9, 1.0)
    planner = make_planner(
        SURVEY if who == SURVEY else "puct-regions-lite",
        fov=fov,
        flyable=world.flyable,
        motion=world.motion,
        heights=None if who == IGNORES else world.heights,
    )
    how = How(world.start, fov=fov, stop_below=0.02, steps=4000, heights=world.heights)
    return fly(planner, prior, world.motion, np.random.default_rng(seed), how)


def row_of(flights: Sequence[TimedFlight]) -> list[float]:
    """Mean seconds to the first detection, and to each of `SHARES`."""
    return [
        float(np.mean([flight.expected(CAP_S) for flight in flights])),
        *(float(np.mean([flight.time_to(share) for flight in flights])) for share in SHARES),
    ]


def _tell_flown(folder: Path) -> int:
    """Print how long each kept flight took and what the motion says, with its autopilot's rates."""
    shown = Table("flight", "flown [s]", "reckoned [s]", "flown / reckoned", "flown / reckoned as flat")
    for each in sorted(folder.glob("*-*-*")):
        name, flavor, _ = each.name.split("-")
        told = compared(each, *world_of(name, flavor))
        ratios = told.flown_s / told.reckoned_s, told.flown_s / told.flat_s
        shown.add_row(
            each.name, f"{told.flown_s:.0f}", f"{told.reckoned_s:.0f}", *(f"{ratio:.2f}" for ratio in ratios)
        )
    Console().print(shown)
    return 0


def main(arguments: list[str]) -> int:
    """The command line."""
    parser = Parser(prog="roisearch-sim climbing", description=__doc__.split("\n")[0])
    parser.add_argument("--grounds", default="slope,ridge", help="which, separated by commas")
    parser.add_argument(
        "--rates", default="settings", choices=sorted(RATES), help="how fast it climbs and sinks"
    )
    parser.add_argument("--seeds", type=int, default=6, help="drawn priors for each ground")
    parser.add_argument("--seed", type=int, default=1, help="the first of them")
    parser.add_argument("--flown", type=Path, help="compare the motion with the flights that are kept here")
    options = parser.parse_args(arguments)
    if options.flown is not None:
        return _tell_flown(options.flown)
    shown = Table(
        "ground", "the plan", "s to first detection", *(f"s to POS {share:.0%}" for share in SHARES)
    )
    for name in options.grounds.split(","):
        world, _ = world_of(name, options.rates)
        seeds = range(options.seed, options.seed + options.seeds)
        priors = [drawn_prior(world, np.random.default_rng(seed)) for seed in seeds]
        for who in (KNOWS, IGNORES, SURVEY):
            flights = [flown(world, prior, who, seed) for prior, seed in zip(priors, seeds, strict=True)]
            shown.add_row(name, who, *(f"{seconds:.0f}" for seconds in row_of(flights)))
    console = Console()
    console.print(shown)
    up, down = RATES[options.rates]
    console.print(
        f"{options.seeds} priors each; climbs with {up:g} m/s, sinks with {down:g}; {ALTITUDE_M:g} m above the ground, "
        f"{CLEARANCE_M:g} m clear of it within {POSITION_ERROR_M:g} m"
    )
    return 0

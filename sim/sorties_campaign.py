"""`roisearch-sim flights --battery-min 15 --trouble`: many searches that outlive batteries, processes and aircraft.

What each is, and what is done to it, `sorties` says. A search is good when it ends FOUND, where the target is, after
four sorties or more, everything was done to it that was to be, and the POS was never less after a landing or a kill
than before: as it is told while it flies, and as a fresh search that is handed the rows of the journal one by one has
it.

With `--out` the same command goes on: a search whose result is there is not flown again.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from service.errors import Parser
from service.resume import retrace, stored_run
from service.rows import ResumedRow, SortieRow
from service.search import Search as KnownGround
from sim.flight_campaign import GOES_ON, add_flavors, add_options, alike, kept, seeds_of
from sim.sorties import HIDDEN, LOST, Outcome, Search, fly

ALIKE = 1e-6
"""So near the POS that was told at a landing has to be to the one that its rows give."""


def lost_in(run: Path) -> list[str]:
    """What a journal says against a search that loses nothing: POS that falls from a landing or a restart to the next,
    or that was told otherwise at a landing than the rows before it give."""
    settings, _, grid, entries = stored_run(run)
    search, wrong, before = KnownGround(grid, settings), list[str](), 0.0
    for entry in entries:
        retrace(entry, search)
        if not isinstance(entry.said, SortieRow | ResumedRow):
            continue
        pos, where = search.record.searched, f"row {entry.seq}, {entry.said.kind}"
        if pos < before - LOST:
            wrong.append(f"POS {before:.6f} became {pos:.6f} ({where})")
        if isinstance(entry.said, SortieRow) and abs(entry.said.pos - pos) > ALIKE:
            wrong.append(f"POS {entry.said.pos:.6f} was told, and the rows give {pos:.6f} ({where})")
        before = pos
    return wrong


def flown(search: Search, folder: Path, console: Console) -> Outcome:
    """A search's outcome: as it is kept in its folder, else flown and kept there. Raises BadInput."""

    def judged() -> Outcome:
        name = f"{search.flavor} seed {search.seed}"
        outcome = fly(search, folder, lambda said: console.print(f"{name}: {said}", highlight=False))
        for run in sorted(path.parent for path in (folder / "runs").glob("*/journal.sqlite")):
            outcome.wrong += lost_in(run)
        return outcome

    return kept(folder, Outcome, judged, lambda outcome: alike(outcome.search, search))


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="roisearch-sim flights --battery-min",
        description=__doc__.split("\n")[0],
        epilog=GOES_ON,
    )
    p.add_argument("--battery-min", type=float, required=True, metavar="MIN", help="how long each hovers")
    p.add_argument(
        "--trouble", action="store_true", help="killed on the ground, in the air; a second aircraft"
    )
    p.add_argument("--side", type=float, default=1000.0, metavar="M", help="of the square (default 1000)")
    add_flavors(p, jobs=1)
    add_options(p, "flavour", speedup=20.0, patience_s=1800.0)
    return p


def main(arguments: list[str]) -> int:
    """The command line; exits 0 when every search was good, else 1; 2 for bad input."""
    p = parser()
    options = p.parse_args(arguments)
    if options.jobs < 1 or options.seeds < 1:
        p.error("--jobs and --seeds are 1 or more")
    searches = [
        Search(
            flavor,
            seed,
            options.side,
            options.battery_min,
            options.trouble,
            options.speedup,
            options.patience,
        )
        for seed in seeds_of(options)
        for flavor in options.flavors.split(",")
    ]
    console, began = Console(), time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        outcomes = _fly_all(searches, options.out or Path(scratch), options.jobs, console)
    console.print(table(outcomes))
    good = sum(each.good for each in outcomes)
    said = f"{good} of {len(outcomes)} found over {HIDDEN + 1} sorties or more, nothing lost"
    console.print(f"{said}, {time.monotonic() - began:.0f} s", highlight=False)
    return 0 if good == len(outcomes) else 1


def _fly_all(searches: list[Search], out: Path, jobs: int, console: Console) -> list[Outcome]:
    """The outcomes, in the order of the searches; each is told as it comes."""
    with ThreadPoolExecutor(jobs) as pool:
        waiting = [
            pool.submit(flown, search, out / f"{search.flavor}-{search.seed}", console) for search in searches
        ]
        try:
            for number, done in enumerate(as_completed(waiting), 1):
                console.print(
                    f"{number} of {len(searches)}: {told(done.result())}", highlight=False, markup=False
                )
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return [each.result() for each in waiting]


def told(outcome: Outcome) -> str:
    """One search in a line, and what went wrong in more."""
    pos = ", ".join(f"{each:.1%}" for each in outcome.pos)
    search, ended = outcome.search, outcome.report.get("outcome", "no report")
    line = (
        f"{search.flavor} seed {search.seed}: exit {outcome.code}, {ended} after {len(outcome.pos)} sorties"
    )
    line += (
        f" (POS {pos}), {outcome.error_cells:.2f} cells off; {', '.join(outcome.troubles) or 'no trouble'}"
    )
    return "\n".join([f"{line}; {outcome.wall_s:.0f} s", *outcome.wrong])


def table(outcomes: list[Outcome]) -> Table:
    """A line for each flavour."""
    columns = (
        "flavour",
        "searches",
        "good",
        "sorties",
        "POS at the landings, median",
        "flown, min",
        "wall, s",
    )
    drawn = Table(*columns)
    for flavor in dict.fromkeys(each.search.flavor for each in outcomes):
        group = [each for each in outcomes if each.search.flavor == flavor]
        counts = sorted(len(each.sorties) for each in group)
        minutes = [each.report["flight_time_s"] / 60.0 for each in group if each.report]
        drawn.add_row(
            flavor,
            str(len(group)),
            str(sum(each.good for each in group)),
            f"{counts[0]} to {counts[-1]}",
            ", ".join(f"{np.median(each):.0%}" for each in _by_landing(group)),
            f"{np.median(minutes):.0f}" if minutes else "–",
            f"{np.median([each.wall_s for each in group]):.0f}",
        )
    return drawn


def _by_landing(group: list[Outcome]) -> list[list[float]]:
    """POS after the first sortie of each search, after the second, and so on for all that most have flown."""
    most = max(len(each.pos) for each in group)
    landings = [[each.pos[number] for each in group if number < len(each.pos)] for number in range(most)]
    return [each for each in landings if 2 * len(each) > len(group)]

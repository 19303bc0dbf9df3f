"""`roisearch-sim trials --preset flight`: planners compared in seconds of flight."""

from __future__ import annotations

import argparse
import functools
import shlex
from collections.abc import Sequence

from rich.console import Console

from service.errors import Parser
from sim.trials.aside import add_how, fly_the_rest, in_its_journal
from sim.trials.flight import HELD_OUT, PLANNERS, SCENES, FlightCampaign, run_flight, warm_up
from sim.trials.flight_report import write_flight_report
from sim.trials.journal import Journal


def is_flight(arguments: Sequence[str]) -> bool:
    """Whether `arguments` of `roisearch-sim trials` ask for this campaign."""
    words = " ".join(arguments).replace("=", " ").split()
    return any(words[i : i + 2] == ["--preset", "flight"] for i in range(len(words)))


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="roisearch-sim trials --preset flight",
        description="Fly planners over areas, a trail and the paper's priors, and compare them in seconds: first true "
        "detection, until FOUND, times to POS, above the release bound. Run again with the same --out, it continues "
        "where it ended.",
    )
    p.add_argument("--preset", choices=("flight",), required=True, help=argparse.SUPPRESS)
    p.add_argument(
        "--planners", default=",".join(PLANNERS), metavar="A,B,..", help=f"of {', '.join(PLANNERS)}"
    )
    p.add_argument("--scenes", default=",".join(SCENES), metavar="A,B,..", help=f"of {', '.join(SCENES)}")
    p.add_argument("--trials", type=int, default=20, metavar="N", help="seeds (default 20)")
    p.add_argument("--slow", type=int, default=5, metavar="N",
                   help="seeds over which the default in steps flies the areas and the trail, and the bound that "
                   "counts travel is reckoned (default 5)")  # fmt: skip
    p.add_argument(
        "--accelerations", default="1.5,3", metavar="A,..", help="of the aircraft, m/s2 (default 1.5,3)"
    )
    p.add_argument("--seed", type=int, default=HELD_OUT, metavar="S", help=f"the first (default {HELD_OUT})")
    p.add_argument("--side", type=int, default=100, metavar="N", help="cells on a side of the paper's priors "
                   "(default 100)")  # fmt: skip
    add_how(p)
    return p


def fly(arguments: Sequence[str]) -> int:
    """Run it; 0 when all is done, 2 for bad input, 1 when a worker died, 130 when interrupted."""
    options = parser().parse_args(arguments)

    def make() -> FlightCampaign:
        return FlightCampaign(
            planners=tuple(options.planners.split(",")),
            scenes=tuple(options.scenes.split(",")),
            accelerations=tuple(float(each) for each in options.accelerations.split(",")),
            trials=options.trials,
            slow=options.slow,
            seed=options.seed,
            side=options.side,
        )

    return in_its_journal(options, make, functools.partial(_work, options, arguments))


def _work(
    options: argparse.Namespace, arguments: Sequence[str], campaign: FlightCampaign, journal: Journal
) -> int:
    """Do what is not done yet, then write the report, also of a part."""
    console, known = Console(), set(campaign.jobs())
    if known - journal.results.keys():
        warm_up(campaign, lambda name: console.print(f"compiled {name}", highlight=False))
    code = fly_the_rest(campaign, journal, options, run_flight, console)
    results = {job: result for job, result in journal.results.items() if job in known}
    if results:
        command = shlex.join(["roisearch-sim", "trials", *arguments])
        write_flight_report(campaign, results, options.out, command)
        console.print(f"{len(results)} of {len(known)} jobs; {options.out / 'FLIGHT.md'}", highlight=False)
    return code

"""`roisearch-sim trials --preset walking`: how soon a target that walks is found, knowing that it walks or not."""

from __future__ import annotations

import argparse
import functools
import shlex
import sys
from collections.abc import Sequence

from rich.console import Console

from service.errors import Parser
from sim.trials.aside import add_how, fly_the_rest, in_its_journal
from sim.trials.flight import HELD_OUT
from sim.trials.journal import Journal
from sim.trials.walking import WALKING, WAYS, WalkingCampaign, run_walking, warm_up
from sim.trials.walking_optimum import print_gaps
from sim.trials.walking_report import write_walking_report


def is_walking(arguments: Sequence[str]) -> bool:
    """Whether `arguments` of `roisearch-sim trials` ask for this campaign."""
    words = " ".join(arguments).replace("=", " ").split()
    return any(words[i : i + 2] == ["--preset", WALKING] for i in range(len(words)))


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="roisearch-sim trials --preset walking",
        description="The expected time until a target that walks is detected, and what one battery finds, by the "
        "default planner that knows how it walks, the same that takes it as still, and the survey. Run again with the "
        "same --out, it continues where it ended.",
    )
    own = WalkingCampaign()
    p.add_argument("--preset", choices=(WALKING,), required=True, help=argparse.SUPPRESS)
    p.add_argument("--planners", default=",".join(WAYS), metavar="A,B,..", help=f"of {', '.join(WAYS)}")
    p.add_argument("--target-mps", type=float, default=own.target_mps, metavar="V",
                   help=f"how fast the target walks (default {own.target_mps:g})")  # fmt: skip
    p.add_argument("--straight-s", type=float, default=own.straight_s, metavar="S",
                   help=f"mean seconds between its turns (default {own.straight_s:g})")  # fmt: skip
    p.add_argument("--stops-per-hour", type=float, default=own.stops_per_hour, metavar="R",
                   help=f"how often in an hour it stops for good (default {own.stops_per_hour:g})")  # fmt: skip
    p.add_argument("--minutes", default="15,25", metavar="M,..", help="of the batteries (default 15,25)")
    p.add_argument("--hours", type=float, default=own.hours, metavar="H",
                   help=f"for how long a flight goes on in all (default {own.hours:g})")  # fmt: skip
    p.add_argument("--trials", type=int, default=20, metavar="N", help="priors (default 20)")
    p.add_argument("--seed", type=int, default=HELD_OUT, metavar="S", help=f"the first (default {HELD_OUT})")
    p.add_argument(
        "--side", type=int, default=own.side, metavar="N", help=f"cells on a side (default {own.side})"
    )
    p.add_argument("--stride", type=int, default=own.stride, metavar="N",
                   help=f"cells flown for a decision (default {own.stride})")  # fmt: skip
    p.add_argument("--optimum", action="store_true",
                   help="instead: how far it is from the optimum, on maps of 3 x 3 and 3 x 4 cells")  # fmt: skip
    add_how(p, required=False)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run it; 0 when all is done, 2 for bad input, 1 when a worker died, 130 when interrupted."""
    options = parser().parse_args(arguments)

    def make() -> WalkingCampaign:
        return WalkingCampaign(
            planners=tuple(options.planners.split(",")),
            minutes=tuple(float(each) for each in options.minutes.split(",")),
            hours=options.hours,
            target_mps=options.target_mps,
            straight_s=options.straight_s,
            stops_per_hour=options.stops_per_hour,
            trials=options.trials,
            seed=options.seed,
            side=options.side,
            stride=options.stride,
        )

    if not options.optimum:
        if options.out is None:
            parser().error("the campaign needs --out, a folder for its results")
        return in_its_journal(options, make, functools.partial(_work, options, arguments))
    try:
        return print_gaps(make(), Console())
    except ValueError as error:
        print(f"roisearch-sim trials: {error}", file=sys.stderr)
        return 2


def _work(
    options: argparse.Namespace, arguments: Sequence[str], campaign: WalkingCampaign, journal: Journal
) -> int:
    """Do what is not done yet, then write the page, also of a part."""
    console, known = Console(), set(campaign.jobs())
    if known - journal.results.keys():
        warm_up(campaign, lambda name: console.print(f"compiled {name}", highlight=False))
    code = fly_the_rest(campaign, journal, options, run_walking, console)
    if journal.results:
        command = shlex.join(["roisearch-sim", "trials", *arguments])
        page = write_walking_report(campaign, journal.results, options.out, command)
        console.print(page, highlight=False, markup=False)
        console.print(
            f"{len(journal.results)} of {len(known)} jobs; {options.out / 'WALKING.md'}", highlight=False
        )
    return code

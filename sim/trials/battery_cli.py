"""`roisearch-sim trials --preset battery`: what one battery finds, its end planned and cut off."""

from __future__ import annotations

import argparse
import functools
import shlex
from collections.abc import Sequence

from rich.console import Console

from service.errors import Parser
from sim.trials.aside import add_how, fly_the_rest, in_its_journal
from sim.trials.battery import BATTERY, BatteryCampaign, run_battery, warm_up
from sim.trials.battery_report import write_battery_report
from sim.trials.flight import HELD_OUT, SCENES
from sim.trials.journal import Journal


def is_battery(arguments: Sequence[str]) -> bool:
    """Whether `arguments` of `roisearch-sim trials` ask for this campaign."""
    words = " ".join(arguments).replace("=", " ").split()
    return any(words[i : i + 2] == ["--preset", BATTERY] for i in range(len(words)))


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="roisearch-sim trials --preset battery",
        description="The probability found within one battery, by the default that is cut off and by the default that "
        "plans the battery's end. Run again with the same --out, it continues where it ended.",
    )
    own = BatteryCampaign()
    p.add_argument("--preset", choices=(BATTERY,), required=True, help=argparse.SUPPRESS)
    p.add_argument("--scenes", default=",".join(own.scenes), metavar="A,B,..", help=f"of {', '.join(SCENES)}")
    p.add_argument("--minutes", default="15,25", metavar="M,..", help="of the batteries (default 15,25)")
    p.add_argument("--p-tn", type=float, default=own.p_tn, help="P(no hit | target not there) (default 1)")
    p.add_argument("--horizon", type=float, default=own.horizon_s, metavar="S",
                   help=f"seconds of search left when the end is planned (default {own.horizon_s:g})")  # fmt: skip
    p.add_argument("--trials", type=int, default=20, metavar="N", help="seeds (default 20)")
    p.add_argument("--seed", type=int, default=HELD_OUT, metavar="S", help=f"the first (default {HELD_OUT})")
    p.add_argument("--side", type=int, default=own.side, metavar="N",
                   help=f"cells on a side of the paper's priors (default {own.side})")  # fmt: skip
    add_how(p)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run it; 0 when all is done, 2 for bad input, 1 when a worker died, 130 when interrupted."""
    options = parser().parse_args(arguments)

    def make() -> BatteryCampaign:
        return BatteryCampaign(
            scenes=tuple(options.scenes.split(",")),
            minutes=tuple(float(each) for each in options.minutes.split(",")),
            p_tn=options.p_tn,
            horizon_s=options.horizon,
            trials=options.trials,
            seed=options.seed,
            side=options.side,
        )

    return in_its_journal(options, make, functools.partial(_work, options, arguments))


def _work(
    options: argparse.Namespace, arguments: Sequence[str], campaign: BatteryCampaign, journal: Journal
) -> int:
    """Do what is not done yet, then write the page, also of a part."""
    console, known = Console(), set(campaign.jobs())
    if known - journal.results.keys():
        warm_up(campaign, lambda name: console.print(f"compiled {name}", highlight=False))
    code = fly_the_rest(campaign, journal, options, run_battery, console)
    if journal.results:
        command = shlex.join(["roisearch-sim", "trials", *arguments])
        write_battery_report(campaign, journal.results, options.out, command)
        done = len(journal.results)
        console.print(f"{done} of {len(known)} jobs; {options.out / 'BATTERY.md'}", highlight=False)
    return code

"""`roisearch-sim trials --preset proven`: the default in steps beside the bound that counts travel."""

from __future__ import annotations

import argparse
import functools
import shlex
from collections.abc import Sequence

from rich.console import Console

from service.errors import Parser
from sim.scenario import EQUAL
from sim.trials.aside import add_how, fly_the_rest, in_its_journal
from sim.trials.flight import HELD_OUT
from sim.trials.journal import Journal
from sim.trials.proven import PROVEN, ProvenCampaign, run_proven, warm_up
from sim.trials.proven_report import write_proven_report


def is_proven(arguments: Sequence[str]) -> bool:
    """Whether `arguments` of `roisearch-sim trials` ask for this campaign."""
    words = " ".join(arguments).replace("=", " ").split()
    return any(words[i : i + 2] == ["--preset", PROVEN] for i in range(len(words)))


def parser() -> argparse.ArgumentParser:
    """The command line."""
    own = ProvenCampaign()
    p = Parser(
        prog="roisearch-sim trials --preset proven",
        description="The default in steps on the paper's priors, beside the release bound and the bound that counts "
        "travel. Run again with the same --out, it continues where it ended.",
    )
    p.add_argument("--preset", choices=(PROVEN,), required=True, help=argparse.SUPPRESS)
    p.add_argument("--equal", choices=EQUAL, default=own.equal, help="what hills share (default mass)")
    p.add_argument("--divisions", type=int, default=own.divisions, metavar="N",
                   help=f"of the bound; more is tighter, and takes longer (default {own.divisions})")  # fmt: skip
    p.add_argument("--trials", type=int, default=own.trials, metavar="N", help="priors (default 12)")
    p.add_argument("--seed", type=int, default=HELD_OUT, metavar="S", help=f"the first (default {HELD_OUT})")
    p.add_argument("--side", type=int, default=own.side, metavar="N", help="cells on a side (default 200)")
    add_how(p)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run it; 0 when all is done, 2 for bad input, 1 when a worker died, 130 when interrupted."""
    options = parser().parse_args(arguments)

    def make() -> ProvenCampaign:
        return ProvenCampaign(options.equal, options.divisions, options.trials, options.seed, options.side)

    return in_its_journal(options, make, functools.partial(_work, options, arguments))


def _work(
    options: argparse.Namespace, arguments: Sequence[str], campaign: ProvenCampaign, journal: Journal
) -> int:
    """Do what is not done yet, then write the page, also of a part."""
    console, known = Console(), set(campaign.jobs())
    if known - journal.results.keys():
        warm_up(lambda name: console.print(f"compiled {name}", highlight=False))
    code = fly_the_rest(campaign, journal, options, run_proven, console)
    if journal.results:
        command = shlex.join(["roisearch-sim", "trials", *arguments])
        write_proven_report(campaign, journal.results, options.out, command)
        done = len(journal.results)
        console.print(f"{done} of {len(known)} priors; {options.out / 'PROVEN.md'}", highlight=False)
    return code

"""`roisearch-sim trials --searchers N`: how much sooner several searchers find the target."""

from __future__ import annotations

import argparse
import functools
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Console

from service.errors import Parser
from sim.trials.aside import add_how, fly_the_rest, in_its_journal
from sim.trials.campaign import Job
from sim.trials.fleet import BOUND, FIRST, FLEET, WAYS, FleetCampaign, run_fleet
from sim.trials.journal import Journal, write_whole

OF_ONE = {2: 0.55, 3: 0.40, 4: 0.32}
"""At most so much of one searcher's expected time."""
OF_BOUND = 1.15


def is_fleet(arguments: Sequence[str]) -> bool:
    """Whether `arguments` of `roisearch-sim trials` ask for this campaign."""
    return any(word.split("=")[0] == "--searchers" for word in arguments)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="roisearch-sim trials --searchers N",
        description="Let several searchers search the paper's priors together, from one corner, and compare their "
        "expected time with one searcher's, with the bound and with baselines. Run again with the same --out, it "
        "continues where it ended.",
    )
    p.add_argument("--searchers", required=True, metavar="N,..", help="how many, such as 2,3,4")
    p.add_argument("--planners", default=",".join(WAYS), metavar="A,B,..", help=f"of {', '.join(WAYS)}")
    p.add_argument("--trials", type=int, default=20, metavar="N", help="priors (default 20)")
    p.add_argument("--seed", type=int, default=FIRST, metavar="S", help=f"the first (default {FIRST})")
    p.add_argument("--slow", type=int, default=5, metavar="N", help="of them for independent searchers, which take "
                   "longest (default 5)")  # fmt: skip
    p.add_argument("--side", type=int, default=200, metavar="N", help="cells on a side (default 200)")
    p.add_argument(
        "--stride", type=int, default=4, metavar="N", help="cells flown for a decision (default 4)"
    )
    p.add_argument("--iterations", type=int, default=4, metavar="N", help="of a decision (default 4)")
    add_how(p)
    return p


def fly_fleets(arguments: Sequence[str]) -> int:
    """Run it; 0 when all is done, 2 for bad input, 1 when a worker died, 130 when interrupted."""
    options = parser().parse_args(arguments)

    def make() -> FleetCampaign:
        return FleetCampaign(
            planners=tuple(options.planners.split(",")),
            searchers=tuple(int(each) for each in options.searchers.split(",")),
            trials=options.trials,
            seed=options.seed,
            slow=options.slow,
            side=options.side,
            stride=options.stride,
            iterations=options.iterations,
        )

    return in_its_journal(options, make, functools.partial(_work, options, arguments))


def _work(
    options: argparse.Namespace, arguments: Sequence[str], campaign: FleetCampaign, journal: Journal
) -> int:
    """Do what is not done yet, then write the report, also of a part."""
    console = Console()
    code = fly_the_rest(campaign, journal, options, run_fleet, console)
    report = report_of(campaign, journal.results, shlex.join(["roisearch-sim", "trials", *arguments]))
    write_whole(options.out / "FLEET.md", report)
    console.print(report, highlight=False, markup=False)
    return code


def report_of(campaign: FleetCampaign, results: Mapping[Job, dict[str, Any]], command: str) -> str:
    """The page: expected times summed over the priors that all were flown on, beside one searcher's and the bound."""
    wanted = campaign.jobs()
    priors = range(campaign.seed, campaign.seed + campaign.trials)
    whole = [trial for trial in priors if all(job in results for job in wanted if job.trial == trial)]
    lines = [
        "# Several searchers on one belief",
        "",
        f"    {command}",
        "",
        f"{len(whole)} priors of {campaign.trials} are complete, seeds {campaign.seed} and on; {campaign.side} x "
        f"{campaign.side} cells, all searchers start in one corner, point field of view, p_tp 0.9, no false alarms, a "
        f"second a step. {campaign.iterations} iterations a decision, {campaign.stride} cells flown for each. E[T] is "
        f"the mean over the first {1.0 - campaign.tail:.0%} of the targets found; ratios are of sums over the "
        "priors that were flown that way.",
        "",
        "| searchers | way | priors | E[T], s | of one searcher's | of the bound | 99 % of decisions, processor ms |",
        "|---|---|---|---|---|---|---|",
    ]
    if not whole:
        return "\n".join([*lines, ""])
    lines += [
        _row(way, n, whole, results) for way, n in dict.fromkeys((job.planner, job.fov) for job in wanted)
    ]
    return "\n".join([*lines, "", *_targets(campaign, whole, results), ""])


def _flown(way: str, n: str, whole: Sequence[int], results: Mapping[Job, dict[str, Any]]) -> list[int]:
    """The priors that so many flew in that way."""
    return [trial for trial in whole if Job("fleet", way, n, trial) in results]


def _sum(way: str, n: str, whole: Sequence[int], results: Mapping[Job, dict[str, Any]]) -> float:
    """Expected seconds, the mean over the priors; not a number where it was not flown."""
    found = [results.get(Job("fleet", way, n, trial), {}).get("expected", np.nan) for trial in whole]
    return float(np.mean(found))


def _row(way: str, n: str, whole: Sequence[int], results: Mapping[Job, dict[str, Any]]) -> str:
    flown = _flown(way, n, whole, results)
    mean = _sum(way, n, flown, results)
    one, least = _sum(FLEET, "1", flown, results), _sum(BOUND, n, flown, results)
    took = [results[Job("fleet", way, n, trial)]["timing"]["slowest_ms"] for trial in flown]
    slowest = f"{np.median(took):.1f}" if way != BOUND else ""
    return f"| {n} | {way} | {len(flown)} | {mean:.1f} | {mean / one:.3f} | {mean / least:.3f} | {slowest} |"


def _targets(
    campaign: FleetCampaign, whole: Sequence[int], results: Mapping[Job, dict[str, Any]]
) -> list[str]:
    """What was to be reached, and whether it was."""
    lines = []
    for n in campaign.searchers:
        mean = _sum(FLEET, str(n), whole, results)
        of_one, of_bound = mean / _sum(FLEET, "1", whole, results), mean / _sum(BOUND, str(n), whole, results)
        others = [way for way in campaign.planners if way not in (BOUND, FLEET)]
        wanted = [(f"at most {OF_BOUND} of the bound: {of_bound:.3f}", of_bound <= OF_BOUND)]
        if n in OF_ONE:
            wanted.append((f"at most {OF_ONE[n]} of one searcher's: {of_one:.3f}", of_one <= OF_ONE[n]))
        for way in others:
            if flown := _flown(way, str(n), whole, results):
                below = _sum(FLEET, str(n), flown, results) < _sum(way, str(n), flown, results)
                wanted.append((f"below {way} over {len(flown)} priors", below))
        lines += [f"- {n} searchers, {what}: {'met' if met else 'MISSED'}" for what, met in wanted]
    return lines

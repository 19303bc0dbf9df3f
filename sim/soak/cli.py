"""`roisearch-sim soak`: flights under random faults until the time is over, and a report of what held and what did not.

Flight k of seed S is flight 0 of seed S + k: `--flights 1 --seed N`, with the `--faults` and `--only` of before, flies
a violation's seed again, and `--verbose` shows what the service has said in it. A violation names the fault that came
last; `--only KIND` draws nothing else.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import FrameType

from rich.console import Console
from rich.table import Table

from service.errors import Parser
from sim.autopilot.process import AutopilotProcess
from sim.soak import ground
from sim.soak.flight import Outcome, SoakFlight
from sim.soak.kinds import EVERY
from sim.soak.plan import draw_plan
from sim.soak.process import Process


class Soak:
    """Flies plan after plan until it is time to stop."""

    def __init__(self, options: argparse.Namespace, folder: Path, console: Console) -> None:
        self.outcomes: list[Outcome] = []
        self._options, self._folder, self._console = options, folder, console
        self._next, self._lock = 0, threading.Lock()
        self._until = time.monotonic() + 60.0 * options.minutes

    def work(self) -> None:
        """One flight after another."""
        while (seed := self._take()) is not None:
            plan = draw_plan(seed, ground.BOUNDS, self._options.faults, self._options.only)
            if self._options.aircraft:
                plan = replace(plan, aircraft=self._options.aircraft)
            outcome = SoakFlight(plan, self._folder / str(seed), self._options.speedup).fly()
            self.outcomes.append(outcome)
            self._tell(outcome)

    def _take(self) -> int | None:
        with self._lock:
            most = self._options.flights
            if (most and self._next >= most) or (self._next and time.monotonic() >= self._until):
                return None
            self._next += 1
            return int(self._options.seed) + self._next - 1

    def _tell(self, outcome: Outcome) -> None:
        kinds = ", ".join(f"{kind} {count}" for kind, count in outcome.faults.items())
        over = ", a hill" if outcome.plan.hill else ""
        over += f", {outcome.plan.aircraft} aircraft" if outcome.plan.aircraft > 1 else ""
        self._console.print(
            f"seed {outcome.plan.seed} ({outcome.plan.flavor}{over}): {outcome.ended or 'not ended'}, "
            f"{outcome.steps} steps, {outcome.reports} reports; {kinds}",
            highlight=False,
        )
        for violation in outcome.violations:
            self._console.print(
                f"  VIOLATION (seed {outcome.plan.seed}): {violation}", highlight=False, markup=False
            )
        if outcome.violations and self._options.verbose:
            self._console.print(outcome.said, highlight=False, markup=False)


def report(outcomes: list[Outcome]) -> Table:
    """What was injected, what was flown, what was checked, and what did not hold."""
    faults: Counter[str] = Counter()
    motions: Counter[str] = Counter()
    ended: Counter[str] = Counter()
    for outcome in outcomes:
        faults += outcome.faults
        motions += outcome.motions
        ended[outcome.ended or "not ended"] += 1
    shown = Table("what", "count")
    hours = sum(outcome.seconds for outcome in outcomes) / 3600.0
    shown.add_row("simulated hours", f"{hours:.2f}")
    shown.add_row("flights", str(len(outcomes)))
    for name, count in sorted(ended.items()):
        shown.add_row(f"  {name}", str(count))
    shown.add_row("  over a hill", str(sum(outcome.plan.hill for outcome in outcomes)))
    for number in sorted({outcome.plan.aircraft for outcome in outcomes} - {1}):
        count = sum(outcome.plan.aircraft == number for outcome in outcomes)
        shown.add_row(f"  with {number} aircraft", str(count))
    shown.add_row("  moments with two in the air", str(sum(outcome.together for outcome in outcomes)))
    shown.add_row("faults injected", str(sum(faults.values())))
    for name, count in sorted(faults.items()):
        shown.add_row(f"  {name}", str(count))
    shown.add_row("steps flown", str(sum(outcome.steps for outcome in outcomes)))
    shown.add_row("motion commands judged", str(sum(motions.values())))
    shown.add_row("reports acknowledged and found in the journal", str(sum(o.reports for o in outcomes)))
    shown.add_row("  that saw the target", str(sum(o.true_hits for o in outcomes)))
    shown.add_row("beliefs summed", str(sum(outcome.beliefs for outcome in outcomes)))
    shown.add_row("violations", str(sum(len(outcome.violations) for outcome in outcomes)))
    for name, count in sorted(by_kind(outcomes).items()):
        shown.add_row(f"  after {name}", str(count))
    return shown


def by_kind(outcomes: list[Outcome]) -> Counter[str]:
    """How many violations there were after which fault; what the books show is no fault's."""
    found = [re.search(r"\[after (\w+)\]", each) for outcome in outcomes for each in outcome.violations]
    return Counter(match.group(1) if match else "the whole flight" for match in found)


def _leave_nothing_behind(number: int, frame: FrameType | None) -> None:
    """A service that is told to end flies home first, and here is nobody left to fly for."""
    for process in tuple(Process.running):
        process.process.kill()
    for autopilot in tuple(AutopilotProcess.running):
        autopilot.stop()
    os._exit(128 + number)


def _kinds(text: str) -> frozenset[str]:
    kinds = frozenset(text.split(","))
    if unknown := sorted(kinds - EVERY):
        raise argparse.ArgumentTypeError(f"no kind '{unknown[0]}'; there are: {', '.join(sorted(EVERY))}")
    return kinds


def main(arguments: list[str]) -> int:
    """The command line; exits 0 without a violation, else 1."""
    parser = Parser(prog="roisearch-sim soak", description=__doc__.split("\n")[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="wall time after which no flight begins")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first flight; the next has the next")
    parser.add_argument(
        "--flights", type=int, default=0, help="most flights (default: as many as there is time for)"
    )
    parser.add_argument("--faults", type=int, default=12, help="most faults in a flight")
    parser.add_argument("--speedup", type=float, default=10.0, help="times faster than the wall clock")
    parser.add_argument(
        "--aircraft", type=int, choices=(1, 2, 3), help="so many in each flight (default: as drawn)"
    )
    parser.add_argument("--jobs", type=int, default=1, help="flights at a time")
    parser.add_argument("--out", type=Path, help="keep the runs in this new folder (default: thrown away)")
    parser.add_argument(
        "--verbose", action="store_true", help="after a violation, also what the service has said"
    )
    parser.add_argument(
        "--only",
        type=_kinds,
        default=EVERY,
        metavar="KIND,...",
        help=f"draw these kinds only, 'none' for a flight that begins as it should: {', '.join(sorted(EVERY))}",
    )
    options = parser.parse_args(arguments)
    console = Console()
    signal.signal(signal.SIGTERM, _leave_nothing_behind)
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(options.jobs) as pool:
        soak = Soak(options, options.out or Path(scratch), console)
        for job in [pool.submit(soak.work) for _ in range(options.jobs)]:
            job.result()
    console.print(report(soak.outcomes))
    return 1 if not soak.outcomes or any(outcome.violations for outcome in soak.outcomes) else 0

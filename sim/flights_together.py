"""`roisearch-sim flights --aircraft N AREA`: one search flown by several aircraft, counted and judged.

Each flight is one service with a link to each of N mocks of both flavours in turn (system ids 1 to N, a few metres from
one another at the launch point), a detector for each, and a target drawn from the prior. Their true places are compared
all the time (see `separation`). They are in lockstep: the first mock keeps the time of all. With `--trouble` something
befalls one of them in the middle of the search, by the seed: see `TROUBLES`.

A flight is good when it ends FOUND, where the target is, with no two aircraft too near, in the air and on the way down.
"""

from __future__ import annotations

import json
import math
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from rich.console import Console

from service.errors import Parser
from sim.autopilot.control import Control
from sim.autopilot.process import AutopilotProcess
from sim.flight_campaign import GOES_ON, add_options, alike, check_areas, kept, seeds_of
from sim.progress import Rest
from sim.separation import Separation, Watching, side_by_side
from sim.soak.process import Process
from sim.sorties import gone_at_the_end
from sim.target import draw_target

FLAVORS = ("px4", "ardupilot")
STARTS_M = 6.0
"""From one aircraft at the launch point to the next: too near for two to be in the air there."""
CUT_AFTER = 15
"""Steps of all together after which a link is cut."""
WITHIN_CELLS = 1.5
TROUBLES = ("its link is cut", "the service is killed", "a pilot takes it", "its failsafe brings it home")
"""What befalls one of them: its link is cut for good, the service is killed and goes on with all, a pilot has it for a
while and an operator takes it back, or its autopilot flies it home and lands it for good."""
PILOT_S = 20.0
"""So long, in seconds of the vehicle's clock, a pilot has it."""
SEARCHES = ("SEARCHING", "CONFIRMING")
SETTINGS = {
    "ROISEARCH_FLIGHT_MAX_FLIGHT_S": "36000",
    "ROISEARCH_SEARCH_STOP_AT_POS": "0.999999",
    "ROISEARCH_RUN_NEXT_SORTIE_WITHIN_S": "0",
}


@dataclass(frozen=True)
class Together:
    """One search to fly: its area, how many fly it, and whether something befalls one of them."""

    area: Path
    aircraft: int
    seed: int
    trouble: bool
    speedup: float
    patience_s: float

    @property
    def trouble_kind(self) -> str:
        """What befalls one of them, if anything does."""
        return str(np.random.default_rng((self.seed, 1)).choice(TROUBLES)) if self.trouble else ""


@dataclass
class JointOutcome:
    """How it ended: exit code, report, what was wrong, and how near two came."""

    search: Together
    code: int = -1
    report: dict[str, Any] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)
    nearest_m: float = math.inf
    together: int = 0
    cut: str = ""
    """Whom the trouble befell."""
    error_cells: float = math.inf

    @property
    def good(self) -> bool:
        """See the module's text."""
        cut = bool(self.cut) or not self.search.trouble
        judged = self.together > 0 and not self.violations
        return self.code == 0 and not self.wrong and judged and cut and self.error_cells <= WITHIN_CELLS


class JointFlight:
    """One search under way."""

    def __init__(self, search: Together, folder: Path, stack: ExitStack) -> None:
        self.search, self.flown, self._stack, self._runs = (
            search,
            JointOutcome(search),
            stack,
            folder / "runs",
        )
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self.lockstep = folder, folder / "time"
        self.names = [str(number) for number in range(1, search.aircraft + 1)]
        self.judge = Separation()
        self._detectors: list[Process] = []
        self._hide()

    def _hide(self) -> None:
        """Draw the target from the prior."""
        from service.config import read_settings
        from service.survey import survey

        _, grid = survey(self.search.area, None, read_settings(None, environment={}))
        where = draw_target(grid.prior / grid.prior.sum(), np.random.default_rng(self.search.seed))
        self._frame, self._launch = grid.frame, grid.launch
        lat, lon = grid.frame.to_latlon(np.array([where]) - 0.5)[0]
        self.target = float(lat), float(lon)

    def begin(self) -> None:
        """Start all of them."""
        search, enter = self.search, self._stack.enter_context
        starts = side_by_side(self._launch, search.aircraft, STARTS_M)
        mocks = {
            name: enter(self._mock(int(name), start)) for name, start in zip(self.names, starts, strict=True)
        }
        controls = {name: str(mock.control) for name, mock in mocks.items()}
        self._watching = enter(Watching(controls, self.judge))
        self._controls = {name: Control(url) for name, url in controls.items()}
        words = ["--area", str(search.area), "--runs", str(self._runs), "--seed", str(search.seed), "--flat"]
        for mock in mocks.values():
            words += ["--connect", mock.url.replace("udpin", "udpout")]
        self._serve([*words, "--takeoff"])

    def _serve(self, words: list[str]) -> None:
        """Start a service, and a detector of each aircraft."""
        search, enter = self.search, self._stack.enter_context
        words = ["service", *words, "--speedup", f"{search.speedup:g}", "--http", "127.0.0.1:0"]
        self.service = enter(
            gone_at_the_end(words, {**SETTINGS, "ROISEARCH_LINK_LOCKSTEP": str(self.lockstep)})
        )
        address = self.service.wait_for(r"listening on (http://\S+)", search.patience_s)[1]
        self._door = enter(httpx.Client(base_url=address, timeout=60.0))
        for each in self._detectors:  # that reported to the service before this one
            each.stop()
        self._detectors = [enter(gone_at_the_end(self._detector(address, name))) for name in self.names]

    def _mock(self, number: int, start: tuple[float, float]) -> AutopilotProcess:
        options = [f"--home={start[0]:.7f},{start[1]:.7f},400", "--sysid", str(number)]
        options += ["--seed", str(10 * self.search.seed + number), "--endurance", "600"]
        options += ["--control", "127.0.0.1:0", "--lockstep", str(self.lockstep)]
        flavor = FLAVORS[(number - 1) % len(FLAVORS)]
        return AutopilotProcess(flavor, speedup=self.search.speedup, options=options)

    def _detector(self, address: str, name: str) -> list[str]:
        words = ["sim", "detector", "--attached", "--service", address, "--aircraft", name]
        words += ["--seed", str(100 * self.search.seed + int(name)), "--lockstep", str(self.lockstep)]
        return [*words, f"--target={self.target[0]:.7f},{self.target[1]:.7f}"]

    def waits(self, until: Callable[[dict[str, Any]], bool]) -> bool:
        """Wait for something to be told; False when the service ended before. AssertionError when nothing comes."""
        deadline = time.monotonic() + self.search.patience_s
        while self.service.process.poll() is None:
            try:
                if until(self._door.get("/api/state").raise_for_status().json()):
                    return True
            except httpx.TransportError:
                pass  # it is ending
            said = self.service.said[-2000:]
            assert time.monotonic() < deadline, f"nothing for {self.search.patience_s:g} s:\n{said}"
            time.sleep(0.2)
        return False

    def befalls(self) -> None:
        """Let trouble come to one that searches, once all have searched for a while."""
        name = self.names[self.search.seed % len(self.names)]

        def in_the_middle(told: dict[str, Any]) -> bool:
            states = {each["name"]: each["state"] for each in told["aircraft"]}
            steps = sum(each["steps"] for each in told["aircraft"])
            return steps >= CUT_AFTER and states[name] in SEARCHES

        if self.waits(in_the_middle):
            self.flown.cut = name
            trouble = self.search.trouble_kind
            if trouble == "the service is killed":
                self._kill()
            elif trouble == "a pilot takes it":
                self._lend(name)
            else:
                self._controls[name].fault("link_lost" if trouble == "its link is cut" else "failsafe")

    def _kill(self) -> None:
        """kill -9, and a service that goes on with the run."""
        for control in self._controls.values():
            control.speedup(1.0)  # a computer that starts does so in its own time
        self.service.process.kill()
        self.service.process.wait()
        (run,) = (path.parent for path in self._runs.glob("*/journal.sqlite"))
        self._serve(["--resume", str(run)])
        for control in self._controls.values():
            control.speedup(self.search.speedup)

    def _lend(self, name: str) -> None:
        """A pilot has it for a while; then an operator takes it back, by its name."""
        control = self._controls[name]
        control.fault("pilot")

        def is_in(*states: str) -> Callable[[dict[str, Any]], bool]:
            return lambda told: any(
                each["name"] == name and each["state"] in states for each in told["aircraft"]
            )

        if not self.waits(is_in("YIELDED")):
            return
        until = control.state()["time"] + PILOT_S
        if self.waits(lambda told: control.state()["time"] >= until):
            control.clear("pilot")
            for order in ("resume", "return"):  # a search that is over by now is not gone on with
                answer = self._door.post("/api/commands", json={"command": order, "aircraft": name})
                if not answer.raise_for_status().json().get("refused"):
                    return

    def end(self) -> JointOutcome:
        """Wait for the end and judge it."""
        flown = self.flown
        flown.code = self.service.exit_code(self.search.patience_s)
        (report,) = self._runs.glob("*/report.json")
        flown.report = json.loads(report.read_text(encoding="utf-8"))
        if place := flown.report.get("position"):
            at = self._frame.to_metres([(place["lat"], place["lon"]), self.target])
            flown.error_cells = float(np.hypot(*(at[0] - at[1]))) / self._frame.cell_m
        lost = flown.cut if self.search.trouble_kind == TROUBLES[0] else ""
        aloft = [name for name, state in self._watching.last.items() if state["armed"] and name != lost]
        if aloft:
            flown.wrong.append(f"the service has ended while aircraft {', '.join(aloft)} fly")
        return flown


def fly(search: Together, folder: Path) -> JointOutcome:
    """Fly one search to its end."""
    with ExitStack() as stack:
        flight = JointFlight(search, folder, stack)
        try:
            flight.begin()
            if search.trouble:
                flight.befalls()
            flight.end()
        except (AssertionError, httpx.HTTPError, ValueError) as error:
            flight.flown.wrong.append(str(error))
        judge, flown = flight.judge, flight.flown
        flown.violations, flown.nearest_m, flown.together = judge.violations, judge.nearest_m, judge.together
    return flown


def flown(search: Together, folder: Path) -> JointOutcome:
    """A search's outcome: as it is kept in its folder, else flown and kept there. Raises BadInput."""
    return kept(
        folder, JointOutcome, lambda: fly(search, folder), lambda outcome: alike(outcome.search, search)
    )


def told(flown: JointOutcome) -> str:
    """One flight in a line, and what went wrong in more."""
    search, near = flown.search, flown.nearest_m
    nearest = f"never nearer than {near:.0f} m" if math.isfinite(near) else "never at one height nearby"
    line = f"{search.area.stem} seed {search.seed}, {search.aircraft} aircraft: exit {flown.code}, "
    line += f"{flown.report.get('outcome', 'no report')}, {flown.error_cells:.2f} cells off, {nearest}, "
    line += f"{len(flown.violations)} violations" + (
        f", aircraft {flown.cut}: {search.trouble_kind}" if flown.cut else ""
    )
    return "\n".join([line, *flown.wrong, *(f"VIOLATION: {each}" for each in flown.violations)])


def main(arguments: Sequence[str]) -> int:
    """The command line; exits 0 when every flight was good, else 1."""
    parser = Parser(
        prog="roisearch-sim flights --aircraft", description=(__doc__ or "").split("\n")[0], epilog=GOES_ON
    )
    parser.add_argument("areas", nargs="+", type=Path, metavar="AREA", help="area files")
    parser.add_argument("--aircraft", type=int, required=True, metavar="N", help="how many fly each search")
    parser.add_argument("--trouble", action="store_true", help="something befalls one, by the seed")
    add_options(parser, "area", speedup=10.0, patience_s=900.0)
    options = parser.parse_args(arguments)
    check_areas(parser, options.areas)
    console, results = Console(), list[JointOutcome]()
    rest = Rest(console, options.seeds * len(options.areas), beside_bars=False)
    with tempfile.TemporaryDirectory() as scratch:
        for area in options.areas:
            for seed in seeds_of(options):
                search = Together(
                    area, options.aircraft, seed, options.trouble, options.speedup, options.patience
                )
                results.append(flown(search, (options.out or Path(scratch)) / f"{area.stem}-{seed}"))
                console.print(told(results[-1]), highlight=False, markup=False, soft_wrap=True)
                rest.advance()
    good, violations = sum(each.good for each in results), sum(len(each.violations) for each in results)
    console.print(f"{good} of {len(results)} found, {violations} separation violations", highlight=False)
    return 0 if good == len(results) else 1

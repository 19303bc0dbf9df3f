"""One flight of the soak: the service, a mock autopilot and a detector, with faults let loose, an operator who helps
after each, and everything watched."""

from __future__ import annotations

import contextlib
import json
import math
import signal
import sqlite3
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from service.lockstep import Lockstep
from sim.autopilot.control import Control
from sim.autopilot.process import AutopilotProcess
from sim.detector import Detector
from sim.grounds import write_heights
from sim.soak import clocked, ground
from sim.soak.audit import Target, audit, wrongly_found
from sim.soak.clocked import SteppedClock
from sim.soak.eyes import Eyes, grown
from sim.soak.judge import AFTER, OPERATOR, Judge
from sim.soak.kinds import AT_BOOT, GROUNDS, KINDS, OF_THE_MOCK
from sim.soak.plan import HOLD, HOME, Fault, Plan
from sim.soak.process import Process
from sim.soak.tap import Tap
from sim.soak.wing import Wing

_FINAL = {"DONE", "ABORTED"}
_FLYING = {"SEARCHING", "CONFIRMING"}
_PATIENCE_S = 90.0  # wall time of a machine with nothing else to do: what takes longer never ends
_SLOWER = 10.0  # so many times as long it may take on one that has
_COMPILED_S = 400.0  # the first flight on a machine compiles the planner
_HELP_AFTER_S = 8.0  # vehicle time after which the operator resumes a search that does not go on by itself
_BAD_WORDS = ("Traceback", "never retrieved", "was destroyed", "never awaited", "Unhandled", "Exception in")
SETTINGS = f"""
[run]
next_sortie_within_s = 0
[flight]
altitude_m = {ground.HEIGHT_M:g}
clearance_m = {ground.CLEARANCE_M:g}
max_hold_s = 120
[sensor]
cell_m = {ground.CELL_M:g}
p_tn = 0.97
[search]
stop_at_pos = 0.999999
"""


class Trouble(Exception):
    """The flight cannot go on as planned, which is a violation of its own."""


@dataclass
class Outcome:
    """What became of one flight."""

    plan: Plan
    ended: str = ""
    steps: int = 0
    seconds: float = 0.0  # of the vehicle's clock
    reports: int = 0
    true_hits: int = 0
    beliefs: int = 0
    motions: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    together: int = 0  # moments at which two were in the air, and judged
    violations: list[str] = field(default_factory=list)
    said: str = ""


class SoakFlight:
    """Flies one plan in a folder of its own."""

    def __init__(self, plan: Plan, folder: Path, speedup: float) -> None:
        self.plan, self.folder, self.speedup = plan, folder, speedup
        self.outcome = Outcome(plan)
        self.judge = Judge(plan.flavor, speedup, hill=plan.hill)
        self._detector = Detector(plan.target, 0.9, 0.97, plan.seed)
        self._rng = np.random.default_rng(plan.seed)
        self._finished: list[Eyes] = []
        self._wing: Wing | None = None
        self._now: Callable[[], float] = time.monotonic

    def fly(self) -> Outcome:
        """Fly it; every violation is in the outcome, even that it could not be flown."""
        with ExitStack() as stack:
            try:
                self._start(stack)
                self._play()
            except (Trouble, AssertionError) as trouble:
                after = AFTER.format(self.judge.during or self.plan.at_boot)
                self.outcome.violations.append(str(trouble).partition("\n")[0] + after)
            finally:
                self._look_away()
                if hasattr(self, "_service"):
                    self.outcome.said += self._service.said
        self._judge()
        return self.outcome

    # ---- setting up

    def _start(self, stack: ExitStack) -> None:
        self.folder.mkdir(parents=True)
        self._time_kept = self.folder / "time"
        self._clock = SteppedClock(self.folder / "clock")
        lat, lon = ground.launch()
        home = f"--home={lat:.7f},{lon:.7f},{ground.GROUND_AMSL_M:g}"
        options = [home, "--ready-after", "3", "--control", "127.0.0.1:0", "--seed", str(self.plan.seed)]
        options += ["--endurance", f"{ground.ENDURANCE_S / 60.0:g}"]
        options += ["--lockstep", str(self._time_kept)]
        options += self._odd_from_the_start()
        over: list[str] = []
        if self.plan.hill:
            dem = self.folder / "hill.tif"
            write_heights(ground.HILL, dem)
            over = ["--ground", str(dem)]
        options += over
        mock = stack.enter_context(AutopilotProcess(self.plan.flavor, speedup=self.speedup, options=options))
        assert mock.control is not None
        self._control = stack.enter_context(Control(mock.control))
        judge, lockstep = self.judge, Lockstep(self._time_kept, self.speedup)
        self._now = lockstep.ticks
        tap = Tap(
            mock.port,
            from_service=judge.from_service,
            from_autopilot=judge.from_autopilot,
            lockstep=lockstep,
        )
        self._tap = stack.enter_context(tap)
        if self.plan.aircraft > 1:
            self._wing = Wing(
                self.plan.aircraft,
                stack,
                speedup=self.speedup,
                seed=self.plan.seed,
                control=mock.control,
                lockstep=self._time_kept,
                over=over,
            )
        area, settings = self.folder / "area.geojson", self.folder / "settings.toml"
        area.write_text(json.dumps(ground.area()), encoding="utf-8")
        settings.write_text(SETTINGS, encoding="utf-8")
        self._runs = self.folder / "runs"
        words = ["--area", str(area), "--config", str(settings), "--runs", str(self._runs)]
        words += ["--connect", self._tap.url, *(self._wing.words if self._wing else [])]
        words += ["--takeoff", "--seed", str(self.plan.seed), *over]
        self._words = words
        self._launch(words)
        stack.callback(lambda: self._service.stop())

    def _odd_from_the_start(self) -> list[str]:
        """The mock's words for a file of faults, where the flight does not begin as it should."""
        table = AT_BOOT[self.plan.at_boot]
        if not table:
            return []
        self.outcome.faults[self.plan.at_boot] += 1
        path = self.folder / "faults.toml"
        lines = [f"{key} = {json.dumps(value)}" for key, value in table.items()]
        path.write_text("\n".join(["[[fault]]", *lines, ""]), encoding="utf-8")
        return ["--faults", str(path)]

    def _launch(self, words: list[str]) -> None:
        words = [*words, "--http", "127.0.0.1:0", "--speedup", f"{self.speedup:g}"]
        self._service = Process(
            ["sim.soak.clocked", *words],
            {
                clocked.CLOCK_FILE: str(self._clock.path),
                "ROISEARCH_LINK_LOCKSTEP": str(self._time_kept),
            },
        )
        self._url = self._service.wait_for(r"listening on (http://\S+)", _COMPILED_S).group(1)
        pid = self._service.process.pid
        own_clock = self.speedup == 1.0
        eyes = Eyes(self._url, pid, self._detector, 2.0 * self.speedup, own_clock=own_clock)
        if self._wing is not None:
            eyes.aircraft = "1"
            self._wing.look(self._url)
        self._eyes = eyes.__enter__()
        self._finished.append(self._eyes)

    def _look_away(self) -> None:
        if self._finished:
            self._finished[-1].__exit__()

    # ---- the flight

    def _play(self) -> None:
        if self.plan.at_boot in GROUNDS:
            self._stay_down(GROUNDS[self.plan.at_boot])
            return
        self._take_off()
        for fault in self.plan.faults:
            self._pass(fault.wait_s)
            if self._state() in _FINAL:
                break
            self._come_to(fault.moment)
            self.outcome.faults[fault.kind] += 1
            self.judge.steady, self.judge.during = KINDS[fault.kind].steady, fault.kind
            with self._taken():
                self._let(fault)
                if fault.moment != HOME:
                    self._recover()
        self._go_home()

    @contextlib.contextmanager
    def _taken(self) -> Iterator[None]:
        """While something goes wrong with the first aircraft, it may be flown by another, or by nobody."""
        if self._wing is not None:
            self._wing.judge.taken = frozenset({"1"})
        yield
        if self._wing is not None:
            self._wing.judge.taken = frozenset()

    def _come_to(self, moment: str) -> None:
        """Let the operator bring about the moment of a fault; what cannot be ordered now is left as it is."""
        self.judge.during = ""
        if moment == HOLD:
            self._order("hold")
            self.judge.stopped(self._now(), OPERATOR)
            self._pass(3.0)
        elif moment == HOME:
            self._order("return")
            self._pass(2.0)

    def _take_off(self) -> None:
        """The search begins; an operator helps where a person or the autopilot stands in the way. What a pilot took
        before it began may be on the ground again before the operator comes."""
        began = helped = self._now()
        over = set[str]() if self.plan.at_boot == "none" else _FINAL
        while (state := self._state()) not in _FLYING | over:
            now = self._now()
            if now - began > _PATIENCE_S or self._service.process.poll() is not None:
                raise Trouble(f"the search has not begun, but is {state}")
            if state in ("HOLDING", "YIELDED", "READY") and (now - helped) * self.speedup > _HELP_AFTER_S * 4:
                helped = now
                self._order("resume" if self._truth()["armed"] else "launch", first=True)
            time.sleep(0.1)

    def _stay_down(self, words: str) -> None:
        """The service ends the run on the ground, and says why."""
        code = self._service.exit_code(_SLOWER * _PATIENCE_S)
        self._look_away()
        self.outcome.ended = "grounded"
        if code != 4 or words not in " ".join(self._service.said.split()):
            raise Trouble(f"ended with exit code {code} and without '{words}'")
        if self.judge.motions["MAV_CMD_NAV_TAKEOFF"] or self._control.state()["armed"]:
            raise Trouble(f"it has left the ground, though it '{words}'")

    def _let(self, fault: Fault) -> None:
        """Let one fault come and pass."""
        kind, eyes, options = fault.kind, self._eyes, dict(fault.options)
        if kind == "killed":
            self._kill(by_its_unit=options["go_on"])
        elif kind in ("killed_while_held", "killed_while_yielded"):
            self._stop_and_kill(kind == "killed_while_held", fault.seconds)
        elif kind == "clock_steps":
            self._clock.step(options["by_s"])
            eyes.clock_off_s += options["by_s"]
            self._pass(fault.seconds)
        elif kind == "detector_lies":
            eyes.lies = options["way"]
            self._pass(fault.seconds)
            eyes.lies = ""
        elif kind == "stall":
            self._control.waits(False)
            self._service.process.send_signal(signal.SIGSTOP)
            if self._rng.random() < 0.5:  # what happens while nobody looks
                self._control.fault("pilot")
            time.sleep(options["wall_s"])
            self._service.process.send_signal(signal.SIGCONT)
            self._control.waits(True)
        elif kind == "hangup":
            self._service.process.send_signal(signal.SIGHUP)  # the terminal is gone, and the flight goes on
            self._pass(fault.seconds)
        elif kind == "garbage":
            for _ in range(50):
                self._tap.say_bytes(self._rng.bytes(int(self._rng.integers(1, 300))))
        elif kind in ("detector_silent", "detector_repeats", "bad_requests"):
            switch = {"detector_silent": "silent", "detector_repeats": "repeats", "bad_requests": "rude"}[
                kind
            ]
            setattr(eyes, switch, True)
            self._pass(fault.seconds)
            setattr(eyes, switch, False)
        elif kind in ("clue", "exclude"):
            self._tell_news(kind, fault)
        elif kind == "strangers":
            with Process(["sim.soak.attacks", options["way"], self._url]):
                self._pass(fault.seconds)
        elif kind == "journal_locked":
            self._lock_the_journal(fault.seconds)
        elif kind == "journal_slow":
            self._slow_the_journal(fault.seconds)
        elif kind == "operator_holds":
            self._order("hold")
            self.judge.stopped(self._now(), OPERATOR)
            self._pass(fault.seconds)
        else:
            self._let_the_mock(fault)

    def _tell_news(self, role: str, fault: Fault) -> None:
        """Somebody tells of the marsh, that there is a clue or that it is not to be flown over, and takes it back."""
        shape = {"type": "Polygon", "coordinates": [ground.ring(ground.MARSH)]}
        properties = {"role": role, **fault.options}
        told = self._post("/api/news", {"type": "Feature", "properties": properties, "geometry": shape})
        if role == "exclude":
            self.judge.excluded(self._now())
        self._pass(fault.seconds)
        self.judge.excluded(math.inf)
        if told is not None:
            self._post(f"/api/news/{told['id']}/withdraw", {})

    def _lock_the_journal(self, seconds: float) -> None:
        """Another program writes to the journal, and is in no hurry."""
        journal = self._alive_runs()[0] / "journal.sqlite"
        with contextlib.closing(sqlite3.connect(journal, timeout=10.0, isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            self._pass(seconds)
            other.execute("ROLLBACK")

    def _slow_the_journal(self, seconds: float) -> None:
        """Every write waits for seconds, as on a worn-out card; a person stops the aircraft meanwhile."""
        until = self._truth()["time"] + seconds
        self._lock_the_journal(3.0)
        self._order("hold")
        self.judge.stopped(self._now(), OPERATOR)
        while self._truth()["time"] < until and self._service.process.poll() is None:
            self._pass(0.3)
            self._lock_the_journal(3.0)

    def _let_the_mock(self, fault: Fault) -> None:
        """A fault of the mock's, under its own name."""
        name = OF_THE_MOCK.get(fault.kind, fault.kind)
        if name == "battery_unknown":  # low enough that it must not be forgotten
            self._control.fault("battery", percent=float(self._rng.uniform(24.0, 30.0)))
            self._pass(3.0)
        self._control.fault(name, **fault.options)
        if by := KINDS[fault.kind].stops:
            if KINDS[fault.kind].named:
                self._be_named(name, fault)
            self.judge.stopped(self._now(), by)
        self._pass(fault.seconds)
        if name != "battery":
            self._control.clear(name)

    def _be_named(self, name: str, fault: Fault) -> None:
        """A target that ours overtakes before the autopilot has named it, which it does twice a second, is one that
        nobody has heard of: whoever gave it gives it again."""
        for _ in range(4):
            self._pass(1.5)
            if self.judge.goes_elsewhere():
                return
            self._control.fault(name, **fault.options)
        self._pass(1.5)

    def _stop_and_kill(self, held: bool, seconds: float) -> None:
        """A person has stopped the aircraft when the service dies: the next one leaves it so."""
        if held:
            self._order("hold")
            self.judge.stopped(self._now(), OPERATOR)
        else:
            self._control.fault("pilot")
            self._pass(4.0)
            self._control.clear("pilot")
            self.judge.stopped(self._now(), KINDS["killed_while_yielded"].stops)
        self._pass(3.0)
        self._kill()
        self._pass(seconds)

    def _kill(self, *, by_its_unit: bool = False) -> None:
        """kill -9 and --resume: what was told before must still hold, and what was acknowledged be there.

        `by_its_unit`: it is started again as it was with `--go-on`, without anybody's order.

        A run that has ended in the meantime is left so: what would come up is another flight, which nobody launches.
        """
        if self._state() in _FINAL:
            return
        self._service.stop()
        self._look_away()
        self.outcome.said += self._service.said
        if not self._alive_runs():
            raise Trouble("there is no run to go on with")
        self.judge.started_over()
        if not (self.judge.is_stopped or by_its_unit):
            self.judge.ordered(self._now())  # --resume is an order to go on
        self._control.speedup(1.0)  # a computer that starts does so in its own time, and the battery is small
        self._launch([*self._words, "--go-on"] if by_its_unit else ["--resume", str(self._alive_runs()[0])])
        self._control.speedup(self.speedup)

    def _alive_runs(self) -> list[Path]:
        return sorted(self._runs.glob("*"))

    def _recover(self) -> None:
        """Wait until the search goes on or has ended; an operator helps where it does not by itself."""
        self._pass(_HELP_AFTER_S / 2)
        began, helped = self._now(), 0
        while (state := self._state()) not in _FLYING | _FINAL | {"FOUND"}:
            waited = (self._now() - began) * self.speedup
            if state in ("HOLDING", "YIELDED") and waited > _HELP_AFTER_S * (helped + 1):
                self._control.clear(None)
                # the second time by name: an order for all takes none from its pilot
                self._order("resume" if self._rng.random() < 0.9 else "return", first=helped % 2 == 1)
                helped += 1
                if self._wing is not None and helped >= 6:
                    self._order("finish")  # another one is left that its pilot has
            if self._now() - began > _PATIENCE_S:
                raise Trouble(f"still {state} after {_PATIENCE_S:.0f} s")
            time.sleep(0.1)

    def _go_home(self) -> None:
        """The operator ends the search; the run must end with the aircraft on the ground, and the process with it."""
        self._control.clear(None)
        began, last, asked = self._now(), -np.inf, 0
        while self._service.process.poll() is None and self._state() not in _FINAL:
            if self._state() in (*_FLYING, "FOUND", "HOLDING", "YIELDED") and self._now() - last > 3.0:
                last = self._now()
                late = self._wing is not None and last - began > 20.0
                self._order("finish" if late else "return", first=asked % 2 == 1)
                asked += 1
            if self._now() - began > _PATIENCE_S:
                raise Trouble(f"not home but {self._state()} after {_PATIENCE_S:.0f} s")
            time.sleep(0.1)
        self._look_away()
        code = self._service.exit_code(_SLOWER * _PATIENCE_S)
        if code not in (0, 3, 4):
            raise Trouble(f"the service has ended with exit code {code}")
        self.outcome.ended = {0: "found", 3: "not found", 4: "aborted"}[code]
        if self._control.state()["armed"] or (self._wing is not None and self._wing.aloft()):
            raise Trouble("the run has ended and the aircraft still flies")

    # ---- asking

    def _state(self) -> str:
        """The state that the service tells; the one before while it does not answer."""
        if self._service.process.poll() is not None:
            return "DONE"
        try:
            told = httpx.get(f"{self._url}/api/state", timeout=20.0).raise_for_status().json()
        except httpx.HTTPError:
            return self.judge.state
        self.outcome.steps = max(self.outcome.steps, told["steps"])
        return str(told["state"])

    def _order(self, command: str, *, first: bool = False) -> None:
        """Order it of all, or of the `first` alone, whom the faults befall: no order for all takes it from a pilot."""
        self.judge.ordered(self._now())
        named = {"aircraft": "1"} if first and self._wing is not None else {}
        self._post("/api/commands", {"command": command, **named}, refused=True)
        self.judge.ordered(self._now())

    def _post(self, path: str, body: dict[str, Any], *, refused: bool = False) -> Any:
        """What the door answers; None when the run has ended. `refused`: it may refuse, which is an answer, too."""
        try:
            answer = httpx.post(self._url + path, json=body, timeout=40.0)
            return (answer if refused else answer.raise_for_status()).json()
        except httpx.HTTPError as error:
            self._wait_for_the_end(30.0)  # what comes when the run ends finds the door shut
            if self._service.process.poll() is None:
                raise Trouble(f"{path} did not take {body}: {error}") from error
            return None

    def _wait_for_the_end(self, patience_s: float) -> None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._service.process.wait(patience_s)

    def _pass(self, seconds: float) -> None:
        """Let so much vehicle time pass, or the flight end."""
        until = self._truth()["time"] + seconds
        while self._truth()["time"] < until and self._service.process.poll() is None:
            time.sleep(0.03)

    def _truth(self) -> dict[str, Any]:
        """What is true of the aircraft; the judge is told how high it is."""
        state = self._control.state()
        crashed = (
            state["crashed"] and not self.outcome.faults["reboot"]
        )  # in flight a reboot is the end of it
        self.outcome.seconds = state["time"]
        here = (state["latitude"], state["longitude"])
        self.judge.truth(state["above_ground"], here, self._now(), crashed=crashed)
        return state

    # ---- afterwards

    def _judge(self) -> None:
        outcome = self.outcome
        outcome.violations += self.judge.violations
        if wire := self.judge.wire:
            outcome.said += "\n".join(["", "before the first of them, on the wire:", *wire])
        if self._wing is not None:
            outcome.violations += self._wing.judge.violations
            outcome.together = self._wing.judge.together
        outcome.motions = self.judge.motions
        acknowledged: set[str] = set()
        told = []
        true_hits: set[str] = set()
        for eyes in self._finished:
            outcome.violations += eyes.violations
            outcome.beliefs += eyes.beliefs
            acknowledged |= eyes.acknowledged
            told += eyes.told
            true_hits |= eyes.true_hits
            outcome.violations += grown(eyes)
        outcome.reports, outcome.true_hits = len(acknowledged), len(true_hits & acknowledged)
        place = self.plan.target
        target = None if place is None else Target(place, frozenset(true_hits))
        for run in self._alive_runs() if hasattr(self, "_runs") else []:
            refuses = "command_refused" in outcome.faults
            outcome.violations += audit(run, acknowledged, told, target, refuses=refuses)
            outcome.violations += wrongly_found(run, place)
        for word in _BAD_WORDS:
            if word in outcome.said:
                line = next(line for line in outcome.said.splitlines() if word in line)
                outcome.violations.append(f"the service has said: {line.strip()}")

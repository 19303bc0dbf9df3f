"""One flight of the soak: the service, a mock autopilot and a detector, with faults let loose, an operator who helps
after each, and everything watched."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import numpy as np

from sim.autopilot.control import Control
from sim.autopilot.process import AutopilotProcess
from sim.detector import Detector
from sim.soak import ground
from sim.soak.audit import audit
from sim.soak.eyes import Eyes
from sim.soak.judge import Judge
from sim.soak.plan import Fault, Plan
from sim.soak.process import Process
from sim.soak.tap import Tap

_FINAL = {"DONE", "ABORTED"}
_FLYING = {"SEARCHING", "CONFIRMING"}
_PATIENCE_S = 90.0  # wall time: what takes longer never ends
_COMPILED_S = 400.0  # the first flight on a machine compiles the planner
_HELP_AFTER_S = 8.0  # vehicle time after which the operator resumes a search that does not go on by itself
_BAD_WORDS = ("Traceback", "never retrieved", "was destroyed", "never awaited", "Unhandled", "Exception in")
_GROWTH_MB, _GROWTH_PART = 40.0, 0.25
_MOST_TASKS = 60
SETTINGS = f"""
[flight]
altitude_m = {ground.HEIGHT_M:g}
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
    reports: int = 0
    beliefs: int = 0
    motions: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    violations: list[str] = field(default_factory=list)
    said: str = ""


class Flight:
    """Flies one plan in a folder of its own."""

    def __init__(self, plan: Plan, folder: Path, speedup: float) -> None:
        self.plan, self.folder, self.speedup = plan, folder, speedup
        self.outcome = Outcome(plan)
        self.judge = Judge(plan.flavor, speedup)
        self._detector = Detector(plan.target, 0.9, 0.97, plan.seed)
        self._rng = np.random.default_rng(plan.seed)
        self._finished: list[Eyes] = []

    def fly(self) -> Outcome:
        """Fly it; every violation is in the outcome, even that it could not be flown."""
        with ExitStack() as stack:
            try:
                self._start(stack)
                self._play()
            except (Trouble, AssertionError) as trouble:
                self.outcome.violations.append(str(trouble).partition("\n")[0])
            finally:
                self._look_away()
                if hasattr(self, "_service"):
                    self.outcome.said += self._service.said
        self._judge()
        return self.outcome

    # ---- setting up

    def _start(self, stack: ExitStack) -> None:
        lat, lon = ground.launch()
        home = f"--home={lat:.7f},{lon:.7f},{ground.GROUND_AMSL_M:g}"
        options = [home, "--ready-after", "3", "--control", "127.0.0.1:0", "--seed", str(self.plan.seed)]
        options += ["--endurance", "600"]
        mock = stack.enter_context(AutopilotProcess(self.plan.flavor, speedup=self.speedup, options=options))
        assert mock.control is not None
        self._control = stack.enter_context(Control(mock.control))
        judge = self.judge
        tap = Tap(mock.port, from_service=judge.from_service, from_autopilot=judge.from_autopilot)
        self._tap = stack.enter_context(tap)
        self.folder.mkdir(parents=True)
        area, settings = self.folder / "area.geojson", self.folder / "settings.toml"
        area.write_text(json.dumps(ground.area()), encoding="utf-8")
        settings.write_text(SETTINGS, encoding="utf-8")
        self._runs = self.folder / "runs"
        words = ["service", "--area", str(area), "--config", str(settings), "--runs", str(self._runs)]
        words += ["--connect", self._tap.url, "--takeoff", "--seed", str(self.plan.seed)]
        self._launch(words)
        stack.callback(lambda: self._service.stop())

    def _launch(self, words: list[str]) -> None:
        words = [*words, "--http", "127.0.0.1:0", "--speedup", f"{self.speedup:g}"]
        self._service = Process(words)
        self._url = self._service.wait_for(r"listening on (http://\S+)", _COMPILED_S).group(1)
        pid = self._service.process.pid
        self._eyes = Eyes(self._url, pid, self._detector, 2.0 * self.speedup).__enter__()
        self._finished.append(self._eyes)

    def _look_away(self) -> None:
        if self._finished:
            self._finished[-1].__exit__()

    # ---- the flight

    def _play(self) -> None:
        self._until(lambda: self._state() in _FLYING, "the search has not begun")
        for fault in self.plan.faults:
            self._pass(fault.wait_s)
            if self._state() in _FINAL:
                break
            self.outcome.faults[fault.kind] += 1
            self._let(fault)
            self._recover()
        self._go_home()

    def _let(self, fault: Fault) -> None:
        """Let one fault come and pass."""
        kind, eyes, options = fault.kind, self._eyes, dict(fault.options)
        if kind == "killed":
            self._kill()
        elif kind == "stall":
            self._service.process.send_signal(signal.SIGSTOP)
            if self._rng.random() < 0.5:  # what happens while nobody looks
                self._control.fault("pilot")
            time.sleep(options["wall_s"])
            self._service.process.send_signal(signal.SIGCONT)
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
        elif kind == "operator_holds":
            self._order("hold")
            self._pass(fault.seconds)
        else:
            self._control.fault(kind.removesuffix("_sticks"), **options)
            self._pass(fault.seconds)
            if kind != "battery":
                self._control.clear(kind.removesuffix("_sticks"))

    def _kill(self) -> None:
        """kill -9 and --resume: what was told before must still hold, and what was acknowledged be there."""
        self._service.stop()
        self._look_away()
        self.outcome.said += self._service.said
        if not self._alive_runs():
            raise Trouble("there is no run to go on with")
        self.judge.started_over()
        self.judge.ordered(time.monotonic())  # --resume is an order to go on
        self._launch(["service", "--resume", str(self._alive_runs()[0])])

    def _alive_runs(self) -> list[Path]:
        return sorted(self._runs.glob("*"))

    def _recover(self) -> None:
        """Wait until the search goes on or has ended; an operator helps where it does not by itself."""
        self._pass(_HELP_AFTER_S / 2)
        began, helped = time.monotonic(), 0
        while (state := self._state()) not in _FLYING | _FINAL | {"FOUND"}:
            waited = (time.monotonic() - began) * self.speedup
            if state in ("HOLDING", "YIELDED") and waited > _HELP_AFTER_S * (helped + 1):
                self._control.clear(None)
                self._order("resume" if self._rng.random() < 0.9 else "return")
                helped += 1
            if time.monotonic() - began > _PATIENCE_S:
                raise Trouble(f"still {state} after {_PATIENCE_S:.0f} s")
            time.sleep(0.1)

    def _go_home(self) -> None:
        """The operator ends the search; the run must end with the aircraft on the ground, and the process with it."""
        self._control.clear(None)
        began = last = -np.inf
        began = time.monotonic()
        while self._service.process.poll() is None and self._state() not in _FINAL:
            if self._state() in (*_FLYING, "FOUND", "HOLDING", "YIELDED") and time.monotonic() - last > 3.0:
                last = time.monotonic()
                self._order("return")
            if time.monotonic() - began > _PATIENCE_S:
                raise Trouble(f"not home but {self._state()} after {_PATIENCE_S:.0f} s")
            time.sleep(0.1)
        self._look_away()
        code = self._service.exit_code(_PATIENCE_S)
        if code not in (0, 3, 4):
            raise Trouble(f"the service has ended with exit code {code}")
        self.outcome.ended = {0: "found", 3: "not found", 4: "aborted"}[code]
        if self._control.state()["armed"]:
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

    def _order(self, command: str) -> None:
        self.judge.ordered(time.monotonic())
        try:
            httpx.post(f"{self._url}/api/commands", json={"command": command}, timeout=40.0)
        except httpx.HTTPError as error:
            self._wait_for_the_end(5.0)  # an order that comes when the run ends finds the door shut
            if self._service.process.poll() is None:
                raise Trouble(f"the order '{command}' was not taken: {error}") from error
        self.judge.ordered(time.monotonic())

    def _wait_for_the_end(self, patience_s: float) -> None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._service.process.wait(patience_s)

    def _pass(self, seconds: float) -> None:
        """Let so much vehicle time pass, or the flight end."""
        until = self._control.state()["time"] + seconds
        while self._control.state()["time"] < until and self._service.process.poll() is None:
            time.sleep(0.03)

    def _until(self, condition: Callable[[], bool], complaint: str) -> None:
        deadline = time.monotonic() + _PATIENCE_S
        while not condition():
            if time.monotonic() > deadline or self._service.process.poll() is not None:
                raise Trouble(complaint)
            time.sleep(0.1)

    # ---- afterwards

    def _judge(self) -> None:
        outcome = self.outcome
        outcome.violations += self.judge.violations
        outcome.motions = self.judge.motions
        acknowledged: set[str] = set()
        told = []
        for eyes in self._finished:
            outcome.violations += eyes.violations
            outcome.beliefs += eyes.beliefs
            acknowledged |= eyes.acknowledged
            told += eyes.told
            outcome.violations += _grown(eyes)
        outcome.reports = len(acknowledged)
        for run in self._alive_runs() if hasattr(self, "_runs") else []:
            outcome.violations += audit(run, acknowledged, told)
        for word in _BAD_WORDS:
            if word in outcome.said:
                line = next(line for line in outcome.said.splitlines() if word in line)
                outcome.violations.append(f"the service has said: {line.strip()}")


def _grown(eyes: Eyes) -> list[str]:
    """Whether memory or tasks have grown from the middle of a process's life to its end."""
    found = []
    third = len(eyes.memory_mb) // 3
    if third >= 10:
        middle, end = (
            float(np.median(part)) for part in (eyes.memory_mb[third:-third], eyes.memory_mb[-third:])
        )
        if end - middle > max(_GROWTH_MB, _GROWTH_PART * middle):
            found.append(f"memory has grown from {middle:.0f} to {end:.0f} MB")
    if eyes.memory_mb and not max(eyes.tasks, default=0):
        found.append("the number of tasks is not told")
    if max(eyes.tasks, default=0) > _MOST_TASKS:
        found.append(f"{max(eyes.tasks)} tasks at a time")
    if third >= 10 and eyes.tasks and min(eyes.tasks[-third:]) > max(eyes.tasks[third:-third]):
        found.append(f"tasks have grown from {max(eyes.tasks[third:-third])} to {min(eyes.tasks[-third:])}")
    return found

"""A flight that faults can be let loose on: the service, a mock autopilot and a detector, each its own process."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import httpx

from service.journal import Row, read_rows
from sim.autopilot.control import Control
from sim.autopilot.process import AutopilotProcess
from sim.soak.process import Process
from sim.soak.tap import Tap
from tests.integration.flight import FIELD, running, service_words, write_area

SPEEDUP = 10.0
TARGET = "47.0508,8.3017"
SETTINGS = """
[run]
next_sortie_within_s = {sortie_within_s}
[flight]
altitude_m = 15
settle_s = {settle_s}
margin_m = {margin_m}
[sensor]
cell_m = 20
p_tn = 0.99
silent_after_s = {silent_after_s}
"""


class Scene:
    """One flight under way. Times asked for are in vehicle time; patience is in wall time."""

    def __init__(
        self,
        runs: Path,
        service: Process,
        detector: Process,
        control: Control,
        tap: Tap,
        door: httpx.Client,
        speedup: float,
    ) -> None:
        self.runs, self.service, self.detector = runs, service, detector
        self.control, self.tap, self.door, self.speedup = control, tap, door, speedup
        self._seen = 0

    @property
    def journal(self) -> Path:
        """The journal of the run."""
        (path,) = self.runs.glob("*/journal.sqlite")
        return path

    def transitions(self) -> list[Row]:
        """All transitions so far."""
        return list(read_rows(self.journal, "transition"))

    def reaches(self, state: str, *reasons: str, patience_s: float = 90.0) -> Row:
        """Wait for the next transition into a state, whose reason has one of these words; which one of two true ones
        comes first may be a matter of which message does."""
        deadline = time.monotonic() + patience_s
        while True:
            over = time.monotonic() > deadline or self.service.process.poll() is not None
            for row in self.transitions():
                if row.seq > self._seen and row.body["to"] == state:
                    self._seen = row.seq
                    said = row.body["reason"]
                    assert not reasons or any(words in said for words in reasons), row.body
                    return row
            assert not over, f"no transition to {state} in:\n{self.service.said}"
            time.sleep(0.05)

    def commands(self, after: Row, before: Row) -> list[str]:
        """The commands that were journalled between two rows."""
        rows = read_rows(self.journal, "command")
        return [row.body["command"] for row in rows if after.seq < row.seq < before.seq]

    def searching(self) -> None:
        """Wait until the search has begun and a few waypoints are out."""
        self.reaches("SEARCHING")
        deadline = time.monotonic() + 60.0
        while self.door.get("/api/state").json()["steps"] < 2:
            assert time.monotonic() < deadline, self.service.said
            time.sleep(0.05)

    def state(self) -> str:
        """The mission's state now."""
        return str(self.door.get("/api/state").json()["state"])

    def order(self, command: str) -> str:
        """An operator's order; the state after it."""
        return str(self.door.post("/api/commands", json={"command": command}).json()["state"])

    def fly(self, seconds: float) -> None:
        """Let so much vehicle time pass."""
        until = self.control.state()["time"] + seconds
        while self.control.state()["time"] < until:
            time.sleep(0.05)

    def sends_nothing(self, seconds: float) -> None:
        """Let vehicle time pass, in which nothing that moves the aircraft may be sent."""
        before = len(self.tap.motions)
        self.fly(seconds)
        moved = self.tap.motions[before:]
        assert moved == [], f"{moved}\n{self.service.said}"

    def moves_again(self, patience_s: float = 60.0) -> None:
        """Wait until another waypoint is sent."""
        before, deadline = len(self.tap.motions), time.monotonic() + patience_s
        while "MAV_CMD_DO_REPOSITION" not in [name for _, name in self.tap.motions[before:]]:
            assert time.monotonic() < deadline, self.service.said
            time.sleep(0.05)

    def map(self) -> Mapping[str, Any]:
        """The belief with its digest."""
        grid: Mapping[str, Any] = self.door.get("/api/map").json()
        return grid

    def ends(self) -> tuple[int, dict[str, Any]]:
        """Wait for the end: the exit code and the report."""
        code = self.service.exit_code()
        (path,) = self.runs.glob("*/report.json")
        report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return code, report


@contextmanager
def flight(
    folder: Path,
    flavor: str = "px4",
    *,
    speedup: float = SPEEDUP,
    settle_s: float = 3.0,
    margin_m: float = 30.0,
    silent_after_s: float = 10.0,
    sortie_within_s: float = 0.0,
    module: str = "service",
    target: str | None = None,
    options: tuple[str, ...] = (),
) -> Iterator[Scene]:
    """A search that has just been started, over a field with nothing in it unless a target is given."""
    with ExitStack() as stack:
        home = ("--home=47.0501,8.3001,400", "--ready-after", "3", "--control", "127.0.0.1:0", *options)
        autopilot = stack.enter_context(AutopilotProcess(flavor, speedup=speedup, options=home))
        assert autopilot.control is not None
        control = stack.enter_context(Control(autopilot.control))
        tap = stack.enter_context(Tap(autopilot.port))
        file = folder / "settings.toml"
        told = {"settle_s": settle_s, "margin_m": margin_m, "sortie_within_s": sortie_within_s}
        file.write_text(SETTINGS.format(**told, silent_after_s=silent_after_s), encoding="utf-8")
        area = write_area(folder, FIELD if target else plain(FIELD))
        runs = folder / "runs"
        words = service_words(area, runs, "--connect", tap.url, "--takeoff", "--config", str(file))
        words[words.index("--speedup") + 1] = str(speedup)
        service = stack.enter_context(running(module, *words[1:]))
        address = service.wait_for(r"listening on (http://\S+)").group(1)
        door = stack.enter_context(httpx.Client(base_url=address, timeout=30.0))
        where = ["--p-tn", "0.99", *(["--target", target] if target else [])]
        detector = stack.enter_context(running("sim", "detector", "--service", address, *where))
        yield Scene(runs, service, detector, control, tap, door, speedup)


def plain(area: Mapping[str, Any]) -> dict[str, Any]:
    """The area without its priors: a search that takes a while."""
    features = [each for each in area["features"] if each["properties"].get("role") != "prior"]
    return {**area, "features": features}

"""`roisearch-sim bench strangers`: does the flight feel what strangers do at the doors?

A real service flies a mock autopilot, first undisturbed, then under all of `attacks` at once, with the service and the
strangers on one core (and the aircraft with the stopwatch on another, where there is one). Measured on the wire: the
longest gap in the service's heartbeat, and how long an operator's Hold takes from the click to the stop on the link.
Counted: reports of an honest detector that were acknowledged, and are not in the journal exactly once.
"""

from __future__ import annotations

import contextlib
import getpass
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from rich.console import Console
from rich.table import Table

from service.errors import Parser
from service.journal import read_rows
from sim.autopilot.process import AutopilotProcess
from sim.detector import Detector
from sim.soak import attacks, ground
from sim.soak.process import ROOT, Process
from sim.soak.tap import Tap

GAP_AT_MOST_S, HOLD_AT_MOST_S = 1.5, 0.3
SETTINGS = """
[flight]
altitude_m = 30
max_hold_s = 3600
[sensor]
profile = "camera"
cell_m = {cell_m}
p_tn = 0.97
[search]
stop_at_pos = 0.999999
found_at = 0.999999999
max_area_km2 = 1000
[doors]
udp = "127.0.0.1:0"
{mqtt}
"""
_PATIENCE_S = 60.0
_COMPILED_S = 600.0
_SETTLED_S = 10.0
"""Until all attackers have started, which takes more of the core than what they do."""


@dataclass
class Figures:
    """What a flight felt."""

    beats: list[float] = field(default_factory=list)
    holds: list[float] = field(default_factory=list)
    acknowledged: set[str] = field(default_factory=set)
    lost: int = 0
    twice: int = 0

    @property
    def gap_s(self) -> float:
        """The longest gap in the heartbeat."""
        return max((b - a for a, b in zip(self.beats, self.beats[1:], strict=False)), default=float("inf"))

    @property
    def hold_s(self) -> float:
        """The longest that a Hold took to the wire."""
        return max(self.holds, default=float("inf"))


def measure(
    folder: Path, kinds: Sequence[str], *, holds: int = 8, side_m: float = 6000.0, cell_m: float = 20.0
) -> Figures:
    """Fly over a square of `side_m` in cells of `cell_m` under these attacks. AssertionError: it cannot be flown."""
    figures, lat_lon = Figures(), ground.launch()
    with ExitStack() as stack:
        home = f"--home={lat_lon[0]:.7f},{lat_lon[1]:.7f},{ground.GROUND_AMSL_M:g}"
        mock = stack.enter_context(
            AutopilotProcess("px4", options=[home, "--ready-after", "2", "--endurance", "600"])
        )

        def heard(message: Any, now: float) -> None:
            if message.get_type() == "HEARTBEAT":
                figures.beats.append(now)

        tap = stack.enter_context(Tap(mock.port, from_service=heard))
        broker = stack.enter_context(_broker(folder)) if "MQTT" in kinds else ""
        service = _service(folder, tap, broker, side_m, cell_m)
        stack.callback(service.stop)
        address = service.wait_for(r"listening on (http://\S+)", _COMPILED_S).group(1)
        service.wait_for("→ SEARCHING", _PATIENCE_S)
        stack.enter_context(_detecting(address, figures))
        where = {"MQTT": broker, "datagrams": service.wait_for(r"(udp://\S+)").group(1)}
        for kind in kinds:
            stack.enter_context(_attacking(kind, where.get(kind, address)))
        time.sleep(_SETTLED_S)
        figures.beats.clear()
        with httpx.Client(base_url=address, timeout=_PATIENCE_S) as operator:
            for _ in range(holds):
                figures.holds.append(_hold(operator, tap))
                time.sleep(0.5)
                _press(operator, "resume", "SEARCHING", "CONFIRMING")
                time.sleep(2.0)
        stack.pop_all().close()
    _count(folder, figures)
    return figures


def _service(folder: Path, tap: Tap, broker: str, side_m: float, cell_m: float) -> Process:
    """The service over a square, on the first core where there are several."""
    area, settings = folder / "area.geojson", folder / "settings.toml"
    area.write_text(json.dumps(ground.square(side_m)), encoding="utf-8")
    mqtt = f'mqtt = "{broker}"' if broker else ""
    settings.write_text(SETTINGS.format(mqtt=mqtt, cell_m=cell_m), encoding="utf-8")
    words = ["service", "--area", str(area), "--config", str(settings), "--runs", str(folder / "runs")]
    with _on_one_core():
        return Process([*words, "--connect", tap.url, "--takeoff", "--flat", "--http", "127.0.0.1:0"])


@contextmanager
def _on_one_core() -> Iterator[None]:
    """What is started within shares the first core."""
    ours = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(ours)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, ours)


@contextmanager
def _attacking(kind: str, address: str) -> Iterator[None]:
    with _on_one_core():
        attacker = subprocess.Popen(
            [sys.executable, "-m", "sim.soak.attacks", kind, address], cwd=ROOT, stderr=subprocess.DEVNULL
        )
    try:
        yield
        assert attacker.poll() is None, f"the attack '{kind}' has ended by itself"
    finally:
        attacker.kill()
        attacker.wait()


@contextmanager
def _broker(folder: Path) -> Iterator[str]:
    """Debian's broker, with its own limits."""
    program = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
    assert program is not None, "the attack over MQTT needs mosquitto (apt-get install mosquitto)"
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    file = folder / "mosquitto.conf"
    lines = [
        f"listener {port} 127.0.0.1",
        "allow_anonymous true",
        "persistence false",
        f"user {getpass.getuser()}",
    ]
    file.write_text("\n".join([*lines, ""]), encoding="utf-8")
    broker = subprocess.Popen([program, "-c", str(file)], stderr=subprocess.DEVNULL)
    try:
        yield f"mqtt://127.0.0.1:{port}"
    finally:
        broker.terminate()
        broker.wait()


@contextmanager
def _detecting(address: str, figures: Figures) -> Iterator[None]:
    """An honest detector, which sends again what was not acknowledged."""
    over = threading.Event()

    def report() -> None:
        detector = Detector(None, 0.9, 0.97, 1)
        unanswered: dict[str, Any] | None = None
        with httpx.Client(base_url=address, timeout=_PATIENCE_S) as client:
            while not over.wait(0.3):
                with contextlib.suppress(httpx.HTTPError, ValueError, KeyError):
                    if unanswered is None:
                        state = client.get("/api/state").raise_for_status().json()
                        unanswered = detector.frame(state) if state["pose"] else None
                    if unanswered is not None:
                        (receipt,) = client.post("/api/reports", json=unanswered).raise_for_status().json()
                        unanswered = None
                        if receipt["status"] in ("accepted", "duplicate"):
                            figures.acknowledged.add(receipt["id"])

    reporting = threading.Thread(target=report)
    reporting.start()
    try:
        yield
    finally:
        over.set()
        reporting.join()


def _hold(operator: httpx.Client, tap: Tap) -> float:
    """Press Hold; how long it took until the stop, the last thing that moves the aircraft, was on the wire, or until
    the answer, where nothing was sent since it was pressed: what has not gone anywhere yet needs no stop."""
    began = time.monotonic()
    _press(operator, "hold", "HOLDING")
    answered = time.monotonic()
    time.sleep(0.2)
    sent = [when for when, _ in tap.motions if when >= began]
    return (sent[-1] if sent else answered) - began


def _press(operator: httpx.Client, command: str, *becomes: str) -> None:
    """Give an order, again while the door is busy, until the search is in one of the states that it leads to."""
    deadline, answer = time.monotonic() + _PATIENCE_S, "no answer"
    while True:
        try:
            said = operator.post("/api/commands", json={"command": command})
            if said.status_code == 200 and said.json()["state"] in becomes:
                return
            answer = f"{said.status_code}: {said.text}"
        except httpx.HTTPError as error:
            answer = repr(error)
        assert time.monotonic() < deadline, f"{command} was not taken: {answer}"


def _count(folder: Path, figures: Figures) -> None:
    """How many of the acknowledged reports the journal does not hold, or holds twice."""
    (journal,) = (folder / "runs").glob("*/journal.sqlite")
    kept = Counter(row.body["report"]["id"] for row in read_rows(journal, "report"))
    figures.lost = sum(name not in kept for name in figures.acknowledged)
    figures.twice = sum(count > 1 for count in kept.values())


def main(arguments: list[str]) -> int:
    """Measure and print; with `--check` 1 when a bound is missed."""
    parser = Parser(prog="roisearch-sim bench strangers", description=__doc__.split("\n")[0])
    parser.add_argument("--holds", type=int, default=8, help="how often Hold is pressed (default 8)")
    parser.add_argument("--side", type=float, default=6000.0, help="metres of the square (default 6000)")
    parser.add_argument("--only", action="append", choices=list(attacks.KINDS), help="only this attack")
    parser.add_argument("--check", action="store_true", help="exit 1 when a bound is missed")
    options = parser.parse_args(arguments)
    kinds = options.only or list(attacks.KINDS)
    found: dict[str, Figures] = {}
    for name, these in (("undisturbed", []), ("under attack", kinds)):
        with tempfile.TemporaryDirectory() as scratch:
            found[name] = measure(Path(scratch), these, holds=options.holds, side_m=options.side)
    Console().print(table(found))
    worst = found["under attack"]
    kept = worst.gap_s <= GAP_AT_MOST_S and worst.hold_s <= HOLD_AT_MOST_S and not worst.lost + worst.twice
    return 0 if kept or not options.check else 1


def table(found: dict[str, Figures]) -> Table:
    """The figures side by side."""
    shown = Table("what", *found, "bound")
    each = list(found.values())
    shown.add_row("longest gap in the heartbeat", *(f"{f.gap_s:.2f} s" for f in each), f"{GAP_AT_MOST_S:g} s")
    shown.add_row("longest Hold to the wire", *(f"{f.hold_s:.3f} s" for f in each), f"{HOLD_AT_MOST_S:g} s")
    shown.add_row("reports acknowledged", *(str(len(f.acknowledged)) for f in each), "")
    shown.add_row("of those lost, or twice", *(str(f.lost + f.twice) for f in each), "0")
    return shown

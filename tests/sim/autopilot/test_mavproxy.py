"""MAVProxy, headless, connects to both flavours, loads parameters, uploads a mission and changes mode."""

from __future__ import annotations

import queue
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sim.autopilot.process import AutopilotProcess

MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent)) or shutil.which("mavproxy.py")
PATIENCE_S = 60.0
MISSION = """QGC WPL 110
0\t0\t0\t16\t0\t0\t0\t0\t47.397742\t8.545594\t489.0\t1
1\t0\t3\t16\t0\t0\t0\t0\t47.398000\t8.545600\t20\t1
2\t0\t3\t16\t0\t0\t0\t0\t47.398200\t8.545800\t20\t1
"""

pytestmark = pytest.mark.skipif(
    MAVPROXY is None, reason="NO MAVPROXY: NO OTHER GROUND STATION HAS FLOWN THE MOCK (pip install MAVProxy)"
)


class Terminal:
    """MAVProxy's prompt: type a line, wait for words."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self._lines: queue.Queue[str] = queue.Queue()
        self.seen: list[str] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)

    def type(self, line: str) -> None:
        """Enter a command."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def expect(self, words: str) -> str:
        """The next line with these words in it."""
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            try:
                line = self._lines.get(timeout=1.0)
            except queue.Empty:
                continue
            self.seen.append(line)
            if words in line:
                return line
        raise AssertionError(f"'{words}' never came:\n{''.join(self.seen)}")


@contextmanager
def mavproxy(port: int, folder: Path) -> Iterator[Terminal]:
    """MAVProxy on a TCP port, working in a folder of its own."""
    command = [str(MAVPROXY), f"--master=tcp:127.0.0.1:{port}", f"--state-basedir={folder}"]
    command += ["--default-modules=param,wp,mode,cmdlong", "--retries=5"]
    with subprocess.Popen(
        [sys.executable, *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        cwd=folder,
        text=True,
    ) as process:
        try:
            yield Terminal(process)
        finally:
            process.kill()


@pytest.mark.parametrize(
    ("flavor", "parameter", "change", "mode"),
    [
        ("px4", "MIS_TAKEOFF_ALT", "long DO_SET_MODE 1 4 5 0 0 0 0", "RTL"),
        ("ardupilot", "FENCE_RADIUS", "mode GUIDED", "GUIDED"),
    ],
)
def test_mavproxy_loads_parameters_uploads_a_mission_and_changes_mode(
    flavor: str, parameter: str, change: str, mode: str, tmp_path: Path
) -> None:
    plan = tmp_path / "plan.txt"
    plan.write_text(MISSION, encoding="ascii")
    tcp = ("tcpin://127.0.0.1:0",)
    with (
        AutopilotProcess(flavor, listen=tcp, speedup=4.0) as mock,
        mavproxy(mock.port, tmp_path) as terminal,
    ):
        terminal.expect("Received ")
        terminal.type(f"param show {parameter}")
        terminal.expect(parameter)
        terminal.type(f"wp load {plan}")
        terminal.expect("TYPE_MISSION: ACCEPTED")
        terminal.type("wp list")
        terminal.expect("47.398200")
        terminal.type(change)
        terminal.expect(f"Mode {mode}")

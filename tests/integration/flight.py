"""Helpers of the integration tests: the real service as a process, on real sockets."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).parents[2]

# A field of 200 x 150 m at 47° north with a last known position: small enough that a search takes half a minute.
FIELD: dict[str, Any] = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"name": "field"},
            "geometry": {
                "type": "Polygon",
                "coordinates": [
                    [[8.3, 47.05], [8.3026, 47.05], [8.3026, 47.05135], [8.3, 47.05135], [8.3, 47.05]]
                ],
            },
        },
        {
            "type": "Feature",
            "properties": {"role": "prior", "sigma_m": 30, "weight": 1},
            "geometry": {"type": "Point", "coordinates": [8.3017, 47.0508]},
        },
        {
            "type": "Feature",
            "properties": {"role": "launch"},
            "geometry": {"type": "Point", "coordinates": [8.3001, 47.0501]},
        },
    ],
}


def write_area(folder: Path, area: dict[str, Any] = FIELD) -> Path:
    """The area as a file."""
    path = folder / "area.geojson"
    path.write_text(json.dumps(area), encoding="utf-8")
    return path


class Process:
    """A process of ours whose lines can be waited for; everything it says is kept in `said`."""

    def __init__(self, words: Sequence[str]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", *words],
            cwd=REPOSITORY,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.said = ""
        self._more = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._more:
                self.said += line
                self._more.notify_all()
        with self._more:
            self._more.notify_all()

    def wait_for(self, pattern: str, patience_s: float = 150.0) -> re.Match[str]:
        """Wait until a line matches; AssertionError with everything said when it does not."""
        deadline = time.monotonic() + patience_s
        with self._more:
            while (match := re.search(pattern, self.said)) is None:
                left = deadline - time.monotonic()
                waiting = left > 0 and self.process.poll() is None
                assert waiting, f"no '{pattern}' in:\n{self.said}"
                self._more.wait(min(left, 1.0))
            return match

    def exit_code(self, patience_s: float = 240.0) -> int:
        """Wait for the end."""
        try:
            return self.process.wait(patience_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"still running after {patience_s} s:\n{self.said}") from None


@contextmanager
def running(*words: str) -> Iterator[Process]:
    """A process that is gone at the end of the block, whatever happens."""
    process = Process(words)
    try:
        yield process
    finally:
        if process.process.poll() is None:
            process.process.kill()
        process.process.wait()


def service_words(area: Path, runs: Path, *more: str) -> list[str]:
    """The service on a free port, fast."""
    words = ["service", "--area", str(area), "--runs", str(runs), "--http", "127.0.0.1:0"]
    return [*words, *(() if "--speedup" in more else ("--speedup", "40")), *more]


def only_report(runs: Path) -> dict[str, Any]:
    """The report.json of the one run in the folder."""
    (path,) = runs.glob("*/report.json")
    report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return report

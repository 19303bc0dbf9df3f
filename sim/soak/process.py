"""A process of ours whose lines can be waited for."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

ROOT = Path(__file__).parents[2]


class Process:
    """`python -m words`; everything it says, on both its outputs, is kept in `said`. `environment` adds to our own."""

    running: ClassVar[set[Process]] = set()
    """All that were started and not stopped yet."""

    def __init__(self, words: Sequence[str], environment: Mapping[str, str] | None = None) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", *words],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, **(environment or {})},
        )
        self.running.add(self)
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
                if left <= 0 or self.process.poll() is not None:
                    raise AssertionError(f"no '{pattern}' in:\n{self.said}")
                self._more.wait(min(left, 1.0))
            return match

    def exit_code(self, patience_s: float = 240.0) -> int:
        """Wait for the end; AssertionError with everything said when it does not come."""
        try:
            return self.process.wait(patience_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"still running after {patience_s} s:\n{self.said}") from None

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """It is gone when this returns, whatever happens."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.running.discard(self)

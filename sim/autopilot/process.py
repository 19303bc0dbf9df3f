"""Starts mock autopilots as processes of their own, for tests and demonstrations."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import ClassVar

_START_S = 20.0
_STOP_S = 10.0


class AutopilotProcess:
    """`roisearch-sim autopilot` with the given options, as a context manager.

    `urls` are the addresses it has printed, in the order of `listen`, ports resolved. Raises RuntimeError
    when it ends before it listens.
    """

    running: ClassVar[set[AutopilotProcess]] = set()
    """All that were started and not stopped yet."""

    def __init__(
        self,
        flavor: str,
        *,
        listen: Sequence[str] = ("udpin://127.0.0.1:0",),
        speedup: float = 1.0,
        options: Sequence[str] = (),
    ) -> None:
        self._command = [
            sys.executable,
            "-m",
            "sim",
            "autopilot",
            "--flavor",
            flavor,
            "--speedup",
            str(speedup),
        ]
        for url in listen:
            self._command += ["--listen", url]
        self._command += list(options)
        self._lines = len(listen) + ("--control" in self._command)
        self._process: subprocess.Popen[bytes] | None = None
        self.urls: list[str] = []
        self.control: str | None = None

    def __enter__(self) -> AutopilotProcess:
        self._process = subprocess.Popen(self._command, stdout=subprocess.PIPE)
        self.running.add(self)
        try:
            self._read_addresses(self._process)
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _read_addresses(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        until, text = time.monotonic() + _START_S, b""
        while text.count(b"\n") < self._lines:
            ready, _, _ = select.select([process.stdout], [], [], max(0.0, until - time.monotonic()))
            piece = os.read(process.stdout.fileno(), 4096) if ready else b""
            if not piece:
                raise RuntimeError(f"the mock autopilot did not start: {' '.join(self._command)}")
            text += piece
        for line in text.decode().splitlines():
            if line.startswith("listening on "):
                self.urls.append(line.removeprefix("listening on "))
            elif line.startswith("control on "):
                self.control = line.removeprefix("control on ")

    @property
    def url(self) -> str:
        """The first address."""
        return self.urls[0]

    @property
    def port(self) -> int:
        """Port of the first address."""
        return int(self.url.rpartition(":")[2])

    @property
    def pid(self) -> int:
        """Process id while it runs."""
        if self._process is None:
            raise RuntimeError("the mock autopilot is not running")
        return self._process.pid

    def stop(self) -> int:
        """End it with SIGTERM and return its exit code."""
        self.running.discard(self)
        process, self._process = self._process, None
        if process is None:
            return 0
        process.terminate()
        try:
            code = process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            code = process.wait()
        finally:
            if process.stdout is not None:
                process.stdout.close()
        return code

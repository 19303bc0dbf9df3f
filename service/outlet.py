"""Standard output and standard error that nobody has to wait for.

A terminal that is stopped with Ctrl-S, a connection that is lost, a pipe that nobody reads: each lets whoever writes to
it wait, and a flight that waits sends no heartbeat. So what is said goes to a queue, and a thread that may wait as long
as it likes writes it. What the queue has no room for is left out, and counted; what cannot be written is lost.
"""

from __future__ import annotations

import contextlib
import io
import os
import queue
import select
import signal
import sys
import threading
from collections.abc import Iterator
from typing import TextIO

MOST_WAITING = 2000
"""Pieces of text that wait to be written."""
OF_A_TERMINAL = (signal.SIGHUP, signal.SIGTSTP, signal.SIGTTOU)
"""Of a terminal that is closed, in which Ctrl-Z is typed, or that is another's now."""
LAST_WORDS_S = 2.0
"""How long the end of a program waits for what is left to be written."""


class Outlet(io.TextIOBase):
    """A text stream in the place of another, `stream`, which has a file descriptor; no method of it waits."""

    def __init__(self, stream: TextIO, most_waiting: int = MOST_WAITING) -> None:
        self._file, self._encoding, self._tty = stream.fileno(), stream.encoding, stream.isatty()
        self._most_waiting, self._left_out = most_waiting, 0
        # the one that may be written to from anywhere, also from where it is being written to
        self._waiting: queue.SimpleQueue[bytes | threading.Event] = queue.SimpleQueue()
        stream.flush()
        # a thread that waits for good must not keep the process from its end
        threading.Thread(target=self._write_all, name="outlet", daemon=True).start()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """As the stream has it."""
        return self._encoding

    def isatty(self) -> bool:
        """Whether the stream was a terminal, which may be gone by now."""
        return self._tty

    def fileno(self) -> int:
        """The stream's."""
        return self._file

    def writable(self) -> bool:
        """It always takes more, and leaves it out where it must."""
        return True

    def write(self, text: str) -> int:
        """Have a text written when its turn comes."""
        length = len(text)
        if self._waiting.qsize() >= self._most_waiting:
            self._left_out += 1
        else:
            if self._left_out:
                text = f"[{self._left_out} pieces of output left out]\n{text}"
                self._left_out = 0
            self._waiting.put(text.encode(self._encoding, "replace"))
        return length

    def finish(self) -> None:
        """Wait until everything is written, but not for long."""
        written = threading.Event()
        self._waiting.put(written)
        written.wait(LAST_WORDS_S)

    def _write_all(self) -> None:
        while True:
            data = self._waiting.get()
            if isinstance(data, threading.Event):
                data.set()
                continue
            with contextlib.suppress(OSError):  # a terminal that is closed, a reader that is gone
                self._write(data)

    def _write(self, data: bytes) -> None:
        # past the stream's own buffer, whose lock would be held while we wait, also at the end of the process
        while data:
            try:
                data = data[os.write(self._file, data) :]
            except BlockingIOError:
                select.select([], [self._file], [])


@contextlib.contextmanager
def nobody_waits() -> Iterator[None]:
    """Have what the block says, on either output, written beside it; all of it when the block ends, if that can be.

    An output that is none of the process (a test's, or closed) is left as it is.
    """
    before = sys.stdout, sys.stderr
    outlets = [_outlet(stream) for stream in before]
    sys.stdout, sys.stderr = (outlet or stream for outlet, stream in zip(outlets, before, strict=True))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
        for outlet in outlets:
            if outlet is not None:
                outlet.finish()


@contextlib.contextmanager
def whatever_the_terminal_does() -> Iterator[None]:
    """Go on through the block when the terminal is closed, stops us, or belongs to another; in the main thread only."""
    before = {number: signal.signal(number, signal.SIG_IGN) for number in OF_A_TERMINAL}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _outlet(stream: TextIO | None) -> Outlet | None:
    try:
        return None if stream is None else Outlet(stream)
    except (OSError, ValueError):  # it has no file descriptor, or is closed
        return None

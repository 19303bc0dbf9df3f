"""What is said holds nobody up: not a pipe that nobody reads, not a terminal that is gone, not the end of a program."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

from service import outlet
from service.outlet import Outlet, nobody_waits


@contextmanager
def pipe() -> Iterator[tuple[int, TextIO]]:
    """A pipe: the end to read from, and a stream to write to."""
    reading, writing = os.pipe()
    with os.fdopen(writing, "w", encoding="utf-8") as stream:
        yield reading, stream
    os.close(reading)


def test_what_has_no_room_is_left_out_and_counted() -> None:
    with pipe() as (reading, stream):
        out = Outlet(stream, most_waiting=3)
        piece = "x" * 70_000  # more than a pipe holds: the thread waits
        assert [out.write(piece) for _ in range(9)] == [70_000] * 9
        seen = b""
        while seen.count(b"x") < 70_000 * 3:
            seen += os.read(reading, 65_536)
        out.write("again\n")
        while not seen.endswith(b"again\n"):
            seen += os.read(reading, 65_536)
        out.finish()
    left = 9 - seen.count(b"x") // 70_000
    assert 5 <= left <= 6
    assert seen.endswith(b"[%d pieces of output left out]\nagain\n" % left)


def test_the_end_waits_for_what_is_left_to_say_but_not_for_a_reader_that_is_stuck() -> None:
    with pipe() as (reading, stream):
        out = Outlet(stream)
        out.write("all of it\n")
        out.finish()
        assert os.read(reading, 100) == b"all of it\n"
        out.write("x" * 70_000)
        began = time.monotonic()
        out.finish()
        assert outlet.LAST_WORDS_S - 0.1 < time.monotonic() - began < outlet.LAST_WORDS_S + 5.0
        os.read(reading, 65_536)


def test_a_reader_that_is_gone_is_no_error_of_ours() -> None:
    reading, writing = os.pipe()
    with os.fdopen(writing, "w", encoding="utf-8") as stream:
        out = Outlet(stream)
        os.close(reading)
        out.write("to nobody")
        out.finish()
        out.write(
            "ü € \udcff",
        )  # what cannot be written is no error either
        out.finish()


def test_a_program_that_ends_has_said_everything_and_one_that_is_stuck_ends_too() -> None:
    program = (
        "import sys\nfrom service.outlet import nobody_waits\n"
        "with nobody_waits():\n for i in range(int(sys.argv[1])): print(i)\n print('end', file=sys.stderr)"
    )
    words = [sys.executable, "-c", program]
    said = subprocess.run([*words, "900"], capture_output=True, text=True, timeout=60, check=True)
    assert said.stdout.split() == [str(i) for i in range(900)]
    assert said.stderr == "end\n"
    with subprocess.Popen([*words, "300000"], stdout=subprocess.PIPE) as stuck:
        assert stuck.wait(60) == 0


def test_outputs_that_are_none_of_the_process_stay_as_they_are(capsys: object) -> None:
    before = sys.stdout, sys.stderr
    with nobody_waits():
        assert (sys.stdout, sys.stderr) == before

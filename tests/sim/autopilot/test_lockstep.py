"""Simulated time waits for who flies with it, for nobody else, and never for long."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import service.lockstep
import sim.autopilot.lockstep
from service.clock import Clock
from service.errors import BadInput
from sim.autopilot.lockstep import AHEAD_WALL_S
from sim.autopilot.settings import STEP_S
from sim.autopilot.transport import Driver

SPEEDUP = 20.0
AHEAD_STEPS = int(AHEAD_WALL_S * SPEEDUP / STEP_S)
FOLLOWER = """
import sys
from pathlib import Path
from {room}.lockstep import Lockstep
lockstep = Lockstep(Path({file!r}))
print("there", flush=True)
for line in sys.stdin:
    {does}
    print("done", flush=True)
"""


class Follower:
    """Another process that follows, and does one thing each time it is asked to."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process

    def answers(self) -> None:
        """Wait for its word."""
        assert self.process.stdout is not None
        assert self.process.stdout.readline()

    def act(self, word: str = "") -> None:
        """Let it do its thing."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{word}\n")
        self.process.stdin.flush()
        self.answers()


@contextmanager
def following(
    file: Path, room: str = "service", does: str = "lockstep.content_for(0.0)"
) -> Iterator[Follower]:
    """A process that follows the time in a file."""
    words = [sys.executable, "-c", FOLLOWER.format(room=room, file=str(file), does=does)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        follower = Follower(process)
        follower.answers()
        try:
            yield follower
        finally:
            process.kill()


def leader(folder: Path) -> tuple[sim.autopilot.lockstep.Lockstep, Path]:
    """The one that moves time on, and where it is kept."""
    return sim.autopilot.lockstep.Lockstep(folder / "time"), folder / "time"


def test_who_leads_alone_is_never_held(tmp_path: Path) -> None:
    lead, _ = leader(tmp_path)
    assert [lead.steps(count, SPEEDUP) for count in (1, 500, 0, 7)] == [1, 500, 0, 7]


def test_time_runs_on_while_it_is_told_to_wait_for_nobody(tmp_path: Path) -> None:
    lead, file = leader(tmp_path)
    lead.steps(100, SPEEDUP)
    driver = Driver([], SPEEDUP, lead)
    with following(file) as follower:
        follower.act()
        driver.set_waits(False)
        assert lead.steps(500, SPEEDUP) == 500
        driver.set_waits(True)
        assert lead.steps(500, SPEEDUP) == 0


def test_time_waits_for_who_follows_and_goes_on_with_it(tmp_path: Path) -> None:
    lead, file = leader(tmp_path)
    lead.steps(100, SPEEDUP)
    with following(file) as follower:
        assert lead.steps(500, SPEEDUP) == 500, "it has not said yet that it flies"
        follower.act()
        assert lead.steps(500, SPEEDUP) == AHEAD_STEPS
        assert lead.steps(500, SPEEDUP) == 0
        follower.act()
        assert lead.steps(500, SPEEDUP) == AHEAD_STEPS


KEEPS_UP = """import asyncio, contextlib
    with contextlib.suppress(TimeoutError):
        asyncio.run(asyncio.wait_for(lockstep.keep_up(lambda: float(line)), 0.05))"""


def test_time_waits_for_what_is_being_written_but_not_for_a_disk_that_is_slow(tmp_path: Path) -> None:
    lead, file = leader(tmp_path)
    with following(file, does=KEEPS_UP) as follower:
        went = []
        for behind_s in (0.0, 0.5, 0.0, 1.5):
            follower.act(str(behind_s))
            went.append(lead.steps(10 * AHEAD_STEPS, SPEEDUP))
        assert went == [AHEAD_STEPS, 0, AHEAD_STEPS, AHEAD_STEPS]


def test_time_goes_on_in_real_time_too(tmp_path: Path) -> None:
    """Seen red while it was to be ahead by less than a step: it stood for ever."""
    lead, file = leader(tmp_path)
    with following(file) as follower:
        follower.act()
        assert lead.steps(5, 1.0) == 1


def test_who_is_content_for_a_while_is_not_waited_for_meanwhile(tmp_path: Path) -> None:
    lead, file = leader(tmp_path)
    with following(file, does="lockstep.content_for(2.0)") as follower:
        follower.act()
        assert lead.steps(500, SPEEDUP) == int(2.0 / STEP_S) + AHEAD_STEPS


def test_nobody_waits_for_the_dead_nor_long_for_who_stands_still(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sim.autopilot.lockstep, "LOOK_S", 0.05)
    monkeypatch.setattr(sim.autopilot.lockstep, "GONE_S", 0.15)
    lead, file = leader(tmp_path)
    with following(file) as alive, following(file) as killed:
        alive.act()
        killed.act()
        killed.process.kill()
        killed.process.wait()
        lead.steps(500, SPEEDUP)
        assert lead.steps(500, SPEEDUP) == 0
        time.sleep(0.1)
        alive.act()
        assert lead.steps(500, SPEEDUP) > 0, "the dead one is forgotten"
        lead.steps(500, SPEEDUP)
        time.sleep(0.2)
        assert lead.steps(500, SPEEDUP) == 500, "the other has been stopped"
        alive.act()
        assert lead.steps(500, SPEEDUP) == AHEAD_STEPS, "and goes on"


def test_a_second_mock_follows_the_first_and_leads_when_that_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sim.autopilot.lockstep, "LOOK_S", 0.05)
    file = tmp_path / "time"
    file.write_bytes(bytes(8 * sim.autopilot.lockstep.PLACES))
    with following(file, "sim.autopilot", "lockstep.steps(50, 20.0)") as first:
        second = sim.autopilot.lockstep.Lockstep(file)
        assert second.steps(500, SPEEDUP) == 0
        first.act()
        assert second.steps(500, SPEEDUP) == 50
    assert second.steps(500, SPEEDUP) == 0
    time.sleep(0.1)
    assert second.steps(500, SPEEDUP) == 0, "it leads from now on"
    assert second.steps(500, SPEEDUP) == 500


@pytest.mark.parametrize(("ends", "gone_s"), [(True, 60.0), (False, 0.3)])
def test_the_services_time_is_the_simulators_until_that_is_gone(
    ends: bool, gone_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service.lockstep, "GONE_S", gone_s)
    file = tmp_path / "time"
    file.write_bytes(bytes(8 * sim.autopilot.lockstep.PLACES))
    with following(file, "sim.autopilot", "lockstep.steps(50, 20.0)") as lead:
        clock = Clock(SPEEDUP, pace=service.lockstep.Lockstep(file, SPEEDUP).ticks)
        lead.act()
        assert clock.monotonic() == pytest.approx(50 * STEP_S)
        time.sleep(0.25)
        assert clock.monotonic() == pytest.approx(50 * STEP_S), "it waits"
        if ends:
            lead.process.kill()
            lead.process.wait()
        while clock.monotonic() == pytest.approx(50 * STEP_S):
            time.sleep(0.05)
        gone = clock.monotonic()
        if not ends:
            lead.act()
            assert clock.monotonic() == pytest.approx(gone + 50 * STEP_S, abs=2.0), "and it does not go back"
            assert clock.monotonic() > gone


def test_a_pause_is_as_long_as_the_simulator_takes_for_it(tmp_path: Path) -> None:
    lead, file = leader(tmp_path)
    clock = Clock(SPEEDUP, pace=service.lockstep.Lockstep(file, SPEEDUP).ticks)

    async def once() -> float:
        pause = asyncio.create_task(clock.sleep(1.0))
        while not pause.done():
            lead.steps(1, SPEEDUP)
            await asyncio.sleep(0.005)  # a quarter of the speed
        return clock.monotonic()

    assert asyncio.run(once()) == pytest.approx(1.0, abs=0.2)


def test_a_time_out_waits_for_the_simulator_too(tmp_path: Path) -> None:
    """Seen red while it was reckoned by the wall: a take-off was given up on a busy machine."""
    lead, file = leader(tmp_path)
    clock = Clock(SPEEDUP, pace=service.lockstep.Lockstep(file, SPEEDUP).ticks)

    async def once() -> float:
        async def wait() -> None:
            async with clock.timeout(1.0):
                await asyncio.Event().wait()

        waiting = asyncio.create_task(wait())
        while not waiting.done():
            lead.steps(1, SPEEDUP)
            await asyncio.sleep(0.005)
        with pytest.raises(TimeoutError):
            waiting.result()
        return clock.monotonic()

    assert asyncio.run(once()) == pytest.approx(1.0, abs=0.2)


def test_a_file_that_no_simulator_made_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no simulator keeps its time there"):
        service.lockstep.Lockstep(tmp_path / "nothing")

"""What can happen to our own process in flight: it stands still, or its disk is full."""

from __future__ import annotations

import resource
import signal
import time
from pathlib import Path

import pytest

from service.journal import read_rows
from service.progress import LINE_EVERY_S
from tests.integration.scene import Scene, flight
from tests.integration.stalling import STALL_S

pytestmark = pytest.mark.timeout(300)
STALLING = "tests.integration.stalling"


def stand_still(scene: Scene) -> int:
    """Stop the event loop; returns how many motion commands were sent before."""
    before = scene.service.said.count("standing still")
    scene.service.process.send_signal(signal.SIGUSR1)
    deadline = time.monotonic() + 30.0
    while scene.service.said.count("standing still") == before:
        assert time.monotonic() < deadline, scene.service.said
        time.sleep(0.01)
    return len(scene.tap.motions)


def test_after_a_stall_nothing_is_sent_on_what_was_known_before(tmp_path: Path) -> None:
    """What waits in the socket is as old as the stall: with nothing newer on the link, nothing may be sent. And a pilot
    who took over meanwhile has the aircraft."""
    with flight(tmp_path, "ardupilot", speedup=5.0, module=STALLING) as scene:
        scene.searching()
        motions = stand_still(scene)
        time.sleep(0.6 * STALL_S)
        scene.control.fault("link_lost", seconds=4.5 * scene.speedup)
        time.sleep(0.4 * STALL_S + 1.0)  # it is awake again, and hears nobody
        assert scene.tap.motions[motions:] == [], scene.service.said
        scene.moves_again()
        motions = stand_still(scene)
        time.sleep(0.4 * STALL_S)
        scene.control.fault("pilot")
        scene.reaches("YIELDED", "LOITER")
        scene.fly(10.0)
        assert scene.tap.motions[motions:] == [], scene.service.said


def test_a_mistake_of_ours_stops_the_aircraft_and_tells_the_pilot(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", module=STALLING) as scene:
        scene.searching()
        scene.service.process.send_signal(signal.SIGUSR2)
        assert scene.service.exit_code() == 1
        assert "ZeroDivisionError: a mistake" in scene.service.said
        assert any(text.startswith("search ABORTED, hovering: internal error") for text in scene.tap.texts)
        scene.fly(5.0)
        assert scene.control.state()["speed"] < 1.0


def test_a_full_disk_in_flight_sends_the_aircraft_home_and_tells_the_pilot(tmp_path: Path) -> None:
    with flight(tmp_path) as scene:
        scene.searching()
        written = max(path.stat().st_size for path in scene.journal.parent.glob("journal.sqlite*"))
        limits = resource.prlimit(scene.service.process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(scene.service.process.pid, resource.RLIMIT_FSIZE, (written, limits[1]))
        deadline = time.monotonic() + 60.0
        while scene.control.state()["mode"] != "AUTO_RTL":
            assert time.monotonic() < deadline, scene.service.said
        code, report = scene.ends()
        assert code == 4
        assert "cannot be written" in report["stopped_because"]
        assert any(text.startswith("search ABORTED, flying home: the journal") for text in scene.tap.texts)
        scene.fly(1.0)
        state = scene.control.state()
        assert state["mode"] == "AUTO_RTL" or state["landed"] == "ON_GROUND", "it is not stopped on its way"
    assert "Traceback" not in scene.service.said
    numbers = [row.seq for row in read_rows(scene.journal)]
    assert numbers == list(range(1, len(numbers) + 1))


def test_outputs_that_nobody_reads_hold_nothing_up(tmp_path: Path) -> None:
    """Ctrl-S in its terminal, a connection that is lost, a pager: the flight goes on, obeys, and ends."""
    with flight(tmp_path, "ardupilot", module=STALLING) as scene:
        scene.searching()
        scene.service.process.send_signal(signal.SIGRTMIN)
        scene.service.wait_for("nobody reads on")
        time.sleep(2.0 * LINE_EVERY_S + 1.0)  # it has had something to say since
        beats = scene.tap.beats
        scene.fly(5.0 * scene.speedup)
        assert scene.tap.beats >= beats + 4
        assert scene.order("hold") == "HOLDING"
        scene.order("abort")
        assert scene.service.exit_code(30.0) == 4


def test_a_terminal_that_is_closed_ends_nothing(tmp_path: Path) -> None:
    """An ssh session that is lost: the flight goes on, as with nohup."""
    with flight(tmp_path, module=STALLING) as scene:
        scene.searching()
        scene.service.process.send_signal(signal.SIGRTMIN + 1)
        scene.service.wait_for("hung up")
        for number in (signal.SIGHUP, signal.SIGTSTP, signal.SIGTTOU):
            scene.service.process.send_signal(number)
        time.sleep(LINE_EVERY_S + 1.0)  # it has had something to say since
        scene.moves_again()
        scene.order("abort")
        assert scene.service.exit_code(30.0) == 4

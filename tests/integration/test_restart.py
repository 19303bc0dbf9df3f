"""A service that is started again: it comes up as it was left, and no flag of an earlier hour moves an aircraft."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from service.journal import Journal
from service.survey import AREA, JOURNAL
from sim.soak.process import Process
from tests.integration.flight import running
from tests.integration.scene import Scene, flight
from tests.service.export.recorded import record

pytestmark = pytest.mark.timeout(400)
SPEEDUP = 5.0


def words(scene: Scene, *more: str) -> list[str]:
    """What is typed to start it again."""
    return ["service", *more, "--http", "127.0.0.1:0", "--speedup", f"{scene.speedup:g}"]


@contextmanager
def restarted(scene: Scene, *more: str) -> Iterator[tuple[Process, httpx.Client]]:
    """The service again, with a door to it, once it hears the vehicle."""
    with running(*words(scene, *more)) as service:
        address = service.wait_for(r"listening on (http://\S+)").group(1)
        with httpx.Client(base_url=address, timeout=30.0) as door:
            yield service, door


def comes_to(door: httpx.Client, state: str) -> None:
    """Wait for a state."""
    deadline = time.monotonic() + 60.0
    while door.get("/api/state").json()["state"] != state:
        assert time.monotonic() < deadline, door.get("/api/state").json()["state"]
        time.sleep(0.05)


def the_run(scene: Scene) -> str:
    """Its folder."""
    (folder,) = scene.runs.iterdir()
    return str(folder)


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
@pytest.mark.parametrize("person", ["pilot", "operator"])
def test_what_a_person_stopped_stays_stopped_across_a_kill(flavor: str, person: str, tmp_path: Path) -> None:
    with flight(tmp_path, flavor, speedup=SPEEDUP) as scene:
        scene.searching()
        if person == "pilot":
            scene.control.fault("pilot")
            scene.reaches("YIELDED")
        else:
            assert scene.order("hold") == "HOLDING"
            scene.fly(5.0)
        state = {"pilot": "YIELDED", "operator": "HOLDING"}[person]
        steps = scene.door.get("/api/state").json()["steps"]
        scene.service.process.kill()
        motions = len(scene.tap.motions)
        with restarted(scene, "--resume", the_run(scene)) as (service, door):
            comes_to(door, state)
            scene.fly(20.0)
            assert scene.tap.motions[motions:] == [], service.said
            assert door.get("/api/state").json()["steps"] == pytest.approx(steps, abs=3)
            scene.control.clear("pilot")
            door.post("/api/commands", json={"command": "resume"}).raise_for_status()
            comes_to(door, "SEARCHING")
            scene.moves_again()


def test_an_aircraft_that_its_pilot_landed_takes_off_on_a_fresh_order_only(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", speedup=SPEEDUP) as scene:
        scene.searching()
        scene.control.fault("pilot", mode="LAND")
        scene.reaches("YIELDED", "LAND")
        scene.service.process.kill()
        deadline = time.monotonic() + 60.0
        while scene.control.state()["armed"]:
            assert time.monotonic() < deadline
            time.sleep(0.1)
        scene.control.clear("pilot")
        motions = len(scene.tap.motions)
        with restarted(scene, "--resume", the_run(scene)) as (service, door):
            comes_to(door, "YIELDED")
            scene.fly(20.0)
            assert scene.tap.motions[motions:] == [], service.said
            assert not scene.control.state()["armed"]
            door.post("/api/commands", json={"command": "resume"}).raise_for_status()
            scene.fly(5.0)
            assert not scene.control.state()["armed"]  # that is no order to take off
            door.post("/api/commands", json={"command": "launch"}).raise_for_status()
            comes_to(door, "SEARCHING")


def test_a_crash_in_flight_and_the_units_restart_are_one_search(tmp_path: Path) -> None:
    """As systemd does it: the same command again, which finds the run that the crash has left."""
    with flight(tmp_path, "ardupilot", speedup=SPEEDUP, module="tests.integration.stalling") as scene:
        scene.searching()
        scene.service.process.send_signal(signal.SIGUSR2)
        assert scene.service.exit_code() == 1
        motions = len(scene.tap.motions)
        area, settings = str(tmp_path / "area.geojson"), str(tmp_path / "settings.toml")
        again = ["--area", area, "--runs", str(scene.runs), "--config", settings, "--connect", scene.tap.url]
        with restarted(scene, *again, "--takeoff", "--go-on") as (service, door):
            comes_to(door, "SEARCHING")
            scene.moves_again()
            assert len(list(scene.runs.iterdir())) == 1
            names = {name for _, name in scene.tap.motions[motions:]}
            assert names <= {"MAV_CMD_DO_REPOSITION", "MAV_CMD_DO_CHANGE_SPEED"}, service.said


def test_over_an_interrupted_flight_it_waits_for_a_device_that_is_gone_and_for_an_aircraft_that_is_silent(
    tmp_path: Path,
) -> None:
    """What made it crash, a brown-out say, may take the serial device along, which then comes back by another name."""
    folder = record(tmp_path / "runs" / "slope", part=0.0)
    device, told = tmp_path / "by-id", tmp_path / "settings.toml"
    with contextlib.closing(Journal(folder / JOURNAL)) as journal:
        settings = journal.meta("settings")
        journal.set_meta("settings", {**settings, "link": {**settings["link"], "connect_timeout_s": 2.0}})
    told.write_text("[link]\nconnect_timeout_s = 2\n", encoding="utf-8")
    again = ["--area", str(folder / AREA), "--runs", str(tmp_path / "runs"), "--config", str(told), "--flat"]
    link = f"serial://{device}:57600"
    with running("service", *again, "--connect", link, "--go-on", "--http", "127.0.0.1:0") as service:
        service.wait_for("by-id:57600: there is no such device; .* it is tried again")
        other, terminal = os.openpty()
        device.symlink_to(os.ttyname(terminal))
        service.wait_for("listening on")
        service.wait_for("(?s)(nothing was heard on .* in 2 s; it is still waited for.*){2}")
        assert service.process.poll() is None
        service.process.terminate()  # a person ends the waiting
        assert service.exit_code(60.0) == 4
    os.close(other)
    os.close(terminal)

"""Two aircraft on one belief: orders by name, one killed process and both back, and the target found."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.journal import read_rows
from sim.soak.process import Process
from tests.integration.flight import only_report, running, service_words, write_area
from tests.ports import free_port

pytestmark = pytest.mark.timeout(400)


def wait_for(
    door: httpx.Client, condition: Callable[[dict[str, Any]], bool], service: Process
) -> dict[str, dict[str, Any]]:
    """The aircraft by their names, once both fulfil a condition."""
    deadline = time.monotonic() + 120.0
    while True:
        try:
            answer = door.get("/api/state")
            told = (
                answer.json()["aircraft"] if answer.status_code == 200 else []
            )  # busy: it does not answer in time
        except httpx.TransportError:  # nor does one that has ended, which is told below
            told = []
        aircraft = {each["name"]: each for each in told}
        if len(aircraft) == 2 and all(map(condition, aircraft.values())):
            return aircraft
        assert time.monotonic() < deadline, (aircraft, service.said)
        time.sleep(0.05)


def the_door(service: Process) -> httpx.Client:
    """A client of the service."""
    return httpx.Client(base_url=service.wait_for(r"listening on (http://\S+)").group(1), timeout=30.0)


def test_two_aircraft_outlive_a_kill_and_find_the_target_together(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    mocks = ["--aircraft", "2", "--flavor", "px4", "--flavor", "ardupilot", "--speedup", "20"]
    with running(*service_words(write_area(tmp_path), runs, *mocks)) as service, the_door(service) as door:
        flying = wait_for(door, lambda each: each["state"] == "SEARCHING" and each["steps"] >= 1, service)
        assert flying["2"]["height"] - flying["1"]["height"] == pytest.approx(10.0, abs=3.0)
        told = door.get("/metrics").text
        for name in ("roisearch_battery_percent", "roisearch_link_up", "roisearch_steps"):
            assert all(f'{name}{{aircraft="{number}"}}' in told for number in (1, 2)), name
        nobody = door.post("/api/commands", json={"command": "hold", "aircraft": "3"})
        assert (nobody.status_code, nobody.json()["detail"]) == (
            422,
            "there is no aircraft '3'; there is 1, 2",
        )
        frame = {"id": "unpaired", "captured_at": time.time(), "source": "cam7"}
        (receipt,) = door.post("/api/reports", json=frame).json()
        assert receipt["status"] == "refused"
        assert 'add "aircraft", one of "1", "2"' in receipt["reason"]
        door.post("/api/commands", json={"command": "hold", "aircraft": "2"}).raise_for_status()
        wait_for(
            door, lambda each: each["state"] == ("HOLDING" if each["name"] == "2" else "SEARCHING"), service
        )
        service.process.kill()
        service.exit_code()
    (folder,) = runs.iterdir()
    named = {row.body.get("aircraft") for row in read_rows(folder / "journal.sqlite", "transition", "report")}
    assert named == {"1", "2"}
    words = ["service", "--resume", str(folder), "--http", "127.0.0.1:0"]
    with running(*words) as service, the_door(service) as door:
        back = wait_for(
            door, lambda each: each["state"] == ("HOLDING" if each["name"] == "2" else "SEARCHING"), service
        )
        assert all(each["steps"] >= 1 for each in back.values())
        door.post("/api/commands", json={"command": "launch", "aircraft": "2"}).raise_for_status()
        assert service.exit_code() == 0, service.said
    report = only_report(runs)
    assert report["outcome"] == "found"
    assert [each["state"] for each in report["aircraft"]] == ["DONE", "DONE"]
    assert report["steps"] == sum(each["steps"] for each in report["aircraft"])


def test_two_whose_journal_is_lost_fly_home_by_our_own_way_and_land(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    words = service_words(write_area(tmp_path), runs, "--aircraft", "2", "--speedup", "20")
    with running(*words) as service, the_door(service) as door:
        wait_for(door, lambda each: each["state"] == "SEARCHING" and each["steps"] >= 1, service)
        (folder,) = runs.iterdir()
        (folder / "journal.sqlite").unlink()
        assert service.exit_code(120.0) == 4, service.said
    report = only_report(runs)
    assert [each["state"] for each in report["aircraft"]] == ["DONE", "DONE"]
    assert "has been deleted" in report["stopped_because"]
    assert "Traceback" not in service.said


def test_one_that_is_switched_on_late_joins_the_other_by_an_order(tmp_path: Path) -> None:
    runs, settings = tmp_path / "runs", tmp_path / "settings.toml"
    free = free_port()
    settings.write_text("[link]\nconnect_timeout_s = 60\n[sensor]\nsilent_after_s = 1e5\n")
    mock = ["sim", "autopilot", "--home=47.0501,8.3001,400", "--speedup", "20", "--listen"]
    with running(*mock, "udpin://127.0.0.1:0", "--endurance", "90") as early:
        url = early.wait_for(r"listening on (udpin://\S+)").group(1).replace("udpin", "udpout")
        links = ["--connect", url, "--connect", f"udpout://127.0.0.1:{free}", "--takeoff", "--speedup", "20"]
        words = service_words(write_area(tmp_path), runs, *links, "--config", str(settings))
        with running(*words) as service, the_door(service) as door:
            searches = ("SEARCHING", "CONFIRMING")
            flies = [searches, ("WAITING",)]
            wait_for(door, lambda each: each["state"] in flies[int(each["name"]) - 1], service)
            service.wait_for("the others go on, and it may join them later")
            with running(*mock, f"udpin://127.0.0.1:{free}", "--sysid", "2"):
                service.wait_for("'2': order launch, or take off and select")
                flies[1] = ("READY",)
                wait_for(door, lambda each: each["state"] in flies[int(each["name"]) - 1], service)
                door.post("/api/commands", json={"command": "launch", "aircraft": "2"}).raise_for_status()
                wait_for(door, lambda each: each["state"] in searches and each["steps"] >= 1, service)
                door.post("/api/commands", json={"command": "finish"}).raise_for_status()
                assert service.exit_code() == 3, service.said
    assert [each["state"] for each in only_report(runs)["aircraft"]] == ["DONE", "DONE"]

"""A search of several sorties: landed, killed, with another battery or aircraft, and one search all the same."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest

from service.journal import read_rows
from service.packing import pack
from sim.autopilot.process import AutopilotProcess
from tests.integration.flight import only_report, running, service_words, write_area
from tests.integration.scene import flight
from tests.integration.test_restart import comes_to, restarted, the_run
from tests.integration.test_resume import replayed

pytestmark = pytest.mark.timeout(600)
BATTERY = ("--endurance", "8", "--swap-battery", "20")


def test_a_killed_search_goes_on_from_the_ground_on_another_computer_with_another_aircraft(
    tmp_path: Path,
) -> None:
    with flight(tmp_path, "px4", sortie_within_s=36000.0) as scene, ExitStack() as stack:
        scene.searching()
        scene.order("return")
        scene.reaches("GROUNDED")
        motions, before = len(scene.tap.motions), scene.door.get("/api/state").json()
        scene.service.process.kill()
        digest, _ = replayed(Path(the_run(scene)), 20.0)
        home = ("--home=47.0501,8.3001,400", "--ready-after", "3", "--sysid", "7")
        mock = stack.enter_context(AutopilotProcess("ardupilot", speedup=scene.speedup, options=home))
        pack(Path(the_run(scene)), tmp_path / "field.zip")
        scene.runs = tmp_path / "other computer"
        again = ["--resume", str(tmp_path / "field.zip"), "--runs", str(scene.runs)]
        again += ["--connect", f"udpout://127.0.0.1:{mock.port}", "--takeoff"]
        with restarted(scene, *again) as (service, door):
            comes_to(door, "GROUNDED")
            assert scene.tap.motions[motions:] == []
            (first,) = door.get("/api/state").json()["sorties"]
            assert first == before["sorties"][0]
            assert door.get("/api/map").json()["digest"] == digest
            door.post("/api/commands", json={"command": "launch"}).raise_for_status()
            comes_to(door, "SEARCHING")
            door.post("/api/commands", json={"command": "finish"}).raise_for_status()
            assert service.exit_code() == 3, service.said
    (path,) = scene.runs.glob("*/report.json")
    report = json.loads(path.read_text(encoding="utf-8"))
    assert [each["number"] for each in report["sorties"]] == [1, 2]
    assert report["stopped_because"] == "the operator finished the search"
    assert report["flight_time_s"] == pytest.approx(
        sum(s["flight_time_s"] for s in report["sorties"]), abs=1.0
    )
    assert report["pos"] >= first["pos"]


def test_a_fresh_battery_is_noticed_and_another_aircraft_flies_on_after_an_order(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", sortie_within_s=36000.0, options=BATTERY) as scene:
        scene.reaches("RETURNING", "battery")
        scene.reaches("GROUNDED")
        motions = len(scene.tap.motions)
        scene.service.wait_for("fresh battery, 100 %: order launch")
        scene.fly(30.0)
        assert scene.tap.motions[motions:] == []
        scene.control.replace("px4", 7)
        scene.door.post("/api/commands", json={"command": "replace", "system_id": 7}).raise_for_status()
        scene.service.wait_for("another aircraft, system 7 .px4.: order launch")
        assert scene.tap.motions[motions:] == []
        assert scene.order("launch") in ("GROUNDED", "TAKEOFF")
        scene.reaches("SEARCHING")
        assert scene.order("finish") == "RETURNING"
        code, report = scene.ends()
    assert (code, report["outcome"]) == (3, "not_found")
    flown = [(each["number"], each["system_id"], each["autopilot"]) for each in report["sorties"]]
    assert flown == [(1, 1, "ardupilot"), (2, 7, "px4")]
    assert "battery" in report["sorties"][0]["why"]
    heard = [(row.body["system_id"], row.body["autopilot"]) for row in read_rows(scene.journal, "vehicle")]
    assert heard == [(1, "ardupilot"), (7, "px4")]
    (order,) = read_rows(scene.journal, "replaced")
    assert order.body == {"system_id": 7, "was_system_id": 1, "was_autopilot": "ardupilot"}


DEMO = """
[demo]
target = false
endurance_min = 2.5
swap_battery_s = 10
[flight]
full_battery_s = 150
"""


def test_the_built_in_world_flies_one_sortie_after_another_by_itself(tmp_path: Path) -> None:
    settings = tmp_path / "settings.toml"
    settings.write_text(DEMO, encoding="utf-8")
    words = service_words(
        write_area(tmp_path), tmp_path / "runs", "--config", str(settings), "--speedup", "20"
    )
    with running(*words) as service:
        address = service.wait_for(r"listening on (http://\S+)").group(1)
        with httpx.Client(base_url=address, timeout=30.0) as door:
            service.wait_for(r"(?s)(RETURNING → GROUNDED.*){2}", 300.0)
            door.post("/api/commands", json={"command": "finish"}).raise_for_status()
        assert service.exit_code() == 3, service.said
    report = only_report(tmp_path / "runs")
    first, second = report["sorties"][:2]
    assert (first["number"], second["number"]) == (1, 2)
    assert all("battery" in each["why"] and each["flight_time_s"] > 20.0 for each in (first, second))

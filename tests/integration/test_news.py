"""News in flight: the next decision knows of a clue, and what is taken back was never there."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

import pytest
import shapely

from service.journal import read_rows
from tests.integration.scene import Scene, flight
from tests.integration.test_restart import restarted, the_run
from tests.integration.test_resume import replayed

pytestmark = pytest.mark.timeout(600)
CLUE: dict[str, Any] = {
    "type": "Feature",
    "geometry": {"type": "Point", "coordinates": [8.3023, 47.0511]},
    "properties": {"role": "clue", "bayes_factor": 500, "sigma_m": 15, "words": "red hat"},
}


def decisions(scene: Scene) -> list[Any]:
    return list(read_rows(scene.journal, "decision"))


def tell(scene: Scene, feature: dict[str, Any]) -> dict[str, Any]:
    answer = scene.door.post("/api/news", json=feature)
    answer.raise_for_status()
    heard: dict[str, Any] = answer.json()
    return heard


def test_a_clue_moves_the_next_decision_and_taken_back_leaves_no_trace(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", speedup=4.0) as scene:
        scene.searching()
        assert scene.order("hold") == "HOLDING"
        scene.fly(10.0)  # what was on its way is in by now
        scene.detector.stop()
        time.sleep(1.0)
        before = scene.map()["digest"]
        heard = tell(scene, CLUE)
        assert heard["status"] == "accepted"
        assert tell(scene, {**CLUE, "id": heard["id"]})["status"] == "duplicate"
        state = scene.door.get("/api/state").json()
        assert [(each["role"], each["words"]) for each in state["news"]] == [("clue", "red hat")]
        told = scene.map()
        assert told["digest"] != before
        best = max((p or 0.0, r, c) for r, row in enumerate(told["probability"]) for c, p in enumerate(row))
        place = scene.door.get("/api/state").json()["place"]
        assert place["lat"] == pytest.approx(47.0511, abs=2e-4), best
        scene.door.post(f"/api/news/{heard['id']}/withdraw").raise_for_status()
        assert scene.map()["digest"] == before
        assert scene.door.get("/api/state").json()["news"] == []
        scene.service.process.kill()
        assert replayed(Path(the_run(scene)), 20.0)[0] == before  # by the reports alone
        with restarted(scene, "--resume", the_run(scene)) as (_, door):
            assert door.get("/api/map").json()["digest"] == before
            tell_again = door.post("/api/news", json=CLUE).json()
            assert tell_again["id"] != heard["id"]
            clued = door.get("/api/map").json()["digest"]
        with restarted(scene, "--resume", the_run(scene)) as (_, door):
            assert door.get("/api/map").json()["digest"] == clued


def test_a_clue_turns_the_aircraft_within_a_second(tmp_path: Path) -> None:
    with flight(tmp_path, "px4", speedup=2.0) as scene:
        scene.searching()
        until = time.monotonic() + 60.0
        while not decisions(scene):
            assert time.monotonic() < until
            time.sleep(0.05)
        scene.fly(3.0)
        heard = tell(scene, CLUE)
        (row,) = read_rows(scene.journal, "news")
        assert json.loads(json.dumps(row.body))["id"] == heard["id"]
        while not (later := [each for each in decisions(scene) if each.seq > row.seq]):
            assert time.monotonic() < until
            time.sleep(0.02)
        assert later[0].time - row.time <= 1.0 * scene.speedup  # a second of wall time, in the vehicle's


def test_an_exclusion_in_flight_is_kept_clear_of_from_then_on(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", speedup=3.0) as scene:
        scene.searching()
        at = scene.control.state()
        spots = [
            (47.0504, 8.3008),
            (47.0504, 8.3018),
            (47.0510, 8.3013),
            (47.0510, 8.3005),
            (47.0510, 8.3021),
        ]
        away = [
            (math.hypot((lat - at["latitude"]) * 111_195, (lon - at["longitude"]) * 75_800), lat, lon)
            for lat, lon in spots
        ]
        _, lat, lon = min(
            each for each in away if each[0] > 45.0
        )  # where it comes by soon, and can still brake
        half = (12.0 / 111_195, 12.0 / 75_800)
        ring = [
            (lon + i * half[1], lat + k * half[0]) for i, k in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
        ]
        ground = {"type": "Polygon", "coordinates": [ring]}
        heard = tell(scene, {"type": "Feature", "geometry": ground, "properties": {"role": "exclude"}})
        assert heard["status"] == "accepted"
        before = len(scene.tap.motions)
        shape = shapely.Polygon(ring)
        scene.fly(2.0)  # to brake in
        until = scene.control.state()["time"] + 90.0
        while (now := scene.control.state())["time"] < until:
            assert not shapely.contains_xy(shape, now["longitude"], now["latitude"]), scene.service.said
            time.sleep(0.05)
        assert len(scene.tap.motions) > before + 3, scene.service.said
        assert scene.state() in ("SEARCHING", "CONFIRMING")

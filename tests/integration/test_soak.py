"""The soak, short: the same command as the long one, and a judge that is not blind."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from service.area import build_grid, read_area
from service.journal import Journal
from sim.autopilot import faults
from sim.detector import Detector
from sim.soak import ground
from sim.soak.audit import Target, audit, wrongly_found
from sim.soak.clocked import CLOCK_FILE, SteppedClock
from sim.soak.eyes import Eyes, distort, grown, misplaced
from sim.soak.kinds import AT_BOOT, KINDS, OF_THE_MOCK
from sim.soak.plan import draw_plan
from tests.integration.flight import REPOSITORY

pytestmark = pytest.mark.timeout(400)


def test_a_short_soak_ends_without_a_violation() -> None:
    words = ["soak", "--flights", "2", "--seed", "4", "--faults", "4", "--jobs", "2"]
    done = subprocess.run(
        [sys.executable, "-m", "sim", *words, "--verbose"], cwd=REPOSITORY, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "violations" in done.stdout
    assert "3 aircraft" in done.stdout  # one flight of one, and one of three


def test_a_seed_is_a_flight_and_every_kind_of_fault_comes() -> None:
    plans = [draw_plan(seed, ground.BOUNDS, 12) for seed in range(200)]
    again = [draw_plan(seed, ground.BOUNDS, 12) for seed in range(200)]
    assert str(plans) == str(again)  # nan is not nan
    assert {fault.kind for plan in plans for fault in plan.faults} == set(KINDS)
    assert {plan.at_boot for plan in plans} == set(AT_BOOT)
    assert {plan.aircraft for plan in plans} == {1, 2, 3}
    for plan in plans:
        if any(fault.kind == "detector_lies" for fault in plan.faults):
            assert plan.target is not None


def test_what_is_drawn_can_be_said() -> None:
    (only,) = {f.kind for f in draw_plan(1, ground.BOUNDS, 5, frozenset({"gcs_goes"})).faults}
    assert only == "gcs_goes"


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_draw_of_a_fault_of_the_mock_is_one_that_it_takes(kind: str) -> None:
    name = OF_THE_MOCK.get(kind, kind)
    for seed in range(30):
        (fault,) = draw_plan(seed, ground.BOUNDS, 1, frozenset({kind})).faults
        if name in faults.KINDS:
            faults.Fault.of({"kind": name, **fault.options})


def test_the_soak_draws_every_fault_that_the_mock_can_make() -> None:
    from_the_start = {table["kind"] for name, table in AT_BOOT.items() if name != "none"}
    assert set(faults.KINDS) <= {OF_THE_MOCK.get(kind, kind) for kind in KINDS} | from_the_start


def test_what_is_so_from_the_start_is_what_the_mock_takes() -> None:
    for name, table in AT_BOOT.items():
        if name != "none":
            faults.Fault.of(table)


# ---- what is done to the detector and to the clock


def test_a_detector_that_lies_says_another_place() -> None:
    seen = {"lat": 47.0, "lon": 8.0}
    assert misplaced("swapped", seen) == {"lat": 8.0, "lon": 47.0}
    assert misplaced("nowhere", seen) == {"lat": 0.0, "lon": 0.0}
    assert misplaced("far", seen)["lat"] > 47.008
    assert misplaced("", seen) == seen


def test_a_detector_that_lies_says_another_time_another_place_or_everything() -> None:
    state = {
        "pose": {"lat": 47.0, "lon": 8.0},
        "footprint": {
            "cells": [{"counts": counts, "lat": 47.0, "lon": 8.0} for counts in (True, True, False)]
        },
    }
    frame: dict[str, Any] = {"detections": [], "captured_at": 1000.0}
    distort("", frame, state, 900.0)
    assert frame == {"detections": [], "captured_at": 1000.0}
    for way in ("everywhere", "still", "pose"):
        distort(way, frame, state, 900.0)
    assert (len(frame["detections"]), frame["captured_at"], frame["pose"]["lat"]) == (2, 900.0, 47.01)


def test_the_audit_sees_what_was_found_where_nothing_is(tmp_path: Path) -> None:
    assert wrongly_found(tmp_path, None) == []  # broken off before there was a report
    place = {"lat": ground.BOUNDS["south"], "lon": ground.BOUNDS["west"]}
    (tmp_path / "report.json").write_text(json.dumps({"outcome": "found", "position": place}))
    assert wrongly_found(tmp_path, None) == ["found what is not there"]
    assert wrongly_found(tmp_path, (place["lat"], place["lon"])) == []
    (said,) = wrongly_found(tmp_path, (place["lat"] + 0.001, place["lon"]))
    assert said == "found 111 m from the target"


STATE = {
    "pose": {"time": 1000.0},
    "footprint": {
        "p_tp": 0.9,
        "p_tn": 0.97,
        "cells": [
            {
                **{"row": 0, "col": col, "counts": True, "p_tp": 0.9, "p_tn": 0.97},
                **{"lat": 47.0, "lon": 8.0 + col, "corners": corners},
            }
            for col, corners in enumerate(
                [[[46.9, east], [46.9, east + 1], [47.1, east + 1], [47.1, east]] for east in (7.5, 8.5)]
            )
        ],
    },
}
"""What the door tells of a frame over two cells, of which the first has the target."""


def reported(sees: bool, way: str = "", off_s: float = 0.0, *, own_clock: bool = False) -> tuple[Eyes, Any]:
    """The detector of the soak after one frame, and what the door got; it sees the target, or what is none."""
    got: list[Any] = []

    def door(request: httpx.Request) -> httpx.Response:
        if request.method == "GET":
            return httpx.Response(200, json=STATE)
        got.append(json.loads(request.content))
        return httpx.Response(200, json=[{"status": "accepted", "id": got[-1]["id"]}])

    detector = Detector((47.0, 8.0), 1.0 if sees else 0.0, 1.0, 1)
    eyes = Eyes("http://door", 0, detector, 1.0, own_clock=own_clock)
    eyes.lies, eyes.clock_off_s = way, off_s
    with httpx.Client(base_url="http://door", transport=httpx.MockTransport(door)) as client:
        eyes._frame(client, None)  # one frame of its thread, which goes on until it is told to stop
    return eyes, got[0]


@pytest.mark.parametrize("way", ["", "swapped", "nowhere", "far"])
def test_the_judge_knows_that_the_target_was_seen_wherever_a_liar_says_it_was(way: str) -> None:
    eyes, got = reported(True, way)
    assert eyes.true_hits == eyes.acknowledged == {got["id"]}
    (said,) = got["detections"]
    assert ((said["lat"], said["lon"]) == (47.0, 8.0)) == (way == "")
    eyes, got = reported(False, way)
    assert (eyes.true_hits, eyes.acknowledged, got["detections"]) == (set(), {got["id"]}, [])


@pytest.mark.parametrize("way", ["swapped", "nowhere", "far"])
def test_a_lie_that_is_taken_for_a_look_in_vain_is_seen_in_the_journal(way: str, tmp_path: Path) -> None:
    area = tmp_path / "area.geojson"
    area.write_text(json.dumps(ground.area()), encoding="utf-8")
    grid = build_grid(read_area(area), ground.CELL_M)
    row, col = (int(number) for number in grid.start)
    (place,) = grid.frame.to_latlon([(row, col)])
    eyes, got = reported(True, way)
    journal = Journal(tmp_path / "journal.sqlite")
    look = {"cells": [[row, col]], "hits": [False], "p_tp": [0.9], "p_tn": [0.9], "first": [True]}
    journal.write(0.0, "report", {"report": {"id": got["id"]}, "pose": POSE, "observation": look}).result()
    target = Target((float(place[0]), float(place[1])), frozenset(eyes.true_hits))
    (said,) = audit(tmp_path, eyes.acknowledged, [], target)
    assert "saw the target, and lowered its cell from " in said
    journal.close()


def test_only_a_detector_that_goes_by_the_computers_clock_steps_with_it() -> None:
    _, got = reported(True, off_s=90.0)
    assert (got["captured_at"], got["clock"]) == (1000.0, "service")
    _, got = reported(True, off_s=90.0, own_clock=True)
    assert (got["captured_at"], "clock" in got) == (1090.0, False)


def test_the_clock_of_a_process_and_of_its_children_steps(tmp_path: Path) -> None:
    clock = SteppedClock(tmp_path / "clock")
    clock.step(1000.0)
    clock.step(-100.0)
    words = "import sim.soak.clocked as c, time, os; from pathlib import Path; before = time.time(); "
    words += f"c.follow(Path(os.environ['{CLOCK_FILE}'])); print(time.time() - before)"
    done = subprocess.run(
        [sys.executable, "-c", words], cwd=REPOSITORY, capture_output=True, text=True,
        env={**os.environ, CLOCK_FILE: str(clock.path)},
    )  # fmt: skip
    assert float(done.stdout) == pytest.approx(900.0, abs=5.0)


# ---- the judge over the journal


POSE = [47.0, 8.0, 30.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("yielded", "row 1 is no yielded that this version knows (it has no reason)"),
        ("tea", "row 1 is of a kind that nobody reads: tea"),
    ],
)
def test_the_audit_sees_a_row_that_the_service_could_not_go_on_from(
    kind: str, words: str, tmp_path: Path
) -> None:
    (tmp_path / "area.geojson").write_text(json.dumps(ground.area()), encoding="utf-8")
    journal = Journal(tmp_path / "journal.sqlite")
    journal.write(0.0, kind, {}).result()
    assert audit(tmp_path, set(), [])[0].endswith(words)
    journal.close()


def test_the_audit_sees_what_is_lost_doubled_or_does_not_add_up(tmp_path: Path) -> None:
    area = tmp_path / "area.geojson"
    area.write_text(json.dumps(ground.area()), encoding="utf-8")
    grid = build_grid(read_area(area), ground.CELL_M)
    row, col = (int(number) for number in grid.start)
    journal = Journal(tmp_path / "journal.sqlite")
    look = {"cells": [[row, col]], "hits": [False], "p_tp": [0.9], "p_tn": [0.9], "first": [True]}
    bodies: list[tuple[str, dict[str, Any]]] = [
        ("transition", {"from": "WAITING", "event": "linked", "to": "READY", "reason": ""}),
        ("transition", {"from": "READY", "event": "airborne", "to": "SEARCHING", "reason": ""}),
        ("command", {"command": "reposition"}),
        ("report", {"report": {"id": "a"}, "pose": POSE, "observation": look}),
    ]
    for kind, body in bodies:
        journal.write(0.0, kind, body).result()
    assert audit(tmp_path, {"a"}, []) == []
    assert "1 acknowledged reports are not in the journal" in audit(tmp_path, {"a", "b"}, [])[0]
    assert "is not the one that the journal adds up to" in audit(tmp_path, {"a"}, [(1, "another")])[0]
    assert "2 reports were told, 1 are in the journal" in audit(tmp_path, {"a"}, [(2, "another")])[0]
    bodies = [
        ("report", {"report": {"id": "a"}, "pose": POSE, "observation": None}),
        ("transition", {"from": "SEARCHING", "event": "pilot", "to": "YIELDED", "reason": ""}),
        ("command", {"command": "reposition"}),
        ("transition", {"from": "HOLDING", "event": "resume", "to": "SEARCHING", "reason": ""}),
    ]
    for kind, body in bodies:
        journal.write(0.0, kind, body).result()
    found = " / ".join(audit(tmp_path, {"a"}, []))
    assert "1 reports are in the journal twice" in found
    assert "row 7: a waypoint in YIELDED" in found
    assert "row 8: a transition from HOLDING in YIELDED" in found
    # what tampers with a file has no door; the journal holds it open and locked
    journal._database.execute("DELETE FROM events WHERE seq = 3")
    assert "rows are missing" in audit(tmp_path, {"a"}, [])[0]
    journal.close()


def test_the_audit_lets_a_run_stop_the_aircraft_that_it_gives_up(tmp_path: Path) -> None:
    (tmp_path / "area.geojson").write_text(json.dumps(ground.area()), encoding="utf-8")
    journal = Journal(tmp_path / "journal.sqlite")

    def write(kind: str, **body: Any) -> None:
        journal.write(0.0, kind, body).result()

    write("transition", **{"from": "WAITING", "event": "climb", "to": "TAKEOFF", "reason": ""})
    write("command", command="hold")
    write("transition", **{"from": "TAKEOFF", "event": "abort", "to": "ABORTED", "reason": ""})
    assert audit(tmp_path, set(), []) == []
    write("command", command="hold")
    assert audit(tmp_path, set(), []) == ["row 4: stop 1 in ABORTED"]
    journal.close()


def test_the_audit_sees_a_true_detection_that_lowered_its_own_cell(tmp_path: Path) -> None:
    area = tmp_path / "area.geojson"
    area.write_text(json.dumps(ground.area()), encoding="utf-8")
    grid = build_grid(read_area(area), ground.CELL_M)
    row, col = (int(number) for number in grid.start)
    (place,) = grid.frame.to_latlon([(row, col)])
    journal = Journal(tmp_path / "journal.sqlite")
    for name, hit in (("good", True), ("half-used", False), ("other", False)):
        look = {"cells": [[row, col]], "hits": [hit], "p_tp": [0.9], "p_tn": [0.9], "first": [True]}
        journal.write(0.0, "report", {"report": {"id": name}, "pose": POSE, "observation": look}).result()
    target = Target((float(place[0]), float(place[1])), frozenset({"good", "half-used"}))
    (said,) = audit(tmp_path, {"good", "half-used", "other"}, [], target)
    assert "row 2: report half-used saw the target, and lowered its cell from " in said
    journal.close()


# ---- the eye on the process


@pytest.mark.parametrize(
    ("memory", "tasks", "words"),
    [
        ([200.0] * 60, [20] * 60, ""),
        ([200.0] * 40 + [300.0] * 20, [20] * 60, "memory has grown from 200 to 300 MB"),
        ([200.0] * 60, [20] * 40 + [25] * 20, "tasks have grown from 20 to 25"),
        ([200.0] * 60, [90] * 60, "90 tasks at a time"),
        ([200.0] * 60, [], "the number of tasks is not told"),
    ],
)
def test_growth_is_seen(memory: list[float], tasks: list[int], words: str) -> None:
    eyes: Any = SimpleNamespace(memory_mb=memory, tasks=tasks, aircraft="")
    assert "; ".join(grown(eyes)) == words

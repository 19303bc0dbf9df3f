"""The soak, short: the same command as the long one, and a judge that is not blind."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.area import build_grid, read_area
from service.journal import Journal
from sim.soak import ground
from sim.soak.audit import audit
from sim.soak.flight import _grown
from sim.soak.judge import Judge
from sim.soak.plan import KINDS, draw_plan
from tests.integration.flight import REPOSITORY

pytestmark = pytest.mark.timeout(400)
PX4_HOLD, PX4_POSCTL = 4 << 16 | 3 << 24, 3 << 16


def test_a_short_soak_ends_without_a_violation() -> None:
    words = ["soak", "--flights", "2", "--seed", "1", "--faults", "4", "--jobs", "2"]
    done = subprocess.run(
        [sys.executable, "-m", "sim", *words, "--verbose"], cwd=REPOSITORY, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "violations" in done.stdout


def test_a_seed_is_a_flight_and_every_kind_of_fault_comes() -> None:
    plans = [draw_plan(seed, ground.BOUNDS, 12) for seed in range(60)]
    assert plans == [draw_plan(seed, ground.BOUNDS, 12) for seed in range(60)]
    assert {fault.kind for plan in plans for fault in plan.faults} == set(KINDS)


# ---- the judge on the wire


class Wire:
    """Frames for a judge, who has seen the search begin."""

    def __init__(self) -> None:
        self.judge = Judge("px4", 10.0)
        self.mode(PX4_HOLD)
        self.at(200.0, 50.0)
        self.state("SEARCHING")

    def state(self, name: str) -> None:
        text = f"search {name}: for a test"
        self.judge.from_service(_from_us(mavlink.MAVLink_statustext_message(6, text.encode())), self.now)

    @property
    def now(self) -> float:
        return time.monotonic()

    def mode(self, custom_mode: int, ago_s: float = 0.0) -> None:
        message = mavlink.MAVLink_heartbeat_message(2, 12, 209, custom_mode, 4, 3)
        self.judge.from_autopilot(_from_autopilot(message), self.now - ago_s)

    def at(self, east: float, north: float) -> None:
        lon, lat = ground._ring([(east, north)])[0]
        message = mavlink.MAVLink_global_position_int_message(
            1, round(lat * 1e7), round(lon * 1e7), 415000, 15000, 0, 0, 0, 0
        )
        self.judge.from_autopilot(_from_autopilot(message), self.now)

    def goes(self, east: float, north: float, height: float = 15.0, param2: float = 0.0) -> list[str]:
        """Send the aircraft there; what the judge says."""
        lon, lat = ground._ring([(east, north)])[0]
        amsl = ground.GROUND_AMSL_M + height
        message = mavlink.MAVLink_command_int_message(
            1, 1, 0, 192, 0, 0, -1.0, param2, 0.0, 0.0, round(lat * 1e7), round(lon * 1e7), amsl
        )
        before = len(self.judge.violations)
        self.judge.from_service(_from_us(message), self.now)
        return self.judge.violations[before:]


def _from_autopilot(message: Any) -> Any:
    return _decoded(message, 1, 1)


def _from_us(message: Any) -> Any:
    return _decoded(message, 1, 191)


def _decoded(message: Any, system: int, component: int) -> Any:
    writer = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    (decoded,) = mavlink.MAVLink(None).parse_buffer(message.pack(writer))
    return decoded


def test_the_judge_lets_a_search_be() -> None:
    wire = Wire()
    assert wire.goes(220.0, 50.0) == []
    wire.state("HOLDING")
    assert wire.goes(205.0, 50.0) == wire.goes(205.0, 50.0) == []
    wire.state("RETURNING")
    assert wire.goes(-10.0, 50.0) != []  # straight through the pond
    assert wire.goes(130.0, 20.0) == []


@pytest.mark.parametrize("state", ["READY", "TAKEOFF", "YIELDED", "DONE"])
def test_the_judge_sees_motion_in_a_state_that_may_not_move(state: str) -> None:
    wire = Wire()
    wire.state(state)
    (said,) = wire.goes(220.0, 50.0)
    assert "not in this state" in said


@pytest.mark.parametrize(
    ("there", "words"),
    [
        ((320.0, 50.0), "outside the area"),
        ((40.0, 50.0), "crosses the pond"),
        ((220.0, 50.0, 45.0), "45.0 m above home"),
        ((220.0, 50.0, 15.0, 1.0), "may change the mode"),
    ],
)
def test_the_judge_sees_a_waypoint_outside_the_limits(there: tuple[float, ...], words: str) -> None:
    (said,) = Wire().goes(*there)
    assert words in said


def test_the_judge_sees_a_second_stop_and_one_that_is_none() -> None:
    wire = Wire()
    wire.state("HOLDING")
    assert wire.goes(205.0, 50.0) == []
    assert "a second stop" in wire.goes(215.0, 50.0)[0]
    wire.state("SEARCHING")
    wire.state("HOLDING")
    assert "a stop far away" in wire.goes(20.0, 10.0)[0]


def test_the_judge_sees_motion_against_the_pilot() -> None:
    wire = Wire()
    wire.mode(PX4_POSCTL, ago_s=5.0)
    said = wire.goes(220.0, 50.0)
    assert any("the pilot has had the aircraft" in each for each in said)
    wire.mode(PX4_HOLD)
    assert any("the pilot has had the aircraft" in each for each in wire.goes(220.0, 50.0))
    wire.judge.ordered(wire.now)
    assert wire.goes(220.0, 50.0) == []


# ---- the judge over the journal


def test_the_audit_sees_what_is_lost_doubled_or_does_not_add_up(tmp_path: Path) -> None:
    area = tmp_path / "area.geojson"
    area.write_text(json.dumps(ground.area()), encoding="utf-8")
    grid = build_grid(read_area(area), ground.CELL_M)
    row, col = (int(number) for number in grid.start)
    journal = Journal(tmp_path / "journal.sqlite")
    look = {"cells": [[row, col]], "hits": [False], "p_tp": [0.9], "p_tn": [0.9], "first": [True]}
    bodies: list[tuple[str, dict[str, Any]]] = [
        ("transition", {"from": "WAITING", "to": "READY"}),
        ("transition", {"from": "READY", "to": "SEARCHING"}),
        ("command", {"command": "reposition"}),
        ("report", {"report": {"id": "a"}, "observation": look}),
    ]
    for kind, body in bodies:
        journal.write(0.0, kind, body).result()
    assert audit(tmp_path, {"a"}, []) == []
    assert "1 acknowledged reports are not in the journal" in audit(tmp_path, {"a", "b"}, [])[0]
    assert "is not the one that the journal adds up to" in audit(tmp_path, {"a"}, [(1, "another")])[0]
    assert "2 reports were told, 1 are in the journal" in audit(tmp_path, {"a"}, [(2, "another")])[0]
    bodies = [
        ("report", {"report": {"id": "a"}, "observation": None}),
        ("transition", {"from": "SEARCHING", "to": "YIELDED"}),
        ("command", {"command": "reposition"}),
        ("transition", {"from": "HOLDING", "to": "SEARCHING"}),
    ]
    for kind, body in bodies:
        journal.write(0.0, kind, body).result()
    found = " / ".join(audit(tmp_path, {"a"}, []))
    assert "1 reports are in the journal twice" in found
    assert "row 7: a waypoint in YIELDED" in found
    assert "row 8: a transition from HOLDING in YIELDED" in found
    journal._database.execute("DELETE FROM events WHERE seq = 3")
    assert "rows are missing" in audit(tmp_path, {"a"}, [])[0]
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
    eyes: Any = SimpleNamespace(memory_mb=memory, tasks=tasks)
    assert "; ".join(_grown(eyes)) == words

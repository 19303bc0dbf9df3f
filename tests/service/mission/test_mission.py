"""The shell: what stops the aircraft waits for nothing, what moves it waits until its row is on disk."""

from __future__ import annotations

import asyncio
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from service.journal import read_rows
from service.mission.apart import Other
from service.mission.formation import Formation
from service.mission.states import State
from tests.service.mission.aloft import aloft, until
from tests.service.mission.flown import HERE

pytestmark = pytest.mark.timeout(180)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Another program has locked the journal."""
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    try:
        yield
    finally:
        other.execute("ROLLBACK")
        other.close()


@pytest.mark.parametrize("command", ["hold", "abort", "return"])
def test_an_order_to_stop_waits_for_no_disk(command: str, tmp_path: Path) -> None:
    becomes = {"hold": State.HOLDING, "abort": State.ABORTED, "return": State.RETURNING}

    async def fly() -> None:
        async with aloft(tmp_path) as mission:
            with locked(mission.journal.path):
                rows = len(list(read_rows(mission.journal.path, "order")))
                await asyncio.wait_for(mission.order(command), 5.0)
                assert mission.state == becomes[command]
                assert len(list(read_rows(mission.journal.path, "order"))) == rows  # it is not on disk yet
                if command == "hold":
                    await until(mission, lambda: mission.vehicle.telemetry.ground_speed_mps < 0.5)
                if command == "return":  # which its autopilot flies, without a row of ours
                    await until(mission, lambda: mission.vehicle.telemetry.mode == "AUTO_RTL")

    asyncio.run(fly())


def test_a_journal_that_another_program_locks_holds_and_the_search_goes_on_after(tmp_path: Path) -> None:
    async def fly() -> None:
        async with aloft(tmp_path) as mission:
            with locked(mission.journal.path):
                await until(mission, lambda: mission.state == State.HOLDING)
                assert mission.standing.causes == {"journal"}
                waypoints = mission.flight.waypoints
                await mission.clock.sleep(10.0)
                assert mission.flight.waypoints == waypoints
                await until(mission, lambda: mission.vehicle.telemetry.ground_speed_mps < 0.5)
            await until(mission, lambda: mission.state == State.SEARCHING)
            await until(mission, lambda: mission.flight.waypoints > waypoints)

    asyncio.run(fly())


def test_among_others_a_lost_journal_leads_home_past_them_and_one_at_a_time(tmp_path: Path) -> None:
    """By itself its autopilot would climb to its own height at once, as would those of all the others."""

    async def fly() -> None:
        formation = Formation()
        async with aloft(tmp_path, formation=formation) as mission:
            t = mission.vehicle.telemetry
            home, up = mission.core.chart.home(t), t.alt_home_m
            beside = Other("2", home, up, home, home, 60.0, 8.0)
            formation.join("2", lambda: beside)
            mission.journal.path.unlink()
            await until(mission, lambda: mission.state == State.RETURNING)
            assert "has been deleted" in mission.standing.why_stopped
            for _ in range(30):
                assert mission.vehicle.telemetry.guided  # it waits for who is over home
                assert mission.vehicle.telemetry.alt_home_m == pytest.approx(up, abs=3.0)
                await mission.clock.sleep(1.0)
            beside = replace(beside, in_air=False)
            await until(mission, lambda: mission.state == State.DONE)

    asyncio.run(fly())


def test_a_planner_that_fails_holds_the_aircraft_until_an_operator_resumes(tmp_path: Path) -> None:
    class Broken:
        """What a planner from outside may turn out to be."""

        def plan(self, *words: Any, **options: Any) -> Any:
            raise IndexError("cell 99")

    async def fly() -> None:
        async with aloft(tmp_path) as mission:
            good, mission.search.ending.planner = mission.search.ending.planner, Broken()  # type: ignore[assignment]
            await until(mission, lambda: mission.state == State.HOLDING)
            assert mission.standing.causes == {"planner"}
            assert mission.standing.why == "the planner fails (IndexError: cell 99)"
            await until(mission, lambda: mission.vehicle.telemetry.ground_speed_mps < 0.5)
            waypoints = mission.flight.waypoints
            mission.search.ending.planner = good
            await mission.clock.sleep(10.0)
            assert mission.state == State.HOLDING
            await mission.order("resume")
            await until(mission, lambda: mission.flight.waypoints > waypoints)
            assert mission.state == State.SEARCHING

    asyncio.run(fly())


def test_a_waypoint_is_on_disk_before_it_is_sent(tmp_path: Path) -> None:
    async def fly() -> None:
        async with aloft(tmp_path, "ardupilot") as mission:
            for _ in range(200):
                sent = mission.flight.waypoints
                rows = read_rows(mission.journal.path, "command")
                assert sum(row.body["command"] == "reposition" for row in rows) >= sent
                await asyncio.sleep(0.01)

    asyncio.run(fly())


def test_flights_are_written_down_so_that_they_outlive_the_process(tmp_path: Path) -> None:
    async def fly() -> None:
        async with aloft(tmp_path) as mission:
            began = time.monotonic()
            while not (rows := list(read_rows(mission.journal.path, "flight"))):
                assert time.monotonic() - began < 30.0
                await asyncio.sleep(0.1)
            assert rows[-1].body["seconds"] > 0.0
            assert len(rows[-1].body["track"]) >= 2

    asyncio.run(fly())


@pytest.mark.parametrize(
    ("place", "why"),
    [((8.3093, 47.0512), "beside the area; are lat and lon swapped"), (None, "nothing was seen yet")],
)
def test_a_word_on_no_place_of_the_search_changes_nothing(
    place: tuple[float, float] | None, why: str, tmp_path: Path
) -> None:
    async def fly() -> None:
        async with aloft(tmp_path) as mission:
            before = mission.search.belief.digest()
            for command in ("confirm", "reject"):
                receipt = await mission.order(command, place)
                assert why in (receipt.refused or "")
            assert (mission.state, mission.search.confirmed) == (State.SEARCHING, None)
            assert mission.search.belief.digest() == before
            assert (await mission.order("confirm", HERE)).refused is None
            await until(mission, lambda: mission.state == State.RETURNING)

    asyncio.run(fly())

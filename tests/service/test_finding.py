"""What follows when a place is probable enough: by the setting, by the state, and by an operator's word."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from service.area import build_grid, read_area
from service.clock import Clock
from service.config import Settings
from service.evidence.intake import Intake
from service.evidence.observe import Observation
from service.evidence.sensors import make_sensor
from service.journal import Journal
from service.mission.finding import Finding
from service.mission.states import Event, State, next_state
from service.search import Search
from tests.integration.flight import write_area


class Scene:
    """A real search, intake and journal; of the mission only its state machine and what it was told to do."""

    def __init__(self, folder: Path, on_found: str) -> None:
        settings = Settings.model_validate({"search": {"planner": "index", "on_found": on_found}})
        grid = build_grid(read_area(write_area(folder)), 20.0)
        self.search = Search(grid, settings)
        journal = Journal(folder / "j.sqlite")
        intake = Intake(
            self.search, make_sensor(settings, grid), journal, Clock(), lambda _: None, lambda *_: None
        )
        self.rows: list[str] = []
        self.mission: Any = SimpleNamespace(
            settings=settings,
            search=self.search,
            intake=intake,
            state=State.SEARCHING,
            found=None,
            why_stopped="",
            autopilot_returns=False,
            vehicle=SimpleNamespace(in_control=True, telemetry=SimpleNamespace(guided=True)),
            happen=self.happen,
        )
        self.low = ""
        self.finding = Finding(self.mission, write=self.write, tick=self.tick, energy_low=lambda: self.low)

    async def happen(self, event: Event, reason: str) -> bool:
        self.mission.state = next_state(self.mission.state, event)
        return True

    async def write(self, kind: str, body: Mapping[str, object]) -> None:
        self.rows.append(kind)

    async def tick(self) -> None:
        await asyncio.sleep(0)

    def hit(self, p_tn: float = 0.9999999) -> None:
        one = np.ones(1)
        there = np.array([[3, 3]])
        self.search.apply(Observation(there, np.array([True]), 0.9 * one, p_tn * one, np.array([True])))

    def miss(self) -> None:
        one = np.ones(1)
        self.search.apply(
            Observation(np.array([[3, 3]]), np.array([False]), (1 - 1e-7) * one, one, np.array([True]))
        )


@pytest.mark.parametrize("on_found", ["return", "hover", "continue"])
def test_a_posterior_over_the_level_ends_the_search_unless_it_is_to_continue(
    tmp_path: Path, on_found: str
) -> None:
    async def fly() -> None:
        scene = Scene(tmp_path, on_found)
        assert not await scene.finding.look()
        scene.hit()
        ended = await scene.finding.look()
        assert ended == (on_found != "continue")
        assert scene.mission.state == (State.FOUND if ended else State.SEARCHING)
        assert scene.mission.found.probability >= 0.999
        await scene.finding.look()
        assert scene.rows == ["found"]  # and not once a tick

    asyncio.run(fly())


def test_hovering_over_what_was_found_ends_with_the_energy_for_the_way_home(tmp_path: Path) -> None:
    async def fly() -> None:
        scene = Scene(tmp_path, "hover")
        hovered: list[State] = []

        async def hover(wanted: object) -> None:
            hovered.append(scene.mission.state)

        scene.mission.helm = SimpleNamespace(hover=hover)
        scene.hit()
        assert await scene.finding.look()
        waiting = asyncio.create_task(scene.finding.wait_over_the_place())
        for _ in range(5):
            await asyncio.sleep(0)
        assert (hovered, scene.mission.state) == ([State.FOUND], State.FOUND)
        scene.low = "the way home needs 31 %"
        async with asyncio.timeout(1.0):
            await waiting
        assert (scene.mission.state, scene.mission.why_stopped) == (State.RETURNING, scene.low)

    asyncio.run(fly())


def test_what_is_found_is_taken_back_when_more_looks_speak_against_it(tmp_path: Path) -> None:
    async def fly() -> None:
        scene = Scene(tmp_path, "continue")
        scene.hit()
        await scene.finding.look()
        scene.miss()
        assert not await scene.finding.look()
        assert scene.mission.found is None

    asyncio.run(fly())


def test_a_confirmed_place_ends_the_search_whatever_its_probability(tmp_path: Path) -> None:
    async def fly() -> None:
        scene = Scene(tmp_path, "continue")
        place = scene.search.grid.frame.to_latlon([[5, 5]])[0]
        await scene.finding.judge((float(place[0]), float(place[1])), confirmed=True)
        assert scene.mission.state == State.FOUND
        assert (scene.mission.found.lat, scene.mission.found.lon) == pytest.approx(tuple(place), abs=5e-4)
        await scene.finding.wait_over_the_place()
        assert scene.mission.state == State.RETURNING

    asyncio.run(fly())


@pytest.mark.parametrize(
    ("state", "why_stopped", "after"),
    [
        (State.FOUND, "", State.SEARCHING),
        (State.RETURNING, "", State.SEARCHING),
        (State.RETURNING, "battery at 20 %", State.RETURNING),
        (State.YIELDED, "", State.YIELDED),
    ],
)
def test_a_rejection_takes_the_search_up_again_only_where_it_ended_for_that_place(
    tmp_path: Path, state: State, why_stopped: str, after: State
) -> None:
    async def fly() -> None:
        scene = Scene(tmp_path, "return")
        scene.hit()
        await scene.finding.look()
        scene.mission.state, scene.mission.why_stopped = state, why_stopped
        await scene.finding.judge(None, confirmed=False)
        assert scene.mission.found is None
        assert scene.mission.state == after

    asyncio.run(fly())


def test_hovering_over_what_was_found_ends_with_an_operators_word_or_the_energy(tmp_path: Path) -> None:
    async def fly() -> None:
        scene = Scene(tmp_path, "hover")
        stops = []

        async def hover(**_: object) -> None:
            stops.append(scene.mission.state)

        scene.mission.helm = SimpleNamespace(hover=hover)
        scene.hit()
        await scene.finding.look()
        waiting = asyncio.create_task(scene.finding.wait_over_the_place())
        for _ in range(50):
            await asyncio.sleep(0)
        assert not waiting.done()
        await scene.finding.judge(None, confirmed=True)
        await waiting
        assert stops == [State.FOUND]
        assert scene.mission.state == State.RETURNING

    asyncio.run(fly())

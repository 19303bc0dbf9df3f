"""Two aircraft over a slope, where their layers meet: nobody comes too near, and nobody waits for ever."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from service.area import Grid
from service.geometry import Cell, LatLon, moved, offset_m
from service.mission.core import MissionCore
from service.mission.effects import Brake, Effect, Note, ReturnToLaunch, SendWaypoint, Stop, Think
from service.mission.news import NotSent, Order
from service.mission.standing import Terms
from service.mission.states import State
from tests.service.mission.flown import GRID, Talk, place
from tests.service.mission.test_heights import AROUND, STEP, relief_of, settings_of

EAST = np.mgrid[0:110, 0:110][1] * STEP - AROUND
SLOPE = replace(GRID, relief=relief_of(0.3 * EAST))
"""Three metres up on ten: 33 m up the slope the lower layer is where the higher one is."""
FLAT = replace(GRID, relief=relief_of(0.0 * EAST))
STEP_S, SPEED, SPEEDS_UP, BRAKES = 0.2, 8.0, 2.0, 1.2
SEPARATION_M, GAP_M = 20.0, 6.5


class Flown:
    """One aircraft: a mission's core that is asked five times a second, and what flies where that sends it.

    `goal`: the cell that its planner wants to get to, along its column first.
    """

    def __init__(
        self, name: str, layer: int, start: tuple[float, float], goal: Cell, over: Grid | None = None
    ) -> None:
        over = over or SLOPE
        own = {"altitude_m": 30.0 + 10.0 * layer, "clearance_m": 15.0 + 10.0 * layer}
        self.name, self.goal, self.settings = name, goal, settings_of(**own)
        self.at: LatLon = place(*start)
        self.speed = (0.0, 0.0)  # east, north
        self.sent: tuple[LatLon, float] | None = None
        self.there = self.lands = False
        self.thinks: Think | None = None
        self.talk = Talk()
        self.talk.settings = self.settings
        self.talk.core = MissionCore(self.settings, over, Terms(name=name))
        below = over.relief.height_at(over.frame.to_metres([self.at]))[0]  # type: ignore[union-attr]
        self.up = float(below) + own["altitude_m"]
        self._shown()
        self._begin()

    @property
    def core(self) -> MissionCore:
        return self.talk.core

    def _shown(self) -> None:
        east, north = self.speed
        flies: dict[str, Any] = {"velocity_ned_mps": (north, east, 0.0)}
        self.talk.shows(
            lat=self.at[0], lon=self.at[1], alt_home_m=self.up, alt_amsl_m=400.0 + self.up, **flies
        )

    def _begin(self) -> None:
        """Up to the search, in the air, in the guided mode."""
        self.talk.tick()
        self.talk.done()
        for _ in range(5):
            self.talk.tick()
            if self.core.doing is not None:
                self.talk.done()
        assert self.talk.state == State.SEARCHING

    def step(self, other: Flown) -> None:
        """Let a moment pass: it looks, wants something, and flies on."""
        self.talk.sees(others=(other.core.told(other.talk.seen, other.talk.now),))
        self._does(self.talk.tick(STEP_S))
        if self.thinks is not None:
            asked, self.thinks = self.thinks, None
            self._decides(asked)
        self._flies()
        self._shown()

    def _does(self, effects: list[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Stop | Brake):
                self.sent = None
            elif isinstance(effect, Think):
                self.thinks = effect
            elif isinstance(effect, ReturnToLaunch):
                self.lands = True
        if (action := self.core.doing) is None:
            return
        if isinstance(action, SendWaypoint):
            objection = self.core.objection(action, self.talk.seen, self.talk.now)
            if objection is not None:
                self._does(self.talk.on(NotSent(action, objection)))
                return
            self.sent = action.point, action.altitude_m - 400.0
            self.core.sent(action)
        self._does(self.talk.done())

    def made_room(self) -> bool:
        """It has moved out of the other's way."""
        return any(isinstance(each, Note) and "makes room" in each.text for each in self.talk.wanted)

    def _decides(self, asked: Think) -> None:
        row, col = asked.cell
        path: list[Cell] = []
        while (row, col) != self.goal and len(path) < 3:
            if row != self.goal[0]:
                row += 1 if self.goal[0] > row else -1
            else:
                col += 1 if self.goal[1] > col else -1
            path.append((row, col))
        self.there = not path
        if path:
            self._does(self.talk.decides(*path))

    def _flies(self) -> None:
        wanted = (0.0, 0.0)
        if self.sent is not None:
            point, up = self.sent
            east, north = offset_m(self.at, point)
            away = math.hypot(east, north)
            if away > 0.1:
                fast = min(SPEED, math.sqrt(2.0 * BRAKES * away), away / STEP_S)
                wanted = (fast * east / away, fast * north / away)
            self.up += min(max(up - self.up, -1.0 * STEP_S), 2.0 * STEP_S)
        x, y = wanted[0] - self.speed[0], wanted[1] - self.speed[1]
        most = (SPEEDS_UP if self.sent is not None else BRAKES) * STEP_S
        share = min(1.0, most / math.hypot(x, y)) if x or y else 0.0
        self.speed = self.speed[0] + share * x, self.speed[1] + share * y
        self.at = moved(self.at, self.speed[0] * STEP_S, self.speed[1] * STEP_S)


def fly(a: Flown, b: Flown, seconds: float, until: Any) -> tuple[float, float]:
    """Let both fly until something is so; how near they came at about one height, and how long it took."""
    nearest, now = math.inf, 0.0
    while now < seconds and not until():
        a.step(b)
        b.step(a)
        now += STEP_S
        if abs(a.up - b.up) < GAP_M:
            nearest = min(nearest, math.hypot(*offset_m(a.at, b.at)))
    return nearest, now


def cell_at(east: float, north: float) -> Cell:
    row, col = GRID.frame.to_cells([place(east, north)])[0].tolist()
    return row, col


@pytest.mark.parametrize("names", ["12", "21"])
def test_two_that_meet_face_to_face_at_one_height_both_get_where_they_want(names: str) -> None:
    """Along the slope, on one column: one makes room and flies on when the other is past."""
    north = Flown(names[0], 0, (210.0, 30.0), cell_at(210.0, 170.0))
    south = Flown(names[1], 0, (210.0, 170.0), cell_at(210.0, 30.0))
    nearest, took = fly(north, south, 300.0, lambda: north.there and south.there)
    assert north.there
    assert south.there
    assert took < 120.0
    assert SEPARATION_M <= nearest < 60.0  # they have met
    assert [north.made_room(), south.made_room()].count(True) == 1  # that of the two which has waited less


@pytest.mark.parametrize(("first", "second"), [(0, 1), (1, 0)])
def test_two_layers_that_meet_on_a_slope_are_flown_past_one_another(first: int, second: int) -> None:
    """A column up the slope the lower layer is nearly as high as the higher one is here."""
    columns = (210.0, 190.0) if first == 0 else (190.0, 210.0)
    north = Flown("1", first, (columns[0], 30.0), cell_at(columns[0], 170.0))
    south = Flown("2", second, (columns[1], 170.0), cell_at(columns[1], 30.0))
    nearest, took = fly(north, south, 300.0, lambda: north.there and south.there)
    assert north.there
    assert south.there
    assert took < 120.0
    assert nearest >= SEPARATION_M


def test_one_that_hovers_by_order_in_the_way_is_passed_from_elsewhere() -> None:
    held = Flown("1", 0, (210.0, 100.0), cell_at(210.0, 100.0))
    held.talk.on(Order("hold"))
    wants = Flown("2", 0, (210.0, 30.0), cell_at(210.0, 170.0))
    nearest, _ = fly(held, wants, 300.0, lambda: wants.there)
    assert held.talk.state == State.HOLDING
    assert wants.there
    assert wants.made_room()
    assert nearest >= SEPARATION_M


def test_who_searches_makes_room_for_one_that_flies_home() -> None:
    """It hovers, as its planner has nothing for it, in the middle of the way home of the other."""
    idle = Flown("1", 0, (170.0, 90.0), cell_at(170.0, 90.0), FLAT)
    home = Flown("2", 0, (240.0, 110.0), cell_at(240.0, 110.0), FLAT)
    home.talk.on(Order("return"))
    nearest, _ = fly(idle, home, 300.0, lambda: home.lands)
    assert home.lands
    assert idle.made_room()
    assert not home.made_room()
    assert nearest >= SEPARATION_M

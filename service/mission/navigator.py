"""When to send the next waypoint, and how far it reaches: from decisions in cells to legs for the autopilot.

The aircraft is always on its way to the last *committed* cell. A decision continues from that cell, so the search
thinks while the aircraft flies. Where the path goes straight on, in any of eight directions, the target is moved ahead
before the aircraft begins to brake (`lead_m`), and cells in one line become one leg, so that it does not stop at each
cell. Where the path turns, the next target waits until the aircraft is `Motion.corner_m` from the corner: early enough
not to stop, late enough to have seen the cell. A leg is aimed beyond its end, in the same cell: an autopilot that is
told to stop in the corner creeps into it. A hit drops what was committed: the next decision starts from where the
aircraft is.

Over hills a leg has one height, and between its ends the ground may be too far below that, or too near, for a look. So
a leg ends where it would pass a cell that is worth a look in vain, and is not led on before that either.

Pure: positions in, legs out; no clock, no socket.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from roisearch import Motion
from roisearch.directions import STEPS, direction_between, direction_index
from roisearch.motion import Leg
from service.geometry import Cell

REACTION_S = 0.5  # telemetry age, decision and command on their way
_BEYOND_OF_CELL, _BEYOND_M = 0.45, 13.0  # so far beyond its end a leg is aimed, at most
_PAST_M = 0.5  # so much farther from the corner than it was, it has passed it


def straight_part(start: Cell, path: Sequence[Cell]) -> list[Cell]:
    """The cells of `path` until its first turn, entering from `start`; ValueError when cells are not neighbours."""
    part: list[Cell] = []
    here = start
    direction = ""
    for cell in path:
        new = direction_between(here, cell)
        if direction and new != direction:
            break
        direction = new
        part.append(cell)
        here = cell
    return part


def straight_cells(leg: Leg) -> list[Cell]:
    """The cells that a leg enters, its end the last."""
    down, right = STEPS[direction_index(leg.direction)]
    return [(leg.start[0] + i * down, leg.start[1] + i * right) for i in range(1, leg.cells + 1)]


@dataclass
class Navigator:
    """The committed cells of one flight.

    `motion` is how the aircraft moves, as far as is known by now; `speed_mps` is what it is to fly at.
    """

    motion: Motion
    speed_mps: float
    waypoint: Cell = (0, 0)
    heading: str = "north"
    _ahead: tuple[Cell, ...] = ()
    _next: tuple[Cell, ...] = ()
    _worth: frozenset[Cell] = frozenset()
    _at_once: bool = False
    _nearest_m: float = math.inf

    def __post_init__(self) -> None:
        self._set_brake = self.motion.pace.brake

    def learn(self, motion: Motion) -> None:
        """More is known of how the aircraft moves. That it brakes harder than it is set to is not relied on: a target
        that comes too late costs more than one that comes too early."""
        self.motion = replace(motion, braking_mps2=min(motion.pace.brake, self._set_brake))

    def begin(self, cell: Cell, heading: str) -> None:
        """Forget everything; the aircraft is at `cell`, or on its way there and nowhere further."""
        self.waypoint, self.heading = cell, heading
        self._ahead, self._next, self._at_once = (cell,), (), False
        self._worth, self._nearest_m = frozenset(), math.inf

    def interrupt(self, cell: Cell, heading: str) -> None:
        """Drop what was committed: the next decision starts at `cell`, and is sent as soon as it is made."""
        self.begin(cell, heading)
        self._at_once = True

    def entered(self, cell: Cell) -> None:
        """The aircraft is over `cell`: cells before it on the leg are behind."""
        if cell in self._ahead:
            self._ahead = self._ahead[self._ahead.index(cell) :]

    @property
    def ahead(self) -> tuple[Cell, ...]:
        """Committed cells from the one the aircraft is over to the waypoint."""
        return self._ahead

    @property
    def decided(self) -> bool:
        """True when the next target is known but not sent yet."""
        return bool(self._next)

    @property
    def interrupted(self) -> bool:
        """True while the next decision starts where the aircraft is, and not where it is sent."""
        return self._at_once

    @property
    def lead_m(self) -> float:
        """How far before its target the aircraft starts to brake from full speed, reaction included, in metres.

        Of the speed that is wanted, not of the speed now: a target closer than this keeps an aircraft slow.
        """
        return self.speed_mps**2 / (2.0 * self.motion.pace.brake) + self.speed_mps * REACTION_S

    def wants_decision(self, remaining_m: float, thinking_s: float) -> bool:
        """True when it is time to decide what comes after the waypoint."""
        if self._next:
            return False
        spare = 0.25 * self.motion.cell_m
        return self._at_once or remaining_m <= self.lead_m + self.speed_mps * thinking_s + spare

    def decide(self, path: Sequence[Cell], worth: frozenset[Cell] = frozenset()) -> None:
        """Take a decision's path, which starts at a neighbour of the waypoint; `worth` a look are these of it."""
        self._next = tuple(straight_part(self.waypoint, path))
        self._worth = self._worth.intersection(self._ahead) | worth.intersection(self._next)

    def due(
        self, remaining_m: float, speed_mps: float, shows: Callable[[Leg, Sequence[Cell]], bool] | None = None
    ) -> Leg | None:
        """The leg to fly now, from the waypoint on, or None; its cells are then committed, and its end the waypoint.

        `shows` says whether flying from here to the end of a leg shows cells on the way; None: all are shown always.
        """
        self._nearest_m = min(self._nearest_m, remaining_m)
        if not self._next:
            return None
        direction = direction_between(self.waypoint, self._next[0])
        straight_on = direction == self.heading
        there = self._at_once or self._at_corner(remaining_m, speed_mps)
        if not (there or straight_on):
            return None
        wanted = self.lead_m - (remaining_m if straight_on else 0.0)
        cell_m = self.motion.cell_m * (math.sqrt(2.0) if direction_index(direction) % 2 else 1.0)
        count = max(1, min(len(self._next), math.ceil(wanted / cell_m)))
        before = () if there else self._ahead
        while shows is not None and not shows(self._leg(count, direction), self._passed(before, count)):
            count -= 1
            if count == 0:  # not before it is there
                return None
        leg = self._leg(count, direction)
        self._ahead = (*self._ahead, *self._next[:count])
        self.waypoint, self.heading = leg.end, direction
        self._next, self._at_once, self._nearest_m = (), False, math.inf
        return leg

    def _leg(self, count: int, direction: str) -> Leg:
        return Leg(self.waypoint, self._next[count - 1], direction, count)

    def _passed(self, before: Sequence[Cell], count: int) -> list[Cell]:
        """What is worth a look of those `before` and of the next cells, except the last of `count`."""
        return [cell for cell in (*before, *self._next[: count - 1]) if cell in self._worth]

    def over(self, remaining_m: float, speed_mps: float) -> bool:
        """The aircraft is over a waypoint that is worth a look, and nothing else holds it there."""
        there = not self._at_once and self.waypoint in self._worth
        return there and self._at_corner(remaining_m, speed_mps)

    def aim(self, leg: Leg) -> tuple[float, float]:
        """The point to send the aircraft to, in rows and columns: beyond the end of the leg, in the same cell."""
        (row, col), (end_row, end_col) = leg.start, leg.end
        beyond = min(_BEYOND_OF_CELL, _BEYOND_M / self.motion.cell_m) / math.hypot(
            end_row - row, end_col - col
        )
        return end_row + beyond * (end_row - row), end_col + beyond * (end_col - col)

    def _at_corner(self, remaining_m: float, speed_mps: float) -> bool:
        """It is time to turn: near the waypoint, past it, or standing not far from it."""
        near = 0.5 * self.motion.cell_m
        past = self._nearest_m < near and remaining_m > self._nearest_m + _PAST_M
        return remaining_m <= self.motion.corner_m or past or (speed_mps < 0.5 and remaining_m < near)

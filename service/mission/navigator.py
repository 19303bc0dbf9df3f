"""When to send the next waypoint, and how far it reaches: from decisions in cells to targets for the autopilot.

The aircraft is always on its way to the last *committed* cell. A decision continues from that cell, so the search
thinks while the aircraft flies. Where the path goes straight on, the target is moved ahead before the aircraft
begins to brake (`lead`), and cells in one line become one target, so that it does not stop at each cell. Where the
path turns, the next target waits until the aircraft is `corner_m` from the corner: early enough not to stop,
late enough to have seen the cell. A hit drops what was committed: the next decision starts from where the aircraft is.

Pure: positions in, targets out; no clock, no socket.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

Cell = tuple[int, int]
Metres = tuple[float, float]

HEADING = {(-1, 0): "north", (0, 1): "east", (1, 0): "south", (0, -1): "west"}
REACTION_S = 0.5  # telemetry age, decision and command on their way


def heading_between(here: Cell, there: Cell) -> str:
    """The direction of one move; raises ValueError when the cells are not neighbours."""
    step = (there[0] - here[0], there[1] - here[1])
    if step not in HEADING:
        raise ValueError(
            f"cells {here} and {there} are not neighbours, a path enters one neighbour after another"
        )
    return HEADING[step]


def straight_part(start: Cell, path: Sequence[Cell]) -> list[Cell]:
    """The cells of `path` until its first turn, entering from `start`."""
    part: list[Cell] = []
    here = start
    heading = ""
    for cell in path:
        new = heading_between(here, cell)
        if heading and new != heading:
            break
        heading = new
        part.append(cell)
        here = cell
    return part


@dataclass
class Navigator:
    """The committed cells of one flight.

    `cell_m` metres a cell; `speed_mps` what the aircraft is to fly at, and `deceleration_mps2` what its autopilot
    brakes with; `corner_m` how early a turn is sent.
    """

    cell_m: float
    speed_mps: float
    deceleration_mps2: float
    corner_m: float
    waypoint: Cell = (0, 0)
    heading: str = "north"
    _ahead: tuple[Cell, ...] = ()
    _next: tuple[Cell, ...] = ()
    _at_once: bool = False

    def begin(self, cell: Cell, heading: str) -> None:
        """Forget everything; the aircraft is at `cell`, or on its way there and nowhere further."""
        self.waypoint, self.heading = cell, heading
        self._ahead, self._next, self._at_once = (cell,), (), False

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
    def lead_m(self) -> float:
        """How far before its target the aircraft starts to brake from full speed, reaction included, in metres.

        Of the speed that is wanted, not of the speed now: a target closer than this keeps an aircraft slow.
        """
        return self.speed_mps**2 / (2.0 * self.deceleration_mps2) + self.speed_mps * REACTION_S

    def wants_decision(self, remaining_m: float, thinking_s: float) -> bool:
        """True when it is time to decide what comes after the waypoint."""
        if self._next:
            return False
        return self._at_once or remaining_m <= self.lead_m + self.speed_mps * thinking_s + 0.25 * self.cell_m

    def decide(self, path: Sequence[Cell]) -> None:
        """Take a decision's path, which starts at a neighbour of the waypoint."""
        self._next = tuple(straight_part(self.waypoint, path))

    def due(self, remaining_m: float, speed_mps: float) -> Cell | None:
        """The target to send now, or None; the sent cells are then committed."""
        if not self._next:
            return None
        heading = heading_between(self.waypoint, self._next[0])
        straight_on = heading == self.heading
        slow = speed_mps < 0.5 and remaining_m < 0.3 * self.cell_m
        if not (self._at_once or straight_on or slow or remaining_m <= self.corner_m):
            return None
        wanted = self.lead_m - (remaining_m if straight_on else 0.0)
        count = max(1, min(len(self._next), math.ceil(wanted / self.cell_m)))
        sent = self._next[:count]
        self._ahead = (*self._ahead, *sent)
        self.waypoint, self.heading = sent[-1], heading
        self._next, self._at_once = (), False
        return self.waypoint

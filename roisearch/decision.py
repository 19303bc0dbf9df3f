"""What goes into a planner and what comes out: where the drone is, and where it should go and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.directions import direction_index
from roisearch.fov import HEADINGS

Cell = tuple[int, int]

AHEAD = 32
"""The most cells that the path of an option tells when the option may be dropped before its end: what a
decision costs must not grow with the distance."""


@dataclass(frozen=True, slots=True)
class SearchState:
    """Where the drone is and how it moves.

    Attributes:
        cell: (row, col).
        heading: the direction of its last move, one of `roisearch.directions.DIRECTIONS`.
        speed_mps: how fast it flies there; 0 when it stands.
    """

    cell: Cell
    heading: str = "north"
    speed_mps: float = 0.0

    def __post_init__(self) -> None:
        direction_index(self.heading)
        if not 0.0 <= self.speed_mps < float("inf"):
            raise ValueError(f"speed_mps must be at least 0 and finite, not {self.speed_mps}")


@dataclass(frozen=True, slots=True)
class Alternative:
    """One option that the planner had: its visits, its value, and the region it goes to (None for a move)."""

    action: str
    visits: int
    value: float
    region: int | None


class Effort(NamedTuple):
    """What the decision cost: iterations of the search, and seconds."""

    iterations: int
    seconds: float


_NO_OPTIONS = np.empty((0, 2))


class Decision(NamedTuple):
    """The cells to enter next, and why. A named tuple, as making one must cost next to nothing.

    Attributes:
        path: cells in order, each a neighbour of the last, the first a neighbour of the drone; never empty. Eight
            neighbours where the planner's motion has them, else four. Of a long way, the first AHEAD cells.
        action: "north", "east", "south", "west", "region 3", "elsewhere" (outside all regions), or the
            pattern's name for a planner that follows one.
        value: what the planner expects of it, in its own measure; comparable within one planner only.
        effort: iterations and seconds.
        unreachable: probability of the cells that cannot be seen from where the drone can fly.
        remark: one sentence for the operator when something is worth saying, else empty.
        goal: the cell that an option goes to look at; None for a single move or a pattern.
        options: the root's visits and value by action, [actions, 2]; see `alternatives`.
    """

    path: tuple[Cell, ...]
    action: str
    value: float
    effort: Effort
    unreachable: float = 0.0
    remark: str = ""
    goal: Cell | None = None
    options: NDArray[np.float64] = _NO_OPTIONS

    @property
    def alternatives(self) -> tuple[Alternative, ...]:
        """Every option that was open to the planner, the best first by visits, then by value."""
        rows = [
            Alternative(action_name(i), int(visits), float(value), i - 4 if i > 4 else None)
            for i, (visits, value) in enumerate(self.options)
            if visits >= 0
        ]
        return tuple(sorted(rows, key=lambda row: (-row.visits, -row.value)))


def action_name(action: int) -> str:
    """The name of an action: 0-3 the moves, 4 the ground outside all regions, 4 + k region k."""
    if action < 4:
        return HEADINGS[action]
    return "elsewhere" if action == 4 else f"region {action - 4}"

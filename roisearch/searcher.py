"""One of several that search together: its planner, what it sees, and what it is going to look at."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from roisearch.belief import Belief
from roisearch.decision import Decision, SearchState
from roisearch.fov import MOVES, FieldOfView
from roisearch.planners.base import Planner
from roisearch.planners.ending.planner import FarSighted
from roisearch.planners.lookahead.others import OthersLooks
from roisearch.planners.lookahead.thinking import Kept

NO_LOOKS = OthersLooks(np.zeros(0), np.zeros((0, 2), dtype=np.int64), np.zeros(0))


@runtime_checkable
class Cooperative(Protocol):
    """A planner that reckons with when others look, and tells its whole plan."""

    def reckon_with_others(self, looks: OthersLooks, searchers: int) -> None:
        """From the next `plan` on take `looks` as flown; `searchers` there are, this one included."""
        ...

    def committed(self) -> NDArray[np.int64]:
        """The whole plan of the last decision, int [k, 2]: the cells to enter, one a step."""
        ...

    @property
    def regions(self) -> int:
        """How many regions of interest there are."""
        ...

    def expected(self) -> float:
        """What the last plan expects of all searchers together, in steps of this one."""
        ...

    def open_with(self, region: int, share: float) -> None:
        """Plan to sweep `region` first, down to `share` of its largest worth."""
        ...

    def kept(self) -> Kept:
        """The present plan, to be taken up again before anything is flown."""
        ...

    def take_up(self, kept: Kept) -> None:
        """Go back to a plan that was kept."""
        ...


@dataclass
class Searcher:
    """One of a fleet.

    Attributes:
        planner: its own. fov: what it sees. step_s: seconds that it takes from cell to cell.
        looks: those of its plan, `when` in seconds on the fleet's clock.
        was_told: whether its planner was told of others before its last plan.
    """

    planner: Planner
    fov: FieldOfView
    step_s: float
    looks: OthersLooks = field(default=NO_LOOKS)
    was_told: bool = False

    def going_to(self, decision: Decision, ahead_s: float) -> NDArray[np.int64]:
        """The cells that it is going to enter, int [k, 2]: those of its whole plan where it tells that, for `ahead_s`
        seconds at least where it tells so many, and those of the decision alone where it flies another way."""
        if isinstance(self.planner, Cooperative):
            return self.planner.committed()
        cells = decision.path
        if isinstance(self.planner, FarSighted):
            ahead = self.planner.ahead(max(len(cells), int(ahead_s / self.step_s) + 1))
            cells = ahead if ahead[: len(cells)] == cells else cells
        return np.array(cells, dtype=np.int64).reshape(-1, 2)

    def commit(
        self, cells: NDArray[np.int64], state: SearchState, shape: tuple[int, int], now_s: float
    ) -> None:
        """Be going to enter `cells`, int [k, 2], of a map of `shape`, from `state` at `now_s`."""
        looks = looks_along(cells, state, self.fov, shape)
        self.looks = looks._replace(when=now_s + self.step_s * looks.when)


def looks_along(
    cells: NDArray[np.int64], state: SearchState, fov: FieldOfView, shape: tuple[int, int]
) -> OthersLooks:
    """The looks of a searcher in `state` that enters `cells`, int [k, 2], one a step: `when` in steps from there."""
    if fov.is_point:
        return OthersLooks(np.arange(1.0, len(cells) + 1.0), cells, np.full(len(cells), fov.p_tp[0]))
    moved = np.diff(np.vstack([[state.cell], cells]), axis=0)
    heading = np.zeros(len(cells), dtype=np.int64)
    for number, move in enumerate(MOVES):
        heading[(moved == move).all(axis=1)] = number
    seen = (cells[:, None, :] + fov.offsets[heading]).reshape(-1, 2)
    each = fov.offsets.shape[1]
    on_map = ((seen >= 0) & (seen < np.array(shape))).all(axis=1)
    when, p_tp = np.repeat(np.arange(1.0, len(cells) + 1.0), each), np.tile(fov.p_tp, len(cells))
    return OthersLooks(when[on_map], seen[on_map], p_tp[on_map])


def expecting(belief: Belief, looks: OthersLooks, ahead_s: float) -> Belief:
    """A copy of `belief` after those of `looks` that are made within `ahead_s`, all in vain."""
    soon = (looks.when <= ahead_s) & (looks.p_tp < 1.0)
    copied = belief.copy()
    if soon.any():
        copied.observe(looks.cells[soon], False, looks.p_tp[soon], 1.0)
    return copied

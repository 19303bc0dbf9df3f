"""The survey that a team flies today: a lawnmower in the best line direction, with second looks at what is reported."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import AHEAD, Decision, Effort, SearchState
from roisearch.directions import STEPS, direction_index
from roisearch.fov import FieldOfView
from roisearch.ground import Ground, Part
from roisearch.motion import Motion
from roisearch.planners.base import Progress, remark_on
from roisearch.planners.lanes import lawnmowers
from roisearch.planners.warm import warm_up
from roisearch.planners.ways import Ways, soonest
from roisearch.watch import LOOKED


class SurveyPlanner:
    """Flies lanes over the whole area, goes back for another look at what is reported, and resumes after.

    The lanes run along the rows or the columns and begin at that corner with which the target is expected soonest,
    in seconds of `motion`. A reported cell is looked at again, at once, until its misses outweigh its hits. After
    the last lane it begins again.

    Args:
        fov, flyable: see `make_planner`; `regions` is taken and not used.
        motion: what turns cost, and whether there are diagonal moves; `Motion.steps()` unless given.
        heights: float [rows, cols], metres at which each cell is flown over; None: all at one height.
    """

    name = "survey"

    def __init__(
        self,
        *,
        fov: FieldOfView,
        flyable: ArrayLike | None = None,
        regions: object = None,
        motion: Motion | None = None,
        heights: ArrayLike | None = None,
    ) -> None:
        self._fov = fov
        self._flyable = None if flyable is None else np.array(flyable, dtype=bool)
        self._motion = motion or Motion.steps()
        self._heights = None if heights is None else np.array(heights, dtype=np.float64)
        self._ground: Ground | None = None
        self._part: Part | None = None
        self._belief: Belief | None = None
        self._known: NDArray[np.float64] = np.zeros(0)
        self._hits = 0
        self._path: list[int] = []  # what the last decision gave

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next: see `Planner.plan`. Draws nothing; its value is the probability of its goal."""
        began = time.perf_counter()
        if self._ground is None:
            self._ground = Ground(belief.shape, self._flyable, self._fov)
        elif self._ground.shape != belief.shape:
            raise ValueError(f"the belief's map is {belief.shape}, the planner's {self._ground.shape}")
        part = self._ground.part_of(state.cell)
        if part is not self._part:
            self._enter(self._ground, part)
        cols = belief.shape[1]
        at, heading = state.cell[0] * cols + state.cell[1], direction_index(state.heading)
        self._looked = belief.follow(LOOKED)
        if self._order.size == 0:
            self._begin(belief, at, heading)
        self._note_reports(belief)
        path: list[int] = []
        goal = action = None
        if self._reported:
            goal, action = min(self._reported, key=lambda cell: _apart(at, cell, cols)), "look again"
            path = self._look(at, goal, heading)
        if not path:
            goal, action = self._resume(belief, at, heading), self.name
            path = self._onward(at, heading)
        if not path:  # the area is a single cell: leave it, to come back
            path = [self._step_off(at, heading)]
        assert goal is not None
        assert action is not None
        self._path = path[:AHEAD]
        hidden = float(belief.weights[self._hidden].sum()) / belief.total if self._hidden.size else 0.0
        return Decision(
            path=tuple(divmod(cell, cols) for cell in path[:AHEAD]),
            action=action,
            value=float(belief.weights[goal]) / belief.total,
            effort=Effort(0, time.perf_counter() - began),
            unreachable=hidden,
            remark=remark_on(hidden),
        )

    def _enter(self, ground: Ground, part: Part) -> None:
        """Make room for everything that depends on the map."""
        if self._heights is not None and self._heights.shape != ground.shape:
            raise ValueError(f"heights has the shape {self._heights.shape}, the map {ground.shape}")
        self._part = part
        self._reach = (part.legal > 0).reshape(ground.shape)
        self._ways = Ways(self._reach, self._motion.diagonal)
        self._hidden = np.flatnonzero(~part.viewable.ravel())
        self._order = np.zeros(0, dtype=np.int64)
        self._next = 0
        self._belief = None
        self._reported: set[int] = set()
        self._path = []

    def _begin(self, belief: Belief, at: int, heading: int) -> None:
        """Lay the lanes, or lay them anew when all were flown.

        The first lanes of a planner that takes over from another one, on the next flight or over other ground, lead
        over what was not looked at yet.
        """
        across = self._fov.offsets[1][:, 0]
        swath = int(across.max() - across.min()) + 1
        wanted = belief.weights.reshape(belief.shape) > 0.0
        if self._order.size == 0 and belief.walks is None:
            assert self._part is not None
            left = wanted & self._part.viewable & ~self._looked.looked().reshape(belief.shape)
            wanted = left if left.any() else wanted
        orders = lawnmowers(wanted, self._reach, swath)
        if not orders:
            orders = [np.flatnonzero(self._reach)]
        self._order = soonest(
            orders, belief.weights, self._ways, self._motion, at, heading, self._flat_heights
        )
        self._next = 0

    def _note_reports(self, belief: Belief) -> None:
        """Take up the cells whose reports stand, and drop those that were looked at in vain since."""
        if belief is not self._belief or belief.hits != self._hits:
            if self._belief is None or belief.hits != self._hits:
                first = self._belief is None  # another planner may have looked before, on an earlier flight
                changed = self._looked.hit() if first else np.flatnonzero(belief.weights != self._known)
                reported = changed[self._looked.raised(changed, belief.weights) & self._near(changed)]
                self._reported.update(reported.tolist())
            self._known = belief.weights.copy()
            self._belief, self._hits = belief, belief.hits
        if self._reported:
            cells = np.array(sorted(self._reported))
            self._reported = set(cells[self._looked.raised(cells, belief.weights)].tolist())

    def _near(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of `cells` can be looked at."""
        assert self._part is not None
        viewable: NDArray[np.bool_] = self._part.viewable.ravel()[cells]
        return viewable

    def _resume(self, belief: Belief, at: int, heading: int) -> int:
        """The next cell of the lanes that it is not over."""
        flown = self._path[: self._path.index(at) + 1] if at in self._path else [at]
        for cell in flown:  # several, when it is asked for what comes after a part of what it said
            if self._order[self._next] != cell:
                continue
            self._next += 1
            if self._next == self._order.size:
                self._begin(belief, at, heading)
                if self._order[0] == at and self._order.size > 1:
                    self._next = 1
                break
        return int(self._order[self._next])

    def _onward(self, at: int, heading: int) -> list[int]:
        """The way along the lanes, as far as a decision tells."""
        ahead = self._order[self._next : self._next + AHEAD]
        return [int(cell) for cell in self._ways.joined(at, ahead, heading)]

    def _look(self, at: int, goal: int, heading: int) -> list[int]:
        """The shortest way to the next look at `goal`; empty when it cannot be seen from anywhere."""
        cols = self._ways.cols
        best: list[int] = []
        for turn in range(4):
            for row, col in self._fov.offsets[turn]:
                down, right = STEPS[2 * turn]
                r, c = goal // cols - int(row), goal % cols - int(col)
                before = (r - down) * cols + c - right
                inside = 0 <= r - down < self._reach.shape[0] and 0 <= c - right < cols
                if not inside or not self._ways.allowed[before] >> 2 * turn & 1:
                    continue
                there = before + down * cols + right
                if self._fov.is_point and at != goal:
                    way = self._ways.way(at, there, heading)
                else:
                    way = [*self._ways.way(at, before, heading), there]
                if way and (not best or self._seconds(at, way, heading) < self._seconds(at, best, heading)):
                    best = way
        return best

    def _seconds(self, at: int, way: list[int], heading: int) -> float:
        path = np.array(way, dtype=np.int64)
        return float(self._motion.seconds(at, path, heading, self._ways.cols, self._flat_heights)[-1])

    @property
    def _flat_heights(self) -> NDArray[np.float64] | None:
        return None if self._heights is None else self._heights.ravel()

    def _step_off(self, at: int, heading: int) -> int:
        bits = [(heading + turn) % 8 for turn in (0, 2, 6, 4, 1, 7, 3, 5)]
        bit = next(bit for bit in bits if self._ways.allowed[at] >> bit & 1)
        return at + self._ways.move(bit)

    def reckon_with(self, motion: Motion) -> None:
        """Let turns cost what `motion` says from now on; it has the same cells and neighbours."""
        self._motion = motion

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use, by making some on a small map."""
        warm_up(
            lambda ground: SurveyPlanner(fov=self._fov, flyable=ground, motion=self._motion),
            self._fov,
            progress,
        )


def _apart(here: int, there: int, cols: int) -> int:
    return max(abs(here // cols - there // cols), abs(here % cols - there % cols))

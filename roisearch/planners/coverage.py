"""Coverage: boustrophedon over the area, what a drone without a prior flies today."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import Decision, Effort, SearchState
from roisearch.fov import FieldOfView
from roisearch.kernels.ground import FAR, flood
from roisearch.kernels.puct import moved
from roisearch.planners.base import Progress, Scene, World, cells_of
from roisearch.planners.puct import remark
from roisearch.regions import Regions


class CoveragePlanner:
    """Flies the rows of the area in turn, west to east and back, and begins again at the end.

    The next cell to enter is the first one of the sweep that was entered least often; what lies between, around an
    obstacle or over a gap, is flown on the shortest way. The planner keeps count itself: the belief plays no part.

    Args:
        swath: rows between two lanes; default the number of rows that the field of view spans.
    """

    name = "coverage"

    def __init__(
        self,
        *,
        fov: FieldOfView,
        flyable: ArrayLike | None = None,
        regions: Regions | None = None,
        swath: int | None = None,
    ) -> None:
        self._world = World(fov, flyable, regions)
        self._fov = fov
        across = fov.offsets[1][:, 0]
        self._swath = int(across.max() - across.min()) + 1 if swath is None else swath
        if self._swath < 1:
            raise ValueError(f"swath must be at least 1 row, not {swath}")
        self._scene: Scene | None = None

    def _lanes(self, scene: Scene, belief: Belief) -> NDArray[np.int64]:
        """The cells to enter, in order."""
        rows, cols = scene.ground.shape
        wanted = (belief.weights > 0.0).reshape(rows, cols)
        flyable = (scene.part.legal > 0).reshape(rows, cols)
        lanes: list[NDArray[np.int64]] = []
        first = min((self._swath - 1) // 2, rows - 1)
        for number, row in enumerate(range(first, rows + self._swath - 1 - first, self._swath)):
            lane = min(row, rows - 1)
            near = wanted[max(lane - first, 0) : lane + self._swath - first].any(axis=0)
            along = np.flatnonzero(near & flyable[lane])
            lanes.append(lane * cols + (along if number % 2 == 0 else along[::-1]))
        order = np.concatenate(lanes) if lanes else np.zeros(0, dtype=np.int64)
        return order if order.size else np.flatnonzero(flyable.ravel())

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next: see `Planner.plan`. Draws nothing and needs no deadline."""
        began = time.perf_counter()
        scene = self._world.scene(belief, state.cell)
        rows, cols = belief.shape
        if scene is not self._scene:
            self._scene = scene
            self._order = self._lanes(scene, belief)
            self._next = 0
            self._field = np.zeros(rows * cols, dtype=np.int32)
            self._queue = np.zeros(rows * cols, dtype=np.int64)
        at = state.cell[0] * cols + state.cell[1]
        if self._order[self._next] == at:
            self._next = (self._next + 1) % self._order.size
        goal = int(self._order[self._next])
        path = self._way(scene, at, goal, cols)
        unreachable = scene.unreachable(belief)
        return Decision(
            path=cells_of(np.array(path, dtype=np.int64), cols),
            action="lane",
            value=float(belief.weights[goal] / belief.total),
            effort=Effort(0, time.perf_counter() - began),
            unreachable=unreachable,
            remark=remark(unreachable),
        )

    def _way(self, scene: Scene, at: int, goal: int, cols: int) -> list[int]:
        """The shortest way from `at` to `goal`; one move away and back when it is there already."""
        legal = scene.part.legal
        if at == goal:
            return [moved(at, int(legal[at] & -legal[at]).bit_length() - 1, cols)]
        if scene.ground.is_open and abs(at - goal) == 1 and at // cols == goal // cols:
            return [goal]
        flood(np.array([goal]), 1, 0, legal, cols, self._field, self._queue)
        path = []
        while at != goal:
            near = [moved(at, move, cols) for move in range(4) if legal[at] >> move & 1]
            at = min(near, key=lambda cell: (int(self._field[cell]), cell))
            assert self._field[at] < FAR
            path.append(at)
        return path

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use."""
        from roisearch.planners.warm import warm_up

        warm_up(CoveragePlanner(fov=self._fov), self._fov, progress)

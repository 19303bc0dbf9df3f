"""Index rule: always towards the cell with the largest m ** alpha / steps, over the whole map."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike

from roisearch.belief import Belief
from roisearch.decision import Decision, Effort, SearchState
from roisearch.fov import FieldOfView, heading_index
from roisearch.kernels import goals as goal_kernels
from roisearch.kernels import puct as puct_kernels
from roisearch.kernels.ground import flood
from roisearch.planners.base import Progress, Scene, World, cells_of
from roisearch.planners.puct import remark
from roisearch.regions import Regions


class IndexPlanner:
    """Goes to argmax of m ** alpha / steps, where steps end with a look at the cell; re-planned at each call.

    On the way to its goal the goal's score rises at least as fast as any farther one's, so it can only change
    to a nearer goal: it cannot dither.

    Args:
        alpha: how much a likely cell counts against a near one; 2.5 is best on the paper's priors.
    """

    name = "index"

    def __init__(
        self,
        *,
        fov: FieldOfView,
        flyable: ArrayLike | None = None,
        regions: Regions | None = None,
        alpha: float = 2.5,
    ) -> None:
        if alpha <= 0.0:
            raise ValueError(f"alpha must be above 0, not {alpha}")
        self._world = World(fov, flyable, regions)
        self._fov = fov
        self._alpha = alpha
        self._scene: Scene | None = None

    def _enter(self, scene: Scene) -> None:
        self._scene = scene
        rows, cols = scene.ground.shape
        cells, k = rows * cols, self._fov.offsets.shape[1]
        is_open = scene.ground.is_open
        regions = scene.forest.root.size
        self._goals = np.full(regions, -1, dtype=np.int64)
        self._sources = np.zeros((regions, 4 * k), dtype=np.int64)
        self._counts = np.zeros(regions, dtype=np.int64)
        self._stack = np.zeros(16 * 8 + 16, dtype=np.int64)
        self._forward = np.zeros(0 if is_open else cells, dtype=np.int32)
        self._queue = np.zeros(0 if is_open else cells, dtype=np.int64)
        self._fields = np.zeros((0 if is_open else regions, cells), dtype=np.int32)
        self._path = np.zeros(rows + cols + 64, dtype=np.int64)
        self._gains = np.ones(k)
        self._fade = np.ones(1)
        with np.errstate(divide="ignore"):
            farthest = rows + cols + 8 if is_open else cells + 8
            self._worth = np.arange(farthest, dtype=np.float64) ** (-1.0 / self._alpha)
        self._worth[0] = 1.0

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
        if scene is not self._scene:
            self._enter(scene)
        cols = belief.shape[1]
        at, heading = state.cell[0] * cols + state.cell[1], heading_index(state.heading)
        forest, legal = scene.forest, scene.part.legal
        if self._forward.size:
            flood(np.array([at]), 1, 0, legal, cols, self._forward, self._queue)
        goal_kernels.choose_goals(
            goal_kernels.INDEX, at, forest.root, self._goals, self._sources, self._counts, belief.weights,
            forest.cell_of, forest.first, forest.last, forest.box, belief.sums_of(forest).peaks, legal, cols,
            self._fov.offsets, self._fov.is_point, self._fov.reach, self._worth, self._forward, self._stack,
        )  # fmt: skip
        scores = np.array([self._score(belief, at, region, cols) for region in range(self._goals.size)])
        best = int(np.argmax(scores))
        if scores[best] > 0.0:
            if self._fields.shape[0]:
                flood(
                    self._sources[best], self._counts[best], 1, legal, cols, self._fields[best], self._queue
                )
            length = puct_kernels.walk_option(
                at, heading, best, int(self._goals[best]), belief.weights, self._fade, legal, cols,
                self._fov.offsets, self._gains, self._fov.is_point, self._sources, self._counts, self._fields,
                self._path,
            )  # fmt: skip
        else:  # nothing left anywhere: any move will do
            self._path[0] = puct_kernels.moved(at, int(legal[at] & -legal[at]).bit_length() - 1, cols)
            length = 1
        unreachable = scene.unreachable(belief)
        return Decision(
            path=cells_of(self._path[:length], cols),
            action="elsewhere" if best == 0 else f"region {best}",
            value=float(scores[best]),
            effort=Effort(0, time.perf_counter() - began),
            unreachable=unreachable,
            remark=remark(unreachable),
        )

    def _score(self, belief: Belief, at: int, region: int, cols: int) -> float:
        """mass ** alpha / steps of the region's goal; 0 without one."""
        goal = int(self._goals[region])
        if goal < 0:
            return 0.0
        sources = self._sources[region, : self._counts[region]]
        if self._forward.size:
            steps = int(self._forward[sources].min()) + 1
        else:
            apart = np.abs(sources // cols - at // cols) + np.abs(sources % cols - at % cols)
            steps = int(apart.min()) + 1
        return float((belief.weights[goal] / belief.total) ** self._alpha / steps)

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use."""
        from roisearch.planners.warm import warm_up

        warm_up(IndexPlanner(fov=self._fov), self._fov, progress)

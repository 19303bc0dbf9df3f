"""Greedy: towards the highest-valued cell within a horizon (the paper's first baseline)."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike

from roisearch.belief import Belief
from roisearch.decision import Decision, Effort, SearchState
from roisearch.fov import FieldOfView, heading_index
from roisearch.kernels.onestep import HORIZON, follow_horizon
from roisearch.planners.base import Progress, Scene, World, any_move, cells_of, remark_on
from roisearch.planners.packing import land_of, sight_of
from roisearch.planners.warm import warm_up
from roisearch.regions import Regions


class GreedyPlanner:
    """Moves towards the cell from which most mass is seen among those within `horizon` steps.

    Of equally good cells the nearest wins, and of equally near ones the one found straight on, right, left,
    back in this order. The drone's own cell does not count. When no cell within the horizon sees any mass at
    all, it makes the first legal move in the same order.

    Args:
        fov, flyable, regions: see `make_planner`.
        horizon: steps looked ahead. Paper: 20.
    """

    name = "greedy"

    def __init__(
        self,
        *,
        fov: FieldOfView,
        flyable: ArrayLike | None = None,
        regions: Regions | None = None,
        horizon: int = 20,
    ) -> None:
        if horizon < 1:
            raise ValueError(f"horizon must be at least 1 step, not {horizon}")
        self._world = World(fov, flyable, regions)
        self._fov = fov
        self._horizon = horizon
        self._scene: Scene | None = None
        self._path = np.zeros((2, horizon), dtype=np.int64)

    def _enter(self, scene: Scene) -> None:
        """Make room for everything that depends on the map."""
        self._scene = scene
        side = 2 * self._horizon + 1
        self._parcel = HORIZON.pack(
            horizon=self._horizon,
            window=np.zeros((side, side), dtype=np.int32),
            queue=np.zeros(2 * side**2, dtype=np.int64),
            **land_of(scene),
            **sight_of(self._fov, detection=False),
            path=self._path,
        )

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next: see `Planner.plan`. Draws nothing; its value is a probability."""
        began = time.perf_counter()
        scene = self._world.scene(belief, state.cell)
        if scene is not self._scene:
            self._enter(scene)
        cols = scene.ground.shape[1]
        at, heading = state.cell[0] * cols + state.cell[1], heading_index(state.heading)
        value, length = follow_horizon(at, heading, belief.weights, self._parcel.address)
        unreachable = scene.unreachable(belief, belief.follow(scene.forest))
        if length == 0:
            return any_move(scene, state, began, unreachable)
        effort = Effort(0, time.perf_counter() - began)
        path = cells_of(self._path, length)
        return Decision(path, "horizon", value / belief.total, effort, unreachable, remark_on(unreachable))

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use, by making some on a small map."""
        warm_up(lambda ground: GreedyPlanner(fov=self._fov, flyable=ground), self._fov, progress)

"""Index rule: always towards the cell with the largest m ** alpha / steps, over the whole map."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from roisearch.belief import Belief
from roisearch.decision import AHEAD, Decision, Effort, SearchState
from roisearch.fov import FieldOfView, heading_index
from roisearch.kernels.onestep import INDEX, follow_index
from roisearch.planners.base import Progress, Scene, World, any_move, cells_of, remark_on
from roisearch.planners.packing import forest_of, land_of, ranging_of, sight_of
from roisearch.planners.warm import warm_up
from roisearch.regions import Regions


class IndexPlanner:
    """Goes to argmax of m ** alpha / steps, where steps end with a look at the cell; re-planned at each call.

    With every move towards its goal the goal's score rises at least as fast as that of any farther cell, so
    the goal can only change to a nearer one: the rule cannot dither.

    Args:
        fov, flyable, regions: see `make_planner`.
        alpha: how much a likely cell counts against a near one; 2.5 is about best on the paper's priors.
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
        if not alpha > 0.0:
            raise ValueError(f"alpha must be above 0, not {alpha}")
        self._world = World(fov, flyable, regions)
        self._fov = fov
        self._alpha = alpha
        self._scene: Scene | None = None

    def _enter(self, scene: Scene) -> None:
        """Make room for everything that depends on the map."""
        self._scene = scene
        rows, cols = scene.ground.shape
        fields = 0 if scene.ground.is_open else 1
        self._path = np.zeros((2, AHEAD), dtype=np.int64)
        self._scores = np.zeros(scene.regions)
        self._parcel = INDEX.pack(
            **forest_of(scene, scene.forest.root[: scene.regions]),
            **land_of(scene),
            **sight_of(self._fov, detection=True),
            **ranging_of(scene, self._fov, self._alpha),
            field=np.zeros((fields, rows * cols), dtype=np.int32),
            scores=self._scores,
            path=self._path,
        )

    def redraw(self, regions: Regions) -> Callable[[], None]:
        """Reckon with other regions: see `Redrawable`."""
        other = self._world.redrawn(regions)

        def take() -> None:
            self._world, self._scene = other, None

        return take

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next: see `Planner.plan`. Draws nothing; its value is m ** alpha / steps."""
        began = time.perf_counter()
        scene = self._world.scene(belief, state.cell)
        if scene is not self._scene:
            self._enter(scene)
        sums = belief.follow(scene.forest)
        cols = scene.ground.shape[1]
        at = state.cell[0] * cols + state.cell[1]
        heading = heading_index(state.heading)
        region, goal, length = follow_index(at, heading, belief.weights, sums.peaks, self._parcel.address)
        unreachable = scene.unreachable(belief, sums)
        if region < 0:
            return any_move(scene, state, began, unreachable)
        scores = (self._scores / belief.total) ** self._alpha
        options = np.zeros((4 + scene.regions, 2))
        options[:4, 0] = -1.0  # single moves are not among its options
        options[4:, 0] = np.where(
            scene.forest.root[: scene.regions] >= 0, 0.0, -1.0
        )  # none to a region without cells
        options[4:, 1] = scores
        return Decision(
            cells_of(self._path, length),
            "elsewhere" if region == 0 else f"region {region}",
            float(scores[region]),
            Effort(0, time.perf_counter() - began),
            unreachable,
            remark_on(unreachable),
            divmod(goal, cols),
            options,
        )

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use, by making some on a small map."""
        warm_up(lambda ground: IndexPlanner(fov=self._fov, flyable=ground), self._fov, progress)

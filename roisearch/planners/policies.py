"""Direct policy search: the best of many epsilon-greedy walks (the paper's second baseline)."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike

from roisearch.belief import Belief
from roisearch.decision import Decision, Effort, SearchState
from roisearch.fov import FieldOfView, heading_index
from roisearch.kernels.handover import Parcel
from roisearch.kernels.policies import WALKS, search_policies
from roisearch.planners.base import Progress, Scene, World, cells_of, remark_on
from roisearch.planners.packing import fading_of, land_of, sight_of
from roisearch.planners.warm import warm_up
from roisearch.regions import Regions

_CHUNK = 100
"""Rollouts between two looks at the clock."""


class DirectPolicySearch:
    """Walks `rollouts` times, each move random with probability epsilon, else greedy; takes the best walk.

    The paper gives epsilon and the horizon; the number of rollouts, and that the best single walk is
    followed, are ours.

    Args:
        fov, flyable, regions: see `make_planner`.
        epsilon: probability of a random move. Paper: 0.65.
        horizon: moves of a walk. Paper: 20.
        rollouts: walks a decision.
        fades: whether what a walk has seen fades by 1 - p_tp within it.
    """

    name = "direct-policy-search"

    def __init__(
        self,
        *,
        fov: FieldOfView,
        flyable: ArrayLike | None = None,
        regions: Regions | None = None,
        epsilon: float = 0.65,
        horizon: int = 20,
        rollouts: int = 100,
        fades: bool = True,
    ) -> None:
        if not 0.0 <= epsilon <= 1.0:
            raise ValueError(f"epsilon must be from 0 to 1, not {epsilon}")
        if horizon < 1 or rollouts < 1:
            raise ValueError(f"horizon and rollouts must be at least 1, not {horizon} and {rollouts}")
        self._world = World(fov, flyable, regions)
        self._fov = fov
        self._epsilon, self._horizon, self._rollouts, self._fades = epsilon, horizon, rollouts, fades
        self._scene: Scene | None = None
        self._random = np.zeros(1, dtype=np.uint64)
        self._path, self._best = (np.zeros((2, horizon), dtype=np.int64) for _ in range(2))

    def _pack(self, scene: Scene, cells: int) -> Parcel:
        """What the kernel needs of the map and of the settings."""
        return WALKS.pack(
            horizon=self._horizon,
            epsilon=self._epsilon,
            random=self._random,
            **land_of(scene),
            **sight_of(self._fov, detection=False),
            **fading_of(self._fov, cells, self._fades, self._horizon),
            trial=np.zeros((2, self._horizon), dtype=np.int64),
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
        """Where to go next: see `Planner.plan`. Its value is the probability seen along the path."""
        began = time.perf_counter()
        scene = self._world.scene(belief, state.cell)
        rows, cols = scene.ground.shape
        if scene is not self._scene:
            self._scene = scene
            self._parcel = self._pack(scene, rows * cols)
        self._random[0] = rng.bit_generator.random_raw()
        at, heading = state.cell[0] * cols + state.cell[1], heading_index(state.heading)
        done, best = 0, -1.0
        while done < self._rollouts:
            chunk = self._rollouts - done if deadline_s is None else min(_CHUNK, self._rollouts - done)
            value = search_policies(at, heading, chunk, belief.weights, self._parcel.address)
            done += chunk
            if value > best:
                best = value
                self._best[:] = self._path
            if deadline_s is not None and time.perf_counter() - began >= deadline_s:
                break
        path = cells_of(self._best, self._horizon)
        unreachable = scene.unreachable(belief, belief.follow(scene.forest))
        effort = Effort(done, time.perf_counter() - began)
        return Decision(path, "walk", best / belief.total, effort, unreachable, remark_on(unreachable))

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use, by making some on a small map."""
        warm_up(lambda ground: DirectPolicySearch(fov=self._fov, flyable=ground), self._fov, progress)

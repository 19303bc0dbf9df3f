"""PUCT over the flat MDP, the BMDP-O or the lite MDP-O: the settings, and the object that plans."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from roisearch.belief import Belief
from roisearch.decision import Decision, Effort, SearchState, action_name
from roisearch.fov import FieldOfView, heading_index
from roisearch.kernels import goals as goal_kernels
from roisearch.kernels import puct as kernels
from roisearch.kernels.ground import flood
from roisearch.planners.base import Progress, Scene, World, cells_of
from roisearch.regions import Regions


@dataclass(frozen=True)
class PuctSettings:
    """What can be set about the search; the defaults are those of `puct-regions-lite`.

    Attributes:
        iterations: simulations a decision. Paper: 40.
        rollout: moves after the new node. Paper: 60.
        rollout_policy: "steepest" goes to the neighbour that sees most, straight on among equals; "random"
            draws each move; "repeat" repeats one drawn move (reference code).
        explore: c of the PUCT score. Paper: 0.5.
        discount: of each further step; the paper has none, the reference code 0.99.
        penalty: d, the time penalty of a step, in probability. None: 1 / number of cells.
        options: whether there are options to go to the regions.
        elsewhere: whether the ground outside all regions is one more region to go to.
        goal: where an option goes: "peak" is the region's most probable cell (paper); "index" the cell with the
            largest m ** alpha / steps from the drone.
        option_reward: "density" is the lite model's f * mean mass / (A^2 * distance); "trip" is what the
            option sees on its way, as in the BMDP-O.
        factor: f of the lite model. Paper: 8e-6.
        area: A of the lite model, in maps: 1 is the whole map, and then the printed f makes an option worth
            a little more than nothing, which is what a step on empty ground is less than.
        fades: whether what the tree has seen fades by 1 - p_tp (the paper's in-tree belief update).
        backup: "mean" or "max" of the returns. The model is deterministic, so the best return is attainable.
        normalise: scale Q to 0 .. 1 over the tree's values before exploration is added.
        prior: P(a) from the one-step "rewards" (paper), "index" (m ** alpha / steps), or "uniform".
        choose: the root action with most "visits" or best "value".
        floor: what the least promising action gets of P(a), the best getting 1 + floor, before scaling.
        alpha: exponent of the mass in "index".
        depth: the most actions down the tree in one iteration.
    """

    iterations: int | None = 100
    rollout: int = 60
    rollout_policy: str = "steepest"
    explore: float = 0.5
    discount: float = 0.99
    penalty: float | None = 0.0
    options: bool = True
    elsewhere: bool = True
    goal: str = "index"
    option_reward: str = "trip"
    factor: float = 8e-6
    area: float = 1.0
    fades: bool = True
    backup: str = "max"
    normalise: bool = True
    prior: str = "index"
    choose: str = "value"
    floor: float = 0.1
    alpha: float = 2.5
    depth: int = 64


_CODES: dict[str, tuple[str, ...]] = {
    "rollout_policy": ("random", "repeat", "steepest"),
    "option_reward": ("density", "trip"),
    "backup": ("mean", "max"),
    "prior": ("uniform", "rewards", "index"),
    "choose": ("visits", "value"),
    "goal": ("peak", "index"),
}
_CHUNK = 64
_MOST_NODES = 1 << 14


class PuctPlanner:
    """Plans by PUCT; see `PuctSettings`.

    Args:
        name: the planner's name in the registry.
        fov: the field of view; its p_tp is used in the tree.
        flyable: bool [rows, cols], None for everything.
        regions: the regions of interest; segmented from the first belief unless given.
    """

    def __init__(
        self,
        name: str,
        settings: PuctSettings,
        *,
        fov: FieldOfView,
        flyable: ArrayLike | None = None,
        regions: Regions | None = None,
    ) -> None:
        self.name = name
        self.settings = settings
        self._world = World(fov, flyable, regions)
        self._fov = fov
        self._gains = np.ones(len(fov.p_tp))
        self._miss = 1.0 - fov.p_tp
        self._scene: Scene | None = None
        s = settings
        codes = {name: _code(name, str(getattr(s, name))) for name in _CODES}
        self._goal_rule = codes["goal"]
        self._flags = np.zeros(10, dtype=np.int64)
        self._flags[kernels.ROLLOUT] = s.rollout
        self._flags[kernels.ROLLOUT_POLICY] = codes["rollout_policy"]
        self._flags[kernels.FADES] = s.fades
        self._flags[kernels.OPTION_REWARD] = codes["option_reward"]
        self._flags[kernels.BACKUP] = codes["backup"]
        self._flags[kernels.NORMALISE] = s.normalise
        self._flags[kernels.PRIOR] = codes["prior"]
        self._flags[kernels.CHOOSE] = codes["choose"]
        self._rates = np.zeros(7)
        self._rates[kernels.EXPLORE] = s.explore
        self._rates[kernels.DISCOUNT] = s.discount
        self._rates[kernels.DENSITY_FACTOR] = s.factor / s.area**2
        self._rates[kernels.ALPHA] = s.alpha
        self._rates[kernels.FLOOR] = s.floor
        self._random = np.zeros(1, dtype=np.uint64)
        self._span = np.zeros(2)
        self._trail = np.zeros((s.depth, 4))

    def _enter(self, scene: Scene) -> None:
        """Make room for everything that depends on the map."""
        self._scene = scene
        rows, cols = scene.ground.shape
        regions = scene.forest.root.size if self.settings.options else 0
        k = len(self._gains)
        nodes = 1 + min(self.settings.iterations or _MOST_NODES, _MOST_NODES)
        self._child = np.zeros((nodes, 4 + regions), dtype=np.int32)
        self._stats = np.zeros((nodes, 4 + regions, 3))
        self._fade = np.ones(rows * cols)
        self._log = np.zeros((self.settings.rollout + 8 * (rows + cols)) * k, dtype=np.int64)
        self._goals = np.full(regions, -1, dtype=np.int64)
        self._sources = np.zeros((regions, 4 * k), dtype=np.int64)
        self._counts = np.zeros(regions, dtype=np.int64)
        self._roots = scene.forest.root[:regions].copy()
        if regions and not self.settings.elsewhere:
            self._roots[0] = -1
        self._cells_in = np.maximum(scene.forest.count[:regions], 1)
        self._stack = np.zeros(16 * 8 + 16, dtype=np.int64)
        is_open = scene.ground.is_open
        self._fields = np.zeros((0 if is_open else regions, rows * cols), dtype=np.int32)
        self._field_goals = np.full(regions, -1, dtype=np.int64)
        self._forward = np.zeros(0 if is_open else rows * cols, dtype=np.int32)
        self._queue = np.zeros(0 if is_open else rows * cols, dtype=np.int64)
        self._path = np.zeros(rows + cols + 64, dtype=np.int64)
        farthest = rows + cols + 8 if is_open else rows * cols + 8
        with np.errstate(divide="ignore"):
            self._worth = np.arange(farthest, dtype=np.float64) ** (-1.0 / self.settings.alpha)
        self._worth[0] = 1.0
        penalty = self.settings.penalty
        self._rates[kernels.PENALTY] = 1.0 / (rows * cols) if penalty is None else penalty

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next: see `Planner.plan`.

        Args:
            deadline_s: seconds after which the search stops and decides with what it has.

        Raises:
            ValueError: when the drone cannot be in its cell or cannot leave it.
        """
        began = time.perf_counter()
        scene = self._world.scene(belief, state.cell)
        if scene is not self._scene:
            self._enter(scene)
        rows, cols = belief.shape
        at = state.cell[0] * cols + state.cell[1]
        heading = heading_index(state.heading)
        self._rates[kernels.SCALE] = 1.0 / belief.total
        self._random[0] = rng.bit_generator.random_raw()
        self._set_goals(belief, scene, at)
        iterations = self._search(belief, scene, at, heading, began, deadline_s)
        return self._decide(belief, scene, at, heading, iterations, began)

    def _set_goals(self, belief: Belief, scene: Scene, at: int) -> None:
        """The goal of each region's option, and the way there around obstacles."""
        regions = self._goals.size
        if not regions:
            return
        forest = scene.forest
        sums = belief.sums_of(forest)
        legal, cols = scene.part.legal, belief.shape[1]
        if self._forward.size and self._goal_rule == goal_kernels.INDEX:
            flood(np.array([at]), 1, 0, legal, cols, self._forward, self._queue)
        goal_kernels.choose_goals(
            self._goal_rule, at, self._roots, self._goals, self._sources, self._counts, belief.weights,
            forest.cell_of, forest.first, forest.last, forest.box, sums.peaks, legal, cols, self._fov.offsets,
            self._fov.is_point, self._fov.reach, self._worth, self._forward, self._stack,
        )  # fmt: skip
        self._means = np.where(self._roots >= 0, sums.sums[self._roots], 0.0) / self._cells_in
        for region in range(self._fields.shape[0]):
            goal = self._goals[region]
            if goal >= 0 and goal != self._field_goals[region]:
                flood(
                    self._sources[region],
                    self._counts[region],
                    1,
                    legal,
                    cols,
                    self._fields[region],
                    self._queue,
                )
                self._field_goals[region] = goal

    def _search(
        self, belief: Belief, scene: Scene, at: int, heading: int, began: float, deadline_s: float | None
    ) -> int:
        """Grow the tree; how many iterations were run."""
        most = self.settings.iterations
        if most is None and deadline_s is None:
            raise ValueError("a planner without a number of iterations needs a deadline")
        if not self._goals.size:
            self._means = np.zeros(0)
        done, nodes = 0, 0
        while most is None or done < most:
            chunk = _CHUNK if most is None else most - done
            if deadline_s is not None:
                chunk = min(chunk, _CHUNK)
            nodes = kernels.search(
                at, heading, nodes, chunk, self._random, self._flags, self._rates, self._span, self._child,
                self._stats, self._trail, belief.weights, self._fade, self._log, scene.part.legal,
                belief.shape[1], self._fov.offsets, self._gains, self._miss, self._fov.is_point, self._goals,
                self._sources, self._counts, self._means, scene.centroids, self._fields,
            )  # fmt: skip
            done += chunk
            if deadline_s is not None and time.perf_counter() - began >= deadline_s:
                break
        return done

    def _decide(
        self, belief: Belief, scene: Scene, at: int, heading: int, iterations: int, began: float
    ) -> Decision:
        """The best root action, its cells, and what was thought of the others."""
        root = self._stats[0]
        visits = root[:, kernels.N_A]
        worth = root[:, kernels.WORTH]
        if self.settings.backup == "mean":
            worth = worth / np.maximum(visits, 1.0)
        rank = visits if self.settings.choose == "visits" else np.where(visits > 0.0, worth, -np.inf)
        action = int(np.argmax(rank))
        cols = belief.shape[1]
        if action < 4:
            self._path[0] = kernels.moved(at, action, cols)
            length = 1
        else:
            length = kernels.walk_option(
                at, heading, action - 4, int(self._goals[action - 4]), belief.weights, self._fade,
                scene.part.legal, cols, self._fov.offsets, self._gains, self._fov.is_point, self._sources,
                self._counts, self._fields, self._path,
            )  # fmt: skip
        legal = root[:, kernels.P_A] >= 0.0
        options = np.stack([np.where(legal, visits, -1.0), worth], axis=1)
        unreachable = scene.unreachable(belief)
        return Decision(
            path=cells_of(self._path[:length], cols),
            action=action_name(action),
            value=float(worth[action]),
            effort=Effort(iterations, time.perf_counter() - began),
            unreachable=unreachable,
            remark=remark(unreachable),
            options=options,
        )

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use, by making one of each on a tiny map."""
        from roisearch.planners.warm import warm_up

        warm_up(PuctPlanner(self.name, self.settings, fov=self._fov), self._fov, progress)


def remark(unreachable: float) -> str:
    """What the operator should hear about ground that cannot be seen."""
    if unreachable <= 0.0:
        return ""
    return f"{unreachable:.2%} of the probability lies where the drone cannot look; it searches the rest"


def _code(name: str, value: str) -> int:
    allowed = _CODES[name]
    if value not in allowed:
        raise ValueError(f"{name} is one of {', '.join(allowed)}, not '{value}'")
    return allowed.index(value)

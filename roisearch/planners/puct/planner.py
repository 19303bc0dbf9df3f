"""PUCT over the flat MDP, the BMDP-O or the lite MDP-O: the object that plans."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import AHEAD, Cell, Decision, Effort, SearchState, action_name
from roisearch.forest import ForestSums
from roisearch.fov import FieldOfView, heading_index
from roisearch.planners.base import Progress, Scene, World, cells_of, remark_on
from roisearch.planners.packing import fading_of, farthest, forest_of, land_of, ranging_of, sight_of
from roisearch.planners.puct.decide import GIVEN, decide
from roisearch.planners.puct.settings import PuctSettings
from roisearch.planners.warm import warm_up
from roisearch.regions import Regions

_CHUNK = 32
"""Iterations between two looks at the clock."""

_MOST_NODES = 1 << 14
"""Nodes of a tree whose size only the deadline limits; a full tree is searched on without growing."""


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
        self._fov = fov
        self._world = World(fov, flyable, regions)
        self._scene: Scene | None = None
        self._trip: _Trip | None = None

    def _enter(self, scene: Scene) -> None:
        """Make room for everything that depends on the map."""
        self._scene = scene
        self._trip = None
        s, fov = self.settings, self._fov
        rows, cols = scene.ground.shape
        cells = rows * cols
        is_open = scene.ground.is_open
        regions = scene.regions if s.options else 0
        slots = regions if s.most_regions is None else min(regions, s.most_regions)
        actions, k = 4 + slots, len(fov.p_tp)
        nodes = 1 + min(s.iterations or _MOST_NODES, _MOST_NODES)
        forest = scene.forest
        roots = forest.root[:regions].copy()
        if regions and not s.elsewhere:
            roots[0] = -1
        self._random = np.zeros(1, dtype=np.uint64)
        self._grown = np.zeros(1, dtype=np.int64)
        self._shown = np.zeros((actions, 2))
        self._path = np.zeros((2, rows + cols + 64 if s.commit == "trip" else AHEAD), dtype=np.int64)
        self._goals = np.full((slots, 3), -1, dtype=np.int64)
        self._chosen = np.arange(slots) if slots == regions else np.full(slots, -1)
        self._parcel = GIVEN.pack(
            **forest_of(scene, roots),
            **land_of(scene),
            **sight_of(fov, detection=s.gain == "detection"),
            **fading_of(fov, cells, s.fades, s.rollout + 8 * (rows + cols)),
            **ranging_of(scene, fov, s.alpha),
            sizes=np.maximum(forest.count[:regions], 1),
            goals=self._goals,
            middles=scene.centroids[:regions],
            chosen=self._chosen,
            chosen_roots=roots[:slots].copy(),
            best=np.zeros((2, slots)),
            sources=np.zeros((slots, 4 * k, 3), dtype=np.int64),
            counts=np.zeros(slots, dtype=np.int64),
            means=np.zeros(slots),
            centroids=scene.centroids[:slots].copy(),
            fields=np.zeros((0 if is_open else slots, cells), dtype=np.int32),
            made_for=np.full(slots, -1, dtype=np.int64),
            goal_rule=s.code("goal"),
            choose_by=s.code("choose"),
            margin=s.margin,
            rollout=s.rollout,
            rollout_policy=s.code("rollout_policy"),
            option_reward=s.code("option_reward"),
            backup=s.code("backup"),
            normalise=s.normalise,
            prior=s.code("prior"),
            explore=s.explore,
            discount=s.discount,
            penalty=1.0 / cells if s.penalty is None else s.penalty,
            density=s.factor / s.area**2,
            alpha=s.alpha,
            floor=s.floor,
            child=np.zeros((nodes, actions), dtype=np.int32),
            stats=np.zeros((nodes, 5, actions)),
            visits=np.zeros(nodes),
            trail=np.zeros((s.depth, 4)),
            span=np.zeros(2),
            grown=self._grown,
            random=self._random,
            decay=np.cumprod(np.concatenate(([1.0], np.full(farthest(scene), s.discount)))),
            shown=self._shown,
            path=self._path,
        )

    def redraw(self, regions: Regions) -> Callable[[], None]:
        """Reckon with other regions: see `Redrawable`. A trip that is under way is weighed anew."""
        other = self._world.redrawn(regions)

        def take() -> None:
            self._world, self._scene, self._trip = other, None, None

        return take

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next: see `Planner.plan`."""
        began = time.perf_counter()
        scene = self._world.scene(belief, state.cell)
        if scene is not self._scene:
            self._enter(scene)
        sums = belief.follow(scene.forest)
        held = -1
        if self._trip is not None:
            rest = self._trip.rest(state.cell, belief.hits)
            if rest and self.settings.commit == "trip":
                return self._go_on(belief, scene, sums, self._trip, rest, began)
            if rest and self.settings.commit == "margin":
                held = self._trip.action
        self._random[0] = rng.bit_generator.random_raw()
        row, col = state.cell
        cols = scene.ground.shape[1]
        at, heading = row * cols + col, heading_index(state.heading)
        scale = 1.0 / belief.total
        most = self.settings.iterations
        if most is None and deadline_s is None:
            raise ValueError("a planner without a number of iterations needs a deadline")
        done = 0
        self._grown[0] = 0
        while True:
            chunk = _CHUNK if most is None else most - done
            if deadline_s is not None:
                chunk = min(chunk, _CHUNK)
            action, length = decide(
                at, heading, chunk, held, scale, belief.weights, sums.address, self._parcel.address
            )
            done += chunk
            if done == most or (deadline_s is not None and time.perf_counter() - began >= deadline_s):
                break
        path, value = cells_of(self._path, length), float(self._shown[action, 1])
        goal = divmod(int(self._goals[action - 4, 0]), cols) if action >= 4 else None
        if action >= 4:
            action = 4 + int(self._chosen[action - 4])
        if action >= 4 and self.settings.commit != "never":
            self._trip = _Trip(action, path, goal, value, belief.hits)
        else:
            self._trip = None
        unreachable = scene.unreachable(belief, sums)
        return Decision(
            path,
            action_name(action),
            value,
            Effort(done, time.perf_counter() - began),
            unreachable,
            remark_on(unreachable),
            goal,
            self._options(scene.regions if self.settings.options else 0),
        )

    def _options(self, regions: int) -> NDArray[np.float64]:
        """Visits and value of each action, those without an option included, float [4 + regions, 2]."""
        if len(self._chosen) == regions:
            return self._shown.copy()
        options = np.tile((-1.0, 0.0), (4 + regions, 1))
        options[:4] = self._shown[:4]
        there = self._chosen >= 0
        options[4 + self._chosen[there]] = self._shown[4:][there]
        return options

    def _go_on(
        self,
        belief: Belief,
        scene: Scene,
        sums: ForestSums,
        trip: _Trip,
        rest: tuple[Cell, ...],
        began: float,
    ) -> Decision:
        """The rest of the trip that the planner is committed to."""
        unreachable = scene.unreachable(belief, sums)
        effort = Effort(0, time.perf_counter() - began)
        remark = remark_on(unreachable)
        return Decision(rest, action_name(trip.action), trip.value, effort, unreachable, remark, trip.goal)

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use."""
        warm_up(
            lambda ground: PuctPlanner(self.name, self.settings, fov=self._fov, flyable=ground),
            self._fov,
            progress,
        )


class _Trip:
    """An option under way: its action, cells, goal and value, and the hits seen before it began."""

    def __init__(
        self, action: int, path: tuple[Cell, ...], goal: Cell | None, value: float, hits: int
    ) -> None:
        self.action = action
        self.goal = goal
        self.value = value
        self._path = path
        self._hits = hits
        self._next = 0

    def rest(self, cell: Cell, hits: int) -> tuple[Cell, ...]:
        """What is left to fly from `cell`; nothing when it is over, left, or a hit has come since."""
        if hits != self._hits:
            return ()
        for place in range(self._next, len(self._path) - 1):
            if self._path[place] == cell:
                self._next = place
                return self._path[place + 1 :]
        return ()

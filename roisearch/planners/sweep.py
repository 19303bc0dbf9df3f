"""PUCT over sweeps, the default of `puct-regions-lite`: the object that plans."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import Decision, Effort, SearchState, action_name
from roisearch.fov import HEADINGS, MOVES, FieldOfView, heading_index
from roisearch.kernels import chart as charts
from roisearch.kernels import plans
from roisearch.kernels.sweeps import ANYWHERE, Wave
from roisearch.planners.base import Progress, Scene, World, any_move, remark_on
from roisearch.planners.looks import Watch
from roisearch.planners.sweep_settings import SweepSettings
from roisearch.planners.thinking import Thinking
from roisearch.planners.warm import warm_up
from roisearch.regions import Regions, segment_regions

ROLLOUT_BALANCES = ((0.4, 1.0), (0.33, 1.0), (0.45, 1.0), (0.4, 2.0), (0.4, 0.3), (0.5, 2.0))
PAUSE = 4
"""Steps by the rollout's rule after a hit, before the old plan's sweeps go on."""
UNSEEN = 0.02
"""A new plan is made when so much of the undetected mass was flown over and not reported."""
OPTION_BALANCES = ((0.25, 1.0), (0.6, 0.0), (1.0, 0.0), (0.4, 4.0))


class SweepPlanner:
    """Plans by PUCT over sweeps; see `roisearch.kernels.plans`.

    It keeps its plan from one call to the next. When the drone flew along it and saw nothing, the search
    goes on where it stopped; after a hit, or from another place, it plans anew.

    Args:
        fov: the field of view; its p_tp is used in the tree.
        flyable: bool [rows, cols], None for everything.
        regions: the regions of interest; segmented from the first belief unless given.
    """

    def __init__(
        self,
        settings: SweepSettings | None = None,
        *,
        name: str = "puct-regions-lite",
        fov: FieldOfView,
        flyable: ArrayLike | None = None,
        regions: Regions | None = None,
    ) -> None:
        self.name = name
        self.settings = settings or SweepSettings()
        self._fov = fov
        self._flyable = None if flyable is None else np.array(flyable, dtype=bool)
        self._regions = regions
        self._world: World | None = None
        self._watch: Any = Watch()
        self._scene: Scene | None = None
        self._belief: Belief | None = None
        self._random = np.zeros(1, dtype=np.uint64)
        self._seconds = 0.0  # of one iteration, lately
        self._at_first = 0.0  # mass when the belief was taken over
        self._hits = 0
        self._unseen = 0.0  # mass flown over and not reported

    def _enter(self, belief: Belief, scene: Scene) -> None:
        """Make room for everything that depends on the map."""
        self._scene = scene
        rows, cols = scene.ground.shape
        cells, s = rows * cols, self.settings
        fov = self._fov
        spread, share = spread_of(fov)
        blocks = (-(-rows // charts.BLOCK), -(-cols // charts.BLOCK))
        areas = (-(-blocks[0] // charts.BLOCK), -(-blocks[1] // charts.BLOCK))
        kept = blocks[0] * blocks[1]  # a simulation may change every block; memory is taken only when it does
        mass = np.zeros(cells)
        tops, levels = np.zeros(areas), np.zeros((charts.LEVELS, 2))
        self._chart = charts.Chart(
            rows=rows,
            cols=cols,
            mass=mass,
            worth=mass if fov.is_point else np.zeros(cells),
            peaks=np.zeros(blocks),
            tops=tops,
            levels=levels,
            scale=np.ones(1),
            legal=scene.part.legal,
            offsets=fov.offsets,
            p_tp=fov.p_tp,
            spread=spread,
            share=share,
            is_point=fov.is_point,
            is_open=scene.ground.is_open,
            stamp=np.zeros(kept, dtype=np.int64),
            log=np.zeros(kept, dtype=np.int64),
            old=np.zeros((kept, 2, charts.BLOCK**2)),
            old_peak=np.zeros(kept),
            old_tops=np.zeros_like(tops),
            old_levels=np.zeros_like(levels),
            counters=np.zeros(2, dtype=np.int64),
        )
        room = [np.zeros(0 if scene.ground.is_open else cells, dtype=np.int64) for _ in range(4)]
        self._wave = Wave(room[0], room[1], room[2], room[3], np.zeros(1, dtype=np.int64))
        regions = self._regions
        assert regions is not None
        self._labels = nearest_labels(regions.labels)
        self._home = homes(self._labels, (rows, cols))
        most = 3 * s.horizon + 4096
        tree = plans.Tree(
            path=np.zeros(most, dtype=np.int64),
            trial=np.zeros(most, dtype=np.int64),
            action=np.zeros(most, dtype=np.int64),
            trial_action=np.zeros(most, dtype=np.int64),
            mark=np.zeros(4, dtype=np.int64),
            at=np.zeros(2 + s.horizon // s.spacing, dtype=np.int64),
            stats=np.zeros((2 + s.horizon // s.spacing, 6 + regions.count, 3)),
            worths=np.zeros((2 + s.horizon // s.spacing, 1 + regions.count)),
            scores=np.zeros(1 + regions.count),
            value=np.zeros(3),
        )
        self._rules = self._make_rules(rows, cols, scene.ground.is_open)
        desk = plans.Desk(self._chart, self._rules, self._labels, self._home, self._wave, self._random)
        self._thinking = Thinking(tree, desk, s, anneals=fov.is_point)
        self._viewable = np.ascontiguousarray(scene.part.viewable.ravel())
        self._belief = None

    def _make_rules(self, rows: int, cols: int, is_open: bool) -> plans.Rules:
        s, p = self.settings, float(self._fov.p_tp.max())
        distance = np.arange(rows + cols + 2 if is_open else rows * cols + 2, dtype=np.float64)
        nears = np.array(
            [
                np.maximum(distance + shift, 1.0) ** -power
                for power, shift in ROLLOUT_BALANCES + OPTION_BALANCES
            ]
        )
        return plans.Rules(
            nears=nears,
            followers=len(ROLLOUT_BALANCES),
            chain=s.chain,
            explore=s.explore,
            keep=s.keep,
            spread=s.spread,
            spacing=s.spacing,
            overhead=s.overhead,
            looks_per_halving=1.0 if p == 1.0 else float(np.log(2.0) / -np.log1p(-p)),
            looks_per_step=max(1.0, fresh_per_step(self._fov)),
        )

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

        Raises: ValueError: when the drone cannot be in its cell or cannot leave it, or when there is
            neither a number of iterations nor a deadline.
        """
        began = time.perf_counter()
        if self.settings.iterations is None and deadline_s is None:
            raise ValueError("a planner without a number of iterations needs a deadline")
        if self._world is None:
            if self._regions is None:
                prior = belief.probability()
                self._regions = segment_regions(prior, searchable=prior > 0.0)
            self._world = World(self._fov, self._flyable, self._regions)
        scene = self._world.scene(belief, state.cell)
        if scene is not self._scene:
            self._enter(belief, scene)
        self._random[0] = rng.bit_generator.random_raw()
        pose = (state.cell[0], state.cell[1], heading_index(state.heading))
        self._follow(belief, state.cell, pose)
        tree, chart, rules = self._tree, self._chart, self._rules
        row, col, heading = pose
        labels, home, wave = self._labels, self._home, self._wave
        horizon = self.settings.horizon
        if tree.mark[plans.LENGTH] - tree.mark[plans.NOW] < horizon - min(512, horizon // 4):
            plans.extend(row, col, heading, chart, tree, rules, labels, home, horizon, wave)
            self._thinking.carried_on()
        for each in self._thinking.plans():
            plans.settle_root(row, col, chart, each, rules, labels, home)
        done = 0
        most = self.settings.iterations
        if self._has_nothing_to_think_about():
            most = 0
        while (most is None or done < most) and self._thinking.is_restless():
            before = time.perf_counter()
            if deadline_s is not None and before + self._seconds > began + deadline_s:
                break
            self._thinking.iterate(pose)
            self._seconds = 0.9 * self._seconds + 0.1 * (time.perf_counter() - before)
            done += 1
        return self._decide(belief, scene, state.cell, done, began)

    @property
    def _tree(self) -> plans.Tree:
        """The plan."""
        return self._thinking.tree

    def _has_nothing_to_think_about(self) -> bool:
        """Whether so little is left that the order in which it is searched hardly matters."""
        return bool(self._tree.value[plans.UNDETECTED] < self.settings.least * self._at_first)

    def _follow(self, belief: Belief, cell: tuple[int, int], pose: tuple[int, int, int]) -> None:
        """Bring map and plan to where the drone is and what was seen."""
        chart, tree = self._chart, self._tree
        changes: Any = belief.sums_of(self._watch)
        everything, touched = changes.take()
        if everything or belief is not self._belief:
            differing = self._differing(belief)
            if differing is None:
                self._load(belief)
                self._replan(pose, -1)
                self._pose = pose
                return
            self._belief, touched = belief, [differing]
        steps = self._steps_flown(cell)
        if steps > 0:
            before = tree.value[plans.EXPECTED]
            flown = plans.advance(steps, *self._pose, chart, tree)
            self._thinking.flown(before - tree.value[plans.EXPECTED])
            seen = self._seen(self._pose, steps)
            touched = [*touched, *seen]
            self._pose = flown
        lost = steps < 0 or self._pose != pose
        self._pose = pose
        changed = False
        if touched:
            changed = self._correct(belief, np.unique(np.concatenate(touched), axis=0))
        if lost or belief.hits != self._hits or self._unseen > UNSEEN * tree.value[plans.UNDETECTED]:
            self._replan(pose, 0 if lost else PAUSE)
        elif changed:
            self._thinking.corrected(tree.value[plans.UNDETECTED], pose)
        self._hits = belief.hits
        if tree.mark[plans.NOW] > self.settings.horizon:
            self._thinking.shift()

    def _differing(self, belief: Belief) -> NDArray[np.int64] | None:
        """Where `belief` differs from what the chart was made from, cells [k, 2]; None if that is another map.

        A caller may hand over a copy each time, with what it expects to see on the way to where it plans from.
        """
        if self._belief is None:
            return None
        flat = np.flatnonzero(belief.weights != self._known)
        if flat.size > self._known.size // 4:
            return None
        return np.stack(np.divmod(flat, self._chart.cols), axis=1)

    def _replan(self, pose: tuple[int, int, int], pause: int) -> None:
        """Plan anew from here; see `plans.replan`."""
        self._unseen = 0.0
        self._thinking.replanned()
        plans.replan(
            *pose, self._chart, self._tree, self._rules, self._labels, self._home, self.settings.horizon,
            pause, self._wave,
        )  # fmt: skip

    def _load(self, belief: Belief) -> None:
        """Take over the whole belief."""
        self._belief = belief
        self._known = belief.weights.copy()
        self._hits = belief.hits
        worth = belief.weights * self._share(belief, np.arange(self._known.size))
        self._chart.mass[:] = np.where(self._viewable, worth, 0.0)
        charts.draw_up(self._chart)
        self._at_first = float(self._chart.mass.sum())
        self._tree.value[plans.UNDETECTED] = self._at_first
        self._tree.mark[:] = 0

    def _steps_flown(self, cell: tuple[int, int]) -> int:
        """How many steps of the plan were flown to get to `cell`; -1 when it is not on the plan."""
        row, col, _ = self._pose
        if (row, col) == cell:
            return 0
        now, length = self._tree.mark[plans.NOW], self._tree.mark[plans.LENGTH]
        ahead = self._tree.path[now : min(length, now + 2 * self.settings.path)]
        found = np.flatnonzero(ahead == cell[0] * self._chart.cols + cell[1])
        return int(found[0]) + 1 if found.size else -1

    def _seen(self, pose: tuple[int, int, int], steps: int) -> list[NDArray[np.int64]]:
        """The cells that the last steps looked at."""
        row, col, _ = pose
        now = self._tree.mark[plans.NOW]
        seen = []
        for flat in self._tree.path[now - steps : now].tolist():
            to_row, to_col = divmod(flat, self._chart.cols)
            heading = (2 if to_row > row else 0) if to_row != row else (1 if to_col > col else 3)
            row, col = to_row, to_col
            seen.append(self._fov.cells((row, col), HEADINGS[heading], (self._chart.rows, self._chart.cols)))
        return seen

    def _correct(self, belief: Belief, cells: NDArray[np.int64]) -> bool:
        """Set the mass of cells to what the belief makes of them for the planner; whether any differed."""
        flat = cells[:, 0] * self._chart.cols + cells[:, 1]
        self._known[flat] = belief.weights[flat]
        worth = belief.weights[flat] * self._share(belief, flat)
        actual = np.where(self._viewable[flat], worth, 0.0)
        expected = self._chart.mass[flat]
        wrong = np.flatnonzero(np.abs(actual - expected) > 1e-12 * np.maximum(actual, expected))
        for i in wrong.tolist():
            charts.change(self._chart, int(cells[i, 0]), int(cells[i, 1]), float(actual[i]), False)
        self._tree.value[plans.UNDETECTED] += float((actual - expected)[wrong].sum())
        looks = (actual > 2.0 * expected) | (
            actual < 0.5 * expected
        )  # flown over and not reported, or reported late
        self._unseen += float((actual - expected)[looks].sum())
        return bool(wrong.size)

    def _share(self, belief: Belief, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """What part of the weights of `cells` [k] counts; see `SweepSettings.contradicted`.

        A false alarm and the miss at the next look leave a cell about where it was before both, and it is as
        much worth a look as its neighbours. But they lie in the drone's way, while coming back for a single cell
        takes two steps or more. A cell whose hits outweigh its misses counts whole.
        """
        share: NDArray[np.float64] = np.power(self.settings.contradicted, belief.contradicted(cells))
        return share

    def _decide(
        self, belief: Belief, scene: Scene, cell: tuple[int, int], iterations: int, began: float
    ) -> Decision:
        """The next cells of the plan, and what was thought of the other actions."""
        tree, cols = self._tree, self._chart.cols
        now, length = int(tree.mark[plans.NOW]), int(tree.mark[plans.LENGTH])
        unreachable = scene.unreachable(belief, belief.sums_of(scene.forest))
        if length == now:  # nothing left anywhere: any move will do
            return any_move(scene, SearchState(cell, HEADINGS[self._pose[2]]), began, unreachable)
        ahead = tree.path[now : min(length, now + self.settings.path)].tolist()
        path = tuple(divmod(flat, cols) for flat in ahead)
        region = int(tree.action[now])
        move = next(
            i for i in range(4)
            if (cell[0] + (i == 2) - (i == 0), cell[1] + (i == 1) - (i == 3)) == path[0]
        )  # fmt: skip
        chosen = move if region == ANYWHERE else 4 + region
        scale = float(tree.value[plans.UNDETECTED])
        scale = 1.0 / scale if scale > 0.0 else 0.0
        root = tree.stats[0]
        expected = float(tree.value[plans.EXPECTED])
        options = np.stack([root[:-1, plans.N_A], -scale * (expected + root[:-1, plans.LOSS])], axis=1)
        options[root[:-1, plans.N_A] == 0.0, 0] = -1.0
        options[chosen] = (max(0.0, options[chosen, 0]) + root[-1, plans.N_A], -scale * expected)
        return Decision(
            path=path,
            action=action_name(chosen),
            value=-scale * expected,
            effort=Effort(iterations, time.perf_counter() - began),
            unreachable=unreachable,
            remark=remark_on(unreachable),
            options=options,
        )

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use, on a small map."""

        def make(flyable: NDArray[np.bool_]) -> SweepPlanner:
            settings = replace(self.settings, iterations=1, horizon=64)
            planner = SweepPlanner(settings, name=self.name, fov=self._fov, flyable=flyable)
            planner._exercise(flyable.shape)
            return planner

        warm_up(make, self._fov, progress)

    def _exercise(self, shape: tuple[int, ...]) -> None:
        """Use what two decisions may not: looks without a hit, a challenger, and carrying the plan on."""
        belief = Belief(1.0 + np.indices(shape).sum(axis=0))
        state, rng = SearchState((0, 0)), np.random.default_rng(0)
        for _ in range(2):
            cell = self.plan(belief, state, rng).path[0]
            heading = next(
                name for name, (down, right) in zip(HEADINGS, MOVES, strict=True)
                if (state.cell[0] + down, state.cell[1] + right) == cell
            )  # fmt: skip
            state = SearchState(cell, heading)
            belief.observe([cell], False, 0.9, 0.9)
        self.plan(belief, state, rng)
        self._thinking.exercise(self._pose)


def spread_of(fov: FieldOfView) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """From where a cell is seen: offsets int [n, 2], and p_tp from there over the headings, float [n]."""
    total: dict[tuple[int, int], float] = {}
    for seen in fov.offsets:
        for (row, col), p in zip(seen.tolist(), fov.p_tp.tolist(), strict=True):
            total[-row, -col] = total.get((-row, -col), 0.0) + p / 4.0
    return np.array(list(total), dtype=np.int64).reshape(-1, 2), np.array(list(total.values()))


def fresh_per_step(fov: FieldOfView) -> float:
    """How many new cells a step straight ahead sees."""
    now = {tuple(cell) for cell in fov.offsets[1].tolist()}
    before = {(row, col - back) for row, col in now for back in range(1, 8)}
    return float(len(now - before))


def nearest_labels(labels: NDArray[np.integer[Any]]) -> NDArray[np.int32]:
    """Each cell's region, and for a cell in none the nearest one's; 0 everywhere when there is no region."""
    from scipy import ndimage

    if not labels.any():
        return np.zeros(labels.size, dtype=np.int32)
    nearest = ndimage.distance_transform_edt(labels == 0, return_distances=False, return_indices=True)
    return np.ascontiguousarray(labels[tuple(nearest)].ravel(), dtype=np.int32)


def homes(labels: NDArray[np.int32], shape: tuple[int, int]) -> NDArray[np.int32]:
    """The label that all cells of a block have, -1 where they differ: int [blocks], row by row."""
    rows, cols = shape
    size = charts.BLOCK
    full = np.pad(labels.reshape(shape), ((0, -rows % size), (0, -cols % size)), mode="edge")
    tiles = full.reshape(full.shape[0] // size, size, full.shape[1] // size, size)
    least, most = tiles.min(axis=(1, 3)), tiles.max(axis=(1, 3))
    return np.ascontiguousarray(np.where(least == most, least, -1).ravel(), dtype=np.int32)

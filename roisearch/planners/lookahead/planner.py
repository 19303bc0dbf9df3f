"""The default of `puct-regions-lite`, the lite MDP-O with options that sweep: the object that plans."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import Decision, Effort, SearchState, action_name
from roisearch.fov import HEADINGS, MOVES, FieldOfView, heading_index
from roisearch.kernels.records import Pose
from roisearch.planners.base import Progress, Scene, World, any_move, remark_on
from roisearch.planners.lookahead import chart as charts
from roisearch.planners.lookahead import plans
from roisearch.planners.lookahead.desk import make_chart, make_rules, make_tree, region_map
from roisearch.planners.lookahead.others import OthersLooks, fill
from roisearch.planners.lookahead.settings import LookaheadSettings
from roisearch.planners.lookahead.small import MOST_CELLS, tour_from
from roisearch.planners.lookahead.sweeps import ANYWHERE
from roisearch.planners.lookahead.thinking import Kept, Thinking
from roisearch.planners.warm import warm_up
from roisearch.regions import Regions, segment_regions
from roisearch.watch import LOOKED, Watch

PAUSE = 4
"""Steps by the rollout's rule after a hit, before the old plan's sweeps go on."""
OPENINGS = (0.3, 0.05)
"""Down to which parts of its largest worth a region may be swept first by one that comes to others."""
NEARBY = 16
"""From how many steps away a hit of another searcher is looked into at once."""
UNSEEN = 0.02
"""A new plan is made when so much of the undetected mass was flown over and not reported."""
MAKING = 0.5
"""Part of the deadline in which a plan may be made anew or carried on; the rest of it follows in the next decisions."""
LEAST_STEPS = 128
"""So many steps are planned whatever they take."""


class LookaheadPlanner:
    """Plans by PUCT over sweeps; see `roisearch.planners.lookahead.plans`.

    It keeps its plan from one call to the next. When the drone flew along it and saw nothing, the search
    goes on where it stopped; after a hit, or from another place, it plans anew.

    Args:
        fov: the field of view; its p_tp is used in the tree.
        visibility: float [rows, cols], how much of that a look has at each cell; None: all. A cell's mass counts as
            much less, as if the rest could never be seen; what the looks are really worth, the belief says after each.
        flyable: bool [rows, cols], None for everything.
        regions: the regions of interest; segmented from the first belief unless given.

    Attributes:
        thinking: the plan, the challenger, and what they lie on; there from the first `plan` on.
        pose: where the plan begins; likewise.
    """

    thinking: Thinking
    pose: Pose

    def __init__(
        self,
        settings: LookaheadSettings | None = None,
        *,
        name: str = "puct-regions-lite",
        fov: FieldOfView,
        flyable: ArrayLike | None = None,
        regions: Regions | None = None,
        visibility: ArrayLike | None = None,
    ) -> None:
        self.name = name
        self._visibility = None if visibility is None else np.array(visibility, dtype=np.float64).ravel()
        self.settings = settings or LookaheadSettings()
        self._fov = fov
        self._flyable = None if flyable is None else np.array(flyable, dtype=bool)
        self._regions = regions
        self._world: World | None = None
        self._watch = Watch()
        self._scene: Scene | None = None
        self._belief: Belief | None = None
        self._random = np.zeros(1, dtype=np.uint64)
        self._seconds = 0.0  # of one iteration, lately
        self._step_s = 0.0  # of one step of a plan that is made or carried on, lately; 0: none was made yet
        self._make_until = math.inf  # the time until which the present decision may do that
        self._at_first = 0.0  # mass when the belief was taken over
        self._hits = 0
        self._unseen = 0.0  # mass flown over and not reported
        self._others: tuple[OthersLooks, int] | None = None  # of a fleet, when there is one
        self._came = False  # whether there was a plan beside others

    def reckon_with_others(self, looks: OthersLooks, searchers: int) -> None:
        """From the next `plan` on take `looks` of others as flown; `searchers` there are, this one included."""
        self._others = (looks, searchers)

    def committed(self) -> NDArray[np.int64]:
        """The whole plan of the last decision, int [k, 2]: the cells to enter, one a step."""
        now, length = self._tree.mark[plans.NOW], self._tree.mark[plans.LENGTH]
        return np.stack(np.divmod(self._tree.path[now:length], self._chart.cols), axis=1)

    def redraw(self, regions: Regions) -> Callable[[], None]:
        """Reckon with other regions: see `Redrawable`. The plan stays as it is, and is thought about again."""
        if self._world is None or self._scene is None:
            return functools.partial(setattr, self, "_regions", regions)
        drawn = region_map(regions, self._scene.ground.shape)

        def take() -> None:
            self._regions = regions
            for own, other in zip(
                (self._chart.labels, self._chart.home, self._chart.homes), drawn, strict=True
            ):
                own[:] = other
            self.thinking.redrawn(regions)

        return take

    def _enter(self, scene: Scene) -> None:
        """Make room for everything that depends on the map."""
        self._scene = scene
        assert self._regions is not None
        chart = make_chart(scene.ground, scene.part, self._regions)
        rules = make_rules(self.settings, scene.ground)
        tree = make_tree(self.settings, self._regions.count)
        self.thinking = Thinking(
            tree, plans.Desk(chart, rules, self._random), self.settings, anneals=self._fov.is_point
        )
        self._viewable = np.ascontiguousarray(scene.part.viewable.ravel())
        self._belief = None

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
        self._make_until = math.inf if deadline_s is None else began + MAKING * deadline_s
        if self._world is None:
            if self._regions is None:
                prior = belief.probability()
                self._regions = segment_regions(prior, searchable=prior > 0.0)
            self._world = World(self._fov, self._flyable, self._regions, bare=True)
        scene = self._world.scene(belief, state.cell)
        if scene is not self._scene:
            self._enter(scene)
        self._random[0] = rng.bit_generator.random_raw()
        pose = Pose(state.cell[0], state.cell[1], heading_index(state.heading))
        self._tell()
        self._follow(belief, state.cell, pose)
        tree, horizon = self._tree, self.settings.horizon
        left = int(tree.mark[plans.LENGTH] - tree.mark[plans.NOW])
        if left < horizon - min(512, horizon // 4):
            with self._making(left):
                plans.extend(pose, tree, self.thinking.desk, left + self._affordable(horizon - left))
            self.thinking.carried_on()
        for each in self.thinking.plans():
            plans.settle_root(pose, each, self.thinking.desk)
        if self._others is not None:
            self._mind_others(pose)
        done = 0
        most = self.settings.iterations
        if self._has_nothing_to_think_about():
            most = 0
        while (most is None or done < most) and self.thinking.is_restless():
            before = time.perf_counter()
            if deadline_s is not None and before + self._seconds > began + deadline_s:
                break
            self.thinking.iterate(pose)
            self._seconds = 0.9 * self._seconds + 0.1 * (time.perf_counter() - before)
            done += 1
        if self._others is not None and self._others[1] == 1:  # alone from now on
            self._others, self._came = None, False
        return self._decide(belief, scene, state.cell, done, began)

    def _mind_others(self, pose: Pose) -> None:
        """Think on, as the others have planned; from a plan made without them try another region first."""
        self.thinking.others_planned()
        if not self._came:
            self._came = True
            for share in OPENINGS:
                for region in range(1, self.regions + 1):
                    self.thinking.open_with(pose, region, share, whatever=False)
                    plans.settle_root(pose, self._tree, self.thinking.desk)

    @property
    def regions(self) -> int:
        """How many regions there are; 0 while they are not known, before the first `plan`."""
        return 0 if self._regions is None else self._regions.count

    def expected(self) -> float:
        """The area under the survival curve of all searchers, in steps of this one; of the last plan."""
        return float(self._tree.value[plans.EXPECTED])

    def open_with(self, region: int, share: float) -> None:
        """Make a plan that sweeps `region` down to `share` of its largest worth first, and anything after."""
        self._tell()
        plans.settle_root(self.pose, self._tree, self.thinking.desk)
        self.thinking.open_with(self.pose, region, share, whatever=True)

    def kept(self) -> Kept:
        """The present plan, to be taken up again before anything is flown."""
        return self.thinking.kept()

    def take_up(self, kept: Kept) -> None:
        """Go back to a plan that was kept."""
        self._tell()
        self.thinking.take_up(kept, self.pose)

    def _tell(self) -> None:
        """Let the simulations know what the others are going to look at."""
        if self._others is not None:
            looks, searchers = self._others
            fill(self._chart.others, looks, searchers, self._chart.cols)

    @property
    def _tree(self) -> plans.PlanTree:
        """The plan."""
        return self.thinking.tree

    @property
    def _chart(self) -> charts.Chart:
        """The map in thought."""
        return self.thinking.desk.chart

    def _has_nothing_to_think_about(self) -> bool:
        """Whether so little is left that the order in which it is searched hardly matters."""
        return bool(self._tree.value[plans.UNDETECTED] < self.settings.least * self._at_first)

    def _follow(self, belief: Belief, cell: tuple[int, int], pose: Pose) -> None:
        """Bring map and plan to where the drone is and what was seen."""
        tree = self._tree
        self._looked = belief.follow(LOOKED)
        everything, touched = belief.follow(self._watch).take()
        if everything or belief is not self._belief:
            differing = self._differing(belief)
            if differing is None:
                self._load(belief)
                self._replan(pose, -1)
                self.pose = pose
                return
            self._belief, touched = belief, [differing]
        steps = self._steps_flown(pose, touched)
        if steps > 0:
            before = tree.value[plans.EXPECTED]
            flown = plans.advance(steps, self.pose, tree, self.thinking.desk)
            self.thinking.flown(before - tree.value[plans.EXPECTED])
            last = self._tree.mark[plans.NOW]
            touched = [*touched, *self._looks(self.pose, self._tree.path[last - steps : last])]
            self.pose = flown
        lost = steps < 0 or self.pose != pose
        self.pose = pose
        changed = False
        if touched:
            changed = self._correct(belief, np.unique(np.concatenate(touched), axis=0))
        if (
            lost
            or self._concerns_it(belief, cell, touched)
            or self._unseen > UNSEEN * tree.value[plans.UNDETECTED]
        ):
            self._replan(pose, 0 if lost else PAUSE)
        elif changed or self._others is not None:
            self.thinking.corrected(tree.value[plans.UNDETECTED], pose)
        self._hits = belief.hits
        if tree.mark[plans.NOW] > self.settings.horizon:
            self.thinking.shift()

    def _concerns_it(
        self, belief: Belief, cell: tuple[int, int], touched: Sequence[NDArray[np.int64]]
    ) -> bool:
        """Whether there was a hit, and beside others one nearby: a far one's hit is no reason for a pause here."""
        if belief.hits == self._hits or self._others is None or not touched:
            return belief.hits != self._hits
        cells = np.concatenate(touched)
        near = cells[np.abs(cells - np.array(cell)).sum(axis=1) <= NEARBY]
        flat = near[:, 0] * self._chart.cols + near[:, 1]
        return bool(self._looked.raised(flat, belief.weights).any())

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

    def _replan(self, pose: Pose, pause: int) -> None:
        """Plan anew from here, as far ahead as there is time for; see `plans.replan`."""
        self._unseen = 0.0
        self.thinking.replanned()
        ways = 1 if pause < 0 else 2  # the old plan's sweeps are tried as well
        horizon = self._affordable(ways * self.settings.horizon) // ways
        with self._making(0, ways):
            plans.replan(pose, self._tree, self.thinking.desk, horizon, pause)
        if self._chart.mass.size <= MOST_CELLS and self._fov.is_point and self._others is None:
            self._try_a_tour(pose)

    def _try_a_tour(self, pose: Pose) -> None:
        """Let a tour be the plan, if it is better than what was planned; see `small`."""
        shape, random = (self._chart.rows, self._chart.cols), int(self._random[0])
        mass = self._chart.mass.reshape(shape)
        cells = tour_from(pose, mass, self._fov, self._flyable, random, self._make_until)
        planned, expected = self.thinking.kept(), self.expected()
        cells = cells[: self.settings.horizon]
        if cells.size:
            self.thinking.take_up(Kept(cells, np.full(cells.size, ANYWHERE)), pose)
            if self.expected() >= expected:
                self.thinking.take_up(planned, pose)

    def _affordable(self, most: int) -> int:
        """How many of `most` steps there is time to plan in this decision; never so few that it would be blind."""
        if self._step_s <= 0.0 or math.isinf(self._make_until):
            return most
        there = int(max(0.0, self._make_until - time.perf_counter()) / self._step_s)
        return min(most, max(LEAST_STEPS, there))

    @contextmanager
    def _making(self, before: int, ways: int = 1) -> Iterator[None]:
        """Note what a step takes of those that a plan has more than `before`, each tried in so many `ways`."""
        began = time.perf_counter()
        yield
        made = ways * (int(self._tree.mark[plans.LENGTH] - self._tree.mark[plans.NOW]) - before)
        if made > 0:
            self._step_s = (time.perf_counter() - began) / made

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

    def _steps_flown(self, pose: Pose, touched: Sequence[NDArray[np.int64]]) -> int:
        """How many steps of the plan were flown to get to `pose`; -1 when its cell is not on the plan.

        A plan may enter a cell more than once within a few steps, so the one that ends with its heading is meant; and
        it may lead around to where it began, which it has when the looks of its first step are among those `touched`.
        """
        cols = self._chart.cols
        now, length = self._tree.mark[plans.NOW], self._tree.mark[plans.LENGTH]
        ahead = self._tree.path[now : min(length, now + 2 * self.settings.path)]
        found = np.flatnonzero(ahead == pose.row * cols + pose.col)
        before = np.where(found > 0, ahead[found - 1], self.pose.row * cols + self.pose.col)
        down, right = MOVES[pose.heading]
        as_told = found[before == (pose.row - down) * cols + pose.col - right]
        stayed = (self.pose.row, self.pose.col) == (pose.row, pose.col)
        if stayed and not (as_told.size and self._has_seen(ahead[:1], touched)):
            return 0
        if as_told.size:
            return int(as_told[0]) + 1
        return int(found[0]) + 1 if found.size else -1

    def _has_seen(self, ahead: NDArray[np.int64], touched: Sequence[NDArray[np.int64]]) -> bool:
        """Whether all looks along the first cells of the plan are among those `touched`."""
        looks = {tuple(cell) for part in self._looks(self.pose, ahead) for cell in part.tolist()}
        return bool(touched) and looks <= {tuple(cell) for part in touched for cell in part.tolist()}

    def _looks(self, pose: Pose, path: NDArray[np.int64]) -> list[NDArray[np.int64]]:
        """The cells looked at in each step along `path`, flat cells, from `pose`."""
        row, col = pose.row, pose.col
        seen = []
        for flat in path.tolist():
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
        if self._others is not None:  # less than expected was seen by another
            looks &= actual > expected
        self._unseen += float((actual - expected)[looks].sum())
        return bool(wrong.size)

    def _share(self, belief: Belief, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """What part of the weights of `cells` [k] counts; see `LookaheadSettings.contradicted`.

        A false alarm and the miss at the next look leave a cell about where it was before both, and it is as
        much worth a look as its neighbours. But they lie in the drone's way, while coming back for a single cell
        takes two steps or more. A cell whose hits outweigh its misses counts whole.
        """
        share: NDArray[np.float64] = np.power(
            self.settings.contradicted, self._looked.contradicted(cells, belief.weights)
        )
        return share if self._visibility is None else share * self._visibility[cells]

    def _decide(
        self, belief: Belief, scene: Scene, cell: tuple[int, int], iterations: int, began: float
    ) -> Decision:
        """The next cells of the plan, and what was thought of the other actions."""
        tree, cols = self._tree, self._chart.cols
        now, length = int(tree.mark[plans.NOW]), int(tree.mark[plans.LENGTH])
        unreachable = scene.unreachable(belief, belief.follow(scene.forest))
        if length == now:  # nothing left anywhere: any move will do
            return any_move(scene, SearchState(cell, HEADINGS[self.pose.heading]), began, unreachable)
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

        def make(flyable: NDArray[np.bool_]) -> LookaheadPlanner:
            settings = replace(self.settings, iterations=1, horizon=64)
            planner = LookaheadPlanner(settings, name=self.name, fov=self._fov, flyable=flyable)
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
        self.thinking.exercise(self.pose)

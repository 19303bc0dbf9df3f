"""A planner that knows when the battery ends: until then another one's plan, at last the course that finds most."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import Cell, Decision, Effort, SearchState
from roisearch.directions import direction_between, direction_index, moves_allowed
from roisearch.endurance import Endurance
from roisearch.fov import FieldOfView
from roisearch.kernels.orienteering import Field, Outset, improve, judge, lay, room_for
from roisearch.kernels.records import Ints
from roisearch.motion import Motion
from roisearch.planners.base import Planner, Progress
from roisearch.planners.ending.settings import EndingSettings

CANDIDATES = 2000
"""The most cells that are tried as stops, the best ones."""
SPARE = 1.5
"""Room for courses so many times as long as straight flight in the time that is left; and no fewer cells than LEAST."""
LEAST = 64
NOWHERE: Ints = np.zeros(0, dtype=np.int64)


@runtime_checkable
class FarSighted(Protocol):
    """A planner whose plan reaches beyond the cells of its decision."""

    def ahead(self, most: int) -> tuple[Cell, ...]:
        """The cells that the plan enters after the last decision's state, `most` at most."""
        ...


class Course(NamedTuple):
    """Stops, flat cells, and what looks along them find in time, as mass of the belief."""

    stops: Ints
    found: float


class EndingPlanner:
    """Flies what another planner plans, and at the end of a battery the course that finds most before the way home.

    A course is judged exactly: by the motion, by Bayes' rule for looks in vain, and cell by cell until the first from
    which the aircraft would not get home any more. The other planner's own plan is one of the courses, judged so as
    well. So by this reckoning nothing is flown that finds less than that plan would until it is cut off.

    Args:
        planner: what is flown until then, and around a suspect.
        fov: what a look sees; where it is no point, the end is not planned.
        motion: how long courses take.
        flyable: bool [rows, cols], None for everything.
        visibility: float [rows, cols], how much of the field of view's p_tp a look has at each cell; None: all.
        heights: float [rows, cols], metres at which each cell is flown over; None: all at one height.
    """

    def __init__(
        self,
        planner: Planner,
        *,
        fov: FieldOfView,
        motion: Motion,
        flyable: ArrayLike | None = None,
        visibility: ArrayLike | None = None,
        heights: ArrayLike | None = None,
        settings: EndingSettings | None = None,
    ) -> None:
        self.planner, self.name = planner, planner.name
        self.settings = settings or EndingSettings()
        self._fov, self._motion = fov, motion
        self._flyable = None if flyable is None else np.array(flyable, dtype=bool)
        self._visibility = None if visibility is None else np.array(visibility, dtype=np.float64)
        self._heights = None if heights is None else np.array(heights, dtype=np.float64)
        self._allowed: NDArray[np.uint8] = np.zeros(0, dtype=np.uint8)
        self._course: Ints = NOWHERE  # the flat cells that the course enters that is flown
        self._random = np.zeros(1, dtype=np.uint64)
        self._room = room_for(LEAST)

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
        endurance: Endurance | None = None,
    ) -> Decision:
        """Where to go next: see `Planner.plan`. `endurance` is what the battery leaves from `state` on; None: enough.

        Raises: ValueError as the planner does that is flown.
        """
        began = time.perf_counter()
        ends = endurance is not None and self._ends(belief, state, endurance)
        share = deadline_s if deadline_s is None or not ends else 0.5 * deadline_s
        decision = self.planner.plan(belief, state, rng, deadline_s=share)
        if endurance is None or not ends:
            self._course = NOWHERE
            return decision
        self._random[0] = rng.bit_generator.random_raw()
        until = np.inf if deadline_s is None else began + deadline_s
        return self._decide(belief, state, endurance, decision, until)

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile what the planner needs and what the end needs, on a small map."""
        self.planner.warm_up(progress)
        if not self._fov.is_point:
            return
        allowed = moves_allowed(np.ones((8, 8), dtype=bool), self._motion.diagonal)
        even = np.ones(64)
        flat = self._motion.climb(None)
        field = Field(
            even, 0.5 * even, 0.0 * even, allowed.ravel(), np.arange(64), 8, self._motion.diagonal, flat
        )
        self._better(Outset(0, 2, 0.0, 60.0), Course(np.array([63]), 0.0), field, 1, np.inf)

    def reckon_with(self, motion: Motion) -> None:
        """Let courses take what `motion` says from now on; it has the same cells and neighbours."""
        self._motion = motion

    # When

    def _ends(self, belief: Belief, state: SearchState, endurance: Endurance) -> bool:
        """Whether the end is to be planned now."""
        if endurance.home_s.shape != belief.shape:
            raise ValueError(f"the belief's map is {belief.shape}, home_s is {endurance.home_s.shape}")
        if self._heights is not None and self._heights.shape != belief.shape:
            raise ValueError(f"the belief's map is {belief.shape}, heights are {self._heights.shape}")
        near = endurance.search_s(state.cell) <= self.settings.horizon_s
        sure = float(belief.weights.max()) >= self.settings.suspect * belief.total
        return self._fov.is_point and not self._motion.is_steps and near and not sure

    # What

    def _decide(
        self, belief: Belief, state: SearchState, endurance: Endurance, decision: Decision, until: float
    ) -> Decision:
        """The best course that is known, made better; the planner's own decision where that is as good."""
        s, cols = self.settings, belief.shape[1]
        field = self._field(belief, endurance)
        at = state.cell[0] * cols + state.cell[1]
        pose = Outset(at, direction_index(state.heading), state.speed_mps, endurance.remaining_s)
        self._room = room_for(max(LEAST, int(SPARE * endurance.remaining_s / field_step(self._motion))))
        own = self._judged(pose, self._own(decision, pose, cols), field)
        kept = self._judged(pose, self._kept(at, cols), field)
        best, spells = max(own, kept, key=lambda course: course.found), s.spells
        if not self._course.size:
            best, spells = self._begin(pose, own, field, until), s.first // 2
        best = self._better(pose, best, field, spells, until)
        course = self._entered(pose, best.stops, field)
        self._course = course
        if not course.size or best.found <= own.found:
            return decision
        path = tuple(divmod(cell, cols) for cell in course[: s.path].tolist())
        share = best.found / belief.total
        ending = f"the end of the battery: {share:.1%} can still be found"
        effort = Effort(decision.effort.iterations + spells, decision.effort.seconds)
        return decision._replace(
            path=path, action=direction_between(state.cell, path[0]), value=share, effort=effort, goal=path[-1],
            remark="; ".join(said for said in (decision.remark, ending) if said),
        )  # fmt: skip

    def _field(self, belief: Belief, endurance: Endurance) -> Field:
        """What is flown over, with the cells that are worth a stop and within reach."""
        rows, cols = belief.shape
        if self._allowed.size != rows * cols:
            flyable = np.ones(belief.shape, dtype=bool) if self._flyable is None else self._flyable
            self._allowed = np.ascontiguousarray(moves_allowed(flyable, self._motion.diagonal).ravel())
            self._p = np.full(rows * cols, float(self._fov.p_tp[0]))
            if self._visibility is not None:
                self._p *= self._visibility.ravel()
        home = np.ascontiguousarray(endurance.home_s.ravel())
        worth = np.where((self._allowed > 0) & (home <= endurance.remaining_s), self._p * belief.weights, 0.0)
        candidates = np.argsort(-worth, kind="stable")[:CANDIDATES]
        candidates = candidates[worth[candidates] > 0.0].astype(np.int64)
        return Field(
            belief.weights.copy(), self._p, home, self._allowed, candidates, cols, self._motion.diagonal,
            self._motion.climb(self._heights),
        )  # fmt: skip

    def _own(self, decision: Decision, pose: Outset, cols: int) -> Ints:
        """The stops of the other planner's plan."""
        path: Sequence[Cell] = decision.path
        if isinstance(self.planner, FarSighted):
            path = self.planner.ahead(self._room.rows.size - 1) or path
        flat = np.array([row * cols + col for row, col in path], dtype=np.int64)
        return corners(pose.cell, flat, cols)

    def _kept(self, at: int, cols: int) -> Ints:
        """The stops of the course that is flown, without what is behind; none when the aircraft left it."""
        behind = np.flatnonzero(self._course == at)
        return corners(at, self._course[behind[0] + 1 :], cols) if behind.size else NOWHERE

    def _judged(self, pose: Outset, stops: Ints, field: Field) -> Course:
        """A course as far as it can be flown in time, with what it finds."""
        count = lay(pose, stops, stops.size, field, self._room)
        found, entered = judge(pose, count, field, self._motion.pace, self._room)
        return Course(corners(pose.cell, self._laid(entered, field), field.cols), found)

    def _entered(self, pose: Outset, stops: Ints, field: Field) -> Ints:
        """The flat cells that a course enters in time."""
        count = lay(pose, stops, stops.size, field, self._room)
        return self._laid(judge(pose, count, field, self._motion.pace, self._room)[1], field)

    def _laid(self, count: int, field: Field) -> Ints:
        return self._room.rows[1 : count + 1] * field.cols + self._room.cols[1 : count + 1]

    def _begin(self, pose: Outset, own: Course, field: Field, until: float) -> Course:
        """The best of the plan itself and of the plan cut here and there and led home, each annealed a little."""
        s, best = self.settings, own
        home = int(np.argmin(np.where(self._allowed > 0, field.home_s, np.inf)))
        for k in range(s.starts):
            if time.perf_counter() > until:
                break
            cut = own.stops[: own.stops.size * k // s.starts]
            start = self._judged(pose, np.append(cut, home), field)
            course = self._better(pose, start, field, s.first // (2 * s.starts), until)
            best = max(best, course, key=lambda each: each.found)
        return best

    def _better(self, pose: Outset, course: Course, field: Field, spells: int, until: float) -> Course:
        """The course after so many spells of annealing; never one that finds less."""
        s = self.settings
        orders = np.zeros((3, self._room.rows.size + 2), dtype=np.int64)
        size = np.array([course.stops.size])
        orders[0, : course.stops.size] = course.stops
        cells = max(1, lay(pose, course.stops, course.stops.size, field, self._room))
        for spell in range(spells):
            if time.perf_counter() > until:
                break
            mean = max(course.found, 1e-9 * float(field.mass.sum())) / cells
            heat = s.heat * mean * (1.0 - spell / spells) + 1e-3 * mean
            how = np.array([float(s.proposals), heat, heat / 30.0])
            found = improve(pose, orders, size, field, self._motion.pace, self._room, how, self._random)
            if found > course.found:
                course = Course(orders[0, : size[0]].copy(), found)
        return course


def field_step(motion: Motion) -> float:
    """Seconds for a straight step at full speed."""
    return motion.cell_m / motion.speed_mps


def corners(at: int, path: Ints, cols: int) -> Ints:
    """Where a path of flat cells from `at` turns, and its end: straight flight between them is the path."""
    if path.size < 2:
        return path
    moves = np.diff(np.concatenate([[at], path]))
    turns: Ints = np.flatnonzero(np.append(moves[1:] != moves[:-1], True))
    return np.asarray(path[turns])

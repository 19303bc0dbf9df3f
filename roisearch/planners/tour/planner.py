"""The default in seconds, `puct-regions-lite` with a motion: the object that plans."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import Cell, Decision, Effort, SearchState
from roisearch.directions import DIRECTIONS, STEPS, direction_index
from roisearch.fov import FieldOfView
from roisearch.ground import Ground, Part
from roisearch.kernels.draws import draw_unit
from roisearch.kernels.records import Ints
from roisearch.motion import Motion
from roisearch.planners.base import Progress, remark_on
from roisearch.planners.lanes import lawnmowers
from roisearch.planners.tour.desk import MOST_LOOKS, Desk, prices_of
from roisearch.planners.tour.landmarks import NO_LANDMARKS, landmarks
from roisearch.planners.tour.levels import keep_up
from roisearch.planners.tour.settings import TourSettings
from roisearch.planners.tour.tour import Prices
from roisearch.planners.warm import warm_up
from roisearch.planners.ways import Ways, soonest
from roisearch.watch import LOOKED, Mark

BATCH = 256
"""Looks by which the tour is carried on at a time."""
RESERVE = 16
"""The looks that are kept in order to carry the tour on, in tours."""
LEAST_PROPOSALS = 300
"""The fewest changes proposed a look for which one more start is worth it."""
DRIFTS = 400
"""How often a target may walk on before the tour is made anew: seldom, as a tour that was kept is the better one."""
ASTRAY = 12
"""Cells beside its last path; from farther away the tour is made anew, not flown to."""
LEISURE_S = 2.0
"""With less time than this a decision neither chooses the best of the lawnmowers anew nor puts in looks one by one."""
AT_ONCE = 64
"""More cells than so many with news are taken in together where there is no leisure."""
TIED = 0.99
"""Looks that are worth as much as this part of the least one that is planned are as good as it."""


class TourPlanner:
    """Flies a tour of looks that is annealed to cost the fewest expected seconds; see `tour.tour`.

    The tour is kept from one call to the next. What was flown falls off its front, what was seen changes what looks
    are worth, and at its end the next best looks are put on.

    Args:
        fov: a point.
        flyable: bool [rows, cols], None for everything.
        motion: what steps and corners cost.
        visibility: float [rows, cols], how much of the field of view's p_tp a look has at each cell; None: all.
        heights: float [rows, cols], metres at which each cell is flown over; None: all at one height.
    """

    def __init__(
        self,
        settings: TourSettings | None = None,
        *,
        name: str = "puct-regions-lite",
        fov: FieldOfView,
        motion: Motion,
        flyable: ArrayLike | None = None,
        regions: object = None,
        visibility: ArrayLike | None = None,
        heights: ArrayLike | None = None,
    ) -> None:
        if not fov.is_point:
            raise ValueError(f"{name} with a motion sees through a point, not through '{fov.name}'")
        self.name = name
        self.settings = settings or TourSettings()
        self._fov, self._motion = fov, motion
        self._visibility = None if visibility is None else np.array(visibility, dtype=np.float64)
        self._heights = None if heights is None else np.array(heights, dtype=np.float64)
        self._p: NDArray[np.float64] = np.zeros(0)  # p_tp of a look at each cell, flat
        self._flyable = None if flyable is None else np.array(flyable, dtype=bool)
        self._ground: Ground | None = None
        self._part: Part | None = None
        self._mark: Mark | None = None  # the state of the belief that is known
        self._random = np.zeros(1, dtype=np.uint64)
        self._seconds = 0.0  # of one spell, lately
        self._known: NDArray[np.float64] = np.zeros(0)
        self._unseen = 0.0  # mass that cannot be looked at
        self._findable = 0.0  # what all looks that would ever be planned may find
        self._path: list[int] = []  # what the last decision gave
        self._at = self._since = self._idle = (
            0  # the cell; cells since looks were ranked; spells without gain
        )
        self._heading = 0  # of the last decision's state
        self._drifted = 0  # how often the target has walked on since the tour was made
        self._turn = False  # whether the last spell was at the front
        self.expected_s = 0.0
        """Seconds until the target is expected to be detected, by the tour of the last decision; see `Expects`."""
        self.hasty = False
        """Whether the tour was made with fewer than its first spells of annealing; see `Hasty`."""

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next: see `Planner.plan`. Its value is minus the expected seconds to the target.

        Raises: ValueError: when the drone cannot be in its cell or cannot leave it, or when there is
            neither a number of iterations nor a deadline.
        """
        began = time.perf_counter()
        if self.settings.iterations is None and deadline_s is None:
            raise ValueError("a planner without a number of iterations needs a deadline")
        until = began + (np.inf if deadline_s is None else deadline_s)
        if self._ground is None:
            self._ground = Ground(belief.shape, self._flyable, self._fov)
        elif self._ground.shape != belief.shape:
            raise ValueError(f"the belief's map is {belief.shape}, the planner's {self._ground.shape}")
        part = self._ground.part_of(state.cell)
        if part is not self._part:
            self._enter(self._ground, part)
        self._random[0] = rng.bit_generator.random_raw()
        self._follow(belief, state, until)
        spells = self._think(until)
        return self._decide(belief, state, Effort(spells, time.perf_counter() - began))

    def _enter(self, ground: Ground, part: Part) -> None:
        """Make room for everything that depends on the map."""
        self._part, self._mark = part, None
        rows, cols = ground.shape
        reach = (part.legal > 0).reshape(ground.shape)
        self._ways = Ways(reach, self._motion.diagonal)
        self._reach = reach
        self._p = np.full(rows * cols, float(self._fov.p_tp[0]))
        for name, values in (("visibility", self._visibility), ("heights", self._heights)):
            if values is not None and values.shape != ground.shape:
                raise ValueError(f"{name} has the shape {values.shape}, the map {ground.shape}")
        if self._visibility is not None:
            self._p *= self._visibility.ravel()
        self._p *= reach.ravel()
        self._hidden = np.flatnonzero(~part.viewable.ravel())
        self._far = NO_LANDMARKS
        self._rank = np.zeros(0, dtype=np.int32)
        self._desk = Desk(self.settings.looks + 2 * BATCH, rows * cols, self._prices())

    def _prices(self) -> Prices:
        ways = self._ways
        return prices_of(self._motion, ways.allowed, ways.cols, ways.is_open, self._flat_heights, self._far)

    @property
    def _flat_heights(self) -> NDArray[np.float64] | None:
        return None if self._heights is None else self._heights.ravel()

    # Following what was flown and seen

    def _follow(self, belief: Belief, state: SearchState, until: float) -> None:
        """Bring the tour to where the drone is and what was seen."""
        mark = belief.follow(LOOKED).mark()
        touched = None if self._mark is None else self._touched(belief, mark, self._mark)
        self._mark = mark
        walked = touched is None and belief.walks is not None and self._drifted < DRIFTS
        if self._lost(state.cell, belief.shape[1]) or (touched is None and not walked):
            self._load(belief, state, until)
            return
        if touched is None:
            self._drift(belief, state, until)
            return
        desk, cols = self._desk, belief.shape[1]
        flown = self._fly(state.cell[0] * cols + state.cell[1])
        desk.stand(state.cell, direction_index(state.heading))
        cells = np.unique(np.concatenate([flown, *(c[:, 0] * cols + c[:, 1] for c in touched)])).astype(
            np.int64
        )
        expected = self._known[cells]
        for cell in flown:
            expected[cells == cell] *= 1.0 - self._p[cell]
        actual = belief.weights[cells]
        self._findable += float((actual - self._known[cells]) @ self._found_of(cells))
        self._known[cells] = actual
        self._settle()
        wrong = (np.abs(actual - expected) > 0.25 * expected) & self._reach.ravel()[cells]
        if wrong.sum() > AT_ONCE and not _at_leisure(until):
            self._expect_all(belief, cells[wrong])
        elif wrong.any():
            for cell in cells[wrong].tolist():
                self._expect(belief, cell)
            self._settle()
        if wrong.any():
            self._idle = 0
        self._since += len(flown)
        if desk.size < self.settings.looks - BATCH:
            self._carry_on(belief, until)

    def _lost(self, cell: Cell, cols: int) -> bool:
        """Whether there is no tour that leads to `cell`, or nearly there."""
        if self._known.size == 0:
            return True
        rows, columns = np.divmod(np.array([self._at, *self._path]), cols)
        away = np.maximum(np.abs(rows - cell[0]), np.abs(columns - cell[1]))
        return bool(away.min() > ASTRAY)

    def _drift(self, belief: Belief, state: SearchState, until: float) -> None:
        """The target has walked on: what all looks are worth has changed, and the tour leads where it did for now.

        Each look of the tour is worth what is there by now; ground that has filled up is looked at again.
        """
        desk, cols = self._desk, belief.shape[1]
        self._drifted += 1
        self._idle = 0
        flown = self._fly(state.cell[0] * cols + state.cell[1])
        desk.stand(state.cell, direction_index(state.heading))
        self._take_over(belief)
        cells = desk.cells()
        nth = _repeats(cells)
        desk.tour.worth[desk.tour.order[1 : desk.size + 1]] = (
            self._p[cells] * belief.weights[cells] * (1.0 - self._p[cells]) ** nth
        )
        self._settle()
        self._since += len(flown)
        worth = self._p * belief.weights
        again = np.flatnonzero((worth > self._least) & self._reach.ravel() & (desk.tour.first < 0))
        for cell in again[np.argsort(-worth[again], kind="stable")][:BATCH].tolist():
            if desk.space <= 0:
                break
            desk.insert(cell, float(worth[cell]))
        self._settle()
        if desk.size < self.settings.looks - BATCH:
            self._carry_on(belief, until)

    def _found_of(self, cells: Ints | slice) -> NDArray[np.float64]:
        """What part of the mass of `cells` can be found: of what more looks than are ever planned would still miss,
        nothing is the sooner for a short tour."""
        return 1.0 - (1.0 - self._p[cells]) ** MOST_LOOKS

    def _settle(self) -> None:
        self._mass = max(self._findable, 1e-300)
        self._desk.prices.rest[0] = max(0.0, self._findable - self._desk.worth)
        self._desk.settle()

    def _take_over(self, belief: Belief) -> None:
        """Know the whole belief."""
        self._known = belief.weights.copy()
        self._unseen = float(belief.weights[self._hidden].sum())
        self._findable = float(belief.weights @ self._found_of(slice(None)))

    def _touched(self, belief: Belief, now: Mark, before: Mark) -> list[NDArray[np.int64]] | None:
        """Where `belief` may differ from what is known, cells [k, 2] each; None if that is another map altogether.

        A caller may hand over a copy each time, with what it expects to see on the way to where it plans from.
        """
        touched = now.apart_from(before)
        if touched is not None:
            return touched
        flat = np.flatnonzero(belief.weights != self._known)
        if flat.size > self._known.size // 4:
            return None
        return [np.stack(np.divmod(flat, belief.shape[1]), axis=1)]

    def _fly(self, cell: int) -> list[int]:
        """Take off the tour what was flown on the way to `cell`, as the last decision had it; those cells."""
        flown = self._path[: self._path.index(cell) + 1] if cell in self._path else [cell]
        self._path = self._path[len(flown) :] if cell in self._path else []
        if cell == self._at:
            flown = []
        self._at = cell
        for each in flown:
            looks = self._desk.looks_at(each)
            if looks:
                self._desk.remove(int(self._desk.tour.place[looks[0]]))
        return flown

    def _expect(self, belief: Belief, cell: int) -> None:
        """Let the looks at `cell` be worth what the belief says, and put in those that it makes worth it."""
        desk, worth = self._desk, float(self._p[cell]) * float(belief.weights[cell])
        looks = desk.looks_at(cell)
        for k in range(MOST_LOOKS):
            if k < len(looks):
                known = float(desk.tour.worth[looks[k]])
                desk.tour.worth[looks[k]] = worth
                if worth > 2.0 * known:  # reported: perhaps it is better looked at sooner
                    desk.remove(int(desk.tour.place[looks[k]]))
                    self._settle()
                    desk.insert(cell, worth)
            elif worth > self._least and desk.space > 0:
                self._settle()
                desk.insert(cell, worth)
            worth *= 1.0 - float(self._p[cell])

    def _expect_all(self, belief: Belief, cells: Ints) -> None:
        """The same for many cells at once, roughly: looks stay where they are, and new ones come at the end. A better
        tour is to be made in its place."""
        desk, worth = self._desk, self._p[cells] * belief.weights[cells]
        for i in np.argsort(-worth, kind="stable").tolist():
            looks, left = desk.looks_at(int(cells[i])), float(worth[i])
            for node in looks:
                desk.tour.worth[node] = left
                left *= 1.0 - float(self._p[cells[i]])
            if not looks and left > self._least and desk.space > 0:
                desk.append(int(cells[i]), left)
        self.hasty = True
        self._settle()

    # What to look at

    def _load(self, belief: Belief, state: SearchState, until: float) -> None:
        """Take over the whole belief and make a tour of the best looks."""
        self._take_over(belief)
        self._path = []
        self._at = state.cell[0] * belief.shape[1] + state.cell[1]
        self._idle = self._since = self._drifted = 0
        self.hasty = False
        if not self._ways.is_open and not len(self._far):
            self._far = landmarks(self._ways.allowed, self._ways.cols, self._at, until)
            self._desk.prices = self._desk.prices._replace(far=self._far)
        desk = self._desk
        desk.clear()
        desk.stand(state.cell, direction_index(state.heading))
        self._reserve = self._ranked(belief, until)
        self._least = 0.0
        self._add(belief, self.settings.looks)
        self._settle()
        if desk.size:
            self._anneal_first(desk.arrange(until), until)

    def _anneal_first(self, starts: list[Ints], until: float) -> None:
        """Anneal the whole new tour from the best starts, the temperature falling over all spells of each."""
        s, desk = self.settings, self._desk
        if desk.size <= 2:
            return
        hot, cold = self._heat(s.heat_first), 0.03 * self._heat(s.heat_first)
        spells, began, spell_s = s.first, time.perf_counter(), 0.0
        if np.isfinite(until) and spells > 0 and began < until:  # one spell tells how long they take
            desk.anneal(1, desk.size, s.proposals, (cold, cold), self._random)
            now = time.perf_counter()
            spell_s = max(now - began, 1e-6)
            spells = min(spells - 1, int((until - now) / spell_s))
        elif began >= until:
            spells = 0
        self.hasty = spells < s.first - 1
        if spells > 0:
            count = max(1, min(s.starts, spells * s.proposals // (LEAST_PROPOSALS * desk.size)))
            desk.anneal_best(starts[:count], spells // count * s.proposals, (hot, cold), self._random)
        if spells > 0 and desk.lawnmowers:
            keep_up(desk, desk.lawnmowers, self._heat(1.0), self._random, until, spell_s / s.proposals)

    def _ranked(self, belief: Belief, until: float) -> Ints:
        """The cells to look at, the best first, those about equally good in the order of a lawnmower: int [n].

        A cell that is worth it stands there for each further look as well.
        """
        worth = np.where(self._reach.ravel(), self._p * belief.weights, 0.0)
        most = RESERVE * self.settings.looks
        least = 0.0
        if worth.size > most:
            least = float(np.partition(worth, worth.size - most)[worth.size - most])
        cells = np.flatnonzero((worth >= TIED * least) & (worth > 0.0))
        if not cells.size:
            return cells
        rank = self._along_lanes(belief, cells, until)
        looks = [(cells, worth[cells])]
        for _ in range(1, MOST_LOOKS):
            further = looks[-1][1] * (1.0 - self._p[looks[-1][0]])
            kept = further >= max(least, 1e-9 * float(worth.max()))
            looks.append((looks[-1][0][kept], further[kept]))
        every = np.concatenate([c for c, _ in looks])
        band = np.round(np.log(np.concatenate([w for _, w in looks])) / -np.log(TIED))
        return every[np.lexsort((rank[every], -band))][:most]

    def _along_lanes(self, belief: Belief, wanted: Ints, until: float) -> NDArray[np.int32]:
        """When each cell's turn comes along the best lawnmower over the cells that are `wanted`, int [cells]; where
        there is no leisure, along the last one that was chosen, or any."""
        if _at_leisure(until):
            there = np.zeros(self._reach.shape, dtype=bool)
            there.ravel()[wanted] = True
            order = self._best_lawnmower(belief, there)
            self._rank = np.zeros(there.size, dtype=np.int32)
            self._rank[order] = np.arange(order.size)
        elif not self._rank.size:
            there_and_back = np.arange(self._reach.size, dtype=np.int32).reshape(self._reach.shape)
            there_and_back[1::2] = there_and_back[1::2, ::-1].copy()
            return there_and_back.ravel()
        return self._rank

    def _best_lawnmower(self, belief: Belief, wanted: NDArray[np.bool_]) -> Ints:
        """The lawnmower over what is wanted with which the target is expected soonest, flat cells."""
        orders = lawnmowers(wanted, self._reach)
        return soonest(orders, belief.weights, self._ways, self._motion, self._at, heights=self._flat_heights)

    def _add(self, belief: Belief, count: int) -> None:
        """Put the best `count` looks that are not planned at the end of the tour."""
        desk, taken = self._desk, 0
        worst = np.inf
        while taken < self._reserve.size and count > 0 and desk.space > BATCH:
            cell = int(self._reserve[taken])
            taken += 1
            planned = len(desk.looks_at(cell))
            p = float(self._p[cell])
            worth = p * float(belief.weights[cell]) * (1.0 - p) ** planned
            if planned < MOST_LOOKS and worth > 0.0:
                desk.append(cell, worth)
                worst = min(worst, worth)
                count -= 1
        self._reserve = self._reserve[taken:]
        if np.isfinite(worst):
            self._least = worst

    def _carry_on(self, belief: Belief, until: float) -> None:
        """Put the next best looks at the end of the tour."""
        if self._reserve.size < BATCH and (self._since >= BATCH or self._desk.size == 0):
            self._reserve, self._since = self._ranked(belief, until), 0
        if self._reserve.size == 0:
            return
        self._add(belief, BATCH)
        self._settle()
        self._idle = max(0, self._idle - self.settings.patience // 4)

    # Thinking and deciding

    def _heat(self, steps: float) -> float:
        return steps * float(self._desk.prices.axis[0]) * self._mass

    def _think(self, until: float) -> int:
        """Anneal windows of the tour, one in two at its front; how many."""
        s, desk = self.settings, self._desk
        heat = self._heat(s.heat)
        done = 0
        while (s.iterations is None or done < s.iterations) and self._idle < s.patience and desk.size > 2:
            before = time.perf_counter()
            if before + self._seconds > until:
                break
            first = 1
            self._turn = not self._turn
            if self._turn:
                first += int(draw_unit(self._random) * max(0, desk.size - s.window))
            gained = desk.anneal(first, first + s.window, s.proposals, (heat, 0.1 * heat), self._random)
            self._idle = 0 if gained > 1e-6 * desk.cost else self._idle + 1
            self._seconds = 0.9 * self._seconds + 0.1 * (time.perf_counter() - before)
            done += 1
        return done

    def _decide(self, belief: Belief, state: SearchState, effort: Effort) -> Decision:
        """The first cells of the tour."""
        desk, cols = self._desk, belief.shape[1]
        self._heading = heading = direction_index(state.heading)
        path = self._entered(self.settings.path) or [self._any_step(self._at, heading)]
        self._path = path
        hidden = self._unseen / belief.total
        self.expected_s = desk.cost / self._mass if desk.size else 0.0
        return Decision(
            path=tuple(divmod(cell, cols) for cell in path),
            action=DIRECTIONS[self._direction(self._at, path[0])],
            value=-self.expected_s,
            effort=effort,
            unreachable=hidden,
            remark=remark_on(hidden),
            goal=divmod(path[-1], cols),
        )

    def ahead(self, most: int) -> tuple[Cell, ...]:
        """The cells that the tour enters after the state of the last decision, `most` at most; none before one."""
        return (
            tuple(divmod(cell, self._ways.cols) for cell in self._entered(most))
            if self._part is not None
            else ()
        )

    def _entered(self, most: int) -> list[int]:
        """The first cells that the tour enters, flat, `most` at most."""
        here, heading = self._at, self._heading
        path: list[int] = []
        for cell in self._desk.cells()[:most].tolist():
            way = (
                [self._any_step(here, heading), here] if cell == here else self._ways.way(here, cell, heading)
            )
            for step in way:
                heading, here = self._direction(here, step), step
            path += way
            if len(path) >= most:
                break
        return path[:most]

    def _direction(self, here: int, there: int) -> int:
        cols = self._ways.cols
        return STEPS.index((there // cols - here // cols, there % cols - here % cols))

    def _any_step(self, here: int, heading: int) -> int:
        """A neighbour, straight on if that can be."""
        turns = (0, 1, 7, 2, 6, 3, 5, 4)
        bit = next(
            (heading + turn) % 8 for turn in turns if self._ways.allowed[here] >> (heading + turn) % 8 & 1
        )
        return here + self._ways.move(bit)

    def reckon_with(self, motion: Motion) -> None:
        """Let steps and corners cost what `motion` says from now on; it has the same cells and neighbours."""
        self._motion = motion
        if self._part is not None:
            self._desk.prices = self._prices()._replace(rest=self._desk.prices.rest)
            self._desk.settle()
            self._idle = 0

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use, by making some on a small map."""
        warm_up(
            lambda ground: TourPlanner(name=self.name, fov=self._fov, motion=self._motion, flyable=ground),
            self._fov,
            progress,
        )


def _at_leisure(until: float) -> bool:
    return until - time.perf_counter() >= LEISURE_S


def _repeats(cells: Ints) -> Ints:
    """How often each of `cells` [n] stands in it before: int [n]."""
    order = np.argsort(cells, kind="stable")
    ranked = cells[order]
    begins = np.flatnonzero(np.concatenate([[True], ranked[1:] != ranked[:-1]])) if cells.size else cells
    counts = np.empty(cells.size, dtype=np.int64)
    counts[order] = np.arange(cells.size) - np.repeat(begins, np.diff(np.append(begins, cells.size)))
    return counts

"""The exact ruler in seconds: when a planner's flight detects the target, and when it is sure; without luck.

As `sim.ruler`, but over time: the flown path is timed by a `Motion`, and each look adds p_tp * u to F at the second at
which its cell is reached. The looks are the same whatever the target; so F is the distribution of the time of the first
true hit over all targets and all true detections. With p_tn < 1 false alarms are drawn at every cell looked at: the
k-th look at a cell says the same whichever planner makes it, so that planners differ by what they do and not by luck.

*Until FOUND* is the time until the best place is `found_at` probable and is the target's. It is the first true hit and
what comes after. What comes after is flown for a few targets: the first true hit falls on the look at which F passes
a drawn level, one level in each of `sequels` equal parts of F, and from there a copy of the whole process flies on with
the target in that cell. So the mean is without bias, and its noise is only that of the part that is short.
"""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Motion, Planner, SearchState
from roisearch.decision import Cell
from roisearch.directions import direction_between
from sim.ruler import unthought


@dataclass(frozen=True, eq=False)
class Sequel:
    """What comes after the first true hit at the look number `begun` of a flight.

    Attributes:
        cells: entered after that look, int [n, 2]; none when the hit was enough.
        found: whether the last of them ended it with FOUND. wrong: other places that were FOUND before.
    """

    begun: int
    cells: NDArray[np.int64]
    found: bool
    wrong: int

    def seconds(self, path: NDArray[np.int64], motion: Motion, how: How) -> float:
        """From the hit until FOUND, in a flight along `path` [looks, 2]; infinite when it never was."""
        if not self.found:
            return float("inf")
        whole = np.concatenate([path[: self.begun + 1], self.cells]).tolist()
        times = how.times(motion, [(row, col) for row, col in whole])
        return float(times[-1] - times[self.begun])


@dataclass(frozen=True, eq=False)
class TimedFlight:
    """What one flight would have found, and when.

    Attributes:
        path: the cells entered, int [n, 2].
        times: seconds at which each was reached, float [n].
        found: probability of the first true detection there, float [n].
        sequels: what came after first true hits; after: the seconds of each until FOUND, float.
    """

    path: NDArray[np.int64]
    times: NDArray[np.float64]
    found: NDArray[np.float64]
    sequels: tuple[Sequel, ...] = ()
    after: tuple[float, ...] = ()

    def expected(self, cap_s: float) -> float:
        """Expected seconds to the first true detection, restricted to `cap_s`."""
        rest = 1.0 - float(self.found[self.times < cap_s].sum())
        return float(np.minimum(self.times, cap_s) @ (self.found * (self.times < cap_s))) + rest * cap_s

    def expected_found(self, cap_s: float) -> float:
        """Expected seconds until FOUND; what comes after the first true detection counts `cap_s` at most."""
        after = float(np.minimum(self.after, cap_s).mean()) if self.after else 0.0
        return self.expected(cap_s) + after * float(self.found[self.times < cap_s].sum())

    def time_to(self, share: float) -> float:
        """Seconds until the probability of success is `share`; infinite when it never is."""
        reached = np.flatnonzero(np.cumsum(self.found) >= share)
        return float(self.times[reached[0]]) if reached.size else float("inf")

    def timed_by(self, motion: Motion, how: How) -> TimedFlight:
        """The same cells, flown with another motion."""
        times = how.times(motion, [(row, col) for row, col in self.path.tolist()])
        after = tuple(each.seconds(self.path, motion, how) for each in self.sequels)
        return replace(self, times=times, after=after)


@dataclass(frozen=True)
class How:
    """How a flight is flown: from a stand at `start`, until less than `stop_below` is undetected or for `steps` cells.

    `fov` is what is seen, with its p_tp and p_tn; the planner must have been made for the same. `follow`: see
    `sim.ruler.detection_curve`; a hit ends what is followed. `sequels` are flown until the best place is `found_at`
    probable, for `sequel_steps` cells at most. `heights` are those at which cells are flown over, float [rows, cols];
    None: flat ground.
    """

    start: Cell = (5, 5)
    heading: str = "north"
    fov: FieldOfView = field(default_factory=lambda: FieldOfView.point(0.9, 1.0))
    steps: int = 40_000
    stop_below: float = 5e-5
    follow: bool = False
    sequels: int = 0
    sequel_steps: int = 4000
    found_at: float = 0.999
    heights: NDArray[np.float64] | None = None

    def times(self, motion: Motion, path: list[Cell]) -> NDArray[np.float64]:
        """Seconds at which each cell of a path from the start is reached."""
        if self.heights is None:
            return motion.arrivals(path, self.start, self.heading)
        rows, cols = np.array([self.start, *path]).T
        return motion.arrivals(path, self.start, self.heading, heights=self.heights[rows, cols])


class Chance:
    """What detectors say by chance: uniform numbers for the looks at each cell, whatever order they come in."""

    def __init__(self, seed: int, shape: tuple[int, int]) -> None:
        self._seed = np.uint64(seed)
        self._cols = shape[1]
        self._looks = np.zeros(shape, dtype=np.uint64)

    def draw(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """For one more look at each of `cells` [k, 2], all different: float [k] in [0, 1)."""
        rows, cols = cells[:, 0], cells[:, 1]
        self._looks[rows, cols] += np.uint64(1)
        with np.errstate(over="ignore"):
            x = (rows * self._cols + cols).astype(np.uint64) << np.uint64(24)
            x = _mixed(x + self._looks[rows, cols] + _mixed(self._seed + np.uint64(1)))
        drawn: NDArray[np.float64] = (x >> np.uint64(11)).astype(np.float64) * 2.0**-53
        return drawn


def _mixed(x: Any) -> Any:
    """The finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): 64 bits well stirred."""
    with np.errstate(over="ignore"):
        x = (x + np.uint64(0x9E3779B97F4A7C15)) & np.uint64(0xFFFFFFFFFFFFFFFF)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


class _Run:
    """A planner on its way over one prior."""

    def __init__(
        self,
        planner: Planner,
        prior: NDArray[np.float64],
        motion: Motion,
        rng: np.random.Generator,
        how: How,
    ) -> None:
        self.planner, self.motion, self.rng, self.how = planner, motion, rng, how
        self.belief = Belief(prior)
        self.undetected = self.belief.probability()
        self.chance = Chance(int(rng.integers(2**63)), self.belief.shape)
        self.state = SearchState(how.start, how.heading)
        self.path: list[Cell] = []
        self.ahead: list[Cell] = []

    def move(self) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Enter the next cell; the cells then in view, with their p_tp and p_tn."""
        if not self.ahead:
            decision = self.planner.plan(self.belief, self.state, self.rng)
            self.ahead = unthought(decision, self.state.cell) if self.how.follow else [decision.path[0]]
        cell = self.ahead.pop(0)
        self.state = SearchState(cell, direction_between(self.state.cell, cell), self.motion.speed_mps)
        self.path.append(cell)
        return self.how.fov.looks(cell, self.state.heading, self.belief.shape)

    def see(
        self,
        seen: NDArray[np.int64],
        p_tp: NDArray[np.float64],
        p_tn: NDArray[np.float64],
        hits: NDArray[np.bool_],
    ) -> None:
        """Take in what the detector said of the cells in view."""
        if len(seen):
            self.belief.observe(seen, hits, p_tp, p_tn)
        if hits.any():
            self.ahead = []

    def fly(self) -> TimedFlight:
        """Fly as if the target stayed undetected, and what comes after at the drawn levels of F."""
        how, found = self.how, []
        levels = (np.arange(how.sequels) + self.rng.random(how.sequels)) / max(1, how.sequels)
        left = [float(level) for level in levels * (1.0 - how.stop_below)]
        sum_found, sequels = 0.0, []
        while len(self.path) < how.steps:
            seen, p_tp, p_tn = self.move()
            rows, cols = seen[:, 0], seen[:, 1]
            gains = p_tp * self.undetected[rows, cols]
            found.append(float(gains.sum()))
            sum_found += found[-1]
            draws = self.chance.draw(seen)
            while left and sum_found >= left[0]:
                left.pop(0)
                at = int(self.rng.choice(len(gains), p=gains / gains.sum()))
                cells, sure, wrong = in_a_copy(functools.partial(self.sequel, seen, p_tp, p_tn, draws, at))
                entered = np.array(cells, dtype=np.int64).reshape(-1, 2)
                sequels.append(Sequel(len(self.path) - 1, entered, sure, wrong))
            self.undetected[rows, cols] *= 1.0 - p_tp
            if self.undetected.sum() < how.stop_below:
                break
            self.see(seen, p_tp, p_tn, draws >= p_tn)
        path = np.array(self.path)
        return TimedFlight(path, np.zeros(len(path)), np.array(found), tuple(sequels)).timed_by(
            self.motion, how
        )

    def sequel(
        self,
        seen: NDArray[np.int64],
        p_tp: NDArray[np.float64],
        p_tn: NDArray[np.float64],
        draws: NDArray[np.float64],
        at: int,
    ) -> tuple[list[Cell], bool, int]:
        """What follows a first true hit at the cell `at` of those in view: the fields of `Sequel`."""
        target, begun = (int(seen[at, 0]), int(seen[at, 1])), len(self.path)
        hits = draws >= p_tn
        hits[at] = True
        raised: set[Cell] = {target}
        wrong: set[Cell] = set()
        cols = self.belief.shape[1]
        for _ in range(self.how.sequel_steps):
            self.see(seen, p_tp, p_tn, hits)
            raised.update((int(row), int(col)) for row, col in seen[hits])
            flat = self.belief.weights
            sure = {
                cell
                for cell in raised
                if flat[cell[0] * cols + cell[1]] >= self.how.found_at * self.belief.total
            }
            if target in sure:
                return self.path[begun:], True, len(wrong)
            wrong |= sure
            seen, p_tp, p_tn = self.move()
            draws = self.chance.draw(seen)
            there = (seen == np.array(target)).all(axis=1)
            hits = np.where(there, draws < p_tp, draws >= p_tn)
        return [], False, len(wrong)


def fly(
    planner: Planner, prior: NDArray[np.float64], motion: Motion, rng: np.random.Generator, how: How
) -> TimedFlight:
    """Fly `planner` over `prior` as `how` says; planning after every cell unless it follows."""
    return _Run(planner, prior, motion, rng, how).fly()


def in_a_copy(work: Callable[[], Any]) -> Any:
    """What `work` returns, plain values, done in a copy of this process: nothing here is changed by it.

    Raises:
        RuntimeError: when it raised there.
    """
    reads, writes = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(reads)
            os.write(writes, json.dumps(work()).encode())
            code = 0
        finally:
            os._exit(code)
    os.close(writes)
    with os.fdopen(reads, "rb") as answer:
        text = answer.read()
    _, status = os.waitpid(child, 0)
    if status != 0:
        raise RuntimeError("what comes after the first true hit could not be flown")
    return json.loads(text)

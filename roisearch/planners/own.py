"""What a planner from outside derives from, so that it has to say only where to go."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import Cell, Decision, Effort, SearchState
from roisearch.fov import HEADINGS, MOVES, FieldOfView
from roisearch.planners.base import Progress, Scene, World, remark_on
from roisearch.planners.warm import warm_up
from roisearch.regions import Regions


class BasePlanner(ABC):
    """A planner of four directions; derive from it and write `choose`.

    What every planner keeps to, and `roisearch.planners.own.check` tries:

    - `plan` may be called with any belief and any state, again after every single move, whatever it said before.
      The belief is not the planner's to change; what it keeps of it, it must copy.
    - Its path is never empty; its cells are flyable, each a neighbour of the last, the first of the drone's.
    - All that it draws comes from the `rng` it is given: the same seed gives the same flight.
    - It is done within `deadline_s` seconds where that is given.
    - It is called from one thread, which need not be the one that made it.

    Args:
        fov: what a look from a cell sees.
        flyable: bool [rows, cols], where the drone may be; None for everywhere.
        regions: the regions of interest; segmented from the first belief unless given.

    A derived class may take more keywords, which `make_planner(name, option=value)` and the trials'
    `module:Class:option=value` hand on; it calls `super().__init__(fov=fov, flyable=flyable, regions=regions)`.
    """

    name = ""
    """What it is called in decisions and reports; the class's name unless given."""

    def __init__(
        self, *, fov: FieldOfView, flyable: ArrayLike | None = None, regions: Regions | None = None
    ) -> None:
        self.name = self.name or type(self).__name__
        self.fov = fov
        self.world = World(fov, flyable, regions)
        self._deadline = float("inf")

    @abstractmethod
    def choose(
        self, belief: Belief, state: SearchState, rng: np.random.Generator
    ) -> Sequence[Cell] | Decision:
        """The cells to enter next, in order, at least one; or a whole `Decision`, which can say more.

        `self.moves(belief, state)` are the cells that the drone can enter now, `self.seen(cell, heading, belief)`
        what it would see from one, and `self.seconds_left` how long it may think.
        """

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """See `Planner.plan`. Raises ValueError when the drone cannot be there, or the planner says what cannot be."""
        began = time.perf_counter()
        self._deadline = float("inf") if deadline_s is None else began + deadline_s
        scene = self.scene(belief, state)
        said = self.choose(belief, state, rng)
        if isinstance(said, Decision):
            self._check(said.path, state, scene)
            return cast(Decision, said)
        path = tuple((int(row), int(col)) for row, col in said)
        self._check(path, state, scene)
        unreachable = scene.unreachable(belief, belief.follow(scene.forest))
        action = HEADINGS[MOVES.index((path[0][0] - state.cell[0], path[0][1] - state.cell[1]))]
        effort = Effort(0, time.perf_counter() - began)
        return Decision(path, action, 0.0, effort, unreachable, remark_on(unreachable))

    def warm_up(self, progress: Progress | None = None) -> None:
        """Make some decisions on a small map, so that whatever compiles has compiled.

        One whose constructor needs more than `fov`, `flyable` and `regions` writes its own.
        """
        warm_up(lambda ground: type(self)(fov=self.fov, flyable=ground), self.fov, progress)

    @property
    def seconds_left(self) -> float:
        """How long the present decision may still think, in seconds; infinite without a deadline."""
        return self._deadline - time.perf_counter()

    def scene(self, belief: Belief, state: SearchState) -> Scene:
        """The connected ground that the drone is on, with its regions as trees."""
        return self.world.scene(belief, state.cell)

    def moves(self, belief: Belief, state: SearchState) -> list[tuple[str, Cell]]:
        """The headings that the drone can move to, with the cell that each enters; never empty."""
        scene = self.scene(belief, state)
        row, col = state.cell
        legal = int(scene.part.legal[row * belief.shape[1] + col])
        return [
            (heading, (row + down, col + right))
            for number, (heading, (down, right)) in enumerate(zip(HEADINGS, MOVES, strict=True))
            if legal >> number & 1
        ]

    def seen(self, cell: Cell, heading: str, belief: Belief) -> NDArray[np.int64]:
        """The cells in view from `cell` with that heading, int [k, 2]."""
        return self.fov.cells(cell, heading, belief.shape)

    def _check(self, path: Sequence[Cell], state: SearchState, scene: Scene) -> None:
        if not path:
            raise ValueError(f"{self.name} names no cell to enter; name at least one")
        before = state.cell
        for cell in path:
            step = (cell[0] - before[0], cell[1] - before[1])
            legal = int(scene.part.legal[before[0] * scene.ground.shape[1] + before[1]])
            if step not in MOVES or not legal >> MOVES.index(step) & 1:
                raise ValueError(
                    f"{self.name} goes from {before} to {cell}, which is no flyable neighbour; see `moves`"
                )
            before = cell


def check(make: type[BasePlanner], *, seed: int = 1, steps: int = 60) -> None:
    """Try a planner on maps with and without obstacles, for whoever writes one: a test calls it.

    Raises:
        ValueError: it flies where it may not, or the same seed gives another flight.
    """
    rng = np.random.default_rng(seed)
    for fov in (FieldOfView.point(), FieldOfView.donut(), FieldOfView.wide_angle()):
        prior = rng.random((17, 23))
        flyable = rng.random((17, 23)) > 0.2
        flyable[:, 0] = flyable[0, :] = True  # one way round is always open
        flights = [_fly(make(fov=fov, flyable=flyable), prior, fov, flyable, steps) for _ in range(2)]
        if flights[0] != flights[1]:
            raise ValueError(f"{make.__name__} flies otherwise with the same seed; draw from `rng` alone")


def _fly(
    planner: BasePlanner,
    prior: NDArray[np.float64],
    fov: FieldOfView,
    flyable: NDArray[np.bool_],
    steps: int,
) -> list[Cell]:
    belief, rng = Belief(prior), np.random.default_rng(7)
    cell, heading, entered = (0, 0), "north", []
    for step in range(steps):
        before = belief.weights.copy()
        path = planner.plan(belief, SearchState(cell, heading), rng, deadline_s=1.0).path
        if not np.array_equal(before, belief.weights):
            raise ValueError(f"{planner.name} changes the belief that it is given; copy it first")
        for near in path:
            if not flyable[near]:
                raise ValueError(f"{planner.name} enters {near}, which is not flyable")
        heading = HEADINGS[MOVES.index((path[0][0] - cell[0], path[0][1] - cell[1]))]
        cell = path[0]
        entered.append(cell)
        belief.observe(fov.cells(cell, heading, belief.shape), step % 20 == 19, 0.9, 0.9)
    return entered

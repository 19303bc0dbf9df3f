"""What every planner shares: the interface, and the world as planners keep it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import Cell, Decision, Effort, SearchState
from roisearch.forest import Forest, ForestSums
from roisearch.fov import HEADINGS, FieldOfView, heading_index
from roisearch.ground import Ground, Part
from roisearch.kernels.forest import find_peak
from roisearch.kernels.ground import cell_step
from roisearch.motion import Motion
from roisearch.regions import Regions, segment_regions

Progress = Callable[[str, int, int], None]
"""Called with the name of the step, its number from 1, and how many there are."""


class Planner(Protocol):
    """A planner: belief and state in, decision out. `roisearch.BasePlanner` has all of it but the choice."""

    name: str

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next. May be called with any belief and any state, again after every single move.

        Args:
            deadline_s: seconds after which the planner decides with what it has found so far.

        Raises:
            ValueError: when the drone cannot be in its cell, or cannot leave it, or the belief's map is of
                another shape than what the planner was made for.
        """
        ...

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that `plan` and the belief will use."""
        ...


@runtime_checkable
class InSeconds(Protocol):
    """A planner that plans by a motion, and takes another one when more is known."""

    def reckon_with(self, motion: Motion) -> None:
        """Let the ways cost what `motion` says from now on; it has the same cells and neighbours."""
        ...


@runtime_checkable
class Expects(Protocol):
    """A planner that reckons how long its plan takes until the target is detected."""

    expected_s: float
    """By the plan of the last decision, in seconds from then; 0 before one."""


@runtime_checkable
class Hasty(Protocol):
    """A planner that keeps its plan from one decision to the next, and says when it had no time to make a good one."""

    hasty: bool
    """Whether the plan was made within the deadline of a decision that left no time for all that makes it good. Whoever
    has another one made in its place, with more time, may say that it is not."""


@runtime_checkable
class Redrawable(Protocol):
    """A planner that goes on with other regions of the same map."""

    def redraw(self, regions: Regions) -> Callable[[], None]:
        """Get ready for other regions, which takes long on a large map: in any thread, beside `plan`.

        Returns what makes the planner reckon with them, which takes no longer than a decision may: to be called where
        `plan` is, between two of its calls.

        Raises:
            ValueError: when the regions are of another map.
        """
        ...


@dataclass(eq=False)
class Scene:
    """A connected part of the map with its regions as trees.

    Attributes:
        ground: the flyable ground, and `part` the connected piece of it that the drone is on.
        forest: tree 0 is the viewable ground outside all regions, 1 .. regions the regions of interest, and
            the last one what cannot be seen from this part.
        centroids: float [1 + regions, 2]. A bare scene has neither: its one tree is of what cannot be seen.
    """

    ground: Ground
    part: Part
    forest: Forest
    centroids: NDArray[np.float64]

    @property
    def regions(self) -> int:
        """How many trees there are to search: the ground outside all regions, and the regions."""
        return len(self.centroids)

    def unreachable(self, belief: Belief, sums: ForestSums) -> float:
        """The probability of what cannot be seen from this part."""
        root = self.hidden_root
        return float(sums.sums[root]) / belief.total if root >= 0 else 0.0

    def likeliest(self, belief: Belief, sums: ForestSums) -> int:
        """The most probable cell that can be seen, flat; -1 when all of them are at zero."""
        f = self.forest
        best, weight = -1, 0.0
        for root in f.root[: self.regions]:
            if root >= 0 and sums.peaks[root] > weight:
                best, weight = int(root), float(sums.peaks[root])
        if best < 0:
            return -1
        return find_peak(best, belief.weights, f.cell_of, f.first, f.last, sums.peaks)

    def __post_init__(self) -> None:
        self.hidden_root = int(self.forest.root[-1])


class World:
    """The map of one search as a planner keeps it: built at the first plan, one scene a connected part.

    `bare`: the scenes have trees over no cells but those that cannot be seen, for a planner that keeps sums and peaks
    in a way of its own.
    """

    def __init__(
        self, fov: FieldOfView, flyable: ArrayLike | None, regions: Regions | None, *, bare: bool = False
    ) -> None:
        self.fov = fov
        self._bare = bare
        self._flyable = None if flyable is None else np.array(flyable, dtype=bool)
        self._regions = regions
        self._ground: Ground | None = None
        self._scenes: dict[int, Scene] = {}
        self._whole: Scene | None = None  # the only one there can be, on open ground

    def scene(self, belief: Belief, cell: Cell) -> Scene:
        """The scene around `cell`; the regions are segmented from the first belief unless they were given.

        Raises:
            ValueError: when the shapes disagree or the drone cannot be in that cell.
        """
        whole = self._whole
        if whole is not None and belief.shape == whole.ground.shape and whole.ground.holds(cell):
            return whole
        if self._ground is None:
            self._ground = Ground(belief.shape, self._flyable, self.fov)
        elif self._ground.shape != belief.shape:
            raise ValueError(f"the belief's map is {belief.shape}, the planner's {self._ground.shape}")
        part = self._ground.part_of(cell)
        scene = self._scenes.get(part.label)
        if scene is None:
            scene = self._scenes[part.label] = self._survey(belief, self._ground, part)
            self._whole = scene if self._ground.is_open else None
        return scene

    def redrawn(self, regions: Regions) -> World:
        """The same ground with other regions; the parts that were entered are laid out again."""
        other = World(self.fov, self._flyable, regions, bare=self._bare)
        if self._ground is not None:
            other._ground = self._ground
            other._scenes = {
                label: _lay_out(self._ground, scene.part, regions, self._bare)
                for label, scene in list(self._scenes.items())
            }
            if self._whole is not None:
                other._whole = other._scenes[self._whole.part.label]
        return other

    def _survey(self, belief: Belief, ground: Ground, part: Part) -> Scene:
        if self._regions is None:
            prior = belief.probability()
            self._regions = segment_regions(prior, searchable=prior > 0.0)
        return _lay_out(ground, part, self._regions, self._bare)


def _lay_out(ground: Ground, part: Part, regions: Regions, bare: bool) -> Scene:
    """The scene of a part of the ground. Raises ValueError when the regions are of another map."""
    if regions.labels.shape != ground.shape:
        raise ValueError(f"the regions have the shape {regions.labels.shape}, the belief {ground.shape}")
    if bare:
        none = np.zeros((0, 2))
        return Scene(ground, part, Forest(np.where(part.viewable, np.int8(-1), np.int8(0)), 1), none)
    labels = np.where(part.viewable, regions.labels, regions.count + 1)
    rest = np.argwhere(labels == 0) if regions.count else np.zeros((0, 2))
    middle = rest.mean(axis=0) if len(rest) else np.array(ground.shape) / 2.0
    centroids = np.ascontiguousarray(np.vstack([middle, regions.centroids]))
    return Scene(ground, part, Forest(labels, regions.count + 2), centroids)


def cells_of(path: NDArray[np.int64], length: int) -> tuple[Cell, ...]:
    """The first `length` cells of rows and columns [2, n], as pairs of plain ints."""
    if length == 1:
        return ((int(path[0, 0]), int(path[1, 0])),)
    return tuple(zip(*path[:, :length].tolist(), strict=False))  # strict costs a microsecond


def remark_on(unreachable: float) -> str:
    """What the operator should hear about ground that cannot be seen; empty when it hardly matters."""
    if unreachable < 1e-9:
        return ""
    return f"{unreachable:.2%} of the probability lies where the drone cannot look; it searches the rest"


def any_move(scene: Scene, state: SearchState, began: float, unreachable: float) -> Decision:
    """The first legal move, straight on, right, left, back: for when all that can be seen is at zero."""
    cols = scene.ground.shape[1]
    at, heading = state.cell[0] * cols + state.cell[1], heading_index(state.heading)
    legal = int(scene.part.legal[at])
    move = next(
        h for h in (heading, (heading + 1) & 3, (heading + 3) & 3, (heading + 2) & 3) if legal >> h & 1
    )
    path = (divmod(at + cell_step(move, cols), cols),)
    effort = Effort(0, time.perf_counter() - began)
    return Decision(path, HEADINGS[move], 0.0, effort, unreachable, remark_on(unreachable))

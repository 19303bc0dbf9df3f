"""What every planner shares: the ground, the regions as trees, the goals, and the shape of a decision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import Cell, Decision, SearchState
from roisearch.forest import Forest
from roisearch.fov import FieldOfView
from roisearch.ground import Ground, Part
from roisearch.regions import Regions, segment_regions

Progress = Callable[[str, int, int], None]
"""Called with the name of the step, its number from 1, and how many there are."""


class Planner(Protocol):
    """A planner: belief and state in, decision out."""

    name: str

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next. May be called with any belief and any state, again after every single move."""
        ...

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that `plan` and the belief will use."""
        ...


@dataclass(eq=False)
class Scene:
    """A connected part of the map with its regions as trees: what a planner needs to know of the world.

    Attributes:
        ground: the flyable ground, and `part` the connected piece of it that the drone is on.
        forest: region 0 is the viewable ground outside all regions, 1 .. regions the regions of interest.
        centroids: float [1 + regions, 2].
        hidden: the cells that cannot be seen from this part, flat indices.
    """

    ground: Ground
    part: Part
    forest: Forest
    centroids: NDArray[np.float64]
    hidden: NDArray[np.int64]

    def unreachable(self, belief: Belief) -> float:
        """The probability of what cannot be seen from this part."""
        if self.hidden.size == 0:
            return 0.0
        return float(belief.weights[self.hidden].sum() / belief.total)


class World:
    """The map of one search as a planner keeps it: built at the first plan, one scene a connected part."""

    def __init__(self, fov: FieldOfView, flyable: ArrayLike | None, regions: Regions | None) -> None:
        self.fov = fov
        self._flyable = None if flyable is None else np.array(flyable, dtype=bool)
        self._regions = regions
        self._ground: Ground | None = None
        self._scenes: dict[int, Scene] = {}

    def scene(self, belief: Belief, cell: Cell) -> Scene:
        """The scene around `cell`; the regions are segmented from the first belief unless they were given.

        Raises:
            ValueError: when the shapes disagree or the drone cannot be in that cell.
        """
        if self._ground is None or self._ground.shape != belief.shape:
            self._ground = Ground(belief.shape, self._flyable, self.fov)
            self._scenes = {}
        part = self._ground.part_of(cell)
        if id(part) not in self._scenes:
            self._scenes[id(part)] = self._survey(belief, self._ground, part)
        return self._scenes[id(part)]

    def _survey(self, belief: Belief, ground: Ground, part: Part) -> Scene:
        if self._regions is None:
            prior = belief.probability()
            self._regions = segment_regions(prior, searchable=prior > 0.0)
        regions = self._regions
        if regions.labels.shape != belief.shape:
            raise ValueError(f"the regions have the shape {regions.labels.shape}, the belief {belief.shape}")
        labels = np.where(part.viewable, regions.labels.astype(np.int64), -1)
        forest = Forest(labels, regions.count + 1)
        rest = np.argwhere(labels == 0)
        middle = rest.mean(axis=0) if len(rest) else np.zeros(2)
        centroids = np.ascontiguousarray(np.vstack([middle, regions.centroids]))
        return Scene(ground, part, forest, centroids, np.flatnonzero(~part.viewable))


def cells_of(path: NDArray[np.int64], cols: int) -> tuple[Cell, ...]:
    """Flat indices as (row, col) pairs of plain ints."""
    return tuple(divmod(cell, cols) for cell in path.tolist())

"""Fixed patterns: coverage (boustrophedon over the area) and the spiral from the peak of the belief."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.belief import Belief
from roisearch.decision import Decision, Effort, SearchState
from roisearch.fov import FieldOfView
from roisearch.kernels.ground import cell_step, flood
from roisearch.planners.base import Progress, Scene, World, any_move, remark_on
from roisearch.planners.lanes import lanes_over
from roisearch.planners.warm import warm_up
from roisearch.regions import Regions


class PatternPlanner:
    """Enters the cells of a pattern in order, around obstacles on the shortest way, then begins again.

    The planner keeps its own place in the pattern; the belief plays a part only where the pattern is made,
    and when one cell has become very likely: then that cell is looked at until it is not.

    Args:
        fov, flyable, regions: see `make_planner`.
        swath: rows (or rings) between two passes; default what the field of view spans across its heading.
        attend: probability from which a cell is looked at whatever the pattern says.
    """

    name = "pattern"

    def __init__(
        self,
        *,
        fov: FieldOfView,
        flyable: ArrayLike | None = None,
        regions: Regions | None = None,
        swath: int | None = None,
        attend: float = 0.2,
    ) -> None:
        across = fov.offsets[1][:, 0]
        self._swath = int(across.max() - across.min()) + 1 if swath is None else swath
        if self._swath < 1:
            raise ValueError(f"swath must be at least 1 row, not {swath}")
        self._attend = attend
        self._world = World(fov, flyable, regions)
        self._fov = fov
        self._scene: Scene | None = None
        self._field_of = -1

    def _pattern(self, scene: Scene, belief: Belief) -> NDArray[np.int64]:
        """The cells to enter, in order."""
        raise NotImplementedError

    def _enter(self, scene: Scene, belief: Belief) -> None:
        rows, cols = scene.ground.shape
        self._scene = scene
        self._order = self._pattern(scene, belief)
        if self._order.size == 0:
            self._order = np.flatnonzero(scene.part.legal)
        self._next = 0
        self._field_of = -1
        self._field = np.zeros(rows * cols, dtype=np.int32)
        self._queue = np.zeros(rows * cols, dtype=np.int64)

    def plan(
        self,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where to go next: see `Planner.plan`. Draws nothing; its value is the mass of its goal."""
        began = time.perf_counter()
        scene = self._world.scene(belief, state.cell)
        if scene is not self._scene:
            self._enter(scene, belief)
        cols = scene.ground.shape[1]
        at = state.cell[0] * cols + state.cell[1]
        sums = belief.follow(scene.forest)
        unreachable = scene.unreachable(belief, sums)
        likely = scene.likeliest(belief, sums)
        if likely >= 0 and belief.weights[likely] > self._attend * belief.total:
            action, goal, path = "look again", likely, self._look(scene, at, likely, cols)
        else:
            if self._order[self._next] == at:
                self._next = (self._next + 1) % self._order.size
                if self._next == 0:
                    self._enter(scene, belief)
            goal = int(self._order[self._next])
            action, path = self.name, self._way(scene, at, goal, cols)
        if not path:
            return any_move(scene, state, began, unreachable)
        value = float(belief.weights[goal]) / belief.total
        effort = Effort(0, time.perf_counter() - began)
        cells = tuple(divmod(cell, cols) for cell in path)
        return Decision(cells, action, value, effort, unreachable, remark_on(unreachable))

    def _way(self, scene: Scene, at: int, goal: int, cols: int) -> list[int]:
        """The shortest way from `at` to `goal`, along rows first; empty when it is there already."""
        if scene.ground.is_open:
            col_sign = 1 if goal % cols > at % cols else -1
            row_sign = cols if goal // cols > at // cols else -cols
            along = [at + col_sign * i for i in range(1, abs(goal % cols - at % cols) + 1)]
            corner = along[-1] if along else at
            return along + [corner + row_sign * i for i in range(1, abs(goal // cols - at // cols) + 1)]
        if self._field_of != goal:
            flood(np.array([goal]), 0, scene.part.legal, cols, self._field, self._queue)
            self._field_of = goal
        path: list[int] = []
        while at != goal:
            at = min(self._neighbours(scene, at, cols), key=lambda cell: int(self._field[cell]))
            path.append(at)
        return path

    def _look(self, scene: Scene, at: int, goal: int, cols: int) -> list[int]:
        """The way to the next look at `goal`: to a cell beside it (or it) from which a move shows it."""
        poses: list[tuple[int, int]] = []
        for heading in range(4):
            for row, col in self._fov.offsets[heading]:
                r, c = goal // cols - int(row), goal % cols - int(col)
                before = r * cols + c - cell_step(heading, cols)
                inside = 0 <= r < scene.ground.shape[0] and 0 <= c < cols
                if inside and 0 <= before < scene.part.legal.size and scene.part.legal[before] >> heading & 1:
                    poses.append((before, before + cell_step(heading, cols)))
        if not poses:
            return []
        ways = [[*self._way(scene, at, before, cols), after] for before, after in poses]
        return min(ways, key=len)

    def _neighbours(self, scene: Scene, cell: int, cols: int) -> list[int]:
        legal = int(scene.part.legal[cell])
        return [cell + cell_step(move, cols) for move in (1, 3, 0, 2) if legal >> move & 1]

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that a decision and an observation use, by making some on a small map."""
        warm_up(lambda ground: type(self)(fov=self._fov, flyable=ground), self._fov, progress)


class CoveragePlanner(PatternPlanner):
    """Boustrophedon over the area, what a drone without a prior flies today: rows in turn, there and back.

    Lanes run over the searchable part of each row; with a multi-cell field of view they lie a swath apart.
    """

    name = "coverage"

    def _pattern(self, scene: Scene, belief: Belief) -> NDArray[np.int64]:
        rows, cols = scene.ground.shape
        wanted = (belief.weights > 0.0).reshape(rows, cols)
        flyable = (scene.part.legal > 0).reshape(rows, cols)
        flown, lanes = lanes_over(wanted, flyable, self._swath), list[NDArray[np.int64]]()
        for row in range(rows):
            along = np.flatnonzero(flown[row])
            lanes.append(row * cols + (along if row // self._swath % 2 == 0 else along[::-1]))
        return np.concatenate(lanes)


class SpiralPlanner(PatternPlanner):
    """A square spiral around the most probable cell, ring after ring until the area is done.

    Begun again at its end around the cell that is then most probable.
    """

    name = "spiral"

    def _pattern(self, scene: Scene, belief: Belief) -> NDArray[np.int64]:
        cols = scene.ground.shape[1]
        centre = scene.likeliest(belief, belief.follow(scene.forest))
        cells: NDArray[np.int64] = np.flatnonzero((scene.part.legal > 0) & (belief.weights > 0.0))
        if centre < 0 or cells.size == 0:
            return cells
        down, right = cells // cols - centre // cols, cells % cols - centre % cols
        ring = np.maximum(np.abs(down), np.abs(right))
        # the place on the ring, clockwise from the cell right of its upper left corner
        place = np.where(
            (down == -ring) & (right > -ring),
            right + ring,
            np.where(
                right == ring, 3 * ring + down, np.where(down == ring, 5 * ring - right, 7 * ring - down)
            ),
        )
        kept = ring % self._swath == 0
        ordered: NDArray[np.int64] = cells[kept][np.lexsort((place[kept], ring[kept]))]
        return ordered

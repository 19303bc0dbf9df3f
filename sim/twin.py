"""The planner's twin in plain Python: the same search without NumPy, numba or any cleverness.

It exists to be believed: `roisearch` must decide exactly as this does, with the same random numbers, and the
benchmark's ratios are against this, in the same run. So it is written for reading: tuples, lists and
dictionaries, the paper's steps one below the other. Where the order of a floating-point sum could show, it
is the planner's order (sums of sixteen).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.decision import AHEAD, Cell
from roisearch.fov import HEADINGS, FieldOfView
from roisearch.planners.puct.settings import PuctSettings
from roisearch.regions import Regions

STEPS = ((-1, 0), (0, 1), (1, 0), (0, -1))
TURNS = (0, 1, 3, 2)  # straight on, right, left, back
MASK = (1 << 64) - 1


def plain_sum(values: list[float]) -> float:
    """One after the other; the built-in sum compensates rounding since Python 3.12."""
    total = 0.0
    for value in values:
        total += value
    return total


def sum_by_sixteens(values: list[float]) -> float:
    """The sum of sums of sixteen, and so on up."""
    while len(values) > 1:
        values = [plain_sum(values[i : i + 16]) for i in range(0, len(values), 16)]
    return values[0] if values else 0.0


class TwinBelief:
    """Bayes' rule, cell by cell; the total is kept as sums of sixteen of sums of sixteen."""

    def __init__(self, prior: ArrayLike, outside: float = 0.0) -> None:
        """`prior`: float [rows, cols]; scaled as `roisearch.Belief` scales it."""
        mass = np.array(prior, dtype=np.float64)
        mass /= mass.max()
        mass *= (1.0 - outside) / float(mass.sum())
        self.rows, self.cols = mass.shape
        self.weights: list[float] = mass.ravel().tolist()
        self.outside = outside
        self.levels = [self.weights]
        while len(self.levels[-1]) > 1 or len(self.levels) == 1:
            below = self.levels[-1]
            self.levels.append([plain_sum(below[i : i + 16]) for i in range(0, len(below), 16)])
        self.changed: set[Cell] = set()

    @property
    def total(self) -> float:
        """What the weights have to be divided by."""
        return self.levels[-1][0] + self.outside

    def observe(self, cells: list[Cell], hits: list[bool], p_tp: list[float], p_tn: list[float]) -> None:
        """Multiply the odds of each looked-at cell."""
        for (row, col), hit, tp, tn in zip(cells, hits, p_tp, p_tn, strict=True):
            at = row * self.cols + col
            self.weights[at] *= tp / (1.0 - tn) if hit else (1.0 - tp) / tn
            for below, above in zip(self.levels, self.levels[1:], strict=False):
                at //= 16
                above[at] = plain_sum(below[at * 16 : at * 16 + 16])
            self.changed.add((row, col))


@dataclass
class Region:
    """A region of interest: its cells in the order of their sum, and what follows from the belief."""

    cells: list[Cell]
    centroid: tuple[float, float]
    mean: float = 0.0
    goal: Cell | None = None
    sources: list[Cell] = field(default_factory=list)
    field_: dict[Cell, int] = field(default_factory=dict)


@dataclass
class Node:
    """A node of the search tree; lists by action, P(a) is None for an illegal one."""

    p: list[float | None]
    worth: list[float]
    n: list[int]
    children: dict[int, Node] = field(default_factory=dict)
    visits: int = 0


def interleaved(row: int, col: int) -> int:
    """The bits of row and column in turn: the order in which a region's cells are summed."""
    return sum(((row >> bit & 1) << (2 * bit + 1)) | ((col >> bit & 1) << (2 * bit)) for bit in range(16))


class TwinPlanner:
    """PUCT over the flat MDP, the BMDP-O or the lite MDP-O, as `roisearch.planners.puct`.

    Args:
        settings: the same as the planner's; goals by "peak", and no commitment to trips.
        fov, flyable, regions: the same as the planner's; flyable is one connected part.
    """

    def __init__(
        self,
        settings: PuctSettings,
        fov: FieldOfView,
        regions: Regions,
        flyable: NDArray[np.bool_] | None = None,
    ) -> None:
        self.s = settings
        self.rows, self.cols = regions.labels.shape
        self.open = flyable is None or bool(flyable.all())
        mask = np.ones(regions.labels.shape, dtype=bool) if flyable is None else flyable
        self.flyable = {(int(r), int(c)) for r, c in np.argwhere(mask)}
        self.seen_from = [[(int(r), int(c)) for r, c in fov.offsets[h]] for h in range(4)]
        self.gains = fov.p_tp.tolist() if settings.gain == "detection" else [1.0] * len(fov.p_tp)
        self.miss = (1.0 - fov.p_tp).tolist()
        self.penalty = 1.0 / (self.rows * self.cols) if settings.penalty is None else settings.penalty
        self.fade: dict[Cell, float] = {}
        self.regions: list[Region] = []
        if settings.options:
            self._make_regions(regions)
        self.fresh = True

    def _make_regions(self, regions: Regions) -> None:
        inside: dict[int, list[Cell]] = {label: [] for label in range(regions.count + 1)}
        for row in range(self.rows):
            for col in range(self.cols):
                if self.find_sources((row, col)):
                    inside[int(regions.labels[row, col])].append((row, col))
        rest = inside[0] if regions.count else []
        middle = (sum(r for r, _ in rest) / len(rest), sum(c for _, c in rest) / len(rest)) if rest else (
            self.rows / 2.0, self.cols / 2.0
        )  # fmt: skip
        centroids = [middle, *[(float(r), float(c)) for r, c in regions.centroids]]
        for label, centroid in enumerate(centroids):
            cells = sorted(inside[label], key=lambda cell: interleaved(*cell))
            if label == 0 and not self.s.elsewhere:
                cells = []
            self.regions.append(Region(cells, centroid))

    # the world ---------------------------------------------------------------------------------------------

    def can_move(self, cell: Cell, move: int) -> bool:
        """Whether the move stays on flyable ground."""
        row, col = STEPS[move]
        return (cell[0] + row, cell[1] + col) in self.flyable

    def in_view(self, cell: Cell, heading: int) -> list[tuple[int, Cell]]:
        """The number and the place of each cell seen from here, on the map."""
        seen = []
        for i, (row, col) in enumerate(self.seen_from[heading]):
            r, c = cell[0] + row, cell[1] + col
            if 0 <= r < self.rows and 0 <= c < self.cols:
                seen.append((i, (r, c)))
        return seen

    def gain(self, cell: Cell, heading: int) -> float:
        """The weight in view, faded where the tree has seen it."""
        total = 0.0
        for i, seen in self.in_view(cell, heading):
            weight = self.weights[seen[0] * self.cols + seen[1]]
            total += self.gains[i] * (weight * self.fade.get(seen, 1.0) if self.s.fades else weight)
        return total

    def look(self, cell: Cell, heading: int) -> None:
        """Let what is in view fade, as the paper's in-tree belief update does."""
        if self.s.fades:
            for i, seen in self.in_view(cell, heading):
                self.fade[seen] = self.fade.get(seen, 1.0) * self.miss[i]

    def find_sources(self, goal: Cell) -> list[Cell]:
        """The cells from which one legal move ends with the goal in view."""
        sources = []
        for heading, (row, col) in enumerate(STEPS):
            for down, right in self.seen_from[heading]:
                cell = (goal[0] - down - row, goal[1] - right - col)
                if cell in self.flyable and self.can_move(cell, heading):
                    sources.append(cell)
        return sources

    def steps_to(self, cell: Cell, region: Region) -> float:
        """Steps until the goal of the region has been looked at."""
        if not self.open:
            return region.field_.get(cell, inf)
        return min((abs(r - cell[0]) + abs(c - cell[1]) + 1 for r, c in region.sources), default=inf)

    def _set_goals(self, belief: TwinBelief) -> None:
        changed, belief.changed = belief.changed, set()
        for region in self.regions:
            if not region.cells or not (self.fresh or changed.intersection(region.cells)):
                continue
            weights = [self.weights[r * self.cols + c] for r, c in region.cells]
            region.mean = sum_by_sixteens(weights) / len(weights)
            peak = max(weights)
            region.goal = region.cells[weights.index(peak)] if peak > 0.0 else None
            if region.goal is not None:
                region.sources = self.find_sources(region.goal)
                if not self.open:
                    region.field_ = self._flood(region.sources)
        self.fresh = False

    def _flood(self, sources: list[Cell]) -> dict[Cell, int]:
        """Breadth-first search over flyable ground, 1 at the sources."""
        steps = dict.fromkeys(sources, 1)
        queue = list(steps)
        for cell in queue:
            for move, (row, col) in enumerate(STEPS):
                near = (cell[0] + row, cell[1] + col)
                if near not in steps and self.can_move(cell, move):
                    steps[near] = steps[cell] + 1
                    queue.append(near)
        return steps

    # the search --------------------------------------------------------------------------------------------

    def plan(self, belief: TwinBelief, cell: Cell, heading: str, raw: int) -> tuple[str, list[Cell]]:
        """The chosen action and the cells to enter; `raw` is the 64-bit number that seeds the search."""
        self.weights = belief.weights
        self.scale = 1.0 / belief.total
        self.random = raw
        self._set_goals(belief)
        self.low, self.high = inf, -inf
        facing = HEADINGS.index(heading)
        self.root = self._expand(cell)
        for _ in range(self.s.iterations or 1):
            self._simulate(cell, facing)
        action = self._choose()
        if action < 4:
            row, col = STEPS[action]
            return HEADINGS[action], [(cell[0] + row, cell[1] + col)]
        region = self.regions[action - 4]
        path: list[Cell] = []
        arrived = False
        while not arrived and len(path) < AHEAD:
            move, arrived = self._trip_move(cell, facing, region)
            cell, facing = (cell[0] + STEPS[move][0], cell[1] + STEPS[move][1]), move
            path.append(cell)
        return ("elsewhere" if action == 4 else f"region {action - 4}"), path

    def _simulate(self, cell: Cell, heading: int) -> None:
        """Down the tree to a new node, a rollout, and the return back up."""
        node = self.root
        trail = []
        for _ in range(self.s.depth):
            action = self._select(node)
            cell, heading, reward, kept = self._step(cell, heading, action)
            trail.append((node, action, reward, kept))
            if action not in node.children:
                node.children[action] = self._expand(cell)
                break
            node = node.children[action]
        value = self._roll_out(cell, heading)
        self.fade = {}
        for node, action, reward, kept in reversed(trail):
            value = reward + kept * value
            node.n[action] += 1
            node.visits += 1
            if self.s.backup == "mean":
                node.worth[action] += value
                shown = node.worth[action] / node.n[action]
            else:
                shown = value if node.n[action] == 1 else max(value, node.worth[action])
                node.worth[action] = shown
            self.low, self.high = min(self.low, shown), max(self.high, shown)

    def _step(self, cell: Cell, heading: int, action: int) -> tuple[Cell, int, float, float]:
        """An action in the model: where it ends, its reward, and the discount of its steps."""
        if action < 4:
            cell = (cell[0] + STEPS[action][0], cell[1] + STEPS[action][1])
            reward = self.scale * self.gain(cell, action) - self.penalty
            self.look(cell, action)
            return cell, action, reward, self.s.discount
        region = self.regions[action - 4]
        reward, kept = 0.0, 1.0
        if self.s.option_reward == "density":
            reward = self._density(cell, region)
            for _ in range(int(self.steps_to(cell, region))):
                kept *= self.s.discount
            return (*self._jump(cell, heading, region), reward, kept)
        arrived = False
        while not arrived:
            move, arrived = self._trip_move(cell, heading, region)
            cell, heading = (cell[0] + STEPS[move][0], cell[1] + STEPS[move][1]), move
            reward += kept * (self.scale * self.gain(cell, heading) - self.penalty)
            kept *= self.s.discount
            self.look(cell, heading)
        return cell, heading, reward, kept

    def _density(self, cell: Cell, region: Region) -> float:
        """f * mean mass / (A^2 * distance to the centroid)."""
        apart = abs(region.centroid[0] - cell[0]) + abs(region.centroid[1] - cell[1])
        return self.s.factor / self.s.area**2 * self.scale * region.mean / max(apart, 1.0)

    def _jump(self, cell: Cell, heading: int, region: Region) -> tuple[Cell, int]:
        """Where the lite model's option ends, and the heading there."""
        assert region.goal is not None
        end = region.goal if any(self.can_move(region.goal, move) for move in range(4)) else None
        if end is None or end not in self.flyable:
            end = region.sources[0]
        down, right = end[0] - cell[0], end[1] - cell[1]
        if abs(down) > abs(right):
            heading = 2 if down > 0 else 0
        elif right != 0:
            heading = 1 if right > 0 else 3
        return end, heading

    def _trip_move(self, cell: Cell, heading: int, region: Region) -> tuple[int, bool]:
        """The next move to a look at the region's goal, and whether that is the last."""
        best, best_steps, best_gain = -1, inf, -1.0
        for turn in TURNS:
            move = (heading + turn) % 4
            if not self.can_move(cell, move):
                continue
            near = (cell[0] + STEPS[move][0], cell[1] + STEPS[move][1])
            done = any(seen == region.goal for _, seen in self.in_view(near, move))
            steps = 0 if done else self.steps_to(near, region)
            if steps > best_steps or steps == inf:
                continue
            gain = self.gain(near, move)
            if steps < best_steps or gain > best_gain:
                best, best_steps, best_gain = move, steps, gain
        return best, best_steps == 0

    def _expand(self, cell: Cell) -> Node:
        """A new node with P(a) from the one-step hopes."""
        hopes: list[float | None] = []
        for move in range(4):
            if not self.can_move(cell, move):
                hopes.append(None)
                continue
            near = (cell[0] + STEPS[move][0], cell[1] + STEPS[move][1])
            gain = self.scale * self.gain(near, move)
            hopes.append(gain**self.s.alpha if self.s.prior == "index" else gain - self.penalty)
        for region in self.regions:
            steps = inf if region.goal is None else self.steps_to(cell, region)
            if region.goal is None or steps == inf:
                hopes.append(None)
            elif self.s.prior == "index":
                weight = self.weights[region.goal[0] * self.cols + region.goal[1]]
                if self.s.fades:
                    weight = weight * self.fade.get(region.goal, 1.0)
                hopes.append((self.scale * self.gains[0] * weight) ** self.s.alpha / steps)
            else:
                hopes.append(self._density(cell, region))
        legal = [hope for hope in hopes if hope is not None]
        least, most = min(legal), max(legal)
        if self.s.prior == "uniform" or most <= least:
            shares = [None if hope is None else 1.0 for hope in hopes]
        else:
            unit = 1.0 / (most - least)
            shares = [None if hope is None else self.s.floor + (hope - least) * unit for hope in hopes]
        total = 0.0
        for share in shares:
            total += share or 0.0
        p = [None if share is None else share * (1.0 / total) for share in shares]
        return Node(p, [0.0] * len(p), [0] * len(p))

    def _select(self, node: Node) -> int:
        """The action with the best PUCT score."""
        urge = self.s.explore * sqrt(node.visits + 1.0)
        scale = 1.0 / (self.high - self.low) if self.high > self.low else 0.0
        best, best_score = -1, -inf
        for action, p in enumerate(node.p):
            if p is None:
                continue
            n, worth = node.n[action], node.worth[action]
            q = 0.0
            if not self.s.normalise:
                q = worth / (1.0 + n)
            elif n > 0:
                q = ((worth / n if self.s.backup == "mean" else worth) - self.low) * scale
            score = q + urge * (p / (1.0 + n))
            if score > best_score:
                best, best_score = action, score
        return best

    def _draw(self) -> int:
        """A number from 0 to 3: the top two bits of the next random number."""
        self.random = (self.random * 6364136223846793005 + 1442695040888963407) & MASK
        return self.random >> 62

    def _roll_out(self, cell: Cell, heading: int) -> float:
        """The discounted return of the rollout policy."""
        total, kept = 0.0, 1.0
        for step in range(self.s.rollout):
            move = heading
            if self.s.rollout_policy == "steepest":
                gain = -1.0
                for turn in TURNS:
                    there = (heading + turn) % 4
                    if self.can_move(cell, there):
                        near = (cell[0] + STEPS[there][0], cell[1] + STEPS[there][1])
                        found = self.gain(near, there)
                        if found > gain:
                            move, gain = there, found
            elif self.s.rollout_policy == "random" or step == 0:
                move = self._draw()
                while not self.can_move(cell, move):
                    move = self._draw()
            elif not self.can_move(cell, move):
                break
            cell, heading = (cell[0] + STEPS[move][0], cell[1] + STEPS[move][1]), move
            total += kept * (self.scale * self.gain(cell, heading) - self.penalty)
            kept *= self.s.discount
            self.look(cell, heading)
        return total

    def _choose(self) -> int:
        """The root action with most visits, or the best value."""
        best = -1
        for action, p in enumerate(self.root.p):
            if p is None:
                continue
            if best < 0:
                best = action
            elif self.s.choose == "visits":
                if self.root.n[action] > self.root.n[best]:
                    best = action
            elif self.root.n[action] and (not self.root.n[best] or self._value(action) > self._value(best)):
                best = action
        return best

    def _value(self, action: int) -> float:
        worth, n = self.root.worth[action], self.root.n[action]
        return worth / n if self.s.backup == "mean" else worth

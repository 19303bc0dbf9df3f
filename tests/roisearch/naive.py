"""Slow, obvious twins of the kernels: what each must agree with. The search's own twin is `sim.twin`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch import FieldOfView
from roisearch.fov import HEADINGS, MOVES

Cell = tuple[int, int]


def posterior(
    prior: NDArray[np.float64], outside: float, looks: list[tuple[Cell, bool, float, float]]
) -> tuple[NDArray[np.float64], float]:
    """Bayes' rule by its definition, every hypothesis a row: the cells' probabilities, and that of outside."""
    p = prior / prior.sum() * (1.0 - outside)
    out = outside
    for cell, hit, p_tp, p_tn in looks:
        likelihood = np.full(p.shape, 1.0 - p_tn if hit else p_tn)
        likelihood[cell] = p_tp if hit else 1.0 - p_tp
        p = p * likelihood
        out = out * (1.0 - p_tn if hit else p_tn)
        total = p.sum() + out
        p, out = p / total, out / total
    return p, out


def neighbours(cell: Cell, flyable: NDArray[np.bool_]) -> list[tuple[int, Cell]]:
    """The legal moves from a cell and where they lead."""
    found = []
    for heading, (down, right) in enumerate(MOVES):
        row, col = cell[0] + down, cell[1] + right
        if 0 <= row < flyable.shape[0] and 0 <= col < flyable.shape[1] and flyable[row, col]:
            found.append((heading, (row, col)))
    return found


def distances(start: Cell, flyable: NDArray[np.bool_]) -> dict[Cell, int]:
    """Moves from `start` to every cell that can be reached."""
    steps = {start: 0}
    queue = [start]
    for cell in queue:
        for _, near in neighbours(cell, flyable):
            if near not in steps:
                steps[near] = steps[cell] + 1
                queue.append(near)
    return steps


def steps_to_look(start: Cell, goal: Cell, flyable: NDArray[np.bool_], fov: FieldOfView) -> float:
    """The least number of moves from `start`, at least one, after which `goal` is in view; inf if none will do."""
    best = np.inf
    for cell, steps in distances(start, flyable).items():
        for heading, near in neighbours(cell, flyable):
            seen = fov.cells(near, HEADINGS[heading], flyable.shape).tolist()
            if list(goal) in seen:
                best = min(best, steps + 1)
    return float(best)


def index_score(
    prior: NDArray[np.float64], start: Cell, flyable: NDArray[np.bool_], fov: FieldOfView, alpha: float
) -> float:
    """The largest m ** alpha / steps of any cell."""
    best = 0.0
    for cell in map(tuple, np.argwhere(prior > 0.0).tolist()):
        steps = steps_to_look(start, cell, flyable, fov)
        best = max(best, float(prior[cell]) ** alpha / steps)
    return best


def greedy_value(
    prior: NDArray[np.float64], start: Cell, flyable: NDArray[np.bool_], horizon: int
) -> tuple[float, int]:
    """The most probable cell within `horizon` moves for a point sensor, its own cell excluded; nearest of equals."""
    reached = {c: n for c, n in distances(start, flyable).items() if 0 < n <= horizon}
    best = max(float(prior[cell]) for cell in reached)
    return best, min(steps for cell, steps in reached.items() if prior[cell] == best)


def walked(
    p: NDArray[np.float64], into: NDArray[np.float64], stops: float, ticks: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Who walks and who has stopped after some ticks, if all of `p` walk at first: the chain's whole matrix, squared.

    `into` [rows, cols]: the chance to step into a cell from each neighbour; zero closes it.
    """
    size, cols = p.size, p.shape[1]
    matrix = np.eye(size)
    for a in range(size):
        for b in range(size):
            beside = abs(a // cols - b // cols) + abs(a % cols - b % cols) == 1
            if beside and into.flat[a] > 0.0 and into.flat[b] > 0.0:
                matrix[a, b] += into.flat[b]
                matrix[a, a] -= into.flat[b]
    walks, stopped = p.ravel().copy(), np.zeros(size)
    for _ in range(ticks):
        walks = walks @ matrix
        stopped += stops * walks
        walks = (1.0 - stops) * walks
    return walks.reshape(p.shape), stopped.reshape(p.shape)

"""The bound after a target that walks: above every flight, and the best flight is that of all that were tried."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from roisearch import Walk
from roisearch.bounds import Hunt, best_flight, pursuit
from roisearch.detection import DetectionRecord

STEP_S = 25.0 / 8.0
WALK = Walk(1.5, 25.0)
STOPS = Walk(1.5, 25.0, stops_per_hour=40.0)


def prior_of(seed: int, shape: tuple[int, int]) -> NDArray[np.float64]:
    prior = np.random.default_rng(seed).random(shape) ** 2
    normalised: NDArray[np.float64] = prior / prior.sum()
    return normalised


def flown(
    prior: NDArray[np.float64],
    hunt: Hunt,
    path: list[tuple[int, int]],
    searchable: NDArray[np.bool_] | None = None,
) -> tuple[float, float]:
    """F at the end, and the end minus the expected time, of a flight; diagonals take longer."""
    record = DetectionRecord(prior, walk=hunt.walk, searchable=searchable)
    here, time, sooner = hunt.start, 0.0, 0.0
    for cell in path:
        passed = hunt.step_s * math.hypot(cell[0] - here[0], cell[1] - here[1])
        if time + passed > hunt.until_s:
            break
        here, time, before = cell, time + passed, record.pos
        record.drift(passed)
        record.look(np.array([cell]), np.array([hunt.p_tp]))
        sooner += (record.pos - before) * (hunt.until_s - time)
    return record.pos, sooner


def next_cells(cell: tuple[int, int], shape: tuple[int, int], diagonal: bool) -> list[tuple[int, int]]:
    near = [(cell[0] + down, cell[1] + right) for down in (-1, 0, 1) for right in (-1, 0, 1)]
    near = [(r, c) for r, c in near if (r, c) != cell and 0 <= r < shape[0] and 0 <= c < shape[1]]
    return near if diagonal else [(r, c) for r, c in near if r == cell[0] or c == cell[1]]


def every_flight(shape: tuple[int, int], steps: int) -> list[list[tuple[int, int]]]:
    flights: list[list[tuple[int, int]]] = [[]]
    for _ in range(steps):
        flights = [[*f, cell] for f in flights for cell in next_cells((f or [(0, 0)])[-1], shape, False)]
    return flights


@pytest.mark.parametrize("walk", [WALK, STOPS])
@pytest.mark.parametrize("p_tp", [0.7, 1.0])
def test_the_best_flight_is_that_of_all_and_the_bound_is_not_below(walk: Walk, p_tp: float) -> None:
    shape, steps = (2, 3), 6
    prior = prior_of(1, shape)
    hunt = Hunt(walk, p_tp=p_tp, step_s=STEP_S, until_s=steps * STEP_S, diagonal=False)
    every = [flown(prior, hunt, path) for path in every_flight(shape, steps)]
    for i, counts in enumerate(("found", "seconds")):
        best, bound = best_flight(prior, hunt, counts=counts), pursuit(prior, hunt, counts=counts)
        most = max(each[i] for each in every)
        assert best.most == pytest.approx(most, rel=1e-9)
        assert flown(prior, hunt, [(r, c) for r, c in best.path.tolist()])[i] == pytest.approx(most, rel=1e-9)
        assert best.tried < len(every)
        assert most - 1e-9 <= bound.most <= 1.35 * most
    assert bound.seconds == pytest.approx(hunt.until_s - bound.most)


def test_no_flight_with_diagonals_is_above_the_bound() -> None:
    shape, rng = (5, 4), np.random.default_rng(7)
    closed = np.ones(shape, dtype=bool)
    closed[2, 1:3] = False
    prior = prior_of(2, shape) * closed
    prior /= prior.sum()
    hunt = Hunt(STOPS, (4, 0), step_s=STEP_S, until_s=40.5)
    bounds = [
        pursuit(prior, hunt, counts=each, searchable=closed, iterations=30).most
        for each in ("found", "seconds")
    ]
    for _ in range(60):
        path, cell = [], hunt.start
        for _ in range(13):  # now and then at random, else to where most was
            near = next_cells(cell, shape, True)
            greedy = max(near, key=lambda each: prior[each] if each not in path else 0.0)
            cell = greedy if rng.random() < 0.7 else near[rng.integers(len(near))]
            path.append(cell)
        for most, got in zip(bounds, flown(prior, hunt, path, closed), strict=True):
            assert got <= most + 1e-9


def test_a_searcher_beside_the_one_cell_there_is_reaches_the_bound() -> None:
    hunt = Hunt(
        Walk(0.5, 25.0), (0, 1), step_s=STEP_S, until_s=STEP_S, diagonal=False
    )  # it has not stepped yet
    assert pursuit(np.array([[1.0, 0.0]]), hunt).most == pytest.approx(0.9, rel=1e-9)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"p_tp": 0.0}, "p_tp"),
        ({"until_s": 1.0}, "a step or longer"),
        ({"start": (3, 0)}, "not on the map"),
        ({"diagonal": True}, "diagonal=False"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, object], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        best_flight(np.ones((2, 2)), Hunt(**{"walk": WALK, "until_s": 20.0, "diagonal": False, **options}))  # type: ignore[arg-type]


def test_a_search_that_is_too_long_for_trying_says_so() -> None:
    with pytest.raises(ValueError, match="take fewer steps"):
        best_flight(np.ones((3, 4)), Hunt(WALK, until_s=60.0, diagonal=False), most_tried=10)

"""The kernels of the sweep planner agree with slow twins, and put the map back to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import Belief, FieldOfView, SearchState
from roisearch.fov import HEADINGS, MOVES
from roisearch.kernels import chart as charts
from roisearch.kernels import plans, sweeps
from roisearch.planners.sweep import SweepPlanner
from roisearch.planners.sweep_settings import SweepSettings
from roisearch.regions import Regions

FOVS = {"point": FieldOfView.point(), "donut": FieldOfView.donut(), "wide": FieldOfView.wide_angle()}


def planner_on(
    weights: np.ndarray, name: str, at: tuple[int, int], flyable: np.ndarray | None = None
) -> tuple[SweepPlanner, np.ndarray]:
    """A planner that has planned once from `at`, with two regions, and the probability of all that can be seen."""
    labels = np.ones(weights.shape, dtype=np.int32)
    labels[:, weights.shape[1] // 2 :] = 2
    regions = Regions(labels, 2, np.zeros((2, 2)), np.zeros((2, 2), dtype=np.int64))
    planner = SweepPlanner(
        SweepSettings(iterations=0, horizon=64), fov=FOVS[name], regions=regions, flyable=flyable
    )
    belief = Belief(weights)
    planner.plan(belief, SearchState(at), np.random.default_rng(0))
    assert planner._scene is not None
    return planner, np.where(planner._scene.part.viewable, belief.probability(), 0.0)


def naive_gain(mass: np.ndarray, fov: FieldOfView, cell: tuple[int, int], heading: int) -> float:
    cells = fov.cells(cell, HEADINGS[heading], mass.shape)
    return float((0.9 * mass[cells[:, 0], cells[:, 1]]).sum())


def naive_distances(flyable: np.ndarray, at: tuple[int, int]) -> np.ndarray:
    distance = np.full(flyable.shape, 10**6)
    distance[at] = 0
    queue = [at]
    for row, col in queue:
        for down, right in MOVES:
            there = (row + down, col + right)
            inside = 0 <= there[0] < flyable.shape[0] and 0 <= there[1] < flyable.shape[1]
            if inside and flyable[there] and distance[there] == 10**6:
                distance[there] = distance[row, col] + 1
                queue.append(there)
    return distance


def naive_best(
    mass: np.ndarray, fov: FieldOfView, at: tuple[int, int], flyable: np.ndarray, labels: np.ndarray, region: int,
    floor: float,
) -> float:  # fmt: skip
    """The best score of the rule (d + 1) ** -0.4, by looking at every cell."""
    distance = naive_distances(flyable, at)
    best = 0.0
    for row, col in np.argwhere(flyable & (distance < 10**6) & (distance > 0)):
        if region >= 0 and labels[row, col] != region:
            continue
        cell, steps = (int(row), int(col)), int(distance[row, col])
        if fov.is_point:
            worth = float(mass[cell])
        elif steps == 1:
            worth = naive_gain(mass, fov, cell, MOVES.index((cell[0] - at[0], cell[1] - at[1])))
        else:
            worth = float(np.mean([naive_gain(mass, fov, cell, heading) for heading in range(4)]))
        if worth >= floor:
            best = max(best, worth * (steps + 1.0) ** -0.4)
    return best


def snapshot(chart: charts.Chart) -> list[np.ndarray]:
    return [array.copy() for array in (chart.mass, chart.worth, chart.peaks, chart.tops, chart.levels)]


@pytest.mark.parametrize("name", FOVS)
@pytest.mark.parametrize("walled", [False, True])
@given(seed=st.integers(0, 10_000), region=st.sampled_from([-1, 1, 2]))
@settings(max_examples=25, deadline=None)
def test_the_next_move_comes_nearer_to_the_naive_best(
    name: str, walled: bool, seed: int, region: int
) -> None:
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(3, 30)), int(rng.integers(3, 30)))
    weights = rng.random(shape) ** 6
    at = (0, int(rng.integers(0, shape[1])))
    flyable = np.ones(shape, dtype=bool)
    if walled:
        flyable[1 : shape[0] - 1, shape[1] // 2] = False
    planner, mass = planner_on(weights, name, at, flyable)
    chart, near = planner._chart, planner._rules.nears[0]
    labels, home, wave = planner._labels, planner._home, planner._wave
    floor = float(rng.choice([0.0, 0.3])) * float(mass.max())
    best = naive_best(mass, FOVS[name], at, flyable, labels.reshape(shape), region, floor)
    _, score = sweeps.best_neighbour(at[0], at[1], 0, chart, near, labels, region, floor)
    if chart.is_open:
        _, far = sweeps.best_close(at[0], at[1], chart, near, labels, region, floor, score)
        limit = sweeps.far_limit(at[0], at[1], chart, near, home, region, floor)
        assert best <= max(far, limit) * (1 + 1e-12)
        if far < limit:
            _, far = sweeps.best_far(at[0], at[1], chart, near, labels, home, region, floor, far)
    else:
        _, far = sweeps.best_wave(at[0], at[1], chart, near, labels, region, floor, score, wave)
    assert far == pytest.approx(best, rel=1e-9)
    chosen = sweeps.next_move(at[0], at[1], 0, chart, near, labels, home, region, floor, np.inf, wave)
    assert (chosen < 0) == (best == 0.0)
    if chosen >= 0:
        there = (at[0] + MOVES[chosen][0], at[1] + MOVES[chosen][1])
        assert flyable[there]


@pytest.mark.parametrize("name", FOVS)
@given(seed=st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_a_sweep_tells_the_area_under_its_survival_curve_and_leaves_no_trace(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(2, 40)), int(rng.integers(2, 40)))
    planner, mass = planner_on(rng.random(shape) ** 6, name, (0, 0))
    chart, fov = planner._chart, FOVS[name]
    before = snapshot(chart)
    path = np.zeros(100, dtype=np.int64)
    charts.begin(chart)
    area, undetected, steps, row, col, _ = sweeps.sweep(
        0, 0, 0, chart, planner._rules.nears[0], planner._labels, planner._home, -1, 0.0, 90, 1.0, path, 5,
        planner._wave,
    )  # fmt: skip
    rebuilt = chart.worth.copy()
    charts.draw_up(chart)  # from the mass alone
    np.testing.assert_allclose(rebuilt, chart.worth, atol=1e-12)
    charts.restore(chart)
    for array, old in zip(snapshot(chart), before, strict=True):
        np.testing.assert_array_equal(array, old)

    at, expected, left = (0, 0), 0.0, 1.0
    for flat in path[5 : 5 + steps]:
        there = (int(flat) // shape[1], int(flat) % shape[1])
        heading = MOVES.index((there[0] - at[0], there[1] - at[1]))
        expected += left
        left -= naive_gain(mass, fov, there, heading)
        cells = fov.cells(there, HEADINGS[heading], shape)
        mass[cells[:, 0], cells[:, 1]] *= 0.1
        at = there
    assert (row, col) == at
    assert area == pytest.approx(expected, rel=1e-9)
    assert undetected == pytest.approx(left, abs=1e-9)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_iterations_leave_the_map_alone_and_the_value_is_that_of_the_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    planner, _ = planner_on(rng.random((25, 31)) ** 8, "point", (3, 4))
    chart, tree = planner._chart, planner._tree
    before, value = snapshot(chart), float(tree.value[plans.EXPECTED])
    planner._random[0] = seed
    args = (chart, tree, planner._rules, planner._labels, planner._home)
    for _ in range(40):
        plans.iterate(3, 4, 0, *args, planner._wave, planner._random, 0)
        assert tree.value[plans.EXPECTED] <= value + 1e-9
        value = float(tree.value[plans.EXPECTED])
    for array, old in zip(snapshot(chart), before, strict=True):
        np.testing.assert_array_equal(array, old)
    assert plans.evaluate(3, 4, 0, chart, tree, planner._rules) == pytest.approx(value, rel=1e-9)
    cells = np.column_stack([tree.path // 31, tree.path % 31])[: tree.mark[plans.LENGTH]]
    assert (np.abs(np.diff(np.vstack([[3, 4], cells]), axis=0)).sum(axis=1) == 1).all()


def test_clearing_takes_as_long_as_halving_every_level() -> None:
    """Four cells of one mass and one of half: with p_tp = 1/2 each look halves a cell."""
    levels = np.zeros((charts.LEVELS, 2))
    levels[0] = 4, 0.8
    levels[1] = 1, 0.1
    masses, left, area = [0.2] * 4 + [0.1], 0.9, 0.0
    for _ in range(400):
        i = int(np.argmax(masses))
        area += (
            left - 0.25 * masses[i]
        )  # half of what the look finds, as the formula spreads it over the look
        left -= masses[i] / 2
        masses[i] /= 2
    assert charts.time_to_clear(levels, 0.9, 1.0, 1.0) == pytest.approx(area, rel=1e-6)

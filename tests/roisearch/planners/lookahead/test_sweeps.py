"""The kernels of the default planner agree with slow twins, and put the map back to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import FieldOfView
from roisearch.fov import HEADINGS, MOVES
from roisearch.planners.lookahead import chart as charts
from roisearch.planners.lookahead import plans, sweeps
from roisearch.regions import Regions

from .thought import Thought, thought

FOVS = {"point": FieldOfView.point(), "donut": FieldOfView.donut(), "wide": FieldOfView.wide_angle()}


def begun_on(
    weights: np.ndarray, name: str, at: tuple[int, int], flyable: np.ndarray | None = None
) -> Thought:
    """A plan from `at`, with two regions."""
    labels = np.ones(weights.shape, dtype=np.int32)
    labels[:, weights.shape[1] // 2 :] = 2
    regions = Regions(labels, 2, np.zeros((2, 2)), np.zeros((2, 2), dtype=np.int64))
    return thought(weights, FOVS[name], at, flyable, regions, horizon=64)


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
    return [
        array.copy()
        for array in (chart.mass, chart.worth, chart.peaks, chart.tops, chart.crests, chart.levels)
    ]


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
    begun = begun_on(weights, name, at, flyable)
    chart, near, pose, mass = begun.chart, begun.near, begun.pose, begun.mass
    floor = float(rng.choice([0.0, 0.3])) * float(mass.max())
    best = naive_best(mass, FOVS[name], at, flyable, chart.labels.reshape(shape), region, floor)
    option = sweeps.Option(near, region, floor)
    _, score = sweeps.best_neighbour(pose, chart, option)
    if chart.is_open:
        _, far = sweeps.best_close(pose, chart, option, score)
        limit = sweeps.far_limit(pose, chart, option)
        assert best <= max(far, limit) * (1 + 1e-12)
        if far < limit:
            _, far = sweeps.best_far(pose, chart, option, far, -1)
    else:
        _, far = sweeps.best_wave(pose, chart, option, score)
    assert far == pytest.approx(best, rel=1e-9)
    chosen, _ = sweeps.next_move(pose, chart, option, np.inf, -1)
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
    begun = begun_on(rng.random(shape) ** 6, name, (0, 0))
    chart, mass, fov = begun.chart, begun.mass, FOVS[name]
    before = snapshot(chart)
    path = np.zeros(100, dtype=np.int64)
    charts.begin(chart)
    anywhere = sweeps.Option(begun.near, sweeps.ANYWHERE, 0.0)
    area, undetected, steps, pose = sweeps.sweep(begun.pose, chart, anywhere, 90, 1.0, path, 5)
    kept = [array.copy() for array in (chart.worth, chart.peaks, chart.tops, chart.crests)]
    charts.draw_up(chart)  # from the mass alone
    for array, drawn in zip(kept, (chart.worth, chart.peaks, chart.tops, chart.crests), strict=True):
        np.testing.assert_allclose(array, drawn, atol=1e-12)
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
    assert (pose.row, pose.col) == at
    assert area == pytest.approx(expected, rel=1e-9)
    assert undetected == pytest.approx(left, abs=1e-9)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_iterations_leave_the_map_alone_and_the_value_is_that_of_the_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    begun = begun_on(rng.random((25, 31)) ** 8, "point", (3, 4))
    chart, tree = begun.chart, begun.tree
    before, value = snapshot(chart), float(tree.value[plans.EXPECTED])
    begun.desk.random[0] = seed
    for _ in range(40):
        plans.iterate(begun.pose, tree, begun.desk, 0)
        assert tree.value[plans.EXPECTED] <= value + 1e-9
        value = float(tree.value[plans.EXPECTED])
    for array, old in zip(snapshot(chart), before, strict=True):
        np.testing.assert_array_equal(array, old)
    assert plans.evaluate(begun.pose, tree, begun.desk) == pytest.approx(value, rel=1e-9)
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


LARGE = (70, 2 * charts.DISTRICT + 90)
"""A map of several districts and areas."""


def thin(seed: int) -> np.ndarray:
    """A large map with mass in few places, so that what is worth most is often far away."""
    rng = np.random.default_rng(seed)
    return np.where(rng.random(LARGE) < 0.0003, rng.random(LARGE), 0.0) + 1e-9 * rng.random(LARGE)


@pytest.mark.parametrize("region", [-1, 1, 2])
def test_the_best_cell_of_a_large_map_is_found_without_reading_it(region: int) -> None:
    for seed in range(3):
        at = (35, 60 + 360 * seed)
        begun = begun_on(thin(seed), "point", at)
        chart, pose, mass = begun.chart, begun.pose, begun.mass
        option = sweeps.Option(begun.near, region, 0.0)
        labels = chart.labels.reshape(LARGE)
        best = naive_best(mass, FOVS["point"], at, np.ones(LARGE, dtype=bool), labels, region, 0.0)
        _, near = sweeps.best_neighbour(pose, chart, option)
        _, near = sweeps.best_close(pose, chart, option, near)
        _, far = sweeps.best_far(pose, chart, option, near, -1)
        assert far == pytest.approx(best, rel=1e-9)
        assert best <= max(near, sweeps.far_limit(pose, chart, option)) * (1 + 1e-12)


@pytest.mark.parametrize("even", [False, True])
@pytest.mark.parametrize("region", [-1, 1, 2])
def test_what_was_the_best_before_changes_no_choice(region: int, even: bool) -> None:
    """Neither a good goal nor a bad one, nor one that is no cell of the option; on an even slope and on thin mass."""
    down, right = np.indices(LARGE) / LARGE[1]
    weights = np.exp(-6.0 * ((down - 0.5) ** 2 + (right - 0.9) ** 2)) if even else thin(1)
    begun = begun_on(weights, "point", (3, 5))
    chart, pose, option = begun.chart, begun.pose, sweeps.Option(begun.near, region, 0.0)
    chosen = sweeps.best_far(pose, chart, option, 0.0, -1)
    goals = np.random.default_rng(1).integers(0, chart.mass.size, 20).tolist()
    for goal in (chosen[0], chosen[0] + 1, 3 * chart.cols + 5, *goals):
        assert sweeps.best_far(pose, chart, option, 0.0, goal) == chosen


@pytest.mark.parametrize("halves", [False, True])
def test_what_regions_are_worth_is_the_most_of_any_of_their_cells(halves: bool) -> None:
    for seed in range(3):
        at = (35, 1090 - 400 * seed)
        begun = begun_on(thin(seed), "point", at)
        chart, near = begun.chart, begun.near
        mass = chart.mass.reshape(LARGE)
        if halves:  # also inside areas and blocks
            chart.labels[:] = 1 + np.random.default_rng(seed).integers(0, 2, mass.size)
            for lives in (chart.home, chart.homes):
                lives[:] = 1, 2
        apart = np.abs(np.indices(LARGE) - np.array(at)[:, None, None]).sum(axis=0)
        scores, worths = np.zeros(3), np.zeros(3)
        sweeps.region_scores(begun.pose, chart, near, scores, worths)
        labels = chart.labels.reshape(LARGE)
        for label in (1, 2):
            inside = np.where(labels == label, mass, 0.0)
            assert worths[label] == inside.max()
            assert scores[label] == (inside * near[np.maximum(1, apart)]).max()


def test_a_change_of_one_cell_is_seen_from_above() -> None:
    rng = np.random.default_rng(3)
    chart = begun_on(thin(0), "point", (1, 1)).chart
    for cell in np.concatenate([np.argsort(chart.mass)[-20:][::-1], rng.integers(0, chart.mass.size, 20)]):
        charts.change(
            chart, *divmod(int(cell), LARGE[1]), float(rng.choice([0.0, 1.0]) * rng.random()), False
        )
        above = [array.copy() for array in (chart.peaks, chart.tops, chart.crests)]
        for row, col in np.ndindex(*chart.peaks.shape):
            chart.peaks[row, col] = charts.largest_in_block(chart.worth, *LARGE, row, col)
        for row, col in np.ndindex(*chart.tops.shape):
            charts.recompute_area(chart, row, col)
        for row, col in np.ndindex(*chart.crests.shape):
            charts.recompute_district(chart, row, col)
        for kept, drawn in zip(above, (chart.peaks, chart.tops, chart.crests), strict=True):
            np.testing.assert_array_equal(kept, drawn)

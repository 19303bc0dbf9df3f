"""Which regions have options at a decision: those that promise most, and the one that is under way."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, SearchState, make_planner, segment_regions
from roisearch.forest import Forest
from roisearch.kernels.records import Forest as Trees
from roisearch.kernels.records import Pose
from roisearch.planners.puct.choosing import choose_regions
from sim.bench_regions import lattice

ALPHA = 2.5


def promises(prior: NDArray[np.float64], labels: NDArray[np.int32], cell: tuple[int, int]) -> list[float]:
    """The plain way: the best weight to the power alpha, over the steps to the box around a region."""
    told = []
    for region in range(int(labels.max()) + 1):
        rows, cols = np.nonzero(labels == region)
        steps = max(0, rows.min() - cell[0], cell[0] - rows.max()) + max(
            0, cols.min() - cell[1], cell[1] - cols.max()
        )
        told.append(float(prior[labels == region].max()) ** ALPHA / max(1, steps))
    return told


def choose(prior: NDArray[np.float64], cell: tuple[int, int], held: int, chosen: NDArray[np.int64]) -> None:
    regions = segment_regions(prior)
    forest = Forest(regions.labels, regions.count + 1)
    sums = forest.begin(prior.ravel().copy(), (prior.shape[0], prior.shape[1]))
    trees = Trees(forest.cell_of, forest.first, forest.last, forest.box, forest.root, sums.peaks)
    choose_regions(Pose(*cell, 0), trees, ALPHA, held, chosen, np.zeros((2, chosen.size)))


@pytest.mark.parametrize("cell", [(0, 0), (40, 25), (71, 71)])
def test_the_regions_that_promise_most_are_chosen(cell: tuple[int, int]) -> None:
    prior = lattice(16, 3, 16)
    told = promises(prior, segment_regions(prior).labels, cell)
    for slots in (1, 4, 9):
        chosen = np.full(slots, -1)
        choose(prior, cell, -1, chosen)
        assert sorted(chosen.tolist()) == sorted(np.argsort(told)[::-1][:slots].tolist())


def test_a_region_keeps_its_slot_and_one_under_way_is_always_chosen() -> None:
    prior = lattice(16, 3, 16)
    chosen = np.full(4, -1)
    choose(prior, (0, 0), -1, chosen)
    before = chosen.copy()
    least = int(np.argmin(promises(prior, segment_regions(prior).labels, (0, 0))))
    choose(prior, (0, 0), least, chosen)
    assert (chosen == before).sum() == 3
    assert least in chosen


def test_a_trip_under_way_is_weighed_again_at_every_decision() -> None:
    """Were it not tried, it could not be kept: between two hills the drone would go back and forth for ever."""
    prior = lattice(16, 3, 16)
    planner = make_planner("puct-regions", fov=FieldOfView.point(0.9, 1.0), iterations=20, most_regions=4)
    belief, state, rng = Belief(prior), SearchState((5, 5)), np.random.default_rng(1)
    under_way = weighed = 0
    before = planner.plan(belief, state, rng)
    for _ in range(250):
        state = SearchState(before.path[0], state.heading)
        belief.observe([state.cell], False, 0.9, 1.0)
        now = planner.plan(belief, state, rng)
        if before.action.startswith("region") and len(before.path) > 1:
            under_way += 1
            weighed += any(each.action == before.action and each.visits > 0 for each in now.alternatives)
        before = now
    assert weighed == under_way > 50


def test_only_so_many_regions_are_told_and_all_of_them_without_a_bound() -> None:
    prior, state = lattice(16, 3, 16), SearchState((5, 5))
    for most, told in ((4, 4), (None, 17)):
        planner = make_planner("puct-regions", fov=FieldOfView.point(), iterations=5, most_regions=most)
        decision = planner.plan(Belief(prior), state, np.random.default_rng(1))
        options = [
            each for each in decision.alternatives if each.region is not None or each.action == "elsewhere"
        ]
        assert len(options) == told


def test_the_papers_preset_has_options_for_all_regions() -> None:
    prior = lattice(16, 3, 16)
    planner = make_planner("puct-regions", fov=FieldOfView.point(), preset="paper")
    decision = planner.plan(Belief(prior), SearchState((5, 5)), np.random.default_rng(1))
    assert sum(each.region is not None for each in decision.alternatives) == 16


def test_no_options_at_all_are_refused() -> None:
    with pytest.raises(ValueError, match="most_regions must be at least 1, or None for all, not 0"):
        make_planner("puct-regions", fov=FieldOfView.point(), most_regions=0)

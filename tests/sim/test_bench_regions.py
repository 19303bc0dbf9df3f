"""What many regions cost, and what a search keeps in memory: measured on little, to see that it is measured."""

from __future__ import annotations

import numpy as np

from roisearch import segment_regions
from sim.bench_memory import PLANNERS, memory_of
from sim.bench_regions import lattice


def test_each_hill_of_the_lattice_is_a_region() -> None:
    few, many = lattice(5, 1, 25), lattice(25, 1, 25)
    assert few.shape == many.shape
    assert segment_regions(few).count == 5
    assert segment_regions(many).count == 25
    np.testing.assert_allclose((few.sum(), many.sum()), 1.0)


def test_a_cell_of_the_default_planner_takes_no_more_than_it_did() -> None:
    """A second copy of the map, or a tree over all its cells, would be seen here."""
    found = memory_of(next(iter(PLANNERS)))
    assert 8.0 <= found.belief < 10.0
    assert found.planner < 80.0
    assert found.peak < 125.0

"""Decisions in words: what is told is what there is, and the best rate is named."""

from __future__ import annotations

import numpy as np

from roisearch import Decision, Effort, segment_regions
from service.explain import explain

EFFORT = Effort(10, 0.001)


def two_hills() -> tuple[np.ndarray, object]:
    """A map of 9 x 9 with a hill of 20 % near the start and one of 70 % far from it."""
    prior = np.full((9, 9), 1e-4)
    prior[1, 2], prior[7, 7] = 0.2, 0.7
    prior[6, 7] = 0.05
    prior /= prior.sum()
    return prior, segment_regions(prior, threshold=0.01)


def options(*rows: tuple[int, float]) -> np.ndarray:
    return np.array([(-1.0, 0.0)] * 4 + [(float(visits), value) for visits, value in rows])


def test_a_region_is_told_with_its_mass_its_distance_and_the_best_rate() -> None:
    prior, regions = two_hills()
    decision = Decision(
        ((1, 1),), "region 1", 0.4, EFFORT, goal=(1, 2), options=options((3, 0.1), (40, 0.4), (7, 0.3))
    )
    reason = explain(decision, (1, 0), prior, regions, 25.0)  # type: ignore[arg-type]
    assert reason.text == "ROI 1: 21 % of the mass, 50 m, best rate"
    rows = reason.rows()
    assert [row["action"] for row in rows] == ["region 1", "region 2", "elsewhere"]
    assert [row["chosen"] for row in rows] == [True, False, False]
    assert rows[1]["words"] == "ROI 2: 78 % of the mass, 325 m"
    assert rows[1]["visits"] == 7
    assert rows[1]["mass"] > 0.7


def test_a_plan_of_single_moves_tells_the_regions_on_its_way_and_what_else_there_is() -> None:
    prior, regions = two_hills()
    path = tuple((1, col) for col in range(1, 8)) + tuple((row, 7) for row in range(2, 8))
    alone = np.array([(1.0, -90.0), (-1.0, 0.0), (-1.0, 0.0), (-1.0, 0.0)])
    reason = explain(Decision(path, "north", -90.0, EFFORT, options=alone), (1, 0), prior, regions, 10.0)  # type: ignore[arg-type]
    assert reason.text == "ROI 1: 21 % of the mass, 20 m; then ROI 2: 78 % of the mass, 120 m"
    rows = reason.rows()
    assert rows[0]["words"] == "one cell north"
    assert [row["value"] for row in rows] == [-90.0, None, None]  # the regions were not weighed
    assert sum("best rate" in row["words"] for row in rows) == 1


def test_ground_without_regions_is_told_as_such() -> None:
    prior = np.full((3, 3), 1 / 9)
    path = ((0, 1), (0, 2))
    reason = explain(Decision(path, "coverage", 0.0, EFFORT), (0, 0), prior, segment_regions(prior), 10.0)
    assert reason.text == "open ground: 22 % of the mass on the next 20 m"

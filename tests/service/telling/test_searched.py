"""Outlines of searched ground: never more than was searched, small enough for a datagram, nearly all of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from service.telling.cot import Events
from service.telling.searched import MOST_CORNERS, MOST_OUTLINES, Outline, outlines
from tests.service.mission.flown import GRID

ROWS, COLS = 70, 80
FRAME = replace(GRID.frame, rows=ROWS, cols=COLS)


def in_metres(outline: Outline) -> shapely.Polygon:
    """The ring in the grid's metres, as whoever receives it draws it."""
    return shapely.Polygon(FRAME.to_metres(outline.ring))


def ground(searched: NDArray[np.bool_]) -> shapely.Geometry:
    """All searched cells as one shape."""
    side = FRAME.cell_m
    return shapely.union_all(
        [
            shapely.box(col * side, row * side, (col + 1) * side, (row + 1) * side)
            for row, col in np.argwhere(searched)
        ]
    )


def of(*rows: str) -> NDArray[np.bool_]:
    """A map drawn in signs, in the grid's north-west corner."""
    searched = np.zeros((ROWS, COLS), dtype=bool)
    for row, signs in enumerate(rows):
        searched[row, : len(signs)] = [sign == "#" for sign in signs]
    return searched


def test_a_block_is_told_as_it_is() -> None:
    (one,) = outlines(FRAME, of("###", "###"))
    assert len(one.ring) == 5
    assert one.ring[0] == one.ring[-1]
    assert np.isclose(one.hectares, 6 * FRAME.cell_m**2 * 1e-4)
    assert in_metres(one).contains(shapely.Point(FRAME.to_metres([one.inside])[0]))


def test_a_hole_is_not_covered() -> None:
    searched = of("###", "#.#", "###")
    told = [in_metres(each) for each in outlines(FRAME, searched)]
    assert np.isclose(sum(each.area for each in told), 8 * FRAME.cell_m**2, rtol=1e-3)
    assert shapely.union_all(told).difference(ground(searched)).area < 0.1


@given(st.integers(0, 2**32), st.floats(0.02, 0.98), st.integers(1, 5))
@settings(max_examples=20)
def test_no_outline_covers_what_was_not_searched(seed: int, part: float, patch: int) -> None:
    coarse = np.random.default_rng(seed).random((ROWS, COLS)) < part
    searched = np.kron(coarse, np.ones((patch, patch), dtype=bool))[:ROWS, :COLS]
    told = outlines(FRAME, searched)
    assert len(told) <= MOST_OUTLINES
    assert all(4 <= len(each.ring) <= MOST_CORNERS for each in told)
    shapes = [in_metres(each) for each in told]
    assert all(each.is_valid for each in shapes)
    assert shapely.union_all(shapes).difference(ground(searched)).area < 0.01 * FRAME.cell_m**2


def test_a_long_edge_of_many_steps_loses_little() -> None:
    searched = np.tri(ROWS, COLS, dtype=bool)
    (one,) = outlines(FRAME, searched)
    assert len(one.ring) <= MOST_CORNERS
    assert in_metres(one).area > 0.75 * ground(searched).area


def test_an_event_fits_a_datagram() -> None:
    searched = np.random.default_rng(1).random((ROWS, COLS)) < 0.7
    made = Events("run", "Falcon").searched(outlines(FRAME, searched), 0.0)
    assert 0 < max(map(len, made)) < 8192

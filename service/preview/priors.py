"""How the priors of an area add up: each by itself with its share, and all together."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from service.area import Grid, SearchArea
from service.area.describing import described_priors
from service.area.prior import cell_squares, prior_parts
from service.view.sheet import HEAT, Sheet

MOST = 11
"""More maps than this are no picture any more."""


def added_up(area: SearchArea, grid: Grid) -> list[tuple[str, NDArray[np.float64]]]:
    """Each prior with a sentence and its part of the whole, float [rows, cols]; empty where they are not what is
    searched by, because a GeoTIFF is."""
    if not area.priors:
        return []
    squares = cell_squares(grid.frame)
    parts = list(prior_parts(area, grid.frame, squares, grid.covered, grid.searchable, grid.mobility))
    whole = np.sum(parts, axis=0)
    if not np.allclose(whole / whole.sum(), grid.prior, rtol=1e-6, atol=1e-12):
        return []
    return list(zip(described_priors(area), [part / whole.sum() for part in parts], strict=True))


def draw_priors(area: SearchArea, grid: Grid) -> list[tuple[str, bytes]]:
    """A map of each prior and one of all together, each with a sentence, as PNGs of the width of a phone.

    Empty when there is only one, or none.
    """
    parts = added_up(area, grid)
    if not 2 <= len(parts) <= MOST:
        return []
    return [(sentence, _drawn(area, grid, part)) for sentence, part in [*parts, ("together", grid.prior)]]


def _drawn(area: SearchArea, grid: Grid, part: NDArray[np.float64]) -> bytes:
    figure = Figure(figsize=(3.6, 3.6), dpi=160, layout="constrained")
    sheet = Sheet(figure.subplots(), grid, area)
    sheet.cells(np.where(grid.searchable, part, np.nan), cmap=HEAT, vmin=0.0)
    sheet.finish()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()

"""What an operator says about a place is evidence too: it is the target, or it is not.

"It is here" and "it is not here" speak of the square of cells around the place. An operator is right with
`search.reject_reliability` r, so the odds of each cell of the square are multiplied by r / (1 - r) or by its inverse,
which is Bayes' rule for such a statement. It goes into the journal before it is believed, like a report.
"""

from __future__ import annotations

import numpy as np

from service.evidence.observe import Observation
from service.geometry import Cell


def verdict_on(cell: Cell, shape: tuple[int, int], reliability: float, *, confirmed: bool) -> Observation:
    """The observation in an operator's word about the square of cells around `cell`; it is not a look."""
    square = np.array([(cell[0] + r, cell[1] + c) for r in (-1, 0, 1) for c in (-1, 0, 1)], dtype=np.int64)
    cells = square[((square >= 0) & (square < np.array(shape))).all(axis=1)]
    k = len(cells)
    sure = np.full(k, reliability)
    return Observation(cells, np.full(k, confirmed), sure, sure.copy(), np.zeros(k, dtype=np.bool_))

"""Random numbers of the kernels: one 64-bit linear congruential generator (Knuth's MMIX constants).

Its state is uint64 [1], seeded by the caller's generator. A move is its top two bits, drawn again when the move is
not legal.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel

MULTIPLIER = np.uint64(6364136223846793005)
INCREMENT = np.uint64(1442695040888963407)


@kernel
def draw_move(state: NDArray[np.uint64]) -> int:
    """A number from 0 to 3."""
    state[0] = state[0] * MULTIPLIER + INCREMENT
    return int(np.int64(state[0] >> np.uint64(62)))


@kernel
def draw_unit(state: NDArray[np.uint64]) -> float:
    """A number from 0 to just below 1, with 53 bits."""
    state[0] = state[0] * MULTIPLIER + INCREMENT
    return float(np.int64(state[0] >> np.uint64(11))) * 2.0**-53

"""How a function becomes a kernel: compiled by numba without the GIL and cached on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` at its first call; it releases the GIL and its machine code is kept on disk.

    No fast-math: sums keep the order that they are written in, so a kernel and its plain twin agree to the
    last bit, and so do two machines.
    """
    return cast(Callable[P, R], numba.njit(cache=True, nogil=True, error_model="numpy", _nrt=False)(function))


def allocating_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, for a function that makes arrays of its own."""
    return cast(Callable[P, R], numba.njit(cache=True, nogil=True, error_model="numpy")(function))

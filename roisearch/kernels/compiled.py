"""How a function becomes a kernel: compiled by numba without the GIL and cached on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` at its first call; it releases the GIL and its machine code is kept on disk.

    It must not make arrays of its own: it is compiled without numba's memory management, which would count
    references at every call and double the time to compile.

    No fast-math: sums keep the order that they are written in, so a kernel and its plain twin agree to the
    last bit, and so do two machines.
    """
    return _compiled(function, _nrt=False)


def allocating_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, for a function that makes arrays of its own."""
    return _compiled(function)


def _compiled(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    njit: Any = numba.njit
    return cast(Callable[P, R], njit(cache=True, nogil=True, error_model="numpy", **options)(function))

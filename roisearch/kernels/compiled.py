"""How a function becomes a kernel: compiled by numba without the GIL and cached on disk.

numba keeps machine code by the age of the file that a function is in, and does not notice that another file,
whose functions were compiled into it, has changed. So the kernels are kept in a folder named after the text
of all of them: a changed kernel is never run from an old cache.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def _cache_folder() -> Path:
    """NUMBA_CACHE_DIR, or the user's cache folder, and in it a folder for these very kernels."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        base = Path(chosen)
    else:
        try:
            base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "roisearch"
        except RuntimeError:  # a service's user may have no home
            base = Path(tempfile.gettempdir()) / "roisearch"
    return base / f"kernels-{digest.hexdigest()[:12]}"


_config: Any = numba.config
_config.CACHE_DIR = str(_cache_folder())


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` at its first call; it releases the GIL and its machine code is kept on disk.

    It must not make arrays of its own: it is compiled without numba's memory management, which would count
    references at every call and double the time to compile.

    No fast-math: sums keep the order that they are written in, so a kernel and its plain twin agree to the
    last bit, and so do two machines.
    """
    return _compiled(function, _nrt=False)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, for a small function: the compiler puts its body where it is called."""
    return _compiled(function, _nrt=False, forceinline=True)


def allocating_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, for a function that makes arrays of its own."""
    return _compiled(function)


def _compiled(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    njit: Any = numba.njit
    return cast(Callable[P, R], njit(cache=True, nogil=True, error_model="numpy", **options)(function))

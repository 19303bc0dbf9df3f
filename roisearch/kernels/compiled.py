"""How a function becomes a kernel: compiled by numba without the GIL and cached on disk.

numba keeps machine code by the age of the file that a function is in, and does not notice that another file,
whose functions were compiled into it, has changed. So it is kept in a folder named after the places and the text of all
files of this package: after a change or a move no old machine code is run.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import stat
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, cast

import numba
from numba.core import compiler_lock

P = ParamSpec("P")
R = TypeVar("R")


def cache_folder(package: Path = Path(__file__).parents[1]) -> Path:
    """NUMBA_CACHE_DIR, or the user's cache folder, and in it a folder for these very files of `package`.

    Where neither can be written to, a folder of the user's own among the temporary files; that is said.
    """
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        text = source.read_bytes()
        digest.update(f"{source.relative_to(package).as_posix()} {len(text)} ".encode())
        digest.update(text)
    name = f"kernels-{digest.hexdigest()[:12]}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    try:
        base = Path(chosen) if chosen else _user_cache()
        if _can_be_written(base / name):
            return base / name
        where = str(base)
    except RuntimeError:  # a service's user may have no home
        where = "a user without a home"
    own = _temporary()
    warnings.warn(
        f"{where}: no place to keep compiled kernels; {own} is used, until it is cleared: set NUMBA_CACHE_DIR to a "
        "folder that can be written to",
        RuntimeWarning,
        stacklevel=2,
    )
    return own / name


def _user_cache() -> Path:
    """Raises RuntimeError for a user without a home."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "roisearch"


def _can_be_written(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _temporary() -> Path:
    """A folder that this user alone writes to: what is kept there is run."""
    folder = Path(tempfile.gettempdir()) / f"roisearch-{os.getuid()}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        is_ = folder.lstat()
        if stat.S_ISDIR(is_.st_mode) and is_.st_uid == os.getuid() and not is_.st_mode & 0o022:
            return folder
    return Path(tempfile.mkdtemp(prefix="roisearch-"))


_config: Any = numba.config
_LEVEL = int(_config.OPT)
_compiler_lock: Any = compiler_lock.global_compiler_lock
_config.CACHE_DIR = str(cache_folder())


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` at its first call; it releases the GIL and its machine code is kept on disk.

    It must not make arrays of its own: it is compiled without numba's memory management, which would count
    references at every call and double the time to compile.

    No fast-math: sums keep the order that they are written in, so a kernel and its plain twin agree to the
    last bit, and so do two machines.
    """
    return _compiled(function, _nrt=False)


def light_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, at LLVM's level 1: for the many kernels of the sweeps, which are as fast so, and ready sooner."""
    return _compiled(function, level=1, _nrt=False)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, for a small function: the compiler puts its body where it is called."""
    return _compiled(function, _nrt=False, forceinline=True)


def allocating_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, for a function that makes arrays of its own."""
    return _compiled(function)


def _compiled(function: Callable[P, R], level: int = 3, **options: Any) -> Callable[P, R]:
    njit: Any = numba.njit
    shared = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
    from_python = njit(**shared)(function)
    from_kernels = njit(**shared, no_cpython_wrapper=True)(_twin(function))
    _call_in_kernels(from_python, from_kernels)
    for dispatcher in (from_python, from_kernels):
        _optimise(dispatcher, level)
    return cast(Callable[P, R], from_python)


def _twin(function: Callable[P, R]) -> Callable[P, R]:
    """The same function under a name of its own, for files of its own in the cache."""
    original = cast(FunctionType, function)
    twin = FunctionType(
        original.__code__,
        original.__globals__,
        original.__name__,
        original.__defaults__,
        original.__closure__,
    )
    functools.update_wrapper(twin, original)
    twin.__qualname__ += "_inside"
    return cast(Callable[P, R], twin)


def _call_in_kernels(kernel: Any, inside: Any) -> None:
    """Let other kernels call `inside` for `kernel`, and compile it once, whatever the constants in the call.

    Much of the time to compile would go into what nobody uses: with numba's plain `njit` the default planner takes 1.8
    times as long to compile, and one with the paper's settings 1.4 times (77 and 26 seconds of processor time against
    42 and 18). The way in from Python, which unpacks every array of every argument, is for the few kernels that Python
    calls. And numba compiles `look(chart, 3, 4, 1, True)` anew for `True`, with all that `look` calls; where a constant
    is worth something, LLVM puts the function's body into its caller, and knows it there anyway.

    This reaches into numba's dispatcher, so pyproject.toml bounds numba.
    """

    def get_call_template(args: Any, kws: Any) -> Any:
        unliteral: Any = numba.types.unliteral
        return inside.get_call_template(
            tuple(unliteral(kind) for kind in args),
            {name: unliteral(kind) for name, kind in dict(kws).items()},
        )

    kernel.get_call_template = get_call_template
    kernel.get_overload = inside.get_overload


def _optimise(dispatcher: Any, most: int) -> None:
    """Compile at LLVM's level `most`, or what NUMBA_OPT says if that is less.

    The level is the process's: what else it compiles keeps its own.
    """
    compile_ = dispatcher.compile

    def compile_at_level(signature: Any) -> Any:
        with _compiler_lock:
            before = _config.OPT
            _config.OPT = type(before)(min(_LEVEL, most))
            try:
                return compile_(signature)
            finally:
                _config.OPT = before

    dispatcher.compile = compile_at_level

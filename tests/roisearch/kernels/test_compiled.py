"""How functions become kernels: what is compiled, how often, and with whose settings."""

from __future__ import annotations

import importlib
import os
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numba.core import event

import roisearch
from roisearch import Belief, FieldOfView, SearchState, make_planner
from roisearch.kernels.compiled import cache_folder, kernel


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """The functions compiled during the test, whose machine code is kept in a folder of its own."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    names: list[str] = []

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            names.append(event.data["dispatcher"].py_func.__qualname__.rpartition(".")[2])

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield names


def test_a_kernel_is_compiled_once_for_all_constants_and_without_a_way_in_that_nobody_uses(
    compiled: list[str],
) -> None:
    @kernel
    def add(number: float, times: int, twice: bool) -> float:
        return number * times * (2.0 if twice else 1.0)

    @kernel
    def call(number: float, times: int) -> float:
        return add(number, 3, True) + add(number, times, number > 0.0) + add(number, -1, twice=False)

    assert call(2.0, 5) == 12.0 + 20.0 - 2.0
    assert compiled == ["call", "add_inside"]
    assert call(-2.0, 5) == -12.0 - 10.0 + 2.0
    assert add(2.0, 3, True) == 12.0
    assert compiled == ["call", "add_inside", "add"]


def test_what_else_a_process_compiles_keeps_its_level_of_optimisation(compiled: list[str]) -> None:
    level = numba.config.OPT

    @kernel
    def wrong(number: float) -> float:
        return number.no_such_thing  # type: ignore[attr-defined, no-any-return]

    with pytest.raises(numba.TypingError):
        wrong(1.0)
    assert numba.config.OPT is level


def signatures() -> dict[str, int]:
    """How many versions of each kernel Python can call by now."""
    found = {}
    for module in pkgutil.walk_packages(roisearch.__path__, "roisearch."):
        for name, value in vars(importlib.import_module(module.name)).items():
            if hasattr(value, "signatures"):
                found[f"{module.name}.{name}"] = len(value.signatures)
    return found


@pytest.mark.parametrize("name", ["puct-regions-lite", "index"])
def test_after_the_warm_up_nothing_is_left_to_compile(name: str) -> None:
    fov = FieldOfView.donut()
    make_planner(name, fov=fov).warm_up()
    before = signatures()
    assert sum(before.values()) > 5
    flyable = np.ones((30, 40), dtype=bool)
    flyable[10:14, 8:20] = False
    restless = {"patience": 2} if name == "puct-regions-lite" else {}
    planner, rng = make_planner(name, fov=fov, flyable=flyable, **restless), np.random.default_rng(1)
    belief, cell = Belief(rng.random((30, 40)), outside=0.1), (2, 2)
    for step in range(60):
        cell = planner.plan(belief, SearchState(cell), rng, deadline_s=0.05).path[0]
        belief.observe([cell], [step == 30], 0.9, 0.9)
    assert signatures() == before


def test_a_kernel_that_was_moved_or_changed_finds_no_old_machine_code(tmp_path: Path) -> None:
    package = tmp_path / "search"
    (package / "kernels").mkdir(parents=True)
    (package / "planners").mkdir()
    source = package / "kernels" / "one.py"
    source.write_text("one = 1\n")
    folders = [cache_folder(package)]
    source = source.rename(package / "planners" / "one.py")
    folders.append(cache_folder(package))
    source.write_text("one = 2\n")
    folders.append(cache_folder(package))
    assert len(set(folders)) == 3
    source.write_text("one = 1\n")
    assert cache_folder(package) == folders[1]
    assert cache_folder() == Path(numba.config.CACHE_DIR)


def test_with_a_home_that_cannot_be_written_to_kernels_are_kept_where_only_their_user_writes(
    tmp_path: Path,
) -> None:
    program = (
        "import numba, numpy\nfrom roisearch.kernels.compiled import kernel\n"
        "@kernel\ndef twice(x: float) -> float:\n    return 2.0 * x\n"
        "assert twice(2.0) == 4.0\nprint(numba.config.CACHE_DIR)"
    )
    (tmp_path / "program.py").write_text(program)
    kept = {
        name: text for name, text in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
    }

    def folder() -> Path:
        environment = {
            **kept,
            "HOME": "/proc",
            "TMPDIR": str(tmp_path),
            "PYTHONPATH": str(Path(__file__).parents[3]),
        }
        words = [sys.executable, str(tmp_path / "program.py")]
        said = subprocess.run(words, env=environment, capture_output=True, text=True, check=True, timeout=120)
        assert "/proc/.cache/roisearch: no place to keep compiled kernels" in said.stderr
        assert "set NUMBA_CACHE_DIR" in said.stderr
        return Path(said.stdout.strip()).parent

    own = tmp_path / f"roisearch-{os.getuid()}"
    assert folder() == own
    assert own.stat().st_mode & 0o077 == 0
    own.chmod(0o777)  # what anybody may have put there is not run
    assert folder().name.startswith("roisearch-")
    assert folder() != own

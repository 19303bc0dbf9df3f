"""What the three packages import is what `pyproject.toml` says they need: tests have more installed than a user."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

TOP = Path(__file__).parents[1]
PROJECT = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = {name: said for name, said in PROJECT["optional-dependencies"].items() if name != "test"}
OURS = {"roisearch", "service", "sim"}
BY_THE_USER = {"ultralytics": "its licence is AGPL-3.0"}
"""What a user brings, and why no extra does."""


def imported(tree: ast.AST, *, late: bool = False) -> Iterator[tuple[str, bool]]:
    """Top-level modules that are imported, and whether only when a function is called."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from ((each.name.split(".")[0], late) for each in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.split(".")[0], late
        elif not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)):
            yield from imported(node, late=late or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def named(requirements: list[str]) -> set[str]:
    """Names of distributions, as they are compared."""
    return {re.split(r"[\[<>=!~; ]", each)[0].lower().replace("_", "-") for each in requirements}


def test_every_import_is_declared() -> None:
    at_once = named(PROJECT["dependencies"])
    sometimes = at_once.union(*(named(said) for said in EXTRAS.values()))
    homes = packages_distributions()
    missing = []
    for path in sorted(each for room in OURS for each in (TOP / room).rglob("*.py")):
        for module, late in set(imported(ast.parse(path.read_text(encoding="utf-8")))):
            if module in OURS or module in sys.stdlib_module_names or module in BY_THE_USER:
                continue
            givers = {home.lower().replace("_", "-") for home in homes.get(module, [])}
            if not givers & (sometimes if late else at_once):
                missing.append(f"{path.relative_to(TOP)}: {module} ({'late' if late else 'at once'})")
    assert not missing, "\n".join(missing)


def test_every_extra_is_installed_with_the_tests() -> None:
    (all_extras,) = [
        each for each in PROJECT["optional-dependencies"]["test"] if each.startswith("roisearch[")
    ]
    assert set(all_extras.removeprefix("roisearch[").rstrip("]").split(",")) == set(EXTRAS)

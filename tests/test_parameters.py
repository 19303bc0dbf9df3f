"""No function wants more values at a time than a reader can hold: what belongs together has a name."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
MOST = 8
"""Every parameter of a `def` counts, with a default or without, keyword-only ones as well; `self` and `cls` do not. The
fields of a dataclass or a named tuple are not parameters: there each has its line, its type and its words."""


def parameters() -> list[tuple[int, str]]:
    """How many parameters each function has, and its file and name; most first."""
    found = []
    for package in ("roisearch", "service", "sim"):
        for path in (ROOT / package).rglob("*.py"):
            for part in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef):
                    told = part.args
                    named = [each.arg for each in [*told.posonlyargs, *told.args, *told.kwonlyargs]]
                    several = [each for each in (told.vararg, told.kwarg) if each is not None]
                    count = len(named) - (named[:1] in (["self"], ["cls"])) + len(several)
                    found.append((count, f"{path.relative_to(ROOT)} {part.name}"))
    return sorted(found, reverse=True)


def is_kernel(name: str) -> bool:
    """Whether a file's functions are compiled."""
    return "roisearch.kernels.compiled import" in (ROOT / name.split()[0]).read_text(encoding="utf-8")


def test_the_longest_lists_of_parameters_are_short() -> None:
    longest = parameters()
    print(
        "the ten longest lists of parameters:", *(f"{count} {name}" for count, name in longest[:10]), sep="\n"
    )
    most = next((count, name) for count, name in longest if is_kernel(name))
    print("the longest of a kernel:", *most)
    assert [name for count, name in longest if count > MOST] == []

"""No function of sim/ wants more at a time than a reader can hold."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in (ROOT / "sim").rglob("*.py")
}
MOST_PARAMETERS = 8


def parameters() -> list[tuple[int, str]]:
    """How many parameters each function has, most first."""
    found = []
    for name, path in FILES.items():
        for part in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef):
                told = part.args
                several = [each for each in (told.vararg, told.kwarg) if each is not None]
                count = len([*told.posonlyargs, *told.args, *told.kwonlyargs, *several])
                found.append((count, f"{name}.{part.name}"))
    return sorted(found, reverse=True)


def test_no_function_has_more_parameters_than_a_reader_can_hold() -> None:
    longest = parameters()[:10]
    print(*(f"{count} {name}" for count, name in longest), sep="\n")
    assert longest[0][0] <= MOST_PARAMETERS

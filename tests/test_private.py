"""Tests look at what is public; where one looks behind it, a comment says why nothing else would do."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
OURS = ("roisearch", "service", "sim")
BY_NAME = ("getattr", "setattr", "delattr")
NO_DEFENCE = ("type:", "noqa", "fmt:", "mypy:", "pragma:", "----")


def is_private(name: object) -> bool:
    """One leading underscore; what Python itself calls by two is everybody's."""
    return (
        isinstance(name, str)
        and name.startswith("_")
        and name.isidentifier()
        and name.strip("_") != ""
        and (not name.startswith("__"))
    )


def of_itself(value: ast.expr) -> bool:
    """`self._name`, `cls._name` and `super()._name`: a test's own classes may have private parts."""
    if isinstance(value, ast.Call):
        value = value.func
    return isinstance(value, ast.Name) and value.id in ("self", "cls", "super")


def private_accesses(tree: ast.AST) -> Iterator[tuple[int, int, str]]:
    """First line, last line and name of each private thing of another object that is read, set or imported."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and is_private(node.attr) and not of_itself(node.value):
            yield node.lineno, node.end_lineno or node.lineno, ast.unparse(node)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in OURS:
            for name in node.names:
                if is_private(name.name):
                    yield node.lineno, node.end_lineno or node.lineno, f"{node.module}.{name.name}"
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in BY_NAME:
            for argument in node.args:
                if isinstance(argument, ast.Constant) and is_private(argument.value):
                    yield argument.lineno, argument.lineno, ast.unparse(node)


def undefended(text: str) -> list[str]:
    """Line and name of each private access without a comment on its line or the line before."""
    comments = {
        token.start[0]
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.COMMENT
        and len(token.string.split()) > 3
        and not token.string.lstrip("# ").startswith(NO_DEFENCE)
    }
    return [
        f"{first}: {name}"
        for first, last, name in private_accesses(ast.parse(text))
        if not comments & {first - 1, first, last}
    ]


def test_every_look_behind_what_is_public_says_why() -> None:
    found, count = [], 0
    for path in sorted(TESTS.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        count += sum(1 for _ in private_accesses(ast.parse(text)))
        found += [f"{path.relative_to(TESTS.parent)}:{each}" for each in undefended(text)]
    print(f"private accesses in tests, each with its reason: {count}")
    assert not found, "say in a comment why, on the line or before it, or test what is public:\n" + "\n".join(
        found
    )


@pytest.mark.parametrize(
    ("line", "accused"),
    [
        ("thing._inner", True),
        ("thing._inner.public()", True),
        ("thing.inner._part = 3", True),
        ("from service.journal import _checksum", True),
        ("monkeypatch.setattr(thing, '_inner', 3)", True),
        ("thing._inner  # type: ignore[attr-defined]", True),
        ("thing._inner  # nothing public tells how much is kept", False),
        ("# nothing public tells how much is kept\nthing._inner", False),
        ("self._inner", False),
        ("super()._inner()", False),
        ("thing.__class__", False),
        ("thing.inner", False),
        ("from hypothesis import _hidden", False),
    ],
)
def test_what_counts(line: str, accused: bool) -> None:
    assert bool(undefended(line + "\n")) == accused

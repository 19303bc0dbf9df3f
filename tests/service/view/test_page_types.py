"""What the page's JavaScript is checked against is what the service says: state.d.ts is written from its types."""

from __future__ import annotations

import os
import types
from enum import Enum
from pathlib import Path
from typing import Any, NotRequired, Union, get_args, get_origin, get_type_hints

from typing_extensions import is_typeddict

from service.view.state import RunState

FILE = Path(__file__).parents[3] / ".ci" / "page" / "state.d.ts"
HEAD = "// What `/api/state` says, as service/view/state.py has it. Written by tests/service/view/test_page_types.py.\n"
PLAIN = {str: "string", int: "number", float: "number", bool: "boolean", types.NoneType: "null", Any: "any"}


def typescript(kind: Any, found: dict[str, Any]) -> str:
    """A type of Python's as JSON has it, in TypeScript; typed dictionaries are noted in `found` by name."""
    origin, parts = get_origin(kind), get_args(kind)
    if kind in PLAIN:
        return PLAIN[kind]
    if is_typeddict(kind):
        found.setdefault(kind.__name__, kind)
        return str(kind.__name__)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return " | ".join(f'"{each.value}"' for each in kind)
    if origin in (types.UnionType, Union):
        return " | ".join(typescript(part, found) for part in parts)
    if origin is list:
        inner = typescript(parts[0], found)
        return f"({inner})[]" if "|" in inner else f"{inner}[]"
    if origin is tuple:
        return f"[{', '.join(typescript(part, found) for part in parts)}]"
    raise TypeError(f"{kind} has no type in JSON")


def declarations(kind: Any) -> str:
    """An interface for a typed dictionary and for each that it holds."""
    found: dict[str, Any] = {kind.__name__: kind}
    done: list[str] = []
    while left := [name for name in found if name not in done]:
        for name in left:
            done.append(name)
            for hint in get_type_hints(found[name], include_extras=True).values():
                typescript(get_args(hint)[0] if get_origin(hint) is NotRequired else hint, found)
    text = HEAD
    for name in sorted(found):
        text += f"\ninterface {name} {{\n"
        for field, hint in get_type_hints(found[name], include_extras=True).items():
            optional = get_origin(hint) is NotRequired
            said = typescript(get_args(hint)[0] if optional else hint, found)
            line = f"  {field}{'?' if optional else ''}: {said};"
            if len(line) > 100:  # as prettier breaks it
                line = f"  {field}{'?' if optional else ''}:\n    | " + said.replace(" | ", "\n    | ") + ";"
            text += line + "\n"
        text += "}\n"
    return text


def test_the_page_is_checked_against_what_the_service_says() -> None:
    wanted = declarations(RunState)
    if os.environ.get("ROISEARCH_TYPES"):
        FILE.write_text(wanted, encoding="utf-8")
    assert FILE.read_text(encoding="utf-8") == wanted, (
        "run this test with ROISEARCH_TYPES=1, and tsc in .ci/page"
    )

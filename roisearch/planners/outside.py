"""Planners that are not ours: by `package.module:Class`, or by the name of an entry point of an installed package.

[project.entry-points."roisearch.planners"]
my-planner = "my_package.planner:MyPlanner"
"""

from __future__ import annotations

import importlib
import importlib.metadata
import inspect
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

GROUP = "roisearch.planners"
"""The group of entry points."""

_SPEC = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")


def is_outside(name: str) -> bool:
    """Whether a name is `package.module:Class`, or that of an installed entry point."""
    return _SPEC.fullmatch(name) is not None or name in installed()


def installed() -> tuple[str, ...]:
    """The names of the planners that installed packages offer."""
    return tuple(sorted({point.name for point in importlib.metadata.entry_points(group=GROUP)}))


def find(name: str) -> Callable[..., Any]:
    """The class (or whatever else makes a planner) of that name. A module may lie in the present folder.

    Raises:
        ValueError: one sentence that says what could not be imported, and why.
    """
    if name in installed():
        (point, *_) = importlib.metadata.entry_points(group=GROUP, name=name)
        name = point.value
    module_name, _, path = name.partition(":")
    try:
        made: Any = _import(module_name)
        for part in path.split("."):
            made = getattr(made, part)
    except Exception as error:  # whatever a stranger's module does when it is imported
        raise ValueError(f"the planner '{name}' cannot be had: {type(error).__name__}: {error}") from error
    if not callable(made):
        raise ValueError(f"the planner '{name}' is no class and no function that makes one")
    return made  # type: ignore[no-any-return]


OPTIONAL = ("flyable", "regions", "motion", "visibility", "heights")
"""What a planner from outside is given if its constructor takes it."""


def make(name: str, options: dict[str, Any]) -> Any:
    """A planner from outside, with those of the options that it takes.

    `fov` is always given. Those in `OPTIONAL` are left out where its constructor does not take them;
    any other option that it does not take is refused.

    Raises:
        ValueError: it cannot be had, does not take an option, or is no planner.
    """
    maker = find(name)
    taken = inspect.signature(maker).parameters
    anything = any(each.kind is each.VAR_KEYWORD for each in taken.values())
    given = {key: value for key, value in options.items() if anything or key in taken or key not in OPTIONAL}
    planner = maker(**given)
    lacks = [what for what in ("name", "plan", "warm_up") if not hasattr(planner, what)]
    if lacks:
        raise ValueError(f"'{name}' is no planner: it has no {', '.join(lacks)}; derive it from BasePlanner")
    return planner


def _import(module: str) -> Any:
    here = str(Path.cwd())
    if here in sys.path or "" in sys.path:
        return importlib.import_module(module)
    sys.path.append(here)  # a console script does not look there, and a planner to be tried often lies there
    try:
        return importlib.import_module(module)
    finally:
        sys.path.remove(here)

"""A planner from outside: what it does wrong before a flight is its writer's to mend, and told in one sentence."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from roisearch.registry import PLANNERS
from service.errors import BadInput


@contextlib.contextmanager
def from_outside(name: str) -> Iterator[None]:
    """Where a planner of that name is made, or makes its first decisions: its ValueErrors are BadInput.

    Those of our own planners stay what they are, faults of ours.
    """
    try:
        yield
    except BadInput:
        raise
    except ValueError as error:
        if name in PLANNERS:
            raise
        raise BadInput(f"search.planner: {error}") from error

"""What a kind of fault is: a sentence about it, what it can be told, and what it does to a mock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from sim.autopilot.host import Host

Options = dict[str, Any]
Act = Callable[[Host, Options], None]


def nothing(host: Host, options: Options) -> None:
    """All of it happens while it lasts."""


def anything(options: Options) -> None:
    """No option needs a check beside that of its type."""


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind: what it does when it begins, ten times a second while it lasts, and when it ends.

    Attributes:
        about: one sentence for whoever writes a fault file.
        options: what it can be told, with the defaults.
        choices: what some of the options may be.
        check: raises ValueError for options that make no sense.
    """

    about: str
    begin: Act = nothing
    options: Options = field(default_factory=dict)
    step: Act | None = None
    end: Act | None = None
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    check: Callable[[Options], None] = anything

"""Why the aircraft goes where it goes, as values: what `service.explain` says of a decision.

They cross into the door process and into rows of the journal, so nothing is imported here that plans.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Option:
    """One way on that the planner weighed.

    `mass` is the probability of the region it leads to and `distance_m` the way to that region's likeliest cell
    along the grid; both are None for a single move. `visits` and `value` are the planner's own measures; it did
    not weigh an option without them.
    """

    action: str
    region: int | None
    visits: int
    value: float | None
    mass: float | None
    distance_m: float | None
    chosen: bool
    words: str


@dataclass(frozen=True)
class Reason:
    """Why the aircraft goes where it goes, for a person: one line, and the root options, the chosen one first."""

    text: str
    options: tuple[Option, ...] = ()

    def rows(self) -> list[dict[str, Any]]:
        """The options as JSON has them."""
        return [asdict(option) for option in self.options]

"""What can be set about the end of a battery."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EndingSettings:
    """What can be set about the search for the end.

    Attributes:
        horizon_s: the end begins when the search has to be over within so many seconds.
        first: spells of annealing when the end begins, shared by `starts` courses; then `spells` in each decision.
        starts: the plan of the planner that flies, cut at so many places and led home from there.
        proposals: changes proposed in a spell.
        heat: temperature of a spell at first, in what a cell of the course finds on average; it cools to a thirtieth.
        suspect: a place with so much probability is looked at again and again until it is sure: not planned here.
        path: the most cells that a decision gives.
    """

    horizon_s: float = 900.0
    first: int = 48
    spells: int = 4
    starts: int = 6
    proposals: int = 1000
    heat: float = 0.3
    suspect: float = 0.2
    path: int = 32

    def __post_init__(self) -> None:
        for name, least in (("first", 0), ("spells", 0), ("starts", 1), ("proposals", 1), ("path", 1)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, not {getattr(self, name)}")
        if not self.horizon_s >= 0.0 or not self.heat > 0.0:
            raise ValueError("horizon_s must be at least 0 and heat above 0")

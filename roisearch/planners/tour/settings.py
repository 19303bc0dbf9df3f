"""What can be set about the tour."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class TourSettings:
    """What can be set about the search for a tour.

    Attributes:
        looks: looks that are planned ahead; what a decision costs grows with them and not with the map.
        iterations: spells of annealing in a decision, at most; None for as many as the deadline allows.
        first: spells over the whole tour when it is made, shared by the best `starts`, fewer on large tours.
        proposals: changes proposed in a spell.
        window: positions that a spell works on.
        patience: spells in a row without gain after which the tour is flown without thinking, until something is
            seen that it did not expect, or it is carried on.
        heat: temperature of a spell at first, in seconds of a step; the first spells begin at `heat_first`.
        path: the most cells that a decision gives.
    """

    looks: int = 4000
    iterations: int | None = 1
    first: int = 480
    starts: int = 4
    proposals: int = 5000
    window: int = 1000
    patience: int = 120
    heat: float = 0.03
    heat_first: float = 0.1
    path: int = 32

    def __post_init__(self) -> None:
        for name, least in (
            ("looks", 16),
            ("first", 0),
            ("starts", 1),
            ("proposals", 1),
            ("window", 2),
            ("patience", 0),
            ("path", 1),
        ):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, not {getattr(self, name)}")
        if self.iterations is not None and self.iterations < 0:
            raise ValueError(f"iterations must be 0 or more, not {self.iterations}")
        for name in ("heat", "heat_first"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")


def tour_settings_for(name: str, options: dict[str, Any]) -> TourSettings:
    """The settings with single `options` changed; ValueError when there is no such option or value."""
    known = sorted(field.name for field in fields(TourSettings))
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise ValueError(f"{name} with a motion has no option '{unknown[0]}'; it has {', '.join(known)}")
    return TourSettings(**options)

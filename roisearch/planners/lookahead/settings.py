"""What can be set about the default planner."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class LookaheadSettings:
    """What can be set about the search.

    Attributes:
        iterations: of a decision, at most; None for as many as the deadline allows. One is a simulation of the tree
            search, or as much annealing as takes about as long (`roisearch.planners.lookahead.thinking`).
        patience: simulations in a row without a better plan, over the decisions, after which the plan is annealed and
            the search goes on from another start, as a challenger of the plan.
        restarts: challengers in a row that do not become the plan, after which it is flown without thinking,
            until something is seen that it did not expect. When the plan is carried on, thinking resumes for the
            part of this and of the patience that it leaves undetected.
        least: part of the mass that was there at first, below which the plan is flown without thinking:
            what is left lies thin and far apart, and the order of it hardly matters.
        horizon: steps that a simulation looks ahead.
        explore: c of the PUCT score.
        keep: P(a) of keeping to the plan in each node; the other actions share the rest.
        spread: loss against the plan, in parts of the expected time, at which Q is one half.
        spacing: steps between the nodes along the plan.
        chain: probability that a tried line sweeps one more region before the rollout's rule takes over.
        overhead: steps that clearing the rest after the horizon takes per step of a search without travel.
        path: the most cells that a decision gives.
        contradicted: what a cell counts for in planning for each hit that misses at the same cell outweigh: 1
            as much as in the belief, 0 nothing.
    """

    iterations: int | None = 4
    patience: int = 60
    restarts: int = 8
    least: float = 0.01
    horizon: int = 4000
    explore: float = 1.0
    keep: float = 0.75
    spread: float = 0.02
    spacing: int = 32
    chain: float = 0.5
    overhead: float = 1.25
    path: int = 64
    contradicted: float = 0.2

    def __post_init__(self) -> None:
        if self.iterations is not None and self.iterations < 0:
            raise ValueError(f"iterations must be 0 or more, not {self.iterations}")
        if self.restarts < 0:
            raise ValueError(f"restarts must be 0 or more, not {self.restarts}")
        for name, least in (("horizon", 64), ("spacing", 1), ("path", 1), ("patience", 1)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, not {getattr(self, name)}")
        for name in ("chain", "least"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name} must be at least 0 and below 1, not {getattr(self, name)}")
        if not 0.0 <= self.contradicted <= 1.0:
            raise ValueError(f"contradicted must be from 0 to 1, not {self.contradicted}")
        if not (0.0 < self.keep < 1.0 and self.explore >= 0.0 and self.spread > 0.0 and self.overhead >= 1.0):
            raise ValueError(
                "keep must be between 0 and 1, explore 0 or more, spread above 0, overhead at least 1"
            )


def lookahead_settings_for(name: str, options: dict[str, Any]) -> LookaheadSettings:
    """The settings with single `options` changed.

    Raises:
        ValueError: when there is no such option, or a value is out of range.
    """
    known = sorted(field.name for field in fields(LookaheadSettings))
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise ValueError(
            f"{name} has no option '{unknown[0]}'; it has {', '.join(known)}, "
            "and with preset='paper' those of PuctSettings"
        )
    return LookaheadSettings(**options)

"""A planner whose regions follow the belief: they are segmented again whenever that is worth it, as the service does.

The service segments beside the flight; here it is done between two decisions, so that a search is the same each time.
"""

from __future__ import annotations

import numpy as np

from roisearch import Belief, Decision, Planner, SearchState
from roisearch.planners.base import Progress, Redrawable
from roisearch.regions import Regions, mass_moved, segment_again, segment_regions

EVERY = 25
"""Decisions between two looks at how much mass has moved."""


class Redrawn:
    """Wraps a planner that takes other regions.

    Args:
        planner: one that is `Redrawable`, made without regions.
        moved: the part of the mass that must have moved; see `worth_segmenting`.

    Attributes:
        drawn: how often the regions were segmented again.
        regions: those of now; None before the first decision.
    """

    def __init__(self, planner: Planner, moved: float) -> None:
        if not isinstance(planner, Redrawable):
            raise ValueError(f"the planner '{planner.name}' keeps the regions that it began with")
        self.planner, self.name, self._moved = planner, planner.name, moved
        self._redrawable: Redrawable = planner
        self.regions: Regions | None = None
        self.drawn = self._decisions = 0

    def plan(
        self, belief: Belief, state: SearchState, rng: np.random.Generator, *, deadline_s: float | None = None
    ) -> Decision:
        """As the planner's, on the regions of now."""
        if self._decisions % EVERY == 0:
            self._redraw(belief)
        self._decisions += 1
        return self.planner.plan(belief, state, rng, deadline_s=deadline_s)

    def _redraw(self, belief: Belief) -> None:
        probability = belief.probability()
        there = probability > 0.0
        if self.regions is None:
            self.regions = segment_regions(probability, searchable=there)
        elif mass_moved(self.regions, probability) >= self._moved:
            self.regions = segment_again(self.regions, probability, searchable=there)
            self._redrawable.redraw(self.regions)()
            self.drawn += 1

    def warm_up(self, progress: Progress | None = None) -> None:
        """As the planner's."""
        self.planner.warm_up(progress)

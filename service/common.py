"""What all aircraft of a search have in common: the ground, what is known of the target, who plans to look where."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray

from roisearch import Fleet
from roisearch.place import Place, most_likely_place, place_at
from service.area import Grid
from service.drawing import Drawing
from service.evidence.found import Found
from service.evidence.observe import Observation
from service.evidence.overlooked import Overlooked
from service.evidence.suspects import found_at
from service.known import Known, Said, Withdrawn
from service.news.bearing import FieldNews
from service.redrawing import Redrawing, Sketch


@dataclass(eq=False)
class Common:
    """One search, whoever flies it.

    Args:
        drawn: the grid of the area file.
        known: what is known of the target.
        drawing: the regions of interest as they are drawn now.
    """

    drawn: Grid
    known: Known
    drawing: Drawing
    grid: Grid = field(init=False)
    """The same without what is excluded by now."""
    overlooked: Overlooked = field(init=False)
    """Which cells are taken as not to be seen from the air, by what was flown."""
    others: Fleet = field(default_factory=Fleet)
    """Who plans to look where; nobody is in it while one aircraft flies."""
    believing: asyncio.Lock = field(default_factory=asyncio.Lock)
    """Held while something is written down and then believed: all aircraft's reports keep the journal's order."""
    new_ground: list[Callable[[Grid], None]] = field(default_factory=list)
    """Called when other ground may be flown over, or can be seen."""
    _redrawing: Redrawing | None = None
    new_drawing: list[Callable[[Sketch], None]] = field(default_factory=list)
    """Called when other regions are drawn."""
    _place: Place | None = None
    _doubt: str | None = None
    _best: Found | None = None
    _confirmed: Found | None = None

    def __post_init__(self) -> None:
        self.grid = self.drawn
        self.overlooked = Overlooked(self.drawn.frame.shape)

    @property
    def place(self) -> Place:
        """The most likely place of the target now."""
        if self._place is None:
            self._place = most_likely_place(self.known.belief.probability())
        return self._place

    @property
    def doubt(self) -> str:
        """Why a find at the most likely place is not to be trusted without a person; empty when it may be."""
        if self._doubt is None:
            self._doubt = self.known.alarms.why_not(self.place.cell)
        return self._doubt

    @property
    def best(self) -> Found:
        """The most likely place as it is told, with its probability and ellipse."""
        if self._best is None:
            self._best = self._told(self.place)
        return self._best

    @property
    def confirmed(self) -> Found | None:
        """The place that an operator said is the target's, in the same way."""
        if self._confirmed is None and self.known.confirmed is not None:
            self._confirmed = self._told(place_at(self.known.belief.probability(), self.known.confirmed))
        return self._confirmed

    def _told(self, place: Place) -> Found:
        return found_at(self.grid.frame, place, self.known.sightings.at(place.cell))

    def _forget(self) -> None:
        """Something else is known: what was worked out of it, which takes a look at every cell, is not so any more."""
        self._place = self._doubt = self._best = self._confirmed = None

    def take(self, said: Said, time: float | None) -> None:
        """Believe what was seen, judged or told, exactly, at its time; see `Known.take`."""
        self.known.take(said, time)
        self._forget()
        if isinstance(said, Observation) and self.overlooked.looked(said.cells):
            self.fly_on(self.grid)
        if isinstance(said, (FieldNews, Withdrawn)):
            self.fly_on(self.ground_of(self.known))

    def passed(self, cells: NDArray[np.int64], now: float) -> int:
        """Cells [k, 2] should have been seen just now; how many of them are given up by that, by all that search."""
        given_up = self.overlooked.passed(cells, now)
        if given_up:
            self.fly_on(self.grid)
        return given_up

    def go_back(self, known: Known, grid: Grid | None) -> None:
        """Take up another state of what is known, which is ours from now on, with the ground of it."""
        self.known = known
        self._forget()
        self.fly_on(grid or self.ground_of(known))

    def ground_of(self, known: Known) -> Grid:
        """The grid of the area file without what is excluded by then. Raises BadInput when that leaves nothing."""
        if not known.excluded:
            return self.drawn
        return self.drawn.excluding(
            shapely.union_all([news.ground for news in known.excluded]), known.told_mass
        )

    def fly_on(self, grid: Grid) -> None:
        """Other ground may be flown over, or can be seen, now."""
        self.grid = grid
        for each in self.new_ground:
            each(grid)

    @property
    def redrawing(self) -> Redrawing | None:
        """What draws the regions again as the belief changes; None: nothing does."""
        return self._redrawing

    def redraw_by(self, redrawing: Redrawing) -> None:
        """Draw the regions again from now on, as the belief changes."""
        self._redrawing = redrawing

    def draw(self, sketch: Sketch) -> None:
        """Other regions of interest are flown by now."""
        self.drawing = sketch.drawing
        for each in self.new_drawing:
            each(sketch)

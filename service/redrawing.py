"""Regions that follow the belief: beside the flight, they are segmented again when enough of the mass has moved.

Everything that takes long is done in a thread: whether it is worth it, the segmentation, the names, and what the
planner needs to go on with them. The flight is asked for a copy of the belief now and then, and is handed what is
ready.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, Regions
from roisearch.planners.base import Planner, Redrawable
from roisearch.regions import segment_again, worth_segmenting
from service.drawing import Drawing, news_of

log = logging.getLogger("roisearch")
EVERY_S = 10.0
"""How often it is looked whether regions are to be drawn again, in the time of the search."""
NamesOf = Callable[[Regions], tuple[str, ...]]


@dataclass(frozen=True)
class Sketch:
    """A drawing that is ready to be written down and flown by.

    Attributes:
        planner: the planner that got ready for it, and `take`, what makes it reckon with it.
    """

    drawing: Drawing
    planner: Planner
    take: Callable[[], None]


def keep() -> None:
    """What makes a planner that knows no regions reckon with others: nothing."""


def taking(planner: Planner, regions: Regions) -> Callable[[], None]:
    """What makes a planner reckon with other regions."""
    return planner.redraw(regions) if isinstance(planner, Redrawable) else keep


class Redrawing:
    """See the module's text.

    Args:
        moved: the part of the mass that must have moved.
        searchable: bool [rows, cols].
        named: what people call regions.
    """

    def __init__(self, moved: float, searchable: NDArray[np.bool_], named: NamesOf) -> None:
        self._moved, self._searchable, self._named = moved, searchable, named
        self._at: float | None = None
        self._drawing: Future[Sketch | None] | None = None

    def ready(self) -> Sketch | None:
        """What has become ready since it was last asked."""
        if self._drawing is None or not self._drawing.done():
            return None
        done, self._drawing = self._drawing, None
        try:
            return done.result()
        except Exception:
            log.exception(
                "the regions of interest could not be drawn again; the search goes on with those of before"
            )
            return None

    def due(self, now: float) -> bool:
        """Whether it is time to `look` again, `now` being seconds since the epoch."""
        if self._drawing is not None:
            return False
        if self._at is None or now < self._at:
            self._at = now
        return now >= self._at + EVERY_S

    def look(self, now: float, belief: Belief, drawing: Drawing, planner: Planner) -> None:
        """Begin to look, in a thread, whether the regions are to be drawn again; `belief` is a copy that is ours."""
        self._at, self._drawing = now, Future()
        work = (belief, drawing, planner, self._drawing)
        threading.Thread(target=self._work, args=work, name="regions", daemon=True).start()

    def _work(self, belief: Belief, drawing: Drawing, planner: Planner, done: Future[Sketch | None]) -> None:
        try:
            done.set_result(self._sketch(belief, drawing, planner))
        except Exception as error:
            done.set_exception(error)

    def _sketch(self, belief: Belief, drawing: Drawing, planner: Planner) -> Sketch | None:
        probability = belief.probability()
        if not worth_segmenting(drawing.regions, probability, moved=self._moved):
            return None
        regions = segment_again(drawing.regions, probability, searchable=self._searchable)
        names = self._named(regions)
        words = news_of(drawing.regions, regions, names) or drawing.words
        drawn = Drawing.of(drawing.number + 1, regions, names, words)
        return Sketch(drawn, planner, taking(planner, regions))

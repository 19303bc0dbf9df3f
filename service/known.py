"""What is known of the target: the prior, what news has changed of it, and all that was seen since.

Reports are believed as they come. News (a clue, ground that others have searched) bears on what was believed before
it, so the whole is then reckoned anew: the prior with all clues that stand, and on it every observation in its order.
That is why a word that is taken back leaves no trace, to the last bit.

A target that walks has walked on between one word and the next. The prior, and with it every clue, is of the time of
the first word; each word is applied at its own time, and one that comes late at its own too: what is known goes back
to before it and takes everything in again.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief
from roisearch.detection import DetectionRecord
from roisearch.walk import MOST_S
from roisearch.watch import LOOKED
from service.area import Grid
from service.area.projection import FloatArray
from service.evidence.alarms import Alarms
from service.evidence.cover import detection_p
from service.evidence.observe import Observation
from service.evidence.suspects import Sightings
from service.geometry import Cell
from service.news.bearing import FieldNews

KEPT_EVERY_S, MOST_KEPT = 30.0, 3
"""How far apart earlier states are kept, in the time of the search, for reports that come late; and how many."""
MOST_LOG_ODDS, SUREST_LOG_ODDS = 500.0, 30.0
"""The most that clues can do between two cells, and to the target's being outside: numbers hold these."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """What an operator said about the place around a cell."""

    cell: Cell
    observation: Observation
    confirmed: bool


@dataclass(frozen=True)
class Withdrawn:
    """A piece of news is taken back."""

    id: str


Said = Observation | Judgement | FieldNews | Withdrawn


class Known:
    """The belief, the records of looks, sightings and false alarms, and whatever they were made from.

    Args:
        grid: the ground.
        p_tp, p_tn: those of the detector, for the record of its false alarms.
    """

    def __init__(self, grid: Grid, p_tp: float, p_tn: float) -> None:
        self._grid, self._rates = grid, (p_tp, p_tn)
        self._priors: dict[frozenset[str], FloatArray] = {}
        """The priors without what is refuted, by that: they take long on a large map."""
        self.since: float | None = None
        """Of the first word, as `time`: the prior is taken to be of then."""
        self._said: list[tuple[float, Said]] = []
        self._field: list[FieldNews | Withdrawn] = []
        """What of it is news from the field."""
        self._kept: list[
            tuple[Known, int]
        ] = []  # earlier states, the oldest first, and how much was said by then
        self._begin()
        self.told_mass = self.belief.probability()
        """Where the target was believed to be when news came last, float [rows, cols]: what is flown after an exclusion
        depends on it, and has to be the same whenever it is asked for."""

    def _begin(self) -> None:
        """As it was before anything was seen, with the clues that stand."""
        grid, assumed = self._grid, self._assumed()
        clues = [news for news in self.news if news.role == "clue"]
        prior, outside = _with_clues(assumed, grid.outside, clues) if clues else (assumed, grid.outside)
        self.time: float | None = None
        """Of the last word, seconds since the epoch; None before the first, and wherever the target stands still."""
        self.belief = Belief(prior, searchable=grid.searchable, outside=outside, walk=grid.walk)
        self.belief.follow(LOOKED)  # the planner is handed copies, and wants to know all looks
        self.record = DetectionRecord(prior, outside, walk=grid.walk, searchable=grid.searchable)
        self.sightings = Sightings(grid.frame)
        self.alarms = Alarms(*self._rates)
        self.confirmed: Cell | None = None
        """The place that an operator said is the target's."""

    def _assumed(self) -> FloatArray:
        """The prior of the area file, float [rows, cols], without what is refuted."""
        refuted = frozenset(news.prior for news in self.news if news.role == "refute")
        if not refuted:
            return self._grid.prior
        if refuted not in self._priors:
            self._priors[refuted] = self._grid.prior_without(refuted)
        return self._priors[refuted]

    @property
    def news(self) -> list[FieldNews]:
        """The news that stand, in the order in which they came."""
        back = {said.id for said in self._field if isinstance(said, Withdrawn)}
        return [said for said in self._field if isinstance(said, FieldNews) and said.id not in back]

    @property
    def excluded(self) -> list[FieldNews]:
        """The exclusions that stand beside those of the area file."""
        return [news for news in self.news if news.role == "exclude"]

    @property
    def heard(self) -> int:
        """How many pieces of news there have been, those that were taken back among them."""
        return sum(isinstance(said, FieldNews) for said in self._field)

    def heard_as(self, name: str) -> FieldNews | None:
        """The news of this id, taken back or not; None when there has been none."""
        each = (said for said in self._field if isinstance(said, FieldNews) and said.id == name)
        return next(each, None)

    def take(self, said: Said, time: float | None = None) -> None:
        """Believe one thing more, which is of `time`, seconds since the epoch; None: of the last word's."""
        moment = time if time is not None else self.time or 0.0
        self._said.append((moment, said))
        if isinstance(said, (FieldNews, Withdrawn)):
            self._field.append(said)
            if self._moves(said):
                self._kept = []
                self._begin()
                self._believe_all(self._said)
            self.told_mass = self.belief.probability()
        elif self._is_late(moment):
            self._believe_all(self._go_back(moment))
        else:
            self._believe(said, moment)
            self._keep()

    def _moves(self, said: FieldNews | Withdrawn) -> bool:
        """Whether news, or news taken back, may change what is believed: an exclusion says nothing of the target, and
        where that stands still the time at which it is told says nothing either."""
        news = self.heard_as(said.id) if isinstance(said, Withdrawn) else said
        return self._grid.walk is not None or news is None or news.role != "exclude"

    @property
    def kept(self) -> int:
        """How many earlier states are kept for words that come late."""
        return len(self._kept)

    def _keep(self) -> None:
        """Keep the present state now and then, for words that come late."""
        if self.time is None or (self._kept and self.time < (self._kept[-1][0].time or 0.0) + KEPT_EVERY_S):
            return
        state = self.copy()
        state._said, state._kept = [], []
        self._kept = [*self._kept[1 - MOST_KEPT :], (state, len(self._said))]

    def _is_late(self, moment: float) -> bool:
        """Whether the target may have walked on between a moment and the present state."""
        if self._grid.walk is None or self.time is None:
            return False
        return moment < self.time - self.belief.since_tick_s

    def _go_back(self, moment: float) -> list[tuple[float, Said]]:
        """Go back to the last state kept from before a moment, else to the first; what was said since."""
        while self._kept and self._kept[-1][0]._is_late(moment):
            self._kept.pop()
        if not self._kept:
            self._begin()
            return self._said
        state, count = self._kept[-1]
        earlier = state.copy()
        self.belief, self.record, self.time = earlier.belief, earlier.record, earlier.time
        self.sightings, self.alarms, self.confirmed = earlier.sightings, earlier.alarms, earlier.confirmed
        return self._said[count:]

    def _believe_all(self, said: list[tuple[float, Said]]) -> None:
        """Believe what stands of it, in the order in which it was so; without a walk, in that in which it came."""
        standing = {news.id for news in self.news}
        ordered = said if self._grid.walk is None else sorted(said, key=lambda each: each[0])
        for moment, each in ordered:
            if not isinstance(each, FieldNews) or each.id in standing:
                self._believe(each, moment)

    def _until(self, moment: float) -> None:
        """Let the target walk on until a moment."""
        if self._grid.walk is None:
            return
        passed = 0.0 if self.time is None else min(max(0.0, moment - self.time), MOST_S)
        self.belief.drift(passed)
        self.record.drift(passed)
        if self.time is None:
            self.time = self.since = moment
        self.time = max(self.time, moment)

    def _believe(self, said: Said, moment: float) -> None:
        self._until(moment)
        match said:
            case Observation():
                self.alarms.add(said)
                self._see(said)
            case Judgement(cell=cell, observation=observation, confirmed=confirmed):
                self._see(observation, judged=True)
                self.confirmed = cell if confirmed else None
                if not confirmed:
                    self.sightings.forget(cell)
            case FieldNews(role="searched"):
                hits = np.zeros(len(said.cells), dtype=np.bool_)
                self.belief.observe(said.cells, hits, said.values, np.ones(len(said.cells)))
                self.record.look(said.cells, said.values)

    def _see(self, seen: Observation, *, judged: bool = False) -> None:
        self.belief.observe(seen.cells, seen.hits, seen.p_tp, seen.p_tn)
        found = seen.p_tp
        if self._grid.visibility is not None and not judged:
            found = detection_p(found, seen.p_tn, self._grid.visibility[seen.cells[:, 0], seen.cells[:, 1]])
        self.record.look(seen.cells[seen.first], found[seen.first])
        self.sightings.add(seen.speaking, seen.sightings)

    def copy(self) -> Known:
        """An independent copy; what was said is shared, since it never changes."""
        twin = copy.copy(self)
        twin._said, twin._field, twin._kept = list(self._said), list(self._field), list(self._kept)
        twin.belief = self.belief.copy()
        twin.record, twin.sightings, twin.alarms = copy.deepcopy((self.record, self.sightings, self.alarms))
        return twin


def _with_clues(
    before: NDArray[np.float64], outside: float, clues: Sequence[FieldNews]
) -> tuple[NDArray[np.float64], float]:
    """A prior, [rows, cols], and the probability outside, with the factors of clues.

    In logarithms: a hundred clues of a thousand each are more than a number can hold. What all of them together can do
    is bounded, so that nothing that was possible becomes impossible.
    """
    with np.errstate(divide="ignore"):
        logs = np.log(before)
        for news in clues:
            logs[news.cells[:, 0], news.cells[:, 1]] += np.log(news.values)
    peak = float(logs.max())
    prior = np.where(before > 0.0, np.exp(np.maximum(logs - peak, -MOST_LOG_ODDS)), 0.0)
    if outside == 0.0:
        return prior, 0.0
    within = math.log(float(prior.sum()) / float(before.sum()) * (1.0 - outside) / outside) + peak
    return prior, 1.0 / (1.0 + math.exp(min(max(within, -SUREST_LOG_ODDS), MOST_LOG_ODDS)))

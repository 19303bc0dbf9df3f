"""Whether the detector is as good as the settings say: how often it saw the target where it is not.

The target is in one place, so hits elsewhere are false alarms, and their share of the cells looked at is 1 - p_tn. A
detector that sees it in every frame makes any place look certain within a few looks. How many of the cells outside the
likely place's square had a hit in their first pass is a count of independent looks (later passes are not: the same
stone fools it again), so it is held against the binomial distribution. While all that was seen lies around the place
itself that says nothing: then it has to have looked somewhere in vain.

A count is looked at again and again, so that sooner or later it is an unlikely one by chance, and a share is never
quite the one of the settings. So a detector is doubted only where its false alarms are also far more than it is said to
have: a find rests on several hits, and with twice the share each of them weighs half.
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy.special import bdtrc

from service.evidence.observe import Observation
from service.geometry import Cell

_UNLIKELY = 0.02
"""So rarely may a find of a detector that is as good as it is said to be have to wait. The doubt goes with the next
looks in vain, while one that sees the target everywhere makes a place sure before many cells were seen."""
_TIMES, _CHANCE = 2.0, 0.1
"""So many times as many false alarms as it is said to have would have to be this rare a chance."""
_FEW = 3
"""Cells, of which a detector that is as good as it is said to be hardly reports the target in all."""
_HALF = 0.5
"""A hit counts when it is worth half of a full one: one spread over many cells is the hit of none."""


@dataclass(slots=True)
class _FirstPass:
    hit: bool
    over: bool = False


class Alarms:
    """The first pass over each cell, and whether it had a hit."""

    def __init__(self, p_tp: float, p_tn: float) -> None:
        self._p_tn = p_tn
        self._least = _HALF * p_tp / (1.0 - p_tn)
        self._cells: dict[Cell, _FirstPass] = {}
        self._alarm = 0.0  # sum of 1 - p_tn over the looks in vain, where a calibration has it otherwise
        self._in_vain = 0

    def add(self, observation: Observation) -> None:
        """Count the looks of a report."""
        o = observation
        columns = (o.cells, o.hits, o.p_tp, o.p_tn, o.first)
        for (row, col), hit, p_tp, p_tn, first in zip(*(each.tolist() for each in columns), strict=True):
            full = hit and p_tp >= self._least * (1.0 - p_tn)
            known = self._cells.get((row, col))
            if known is None:
                self._cells[row, col] = _FirstPass(full)
            elif first:
                known.over = True
            elif not known.over:
                known.hit |= full
            if first and not hit:
                self._alarm, self._in_vain = self._alarm + 1.0 - p_tn, self._in_vain + 1

    def why_not(self, place: Cell) -> str:
        """Why a find at `place` is not to be trusted without a person, for people; empty when it may be."""
        beside = [
            one.hit
            for cell, one in self._cells.items()
            if max(abs(cell[0] - place[0]), abs(cell[1] - place[1])) > 1
        ]
        hits, rate = sum(beside), max(1.0 - self._p_tn, self._alarm / max(self._in_vain, 1))
        as_said, worse = (bdtrc(hits - 1, len(beside), min(each, 1.0)) for each in (rate, _TIMES * rate))
        if not hits or as_said >= _UNLIKELY or worse >= _CHANCE:
            return self._sees_it_everywhere()
        return (
            f"the detector reported the target in {hits} of {len(beside)} cells elsewhere, where p_tn = "
            f"{self._p_tn:g} lets expect {len(beside) * rate:.0f}; a person has to confirm what it finds"
        )

    def _sees_it_everywhere(self) -> str:
        if len(self._cells) < _FEW or not all(one.hit for one in self._cells.values()):
            return ""
        return (
            f"the detector reported the target in each of the {len(self._cells)} cells that it has seen; a person has "
            "to confirm what it finds"
        )

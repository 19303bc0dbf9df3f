"""One look per cell per pass: what frames of the same ground, seconds apart, are worth together.

Neighbouring frames agree with each other, right or wrong, so a video of a cell is one look and not thirty a second.
A *pass* over a cell goes on while the frames of its source show the cell at all; a frame of that source that does not
show it ends the pass. So do `again_s` seconds, if frames so far apart are to be looks of their own: what one gains by
hovering over a suspect (`sensor.hover_look_s`). A pass becomes a look with the first frame that covers the cell well
enough, or that has a hit in it. Several sources that watch a cell at the same time share its pass: it goes on while
any of them shows the cell.

A pass is worth its best frame: a hit replaces a miss, a surer hit a weaker one, a miss from a better place a miss
from a worse one, and never the reverse. So a calibration is to be made from the best score of each pass.

All of this goes by the time of capture. A frame that arrives late joins the pass that was going on when it was
taken: it may add to what that pass is worth, but it is no look of its own unless a frame of its source is known
that did not show the cell in between. What is not known yet is taken for no end, so that frames in a wrong order are
worth at most what they are in the right one (of one source; a second source that arrives later than the first, and
shows that a pass never ended, comes too late to make one of two). A source that falls silent while others report
keeps no pass going for longer than `SILENT_S`.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right, insort
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from service.geometry import Cell

SILENT_S = 30.0


@dataclass(frozen=True, slots=True)
class CellLook:
    """What one frame says about one cell of its footprint.

    counts: it is covered well enough for a look. p_tp, p_tn: the likelihoods of a look from there. ratio: the
    likelihood ratio of the hit in it, above 0, or None for a miss.
    """

    counts: bool
    p_tp: float
    p_tn: float
    ratio: float | None = None

    @property
    def worth(self) -> float:
        """The factor on the odds of the cell: below 1 for a miss."""
        return (1.0 - self.p_tp) / self.p_tn if self.ratio is None else self.ratio

    def beats(self, other: CellLook) -> bool:
        """A hit beats a miss, a surer hit a weaker one, a miss from a better place one from a worse."""
        if self.ratio is None:
            return other.ratio is None and self.counts and self.p_tp > other.p_tp
        return other.ratio is None or self.ratio > other.ratio


@dataclass(frozen=True, slots=True)
class Change:
    """What a frame adds to what is known of a cell: a look, or by how much a pass is worth more than before.

    `first` is False where a pass that had been a look turned into a hit, or a surer one: no look was added.
    """

    cell: Cell
    hit: bool
    p_tp: float
    p_tn: float
    first: bool


@dataclass(slots=True, eq=False)
class _Pass:
    """Frames from `first` to `last` show the cell; it had not begun at `after` and is over at `before`.

    It goes on while a source is `watching`: while that source's newest frame shows the cell.
    """

    after: float
    first: float
    last: float
    before: float
    best: CellLook | None = None
    watching: set[str] = field(default_factory=set)
    left: float = -math.inf

    def leave(self, source: str, time: float) -> None:
        """The source does not show the cell any more; the last to leave ends the pass."""
        self.watching.discard(source)
        self.left = max(self.left, time)
        if not self.watching:
            self.before = self.left


@dataclass(slots=True)
class _Source:
    times: list[float] = field(default_factory=list)
    open: dict[Cell, _Pass] = field(default_factory=dict)


class Passes:
    """The passes of the last `keep_s` seconds, by the time of capture."""

    def __init__(self, keep_s: float = 120.0, again_s: float = math.inf) -> None:
        """`again_s`: a pass that has lasted so many seconds is over, and the next frame begins another."""
        self._keep_s, self._again_s = keep_s, again_s
        self._sources: dict[str, _Source] = {}
        self._cells: dict[Cell, list[_Pass]] = {}
        self._newest = self._pruned = -math.inf
        self._unsettled: list[tuple[_Pass, CellLook | None]] = []

    def __contains__(self, cell: Cell) -> bool:
        """Whether a pass over the cell is going on: flying there brings no other look."""
        return any(one.before == math.inf and one.best is not None for one in self._cells.get(cell, ()))

    def take(self, source: str, time: float, looks: Mapping[Cell, CellLook]) -> list[Change]:
        """Take in one frame of a source, taken at `time`: the changes that it makes, to be settled or undone."""
        known = self._sources.setdefault(source, _Source())
        changes = [
            change
            for cell, look in looks.items()
            if (change := self._look(source, known, time, cell, look)) is not None
        ]
        if not known.times or time >= known.times[-1]:
            for cell in known.open.keys() - looks.keys():
                known.open.pop(cell).leave(source, time)
        insort(known.times, time)
        self._newest = max(self._newest, time)
        if self._newest - self._pruned > 0.25 * self._keep_s:
            self._prune()
        return changes

    def settle(self) -> None:
        """The changes so far are in the journal and in the belief."""
        self._unsettled.clear()

    def undo(self) -> None:
        """The changes since the last `settle` have not happened; the same frames may come again."""
        for one, best in reversed(self._unsettled):
            one.best = best
        self._unsettled.clear()

    def _look(self, source: str, known: _Source, time: float, cell: Cell, look: CellLook) -> Change | None:
        """One cell of one frame."""
        one = self._going_on(cell, time)
        if one is None:
            one = self._begin(known, time, cell)  # worth nothing yet
        one.first, one.last = min(one.first, time), max(one.last, time)
        if not known.times or time >= known.times[-1]:
            self._keep_open(source, known, cell, one)
        best = one.best
        if best is None:
            if not look.counts and look.ratio is None:
                return None
        elif not look.beats(best):
            return None
        self._unsettled.append((one, best))
        one.best = look if best is None else replace(look, p_tn=best.p_tn)
        return _change(cell, best, look)

    def _going_on(self, cell: Cell, time: float) -> _Pass | None:
        for one in reversed(self._cells.get(cell, ())):
            if one.after < time < one.before:
                if time < one.first + self._again_s:
                    return one
                one.before = time
        return None

    def _begin(self, known: _Source, time: float, cell: Cell) -> _Pass:
        """A pass that has neither begun before the source's last frame nor goes on after its next."""
        at, end = bisect_left(known.times, time), bisect_right(known.times, time)
        after = known.times[at - 1] if at else -math.inf
        before = known.times[end] if end < len(known.times) else math.inf
        one = _Pass(after, time, time, before)
        self._cells.setdefault(cell, []).append(one)
        return one

    def _keep_open(self, source: str, known: _Source, cell: Cell, one: _Pass) -> None:
        """The source's newest frame shows the cell: its pass goes on, unless another has begun since."""
        if all(other.first <= one.last for other in self._cells[cell]):
            one.before = math.inf
            one.watching.add(source)
            known.open[cell] = one

    def _prune(self) -> None:
        """Forget what no report can change any more, and what waits for a source that is silent."""
        self._pruned = self._newest
        horizon = self._newest - self._keep_s
        for name, known in self._sources.items():
            if known.times[-1] < self._newest - SILENT_S:
                for one in known.open.values():
                    one.leave(name, self._newest)
                known.open.clear()
            del known.times[: bisect_left(known.times, horizon)]
        self._sources = {name: known for name, known in self._sources.items() if known.times}
        for cell in list(self._cells):
            kept = [one for one in self._cells[cell] if one.before > horizon]
            if kept:
                self._cells[cell] = kept
            else:
                del self._cells[cell]


def _change(cell: Cell, before: CellLook | None, after: CellLook) -> Change:
    """What has to be told so that a pass counts as `after` where it had counted as `before`."""
    if before is None:
        if after.ratio is None:
            return Change(cell, False, after.p_tp, after.p_tn, True)
        return Change(cell, True, *as_likelihoods(after.ratio, after.p_tp), True)
    if after.ratio is None:  # a better miss: the odds and the chance of a miss so far both shrink by this
        shrunk = (1.0 - after.p_tp) / (1.0 - before.p_tp)
        return Change(cell, False, 1.0 - shrunk, 1.0, True)
    ratio = after.ratio / before.worth
    return Change(cell, True, *as_likelihoods(ratio, before.p_tp), False)


def as_likelihoods(ratio: float, p_tp: float) -> tuple[float, float]:
    """p_tp and p_tn of a sensor whose hit multiplies the odds by `ratio` > 0: p_tp / (1 - p_tn) = ratio.

    The given p_tp is kept wherever it can be; a hit that says hardly more than it, or less, is told with
    p_tp = p_tn = ratio / (1 + ratio), which has that ratio too.
    """
    if p_tp < 0.99 * ratio:
        return p_tp, 1.0 - p_tp / ratio
    return ratio / (1.0 + ratio), ratio / (1.0 + ratio)

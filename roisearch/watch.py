"""What planners may have kept beside a belief: which cells have changed, and how often each was looked at.

See `Belief.follow`. The sums of regions, `roisearch.forest`, are another such thing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.looks import count_looks
from roisearch.walk import Ways


class Changes:
    """The cells of a belief that observations have changed since the last look at this list."""

    lasts = False

    def __init__(self, subject: Watch) -> None:
        self.subject = subject
        self.cells: list[NDArray[np.int64]] = []
        self.all = True

    def touch(self, cells: NDArray[np.int64], hits: NDArray[np.bool_], weights: NDArray[np.float64]) -> None:
        """Note that `cells` [k, 2] were looked at."""
        if len(self.cells) >= 4096:
            self.all = True
        if not self.all:
            self.cells.append(cells.copy())

    def renew(self, weights: NDArray[np.float64], factor: float) -> None:
        """Note that every cell has changed."""
        self.all = True

    def drifted(self, weights: NDArray[np.float64], ways: Ways, ticks: int) -> None:
        """Note that every cell has changed."""
        self.all = True

    def copy(self) -> Changes:
        """For a copied belief: everything is new to whoever reads it."""
        return Changes(self.subject)

    def take(self) -> tuple[bool, list[NDArray[np.int64]]]:
        """Whether everything may have changed, and the cells that have; the list starts again."""
        everything, cells = self.all, self.cells
        self.all, self.cells = False, []
        return everything, cells


class Watch:
    """Asks a belief to keep `Changes`; one for each reader."""

    def begin(self, weights: NDArray[np.float64], shape: tuple[int, int]) -> Changes:
        """The list for one belief."""
        return Changes(self)


LONGEST_TRAIL = 1 << 16
"""Observations that a trail remembers; a longer one begins anew, and so does a copy of so many copies as DEEPEST."""
DEEPEST = 64


class Trail:
    """The cells looked at by a belief, and how many of them a copied belief has from the one it is a copy of."""

    def __init__(self, parent: Trail | None = None, shared: int = 0) -> None:
        self._parent, self._shared = parent, shared
        self._depth: int = 0 if parent is None else parent._depth + 1
        self._cells: list[NDArray[np.int64]] = []

    def copy(self) -> Trail:
        """That of a copied belief: it has all that this one has now."""
        if self._depth >= DEEPEST:
            return Trail()
        if not self._cells and self._parent is not None:
            return Trail(self._parent, self._shared)
        return Trail(self, len(self._cells))

    def add(self, cells: NDArray[np.int64]) -> None:
        """Note that `cells` [k, 2] were looked at."""
        self._cells.append(cells.copy())

    @property
    def is_full(self) -> bool:
        """Whether it should be begun anew."""
        return len(self._cells) >= LONGEST_TRAIL

    def mark(self) -> Mark:
        """The state of the belief now."""
        return Mark(self, len(self._cells))


class Mark:
    """A state of a belief, to be compared with another state of it or of its copies."""

    def __init__(self, trail: Trail, length: int) -> None:
        self._trail, self._length = trail, length

    def apart_from(self, other: Mark) -> list[NDArray[np.int64]] | None:
        """The cells [k, 2] in which the two states may differ; None when neither knows how they are related."""
        mine, theirs = self._line(), other._line()
        shared = next((trail for trail, _ in mine if any(trail is each for each, _ in theirs)), None)
        if shared is None:
            return None
        found: list[NDArray[np.int64]] = []
        ends = []
        for line in (mine, theirs):
            for trail, length in line:
                if trail is shared:
                    ends.append(length)
                    break
                found += trail._cells[:length]
        return found + shared._cells[min(ends) : max(ends)]

    def _line(self) -> list[tuple[Trail, int]]:
        """The trails it goes back to, the latest first, and how far along each."""
        line, trail, length = [], self._trail, self._length
        while True:
            line.append((trail, length))
            if trail._parent is None:
                return line
            trail, length = trail._parent, trail._shared


class LookCounts:
    """How often each cell was looked at with a hit and without one, and the weights before."""

    lasts = True

    def __init__(self, subject: Looked, first: NDArray[np.float64], cols: int) -> None:
        self.subject = subject
        self._trail = Trail()
        self._first = first  # never written: all copies share it
        self._going: NDArray[np.float64] | None = None  # what part of it walks; None: the target never has
        self._cols = cols
        self._rescaled = 1.0  # what the weights were multiplied with since
        self._tally = np.zeros((first.size, 2), dtype=np.int16)

    def touch(self, cells: NDArray[np.int64], hits: NDArray[np.bool_], weights: NDArray[np.float64]) -> None:
        """Count looks at `cells` [k, 2] with `hits`, bool [k] or [1] for all alike."""
        count_looks(self._tally, self._cols, cells, hits)
        if self._trail.is_full:
            self._trail = Trail()
        self._trail.add(cells)

    def mark(self) -> Mark:
        """The state of the belief now, to be compared with a later one, or with that of a copy."""
        return self._trail.mark()

    def renew(self, weights: NDArray[np.float64], factor: float) -> None:
        """Note by what all weights were multiplied."""
        self._rescaled *= factor
        self._trail = Trail()

    def drifted(self, weights: NDArray[np.float64], ways: Ways, ticks: int) -> None:
        """Let the weights as they would be without looks drift too: what there is now is compared with those."""
        self._first = self._first.copy()
        self._going = ways.going() if self._going is None else self._going.copy()
        ways.go(self._first, self._going, ticks)
        self._trail = Trail()

    def copy(self) -> LookCounts:
        """An independent copy for a copied belief."""
        twin = LookCounts(self.subject, self._first, self._cols)
        twin._going = self._going
        twin._rescaled, twin._tally, twin._trail = self._rescaled, self._tally.copy(), self._trail.copy()
        return twin

    def looked(self) -> NDArray[np.bool_]:
        """Which cells were looked at, flat, bool [cells]."""
        return np.asarray(self._tally.any(axis=1))

    def hit(self) -> NDArray[np.int64]:
        """The cells in which something was reported, flat, int [n]."""
        return np.flatnonzero(self._tally[:, 1] > 0)

    def raised(self, cells: NDArray[np.int64], weights: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of `cells` [k], flat indices, are more probable, beside the others, than before the looks.

        Once the target may have walked: than without any looks, where there was a hit. Beside such a cell they all are
        more probable, a little, and ask for nothing.
        """
        above: NDArray[np.bool_] = weights[cells] > self._first[cells] * (self._rescaled * (1.0 + 1e-9))
        return above if self._going is None else above & (self._tally[cells, 1] > 0)

    def contradicted(self, cells: NDArray[np.int64], weights: NDArray[np.float64]) -> NDArray[np.int64]:
        """How many hits at each of `cells` [k], flat indices, the misses at the same cell outweigh, int [k].

        None while the cell is raised.
        """
        return np.where(self.raised(cells, weights), 0, self._tally[cells].min(axis=1)).astype(np.int64)


class Looked:
    """Asks a belief to keep `LookCounts`."""

    def begin(self, weights: NDArray[np.float64], shape: tuple[int, int]) -> LookCounts:
        """The counts for one belief, from now on."""
        return LookCounts(self, weights.copy(), shape[1])

    def __reduce__(self) -> str:
        return "LOOKED"


LOOKED = Looked()
"""All planners read the same counts."""

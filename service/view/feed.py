"""What one watcher has not seen yet: a small message for each moment, with the map as bytes and changes only.

The belief goes out as one byte a cell: 0 where nothing is searched, else an eighth of an octave of the
*unnormalised* weight below a reference, beside the total. An observation changes the weights of the cells that it
saw and the total, so a moment later a few cells are sent, not the map. (0.1 octaves or 9 % a step is finer than
colours can tell; what is told in numbers is sent as numbers.)
"""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.view.state import RunState

STEPS_AN_OCTAVE = 8
HEADROOM_OCTAVES = 7  # a hit of a good sensor lifts a cell by that much


@dataclass(frozen=True)
class Moment:
    """What there is to see of a run at one time.

    Attributes:
        state: the state as `/api/state` tells it.
        weights: the belief's unnormalised weights, float [cells], and `total` what to divide them by.
        pod: cumulative probability of detection, float [rows, cols].
        tracks: where each aircraft was, in the order of the state's `aircraft`.
        hits, curve: as the lists in `tracks`, they only grow from moment to moment, unless time is set back.
    """

    state: RunState
    weights: NDArray[np.float64]
    total: float
    pod: NDArray[np.float64]
    tracks: Sequence[Sequence[Sequence[float]]]
    hits: Sequence[Sequence[float]]
    curve: Sequence[Sequence[float]]

    def copied(self) -> Moment:
        """This moment with arrays and lists of its own, to be looked at while the search goes on."""
        tracks, hits, curve = [list(each) for each in self.tracks], list(self.hits), list(self.curve)
        weights, pod = self.weights.copy(), self.pod.copy()
        return replace(self, weights=weights, pod=pod, tracks=tracks, hits=hits, curve=curve)


@dataclass
class Feed:
    """One watcher's stream; `searchable` bool [rows, cols]."""

    searchable: NDArray[np.bool_]
    _belief: _Bytes = field(default_factory=lambda: _Bytes())
    _pod: _Bytes = field(default_factory=lambda: _Bytes())
    _weights: NDArray[np.float64] | None = None
    _reference: int = 0
    _sent: dict[str, int] = field(default_factory=dict)

    def message(self, moment: Moment) -> dict[str, Any]:
        """Everything that is new at this moment."""
        said: dict[str, Any] = {"type": "moment", "state": moment.state}
        said["belief"] = {**self._belief_news(moment), "log2_total": math.log2(moment.total)}
        said["pod"] = self._pod.news(np.rint(255.0 * moment.pod.ravel()).astype(np.uint8))
        tracks = [self._more(f"track {number}", rows) for number, rows in enumerate(moment.tracks)]
        if any(tracks):
            said |= {"track": tracks[0]} if len(tracks) == 1 else {"tracks": tracks}
        for name, rows in (("hits", moment.hits), ("curve", moment.curve)):
            news = self._more(name, rows)
            if news is not None:
                said[name] = news
        return said

    def _belief_news(self, moment: Moment) -> dict[str, Any]:
        """The cells whose byte is another one; all of them when the reference is."""
        top = math.ceil(math.log2(max(float(moment.weights.max()), 1e-300)))
        fresh = self._weights is None or not self._reference - 2 * HEADROOM_OCTAVES <= top <= self._reference
        if fresh:
            self._reference = top + HEADROOM_OCTAVES
            self._belief = _Bytes()
        if self._weights is None or fresh:
            codes = encode(moment.weights, self._reference)
            codes[~self.searchable.ravel()] = 0
            self._weights = moment.weights.copy()
        else:
            codes = self._belief.last.copy()
            changed = np.flatnonzero(moment.weights != self._weights)
            codes[changed] = np.where(
                self.searchable.ravel()[changed], encode(moment.weights[changed], self._reference), 0
            )
            self._weights[changed] = moment.weights[changed]
        return {"reference": self._reference, **self._belief.news(codes)}

    def _more(self, name: str, rows: Sequence[Sequence[float]]) -> dict[str, Any] | None:
        """The rows that are new: the watcher cuts its list at `from` and appends."""
        sent, self._sent[name] = self._sent.get(name, 0), len(rows)
        if len(rows) == sent:
            return None
        start = min(sent, len(rows))
        return {"from": start, "rows": [list(row) for row in rows[start:]]}


class _Bytes:
    """An array of bytes that the watcher has a copy of."""

    def __init__(self) -> None:
        self.last = np.empty(0, dtype=np.uint8)

    def news(self, codes: NDArray[np.uint8]) -> dict[str, Any]:
        """What to change in the copy: everything, or the bytes at some places; nothing when nothing is new."""
        before, self.last = self.last, codes
        if before.size != codes.size:
            return {"codes": _text(codes)}
        at = np.flatnonzero(before != codes)
        if not at.size:
            return {}
        if at.size * 5 > codes.size:
            return {"codes": _text(codes)}
        return {"at": _text(at.astype("<u4")), "codes": _text(codes[at])}


def encode(weights: NDArray[np.float64], reference: int) -> NDArray[np.uint8]:
    """One byte a weight: 255 is 2 ** reference, each step down an eighth of an octave less, 1 the least."""
    with np.errstate(divide="ignore"):
        octaves = np.log2(weights) - reference
    return np.clip(np.rint(255.0 + STEPS_AN_OCTAVE * octaves), 1.0, 255.0).astype(np.uint8)


def _text(array: NDArray[Any]) -> str:
    return base64.b64encode(array.tobytes()).decode()

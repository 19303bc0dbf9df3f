"""How long the way around is: distances from a few landmarks, from which those between any two cells follow.

The way between two cells is never shorter than the difference of their distances from a third one. With landmarks far
apart, at the ends of arms and valleys, one of the differences is nearly the way itself (Goldberg and Harrelson,
"Computing the Shortest Path: A* Search Meets Graph Theory", SODA 2005). It costs two numbers a landmark, and no search.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from roisearch.directions import STEPS
from roisearch.kernels.compiled import kernel
from roisearch.kernels.records import Ints

Fields = NDArray[np.int32]
STRAIGHT, DIAGONAL = 5, 7
"""What a move costs in the unit of the fields, a fifth of a cell."""
FAR = np.int32(1 << 30)
COUNT = 16
MOST_CELLS = 1 << 18
"""On larger maps there are none: they would take as much memory as all the rest."""
_BUCKETS = 8  # more than the dearest move costs
_DOWN = np.array([down for down, _ in STEPS])
_RIGHT = np.array([right for _, right in STEPS])
NO_LANDMARKS: Fields = np.zeros((0, 0), dtype=np.int32)


def landmarks(allowed: NDArray[np.uint8], cols: int, at: int, until: float) -> Fields:
    """Distances of all cells from landmarks, int [landmarks, cells], in `STRAIGHT`; FAR where no way leads.

    Each landmark is the cell farthest from those before it, the first the one farthest from `at`; there are fewer when
    it is `until`, by `time.perf_counter`, and none on a large map.
    """
    if allowed.size > MOST_CELLS:
        return NO_LANDMARKS
    room = np.zeros((_BUCKETS, allowed.size), dtype=np.int32), np.zeros(_BUCKETS, dtype=np.int64)
    nearest = np.empty(allowed.size, dtype=np.int32)
    fields: list[Fields] = []
    spread(at, allowed, cols, nearest, *room)
    reached = nearest < FAR
    while len(fields) < COUNT and time.perf_counter() < until:
        farthest = int(np.argmax(np.where(reached, nearest, -1)))
        if nearest[farthest] <= 0:
            break
        field = np.empty(allowed.size, dtype=np.int32)
        spread(farthest, allowed, cols, field, *room)
        nearest = field if not fields else np.minimum(nearest, field)
        fields.append(field)
    return np.array(fields) if fields else NO_LANDMARKS


@kernel
def spread(
    start: int, allowed: NDArray[np.uint8], cols: int, field: Fields, buckets: Fields, count: Ints
) -> None:
    """Fill `field` [cells] with the distances from `start`, by Dial's algorithm; `buckets` [8, cells] and `count` [8]
    are room to work in."""
    field[:] = FAR
    field[start] = 0
    count[:] = 0
    buckets[0, 0], count[0] = start, 1
    left, distance = 1, 0
    while left > 0:
        bucket = distance & (_BUCKETS - 1)
        for i in range(count[bucket]):
            left -= 1
            cell = buckets[bucket, i]
            if field[cell] != distance:
                continue
            for d in range(8):
                if not allowed[cell] >> d & 1:
                    continue
                near = cell + _DOWN[d] * cols + _RIGHT[d]
                further = distance + (DIAGONAL if d & 1 else STRAIGHT)
                if further < field[near]:
                    field[near] = further
                    other = further & (_BUCKETS - 1)
                    buckets[other, count[other]] = near
                    count[other] += 1
                    left += 1
        count[bucket] = 0
        distance += 1


@kernel
def apart(here: int, there: int, fields: Fields) -> int:
    """The least that the way between two cells can be, in the unit of `fields`; 0 without landmarks."""
    least = 0
    for k in range(fields.shape[0]):
        least = max(least, abs(fields[k, here] - fields[k, there]))
    return int(least)

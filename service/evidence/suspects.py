"""The places that look promising: how probable each is, where exactly, how sure that is, and what was seen there.

A place's position is its posterior's mean, and its error ellipse the posterior's second moments over the square of
cells. Where detections with a known accuracy lie in the square, they may know better than cells can: their mean,
weighted by the posterior of their cells, with the second moments of the mixture of their Gaussians. Averaging does
not make it smaller, since detections of one aircraft share their errors. Of the two, the one with the smaller ellipse
is told.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from roisearch.place import Place, likely_places
from service.area.frame import GridFrame
from service.evidence.found import IN_95_PERCENT, Found, Suspect
from service.evidence.observe import Sighting
from service.geometry import Cell

MOST_SIGHTINGS = 1000


def found_at(frame: GridFrame, place: Place, near: Sequence[Sighting] = ()) -> Found:
    """What is known of a place of the grid, from its cells and the detections in its square."""
    point, covariance = _of_cells(frame, place)
    known = _of_sightings(frame, place, near)
    if known is not None and np.linalg.det(known[1]) < np.linalg.det(covariance):
        point, covariance = known
    lat, lon = frame.from_metres(point[None])[0]
    values, vectors = np.linalg.eigh(covariance)
    minor, major = np.sqrt(np.maximum(values, 0.0))
    east, south = vectors[:, 1]
    bearing = (math.degrees(math.atan2(east, -south)) + frame.bearing_deg) % 180.0
    ellipse = {
        "semi_major_m": round(float(major) * IN_95_PERCENT, 2),
        "semi_minor_m": round(float(minor) * IN_95_PERCENT, 2),
        "bearing_deg": round(bearing, 1) % 180.0,
    }
    pictures = [each.thumbnail for each in near if each.thumbnail is not None]
    picture = pictures[-1] if pictures else None
    return Found(float(lat), float(lon), place.probability, float(major), ellipse, picture)


def _of_cells(frame: GridFrame, place: Place) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and covariance of the posterior, as (east, south) in metres."""
    row, col = place.centroid
    swapped = place.covariance[::-1, ::-1]
    return np.array([col + 0.5, row + 0.5]) * frame.cell_m, swapped * frame.cell_m**2


def _of_sightings(
    frame: GridFrame, place: Place, near: Sequence[Sighting]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Mean and covariance of the mixture of the detections whose accuracy is known; None without any."""
    known = [each for each in near if each.covariance is not None]
    if not known:
        return None
    points = frame.to_metres([[each.lat, each.lon] for each in known])
    squares = np.array([[[c[0], c[1]], [c[1], c[2]]] for each in known if (c := each.covariance) is not None])
    mean, square = _of_cells(frame, place)
    gaps = points - mean
    closeness = np.exp(-0.5 * np.einsum("ki,ij,kj->k", gaps, np.linalg.inv(square), gaps))
    weights = (closeness + 1e-12) / np.sqrt(np.linalg.det(squares))
    weights /= weights.sum()
    middle = weights @ points
    off = points - middle
    moments = np.einsum("k,kij->ij", weights, squares) + np.einsum("k,ki,kj->ij", weights, off, off)
    return middle, moments


class Sightings:
    """The detections so far, the newest MOST_SIGHTINGS of them, and the cells that ever had a hit."""

    def __init__(self, frame: GridFrame) -> None:
        self._frame = frame
        self._all: deque[tuple[Cell, Sighting]] = deque(maxlen=MOST_SIGHTINGS)
        self._hit: set[Cell] = set()

    def add(self, hit: Iterable[Cell], sightings: Iterable[Sighting]) -> None:
        """Note cells with a hit, and the detections behind them."""
        self._hit.update(hit)
        for each in sightings:
            row, col = self._frame.to_cells([[each.lat, each.lon]])[0].tolist()
            self._all.append(((row, col), each))

    def at(self, cell: Cell) -> list[Sighting]:
        """The detections in the square of cells around `cell`, the oldest first."""
        return [each for where, each in self._all if _beside(where, cell)]

    def near(self, cell: Cell) -> bool:
        """Whether there ever was a hit at `cell` or beside it."""
        return any(near in self._hit for near in _square(cell))

    def forget(self, cell: Cell) -> None:
        """An operator has looked at these: what was seen at `cell` and beside it is not the target."""
        self._hit.difference_update(_square(cell))
        kept = [(where, each) for where, each in self._all if not _beside(where, cell)]
        self._all = deque(kept, maxlen=MOST_SIGHTINGS)

    def suspects(self, probability: NDArray[np.float64]) -> list[Suspect]:
        """The places with a hit that are not improbable, the most probable first, for people."""
        found: list[Suspect] = []
        for place in likely_places(probability, self._hit):
            near = self.at(place.cell)
            here = found_at(self._frame, place, near)
            found.append(
                {
                    "lat": here.lat,
                    "lon": here.lon,
                    "probability": here.probability,
                    "thumbnail": here.thumbnail,
                    "hits": len(near),
                    "score": max((each.score for each in near if each.score is not None), default=None),
                }
            )
        return sorted(found, key=lambda each: -each["probability"])


def _square(cell: Cell) -> list[Cell]:
    return [(cell[0] + r, cell[1] + c) for r in (-1, 0, 1) for c in (-1, 0, 1)]


def _beside(one: Cell, other: Cell) -> bool:
    return max(abs(one[0] - other[0]), abs(one[1] - other[1])) <= 1

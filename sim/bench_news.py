"""What a clue costs after a long search: all that was seen is believed anew, on a copy and beside the flight.

As a ratio to what came before it in the same run: 1 is the time that all the observations took when they came one by
one. An exclusion says nothing of the target, so that nothing is believed anew for it.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence

import numpy as np

from service.area import Grid, build_grid, parse_area
from service.evidence.observe import Observation
from service.known import Known
from service.news.request import NewsRequest
from sim.soak import ground

OBSERVATIONS = 10_000
"""About what a detector of two frames a second reports in an hour and a half."""


def line(count: int = OBSERVATIONS) -> str:
    """A sentence with both ratios, for so many observations."""
    grid = build_grid(parse_area(json.dumps(ground.area()).encode(), source="field"), 10.0)
    cells, known = np.argwhere(grid.searchable), Known(grid, 0.9, 0.99)
    sure, never, first = np.array([0.9]), np.array([False]), np.array([True])
    looks = [
        Observation(cells[number % len(cells)].reshape(1, 2), never, sure, sure, first)
        for number in range(count)
    ]
    began = time.thread_time()
    for each in looks:
        known.take(each)
    one_by_one = time.thread_time() - began
    place = grid.frame.to_latlon(cells[:1])[0].tolist()
    clue, exclusion = (_seconds(known, grid, place, role) for role in ("clue", "exclude"))
    return (
        f"news after {count} observations: believing them anew for a clue takes x {clue / one_by_one:.2f} of what they "
        f"took as they came, an exclusion x {exclusion / one_by_one:.3f}"
    )


def _seconds(known: Known, grid: Grid, place: Sequence[float], role: str) -> float:
    """Processor seconds of a piece of news at a place (lat, lon)."""
    lat, lon = place
    east, north = lon + 2e-4, lat + 2e-4
    ring = [[lon, lat], [east, lat], [east, north], [lon, north], [lon, lat]]
    said = {"role": role, **({"bayes_factor": 5.0} if role == "clue" else {})}
    feature = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [ring]}, "properties": said}
    news = NewsRequest.model_validate(feature).news(grid, role)
    began = time.thread_time()
    known.copy().take(news)
    return time.thread_time() - began

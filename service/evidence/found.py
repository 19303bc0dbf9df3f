"""A place that looks promising, and the one that counts as found, as values: what `suspects` works out.

They cross into the door process and into rows of the journal, so nothing is imported here that computes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from typing_extensions import TypedDict  # what pydantic can read on Python 3.11

IN_95_PERCENT = math.sqrt(-2.0 * math.log(0.05))
"""Semi-axes in standard deviations of a Gaussian in the plane."""


class Suspect(TypedDict):
    """A place where something was seen that is not improbable: in degrees, with the probability that the target is
    there, a picture, if there is one, how many detections, and the best score of them, 0 to 1."""

    lat: float
    lon: float
    probability: float
    thumbnail: str | None
    hits: int
    score: float | None


@dataclass(frozen=True)
class Found:
    """The target's place: position in degrees, probability of the neighbourhood, the largest standard deviation in
    metres, the ellipse that holds it with 95 % (semi-axes in metres, the long one's bearing from true north), and a
    picture."""

    lat: float
    lon: float
    probability: float
    sigma_m: float
    ellipse: dict[str, float]
    thumbnail: str | None = None

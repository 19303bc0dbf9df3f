"""What an area file says, as plain values: the search polygon, priors, exclusions, launch.

Geometries are shapely ones in WGS84 with x = longitude and y = latitude, in degrees, as in
the file. Positions that we hand around ourselves are (latitude, longitude).
"""

from dataclasses import dataclass

import shapely

from service.geometry import LatLon


@dataclass(frozen=True)
class PolygonPrior:
    """The target is equally likely anywhere in this polygon."""

    polygon: shapely.MultiPolygon
    weight: float
    label: str


@dataclass(frozen=True)
class PointPrior:
    """The target is near this point: an isotropic Gaussian of `sigma_m` metres."""

    position: LatLon
    sigma_m: float
    weight: float
    label: str


@dataclass(frozen=True)
class LinePrior:
    """The target is near a line, such as a trail: equally likely anywhere in a strip `width_m` metres wide along it."""

    line: shapely.MultiLineString
    width_m: float
    weight: float
    label: str


@dataclass(frozen=True)
class RingPrior:
    """The target went some distance from the initial planning point: rings that hold 25, 25, 25, 20 and 5 %.

    `rings_m` are the quantiles 25, 50, 75 and 95 % of that distance in metres; `about` says whose they are. Within a
    ring every place is equally likely, and the last 5 % lie between the 95 % distance and twice that.
    """

    position: LatLon
    rings_m: tuple[float, float, float, float]
    about: str
    weight: float
    label: str


Prior = PolygonPrior | PointPrior | LinePrior | RingPrior


def prior_shape(prior: Prior) -> shapely.Geometry:
    """Where a prior is, in degrees, x = longitude."""
    if isinstance(prior, PolygonPrior):
        return prior.polygon
    if isinstance(prior, LinePrior):
        return prior.line
    return shapely.Point(prior.position[1], prior.position[0])


RING_MASS = (0.25, 0.25, 0.25, 0.20, 0.05)
"""Of the rings up to the quantiles 25, 50, 75 and 95 %, and of what lies beyond."""
BEYOND = 2.0
"""The last ring ends at so many times the 95 % distance: ours, since the published quantiles say nothing of it."""


def ring_edges(prior: RingPrior) -> tuple[float, ...]:
    """The outer radius of each ring in metres, [5]."""
    return (*prior.rings_m, BEYOND * prior.rings_m[-1])


@dataclass(frozen=True)
class Exclusion:
    """Ground that is never flown over; with `searchable` the target may still be there."""

    polygon: shapely.MultiPolygon
    searchable: bool
    label: str


COVER_KINDS = {
    "open": 1.0,
    "scrub": 0.6,
    "woodland": 0.3,
    "dense woodland": 0.05,
    "buildings": 0.05,
    "water": 0.7,
}
"""How much of what is found in the open a look from above finds there: round guesses of ours, to be replaced by what a
detector was measured to find under such cover (`p_tp`)."""


@dataclass(frozen=True)
class Cover:
    """Ground on which a target is hidden from above: `p_tp` of a look there, or else what its kind says."""

    polygon: shapely.MultiPolygon
    kind: str
    p_tp: float | None
    label: str

    def visibility(self, p_tp: float) -> float:
        """What a look finds there, as a share of the `p_tp` that it has in the open, 0 to 1."""
        return COVER_KINDS[self.kind] if self.p_tp is None else min(1.0, self.p_tp / p_tp)


@dataclass(frozen=True)
class TargetMotion:
    """How the target moves, if it does: it walks at random (`roisearch.Walk`).

    `speed_mps` metres a second; `stops_per_hour` how often in an hour it stops for good; `straight_s` mean seconds
    between its changes of direction.
    """

    speed_mps: float
    stops_per_hour: float = 0.0
    straight_s: float = 60.0


@dataclass(frozen=True)
class SearchArea:
    """A checked area file.

    `polygon` is where the target is looked for, as drawn; `ground` is the same without the
    exclusions that are not searchable. `outside` is the probability that the target is not
    in the area at all. `transit` is ground that is not searched and may be crossed between parts
    of the area, as drawn; without it that is their convex hull. `source` and each `label` name
    the file and the feature for messages; `notes` says what of the file was left out, and what
    was taken for what. `target` says how it moves, None: it stands still.
    """

    source: str
    name: str
    description: str
    polygon: shapely.MultiPolygon
    ground: shapely.MultiPolygon
    priors: tuple[Prior, ...]
    exclusions: tuple[Exclusion, ...]
    launch: LatLon | None
    outside: float
    notes: tuple[str, ...] = ()
    transit: shapely.MultiPolygon | None = None
    covers: tuple[Cover, ...] = ()
    target: TargetMotion | None = None

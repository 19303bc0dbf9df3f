"""What an area file says, as plain values: the search polygon, priors, exclusions, launch.

Geometries are shapely ones in WGS84 with x = longitude and y = latitude, in degrees, as in
the file. Positions that we hand around ourselves are (latitude, longitude).
"""

from dataclasses import dataclass

import shapely

LatLon = tuple[float, float]
"""(latitude, longitude) in degrees, WGS84."""


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


Prior = PolygonPrior | PointPrior


@dataclass(frozen=True)
class Exclusion:
    """Ground that is never flown over; with `searchable` the target may still be there."""

    polygon: shapely.MultiPolygon
    searchable: bool
    label: str


@dataclass(frozen=True)
class SearchArea:
    """A checked area file.

    `polygon` is where the target is looked for, as drawn; `ground` is the same without the
    exclusions that are not searchable. `outside` is the probability that the target is not
    in the area at all. `source` and each `label` name the file and the feature for messages.
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

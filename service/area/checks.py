"""What an area must be before it is searched: near enough, small enough, its parts where they mean something."""

import numpy as np
import shapely

from service.area.describing import few
from service.area.geojson import Where, as_multipolygon
from service.area.model import LinePrior, PolygonPrior, Prior, RingPrior, SearchArea, ring_edges
from service.area.prior import rings_inside
from service.area.projection import REACH_M, Projection, surface_m2
from service.geometry import LatLon

MAX_LAUNCH_M = 2000.0
MAX_LATITUDE = 85.0
FAR_SIGMAS = 4.0
"""A point prior further than this from the area says nothing about where in the area the target is."""


def check_extent(polygon: shapely.MultiPolygon, where: Where, max_area_km2: float) -> None:
    """Refuse an area that is too large, too long, too near a pole or on both sides of the antimeridian.

    Raises:
        BadInput: it is.
    """
    west, south, east, north = polygon.bounds
    if east - west > 180:
        raise where.bad("the area lies on both sides of the antimeridian; search one side of it at a time")
    if max(-south, north) > MAX_LATITUDE:
        raise where.bad(
            f"the area reaches latitude {north if north > -south else south:g}; "
            f"stay within {MAX_LATITUDE:g} degrees, as compasses fail near the poles"
        )
    km2 = surface_m2(polygon) / 1e6
    if km2 > max_area_km2:
        raise where.bad(
            f"the area covers {km2:.4g} km², over the limit of {max_area_km2:g} km²; "
            "draw a smaller area or raise the limit"
        )
    corners = Projection.around(polygon).flatten(shapely.convex_hull(polygon))
    reach = float(np.hypot(*shapely.get_coordinates(corners).T).max())
    if reach > REACH_M:
        raise where.bad(
            f"the area reaches {reach / 1000:.1f} km from its centre, more than {REACH_M / 1000:g} km; "
            "divide it into several searches"
        )


def check_launch(area: SearchArea, where: Where, max_launch_m: float = MAX_LAUNCH_M) -> None:
    """Refuse a launch point that is further than `max_launch_m` metres from the search area.

    Raises:
        BadInput: it is; `where` names it in the message.
    """
    if area.launch is None:
        return
    away = distance_m(area.polygon, area.launch)
    if away > max_launch_m:
        fix = _swapped(area.polygon, area.launch, max_launch_m) or "move it to the edge of the area"
        raise where.bad(
            f"the launch point is {away / 1000:.4g} km from the area, "
            f"more than {max_launch_m / 1000:g} km; {fix}"
        )


def _swapped(polygon: shapely.MultiPolygon, point: LatLon, within_m: float) -> str:
    """The fix where a point would be near enough with its longitude and latitude swapped, or nothing."""
    lat, lon = point
    swapped = abs(lon) <= 90 and distance_m(polygon, (lon, lat)) <= within_m
    return "longitude and latitude are swapped, either here or in the area" if swapped else ""


def check_prior(area: SearchArea, prior: Prior) -> None:
    """Refuse a prior that says nothing about where in the area the target is.

    Raises:
        BadInput: it lies outside.
    """
    where = Where(area.source, prior.label)
    outside = "the prior lies entirely outside the area that is searched"
    if isinstance(prior, PolygonPrior):
        if as_multipolygon(shapely.intersection(prior.polygon, area.ground)).is_empty:
            raise where.bad(f"{outside}; move it or remove it")
    elif isinstance(prior, LinePrior):
        plane = Projection.around(area.ground)
        away = shapely.distance(plane.flatten(area.ground), plane.flatten(prior.line))
        if away >= prior.width_m / 2:
            raise where.bad(f"{outside}; move it, widen it or remove it")
    else:
        rings = isinstance(prior, RingPrior)
        reach_m = ring_edges(prior)[-1] if isinstance(prior, RingPrior) else FAR_SIGMAS * prior.sigma_m
        if distance_m(area.ground, prior.position) > reach_m:
            how = "further than its last ring" if rings else f"over {FAR_SIGMAS:g} sigma_m from it"
            fix = _swapped(area.ground, prior.position, reach_m)
            raise where.bad(f"{outside} ({how}); {fix or 'move it, widen it or remove it'}")


def ring_notes(area: SearchArea) -> list[str]:
    """How much of the distances of an initial planning point the area covers: what lies beyond is `outside`."""
    notes = []
    for prior in area.priors:
        if isinstance(prior, RingPrior):
            plane = Projection.around(area.ground)
            inside = rings_inside(prior, plane.forward(prior.position)[0], plane.flatten(area.ground))
            notes.append(
                f"{prior.label}: by the distances of {prior.about}, {few(100.0 * inside)} % lie in the area; "
                f"'outside' is {area.outside:g}, and by them alone would be {1.0 - inside:.3f}"
            )
    return notes


def distance_m(polygon: shapely.MultiPolygon, point: LatLon) -> float:
    """Metres from a point to the nearest ground of a polygon, 0 inside."""
    plane = Projection.around(polygon)
    return float(shapely.distance(plane.flatten(polygon), shapely.Point(plane.forward(point)[0])))

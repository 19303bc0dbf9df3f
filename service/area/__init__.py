"""From an area file to a grid of cells: reading and checking, prior, geodesy, ways around exclusions."""

from service.area.faults import BadArea
from service.area.frame import GridFrame
from service.area.geotiff import read_geotiff_prior
from service.area.grid import Grid, build_grid, leads_out, leg_is_clear, nearest_flyable, way_home
from service.area.model import Exclusion, LinePrior, PointPrior, PolygonPrior, RingPrior, SearchArea
from service.area.reading import area_of, parse_area, read_area
from service.geometry import LatLon

__all__ = [
    "BadArea",
    "Exclusion",
    "Grid",
    "GridFrame",
    "LatLon",
    "LinePrior",
    "PointPrior",
    "PolygonPrior",
    "RingPrior",
    "SearchArea",
    "area_of",
    "build_grid",
    "leads_out",
    "leg_is_clear",
    "nearest_flyable",
    "parse_area",
    "read_area",
    "read_geotiff_prior",
    "way_home",
]

"""From an area file to a grid of cells: reading and checking, prior, geodesy, ways around exclusions."""

from service.area.frame import GridFrame
from service.area.geotiff import read_geotiff_prior
from service.area.grid import Grid, build_grid, leads_out, leg_is_clear, nearest_flyable, way_home
from service.area.model import Exclusion, LatLon, PointPrior, PolygonPrior, SearchArea
from service.area.reading import parse_area, read_area

__all__ = [
    "Exclusion",
    "Grid",
    "GridFrame",
    "LatLon",
    "PointPrior",
    "PolygonPrior",
    "SearchArea",
    "build_grid",
    "leads_out",
    "leg_is_clear",
    "nearest_flyable",
    "parse_area",
    "read_area",
    "read_geotiff_prior",
    "way_home",
]

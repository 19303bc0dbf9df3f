"""From the files of a search to its area and grid: what a run, its export and its preview have in common."""

from __future__ import annotations

from pathlib import Path

from service.area import Grid, SearchArea, build_grid, read_area, read_geotiff_prior
from service.config import Settings
from service.evidence.sensors import cell_size

AREA, PRIOR, JOURNAL = "area.geojson", "prior.tif", "journal.sqlite"
"""The files in a run's folder that the search is made of."""


def survey(area_file: Path, prior_file: Path | None, settings: Settings) -> tuple[SearchArea, Grid]:
    """The area and its grid. Raises BadInput."""
    area = read_area(area_file, max_area_km2=settings.search.max_area_km2)
    grid = build_grid(area, cell_size(settings))
    if prior_file is not None:
        grid = grid.with_prior(read_geotiff_prior(prior_file, grid.frame, grid.covered))
    return area, grid

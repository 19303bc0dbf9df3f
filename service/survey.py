"""From the files of a search to its area and grid: what a run, its export and its preview have in common."""

from __future__ import annotations

from pathlib import Path

from service.area import Grid, SearchArea, area_of, build_grid, read_geotiff_prior
from service.area.document import Document, as_geojson
from service.area.formats import read_document
from service.area.geojson import Where, read_bytes
from service.config import Settings

AREA, PRIOR, JOURNAL = "area.geojson", "prior.tif", "journal.sqlite"
"""The files in a run's folder that the search is made of."""
GIVEN = "area-as-given"
"""Beside the area, the file that it was translated from, with its own suffix."""


def survey(area_file: Path, prior_file: Path | None, settings: Settings) -> tuple[SearchArea, Grid]:
    """The area and its grid. Raises BadInput."""
    # these load what is compiled, which a file alone can do without
    from service.evidence.sensors import cell_for_all
    from service.ground.cover import visibility_of
    from service.ground.flyable import over_ground
    from service.ground.mobility import walked

    area, _ = read_survey(area_file, settings)
    grid = build_grid(area, cell_for_all(settings), coordinates=settings.run.coordinates)
    grid = walked(area, grid, settings)
    if prior_file is not None:
        grid = grid.with_prior(read_geotiff_prior(prior_file, grid.frame, grid.covered))
    if (visibility := visibility_of(area, grid, settings)) is not None:
        grid = grid.under(visibility)
    return area, over_ground(grid, settings) if settings.ground_files else grid


def read_survey(area_file: Path, settings: Settings) -> tuple[SearchArea, Document]:
    """The checked area of a file of any kind that is read, and what it says. Raises BadInput."""
    document = read_document(read_bytes(area_file), Where(str(area_file)))
    area = area_of(document, source=str(area_file), max_area_km2=settings.search.max_area_km2)
    return area, document


def keep_area(area_file: Path, folder: Path, settings: Settings) -> None:
    """Keep an area file in a run's folder as GeoJSON, beside the file as it was given where that is something else.

    Raises BadInput.
    """
    area, document = read_survey(area_file, settings)
    data = read_bytes(area_file)
    if document.plain:
        (folder / AREA).write_bytes(data)
    else:
        (folder / AREA).write_text(as_geojson(document, area.name), encoding="utf-8")
        (folder / GIVEN).with_suffix(area_file.suffix).write_bytes(data)


def is_of(folder: Path, area_file: Path) -> bool:
    """Whether the run in a folder was begun with just this area file."""
    kept = [folder / AREA, *folder.glob(f"{GIVEN}.*")]
    return any(each.is_file() and each.read_bytes() == area_file.read_bytes() for each in kept)

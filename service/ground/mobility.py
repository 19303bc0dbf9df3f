"""How well the ground is walked: a raster of factors that rings of lost persons, and a target that walks, keep to."""

from __future__ import annotations

from service.area import Grid, RingPrior, SearchArea
from service.config import Settings
from service.ground.factors import read_factors


def walked(area: SearchArea, grid: Grid, settings: Settings) -> Grid:
    """The grid with the mobility of its ground, if a raster of that is given. Raises BadInput."""
    file = settings.ground.mobility_file
    if not file:
        return grid
    mobility = read_factors(
        file,
        grid.frame,
        of="mobility",
        meaning="how well the ground is walked, from 0 (not at all) to 1 (as a path)",
    )
    grid = grid.walked_at(area, mobility)
    if area.target is None and not any(isinstance(prior, RingPrior) for prior in area.priors):
        note = f"{file} changes nothing: the area has no ipp, and its target does not walk."
        return grid.noting(note)
    return grid

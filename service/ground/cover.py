"""What hides a target from above: areas of cover and a raster of factors, as one factor for each cell."""

from __future__ import annotations

import numpy as np

from service.area import Grid, SearchArea
from service.area.prior import cell_squares, covered_fraction
from service.area.projection import FloatArray
from service.config import Settings
from service.ground.factors import read_factors


def visibility_of(area: SearchArea, grid: Grid, settings: Settings) -> FloatArray | None:
    """How much of what a look finds in the open it finds in each cell, float [rows, cols]; None: nothing hides.

    Where covers overlap the one drawn last counts; a cell is worth its parts. The raster's factor comes on top.
    Raises BadInput.
    """
    if not area.covers and not settings.ground.cover_file:
        return None
    visibility: FloatArray = np.ones(grid.frame.shape)
    squares = cell_squares(grid.frame) if area.covers else None
    for cover in area.covers:
        part = covered_fraction(squares, grid.frame.flatten(cover.polygon))
        visibility += part * (cover.visibility(settings.sensor.p_tp) - visibility)
    if settings.ground.cover_file:
        visibility *= read_factors(
            settings.ground.cover_file,
            grid.frame,
            of="cover",
            meaning="what a look finds there, from 0 to 1 of the open",
        )
    return visibility

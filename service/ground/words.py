"""What a person is told of the ground before a flight."""

from __future__ import annotations

import numpy as np

from service.area import Grid
from service.config import Settings

FLAT = "constant height above the launch point; the ground is taken as flat"


def of_the_ground(grid: Grid, settings: Settings) -> str:
    """The ground in one sentence: how far it goes up and down, and how it is flown over."""
    relief, flight = grid.relief, settings.flight
    if relief is None:
        return FLAT
    rows, cols = np.indices(grid.frame.shape)
    inside = grid.covered > 0.0
    cells = np.stack([cols[inside], rows[inside]], axis=1).astype(np.float64)
    middles = (cells + 0.5) * grid.frame.cell_m
    heights = relief.height_at(middles)
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    return (
        f"from {low:+.0f} to {high:+.0f} m of the launch point, as {', '.join(settings.ground_files)} says; flown "
        f"{flight.altitude_m:g} m above it, {flight.clearance_m:g} m clear of all that is within "
        f"{settings.ground.position_error_m:g} m of a leg"
    )

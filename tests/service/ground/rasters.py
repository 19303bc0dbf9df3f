"""Height models for tests: any function of the place, written as a raster of any kind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from numpy.typing import NDArray

from service.area import GridFrame

Floats = NDArray[np.float64]
Height = Callable[[Floats, Floats], Floats]
"""From metres east and south of the grid's corner to a height."""


def write(
    path: Path,
    frame: GridFrame,
    height: Height,
    *,
    crs: str = "EPSG:4326",
    pitch: float = 20.0,
    reach_m: float = 700.0,
    turn_deg: float = 0.0,
    south_up: bool = False,
    spoil: Callable[[NDArray[Any]], None] = lambda values: None,
    dtype: str = "float32",
    scale: float | None = None,
    offset: float | None = None,
    unit: str = "",
    **profile: Any,
) -> Path:
    """Write a raster of about `pitch` metres that covers the frame and `reach_m` around; returns its path."""
    import rasterio
    from affine import Affine

    forth = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    width, depth = frame.cols * frame.cell_m, frame.rows * frame.cell_m
    middle = frame.from_metres([[width / 2, depth / 2]])[0]
    x, y = forth.transform(middle[1], middle[0])
    side = max(width, depth) + 2 * reach_m
    count = int(np.ceil(side / pitch))
    geographic = pyproj.CRS(crs).is_geographic
    step_x = pitch / (111_195.0 * np.cos(np.radians(middle[0]))) if geographic else pitch
    step_y = pitch / 111_195.0 if geographic else pitch
    if pyproj.CRS(crs).to_epsg() == 3857:
        step_x = step_y = pitch / np.cos(np.radians(middle[0]))
    up = 1.0 if south_up else -1.0
    there = (
        Affine.translation(x, y)
        @ Affine.rotation(turn_deg)
        @ Affine.scale(step_x, up * step_y)
        @ Affine.translation(-count / 2, -count / 2)
    )
    cols, rows = np.meshgrid(np.arange(count) + 0.5, np.arange(count) + 0.5)
    px, py = there @ (cols.ravel(), rows.ravel())
    lon, lat = forth.transform(px, py, direction="INVERSE")
    plane = frame.to_metres(np.stack([lat, lon], axis=1))
    values = height(plane[:, 0], plane[:, 1]).reshape(count, count)
    if offset is not None:
        values = values - offset
    if scale is not None:
        values = values / scale
    values = values.astype(dtype)
    spoil(values)
    with rasterio.open(
        path, "w", driver="GTiff", width=count, height=count, count=1, dtype=dtype, crs=crs, transform=there, **profile
    ) as raster:  # fmt: skip
        raster.write(values, 1)
        if scale is not None:
            raster.scales = (scale,)
        if offset is not None:
            raster.offsets = (offset,)
        if unit:
            raster.units = (unit,)
    return path

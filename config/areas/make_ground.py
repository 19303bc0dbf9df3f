"""Makes `mountain-valley.tif`, the ground under `mountain-valley.geojson`: synthetic, and no survey of the real valley.

    python config/areas/make_ground.py

A valley floor that rises gently to the east along the middle of the search area, between walls of about one in one that
end 350 m above it.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import rasterio
import shapely
from rasterio.transform import from_origin

HERE = Path(__file__).parent
FLOOR_M, RISE, WALL_M, STEEP = 950.0, 0.04, 350.0, 0.9
PITCH_M, AROUND_M, METRES_PER_DEGREE = 20.0, 900.0, 111_194.93


def main() -> None:
    """Write the GeoTIFF beside the area."""
    document = json.loads((HERE / "mountain-valley.geojson").read_text(encoding="utf-8"))
    search = next(f for f in document["features"] if f["properties"].get("role") == "search")
    narrow = METRES_PER_DEGREE * math.cos(math.radians(47.39))
    west, south = np.array(search["geometry"]["coordinates"][0]).min(axis=0)
    shape = shapely.transform(
        shapely.geometry.shape(search["geometry"]),
        lambda points: (points - [west, south]) * [narrow, METRES_PER_DEGREE],
    )
    left, bottom, right, top = shape.bounds
    east = np.arange(left - AROUND_M, right + AROUND_M, PITCH_M)
    north = np.arange(top + AROUND_M, bottom - AROUND_M, -PITCH_M)
    x, y = np.meshgrid(east, north)
    away = shapely.distance(shape.buffer(25.0), shapely.points(x, y))
    heights = (
        FLOOR_M + RISE * x + np.minimum(WALL_M, STEEP * away) + 1.5 * np.sin(x / 40.0) * np.cos(y / 55.0)
    )
    side_x, side_y = PITCH_M / narrow, PITCH_M / METRES_PER_DEGREE
    corner = west + (east[0] - PITCH_M / 2) / narrow, south + (north[0] + PITCH_M / 2) / METRES_PER_DEGREE
    with rasterio.open(
        HERE / "mountain-valley.tif", "w", driver="GTiff", width=len(east), height=len(north), count=1,
        dtype="int16", crs="EPSG:4326", transform=from_origin(*corner, side_x, side_y), compress="deflate",
        predictor=2,
    ) as raster:  # fmt: skip
        raster.write(np.rint(heights).astype("int16"), 1)
        raster.units = ("metre",)


if __name__ == "__main__":
    main()

"""What does not change during a run, as the page needs it once: the ground, the grid, the regions."""

from __future__ import annotations

from typing import Any

from service.area import SearchArea
from service.search import Search
from service.view.shapes import area_features, collection


def describe(area: SearchArea, search: Search, outlines: list[dict[str, Any]]) -> dict[str, Any]:
    """Area, grid and regions; `outlines` as `region_features` gives them."""
    frame = search.grid.frame
    return {
        "area": area.name,
        "about": area.description,
        "planner": search.settings.search.planner,
        "frame": {
            "rows": frame.rows,
            "cols": frame.cols,
            "cell_m": frame.cell_m,
            "bearing_deg": frame.bearing_deg,
            "corners": frame.corners().tolist(),
        },
        "features": collection(area_features(area, search.grid)),
        "regions": collection(outlines),
        "outside": search.grid.outside,
        "notes": list(search.grid.notes),
    }

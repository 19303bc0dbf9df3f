"""The formats by name. A format is one module with one function, imported when it is asked for."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from service.export.model import ExportedRun
    from service.export.wishes import Wishes


@dataclass(frozen=True)
class Format:
    """A format: its module in this room, the end of its files' names, and what is in it, for a person."""

    module: str
    suffix: str
    about: str

    def write(self, run: ExportedRun, wishes: Wishes) -> bytes:
        """The content of a file of this format. Raises BadInput when the run has nothing to put into it."""
        data: bytes = importlib.import_module(f"service.export.{self.module}").write(run, wishes)
        return data


FORMATS = {
    "geojson": Format("geojson", ".geojson", "everything with a place: track, hits, find, gaps, area"),
    "kml": Format("kml", ".kml", "the same for Google Earth, CalTopo and other maps"),
    "gpx": Format("gpx", ".gpx", "track and marks for handheld GPS receivers"),
    "geotiff": Format("geotiff", ".tif", "rasters: probability of area now, of detection, and the prior"),
    "plan": Format("plan", ".plan", "a QGroundControl mission over what is left to search"),
    "csv": Format("table", ".csv", "a table of what happened when and where"),
    "html": Format("page", ".html", "one page with pictures for the team; opens with no network"),
}

"""What hardly changes during a run: the ground, the grid, and the regions as they are drawn now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from service.area import Grid, SearchArea
from service.drawing import Drawing
from service.geometry import LatLon
from service.places import Coordinates, written
from service.view.names import place_names, region_names
from service.view.shapes import area_features, collection, region_features

if TYPE_CHECKING:
    from roisearch import Regions


@dataclass(frozen=True, eq=False)
class SearchGround:
    """Where a search takes place. It can be handed to another process: it knows neither belief nor planner.

    Attributes:
        labels: the regions of interest, int [rows, cols], 0 for none.
        outlines: the same as GeoJSON features.
        planner: the planner's name.
        names: what people call the regions, region 1 first.
        coordinates: how the team writes places.
        drawn: the number of the drawing that the regions are of; see `service.drawing`.
    """

    area: SearchArea
    grid: Grid
    labels: NDArray[np.integer[Any]]
    outlines: list[dict[str, Any]]
    planner: str
    names: tuple[str, ...] = ()
    coordinates: Coordinates = "degrees"
    drawn: int = 0

    @classmethod
    def of(
        cls,
        area: SearchArea,
        grid: Grid,
        labels: NDArray[np.integer[Any]],
        planner: str,
        coordinates: Coordinates = "degrees",
    ) -> SearchGround:
        """The ground with its regions outlined."""
        outlines = region_features(grid, labels)
        names = tuple(region_names(area, grid.frame, outlines))
        return cls(area, grid, labels, outlines, planner, names, coordinates)

    def redrawn(self, drawing: Drawing) -> SearchGround:
        """The same ground with the regions of another drawing, outlined, which takes long on a large map."""
        outlines = region_features(self.grid, drawing.labels)
        return replace(
            self, labels=drawing.labels, outlines=outlines, names=drawing.names, drawn=drawing.number
        )

    def named(self, regions: Regions, known: Sequence[str]) -> tuple[str, ...]:
        """What people call the regions, region 1 first: as they are `known`, and new ones by where they lie.

        No two are alike, those that are no more included.
        """
        fresh = region_names(self.area, self.grid.frame, region_features(self.grid, regions.labels))
        names = list(known)
        for number in range(len(names) + 1, regions.count + 1):
            name = fresh[number - 1] if number <= len(fresh) else "open ground"
            names.append(f"{name} ({number})" if name in names else name)
        return tuple(names)

    def described_regions(self) -> dict[str, Any]:
        """What the page needs again whenever the regions are drawn again."""
        return {"regions": collection(self.outlines), "names": list(self.names), "drawn": self.drawn}

    def written(self, place: LatLon) -> str:
        """A place (latitude, longitude) as the team writes places."""
        return written(place, self.coordinates)

    def describe(self) -> dict[str, Any]:
        """What the page needs once."""
        frame = self.grid.frame
        return {
            "area": self.area.name,
            "about": self.area.description,
            "planner": self.planner,
            "frame": {
                "rows": frame.rows,
                "cols": frame.cols,
                "cell_m": frame.cell_m,
                "bearing_deg": frame.bearing_deg,
                "corners": frame.corners().tolist(),
            },
            "features": collection(area_features(self.area, self.grid)),
            **self.described_regions(),
            "coordinates": self.coordinates,
            "places": place_names(self.area),
            "priors": list(self.grid.prior_places),
            "outside": self.grid.outside,
            "notes": list(self.grid.notes),
        }

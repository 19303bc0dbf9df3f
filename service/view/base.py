"""What can be seen of any search, live or replayed: its map, its regions, its pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.area import SearchArea
from service.config import Settings
from service.evidence.observe import Pose
from service.evidence.sensors import Profile
from service.mission.flight import LatLon
from service.search import Search
from service.view.scene import describe
from service.view.shapes import (
    area_features,
    cell_features,
    collection,
    feature,
    line,
    point,
    region_features,
)


class BaseView:
    """A search to look at; who derives from it says where the aircraft is and what state the search is in."""

    def __init__(self, area: SearchArea, search: Search, sensor: Profile, settings: Settings) -> None:
        self.area, self.search, self.sensor, self.settings = area, search, sensor, settings
        self._outlines = region_features(search.grid, search.regions.labels)

    # ---- what a run has to tell

    def state(self) -> dict[str, Any]:
        """Where the search stands."""
        raise NotImplementedError

    def track(self) -> Sequence[LatLon]:
        """Where the aircraft was, one position a second."""
        raise NotImplementedError

    def hits(self) -> Sequence[LatLon]:
        """Where the detector reported the target."""
        raise NotImplementedError

    # ---- what follows from that

    def place(self) -> dict[str, float]:
        """The most likely place."""
        place = self.search.place
        lat, lon = self.search.grid.frame.to_latlon(np.array([place.centroid]))[0]
        return {"lat": float(lat), "lon": float(lon), "probability": place.probability}

    def footprint(self, pose: Pose | None) -> dict[str, Any]:
        """The cells that a frame taken now shows, with their corners (north-west first, clockwise), how much of each is
        covered, and what a look is worth there; p_tp and p_tn of the footprint are the settings'."""
        nominal = {"p_tp": self.settings.sensor.p_tp, "p_tn": self.settings.sensor.p_tn}
        if pose is None:
            return {"counts": False, "covered": 0.0, **nominal, "cells": []}
        footprint, frame = self.sensor.footprint(pose), self.search.grid.frame
        corners = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])
        cells = []
        worth = (footprint.counts, footprint.covered, footprint.p_tp, footprint.p_tn)
        columns = [column.tolist() for column in (footprint.cells, *worth)]
        for (row, col), counts, covered, p_tp, p_tn in zip(*columns, strict=True):
            points = frame.to_latlon(np.vstack([[[row, col]], np.array([row, col]) + corners])).tolist()
            centre, around = points[0], points[1:]
            where = {"row": row, "col": col, "lat": centre[0], "lon": centre[1], "corners": around}
            cells.append({**where, "counts": counts, "covered": covered, "p_tp": p_tp, "p_tn": p_tn})
        best = float(footprint.covered.max(initial=0.0))
        return {"counts": bool(footprint.counts.any()), "covered": best, **nominal, "cells": cells}

    def region_masses(self) -> list[float]:
        """The probability of each region of interest now, region 1 first."""
        regions = self.search.regions
        weights = self.search.belief.weights / self.search.belief.total
        sums = np.bincount(regions.labels.ravel(), weights, minlength=regions.count + 1)
        return [float(mass) for mass in sums[1:]]

    def map(self) -> dict[str, Any]:
        """The belief and the probability of detection, cell by cell (null where nothing is searched)."""
        grid = self.search.grid
        searchable = grid.searchable

        def cells(values: Any) -> list[list[float | None]]:
            return [
                [float(v) if s else None for v, s in zip(row, inside, strict=True)]
                for row, inside in zip(values, searchable, strict=True)
            ]

        return {
            "frame": grid.frame.to_dict(),
            "corners": grid.frame.corners().tolist(),
            "probability": cells(self.search.belief.probability()),
            "pod": cells(self.search.record.pod()),
            "regions": self.search.regions.labels.tolist(),
            "outside": self.search.belief.outside,
            "digest": self.search.belief.digest(),
            "reports": self.state()["reports"]["accepted"],
        }

    def geojson(self) -> dict[str, Any]:
        """The map for other programs: area, regions with their mass, cells, track, hits, the place found."""
        grid, state = self.search.grid, self.state()
        features = area_features(self.area, grid)
        for outline in self._outlines:
            number = outline["properties"]["number"]
            mass = state["regions"][number - 1]
            features.append(feature(outline["geometry"], "region", number=number, mass=mass))
        features += cell_features(grid, self.search.belief.probability(), self.search.record.pod())
        if len(self.track()) > 1:
            features.append(feature(line(self.track()), "track"))
        features += [feature(point(*hit), "hit") for hit in self.hits()]
        if found := state["found"]:
            place = point(found["lat"], found["lon"])
            features.append(feature(place, "found", probability=found["probability"]))
        return collection(features, pos=state["pos"], outside=state["outside"], time=state["time"])

    def picture(self) -> Callable[[], bytes]:
        """What draws the map as it is now, as a PNG; drawing takes long, and may be left to another thread."""
        state = self.state()
        pose, found = state["pose"], state["found"]
        said = f"POS {state['pos']:.0%}, {state['steps']} steps, {state['flight_time_s']:.0f} s in the air"
        if found:
            said += f" · found at {found['lat']:.6f}, {found['lon']:.6f}"
            said += f" with probability {found['probability']:.4f}"
        shown = {
            "grid": self.search.grid,
            "probability": self.search.belief.probability(),
            "pod": self.search.record.pod(),
            "labels": self.search.regions.labels,
            "track": self.track(),
            "ahead": state["ahead"],
            "hits": tuple(self.hits()),
            "aircraft": (pose["lat"], pose["lon"]) if pose else None,
            "found": (found["lat"], found["lon"]) if found else None,
            "title": f"{self.area.name}: {state['state']}",
            "subtitle": said,
        }

        def draw() -> bytes:
            from service.view.picture import Scene, draw_scene  # matplotlib: it takes long to import, too

            return draw_scene(Scene(**shown))

        return draw

    def scene(self) -> dict[str, Any]:
        """What does not change during a run, for the page."""
        return describe(self.area, self.search, self._outlines)

    def searchable(self) -> NDArray[np.bool_]:
        """The cells that are searched, [rows, cols]."""
        return self.search.grid.searchable

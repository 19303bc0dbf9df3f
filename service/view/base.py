"""What can be seen of any search, live or replayed: its map, its regions, its pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from roisearch import Regions
from service.area import SearchArea
from service.chances import share
from service.config import Settings, each_aircraft
from service.evidence.found import Found
from service.evidence.observe import FramePose, finite_or_level
from service.evidence.sensors import Profile
from service.geometry import LatLon
from service.mission.states import State
from service.news.bearing import FieldNews
from service.places import written
from service.reasons import Option
from service.rows import SortieRow
from service.search import Search
from service.view.feed import Moment
from service.view.maps import draw_map
from service.view.next import ChoiceState, NextState, choices, next_state
from service.view.scene import SearchGround
from service.view.state import (
    DrawnState,
    FootprintCell,
    FootprintState,
    FoundState,
    GeometryState,
    NewsState,
    PlaceState,
    RunState,
    SortieState,
    SuspectState,
    found_state,
    suspect_states,
)


class BaseView:
    """A search to look at; who derives from it says where the aircraft is and what state the search is in."""

    def __init__(
        self, area: SearchArea, search: Search, sensors: Mapping[str, Profile], settings: Settings
    ) -> None:
        """`sensors`: that of each aircraft by its name; "" that of the only one."""
        self.area, self.search, self.sensors, self.settings = area, search, sensors, settings
        self._chances = {
            name: (alone.sensor.p_tp, alone.sensor.p_tn) for name, alone in each_aircraft(settings).items()
        }
        how = settings.run.coordinates
        drawing = search.drawing
        self.ground = SearchGround.of(area, search.grid, drawing.labels, settings.search.planner, how)
        """The ground with the regions as they were drawn when this view was made."""
        self._ground = self.ground

    def ground_now(self) -> SearchGround:
        """The ground with the regions as they are drawn now; where they are other ones it outlines them, which takes
        long on a large map."""
        drawing = self.search.drawing
        if drawing.number != self._ground.drawn:
            self._ground = (
                self.ground if drawing.number == self.ground.drawn else self.ground.redrawn(drawing)
            )
        return self._ground

    def names(self) -> tuple[str, ...]:
        """What people call the regions that there are now, region 1 first."""
        return self.search.drawing.names or self.ground.names

    def named(self, regions: Regions) -> tuple[str, ...]:
        """What people are to call regions that come after those of now."""
        return self.ground.named(regions, self.names())

    def drawn(self) -> DrawnState:
        """How the regions stand."""
        drawing = self.search.drawing
        return {"number": drawing.number, "words": drawing.words or None}

    # ---- what a run has to tell

    def state(self) -> RunState:
        """Where the search stands."""
        raise NotImplementedError

    def tracks(self) -> Sequence[Sequence[LatLon]]:
        """Where each aircraft was, one position a second."""
        raise NotImplementedError

    def hits(self) -> Sequence[LatLon]:
        """Where the detector reported the target."""
        raise NotImplementedError

    # ---- what follows from that

    def place(self) -> PlaceState:
        """The most likely place."""
        place = self.search.place
        lat, lon = self.search.grid.frame.to_latlon(np.array([place.centroid]))[0]
        where = (float(lat), float(lon))
        how = self.settings.run.coordinates
        return {
            "lat": where[0],
            "lon": where[1],
            "probability": place.probability,
            "written": written(where, how),
        }

    def unseen(self) -> list[PlaceState]:
        """Cells that are taken as not to be seen from the air."""
        frame, how = self.search.grid.frame, self.settings.run.coordinates
        cells = np.argwhere(self.search.common.overlooked.cells)
        if not len(cells):
            return []
        shares = self.search.belief.mass_at(cells).tolist()
        places = [(float(lat), float(lon)) for lat, lon in frame.to_latlon(cells)]
        return [
            {"lat": lat, "lon": lon, "probability": share, "written": written((lat, lon), how)}
            for (lat, lon), share in zip(places, shares, strict=True)
        ]

    def found_state(self, found: Found | None) -> FoundState | None:
        """The place found as it is told."""
        how = self.settings.run.coordinates
        return found_state(found, how, confirmed=self.search.confirmed is not None)

    def suspects(self) -> list[SuspectState]:
        """What was seen and is not improbable."""
        suspects = self.search.sightings.suspects(self.search.belief.probability())
        return suspect_states(suspects, self.settings.run.coordinates)

    def footprint(self, pose: FramePose | None, aircraft: str) -> FootprintState:
        """The cells that a frame of an aircraft taken now shows, with their corners (north-west first, clockwise), how
        much of each is covered, and what a look is worth there; p_tp and p_tn of the footprint are the settings'."""
        whose = aircraft if aircraft in self.sensors else next(iter(self.sensors))
        p_tp, p_tn = self._chances[whose]
        shown: FootprintState = {
            "counts": False, "covered": 0.0, "p_tp": p_tp, "p_tn": p_tn, "cells": [],
        }  # fmt: skip
        if pose is None:
            return shown
        pose = replace(pose, heading_deg=finite_or_level(pose.heading_deg))  # drawn all the same
        footprint, frame = self.sensors[whose].footprint(pose), self.search.grid.frame
        corners = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])
        worth = (footprint.counts, footprint.covered, footprint.p_tp, footprint.p_tn)
        columns = [column.tolist() for column in (footprint.cells, *worth)]
        for (row, col), counts, covered, finds, clears in zip(*columns, strict=True):
            points = frame.to_latlon(np.vstack([[[row, col]], np.array([row, col]) + corners])).tolist()
            centre, around = points[0], points[1:]
            where: FootprintCell = {
                "row": row, "col": col, "lat": centre[0], "lon": centre[1], "corners": around,
                "counts": counts, "covered": covered, "p_tp": finds, "p_tn": clears,
            }  # fmt: skip
            shown["cells"].append(where)
        shown["counts"] = bool(footprint.counts.any())
        shown["covered"] = float(footprint.covered.max(initial=0.0))
        return shown

    def next(
        self, state: State, options: Sequence[Option], causes: Set[str] = frozenset(), *, down: bool = False
    ) -> NextState:
        """What happens next, in words: see `next_state`."""
        again = ""
        if state == State.CONFIRMING:  # the place as its card has it
            best = self.search.best()
            place = written((best.lat, best.lon), self.settings.run.coordinates)
            again = f"{place}, {share(best.probability)}"
        names, regions = self.names(), self.region_masses()
        return next_state(state, options, names, regions, again, causes=causes, down=down)

    def choices(self, options: Sequence[Option]) -> list[ChoiceState]:
        """What the last decision weighed, as places with their names."""
        return choices(options, self.names(), self.region_masses())

    def above_ground(self, pose: FramePose | None) -> float | None:
        """How high a pose is above the ground below it; above the launch point where the ground is taken as flat."""
        relief = self.search.grid.relief
        if pose is None or relief is None:
            return None if pose is None else pose.height_m
        below = float(relief.height_at(self.search.grid.frame.to_metres([(pose.lat, pose.lon)]))[0])
        return pose.height_m - below if math.isfinite(below) else None

    def region_masses(self) -> list[float]:
        """The probability of each region of interest now, region 1 first."""
        regions = self.search.regions
        weights = self.search.belief.weights / self.search.belief.total
        sums = np.bincount(regions.labels.ravel(), weights, minlength=regions.count + 1)
        return [float(mass) for mass in sums[1:]]

    def seen(self) -> Moment:
        """What there is to see as it stands; its arrays are the search's own, to be copied by who keeps them."""
        belief = self.search.belief
        return Moment(
            state=self.state(),
            weights=belief.weights,
            total=belief.total,
            pod=self.search.record.pod(),
            tracks=self.tracks(),
            hits=self.hits(),
            curve=(),
        )

    def picture(self) -> Callable[[], bytes]:
        """What draws the map as it is now, as a PNG; drawing takes long, and may be left to another thread."""
        return partial(draw_map, self.ground_now(), self.seen().copied())


def sortie_states(sorties: Sequence[SortieRow], aircraft: str) -> list[SortieState]:
    """The flights of an aircraft that are over, as they are told."""
    return [
        {
            "number": each.number,
            "aircraft": aircraft,
            "landed": each.landed,
            "flight_time_s": each.seconds,
            "steps": each.steps,
            "pos": each.pos,
            "why": each.why,
            "system_id": each.system_id,
            "autopilot": each.autopilot,
        }
        for each in sorties
    ]


def news_states(news: Sequence[FieldNews]) -> list[NewsState]:
    """The news that stand, as they are told."""
    return [
        {
            "id": each.id,
            "role": each.role,
            "words": each.words,
            "lat": each.place[0],
            "lon": each.place[1],
            "cells": len(each.cells),
            "geometry": cast(GeometryState | None, each.drawn),
        }
        for each in news
    ]

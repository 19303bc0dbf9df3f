"""The search as the mission sees it: one belief, one planner, and what has been looked at so far.

No search mathematics here: it holds the pieces of `roisearch` together, and keeps the belief out of the planner's
hands while it thinks in another thread.
"""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, Decision, Regions, SearchState, make_planner, segment_regions
from roisearch.detection import DetectionRecord
from roisearch.place import Place, most_likely_place, place_at
from service.area import Grid
from service.config import Settings
from service.evidence.observe import Observation
from service.evidence.sensors import field_of_view
from service.evidence.suspects import Found, Sightings
from service.view.reasons import Reason, explain

Cell = tuple[int, int]


class Search:
    """One target, one grid, one planner."""

    def __init__(self, grid: Grid, settings: Settings) -> None:
        self.grid = grid
        self.settings = settings
        self.belief = Belief(grid.prior, searchable=grid.searchable, outside=grid.outside)
        self.record = DetectionRecord(grid.prior, grid.outside)
        self.regions: Regions = segment_regions(self.belief.probability(), searchable=grid.searchable)
        self.fov = field_of_view(settings, grid.frame.cell_m)
        self.planner = make_planner(
            settings.search.planner, fov=self.fov, flyable=grid.flyable, regions=self.regions
        )
        # one thread: a dropped decision may still be thinking, and the planner is one object
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="planner")
        self._rng = np.random.default_rng(settings.run.seed)
        self._place: Place | None = None
        self.sightings = Sightings(grid.frame)
        self.confirmed: Cell | None = None
        """The place that an operator said is the target's."""

    def warm_up(self, progress: Callable[[str, int, int], None] | None = None) -> None:
        """Compile what the planner needs; `progress(name, done, total)` is told."""
        self.planner.warm_up(progress)

    def apply(self, observation: Observation) -> None:
        """Update the belief, exactly, and the record of looks."""
        self.belief.observe(observation.cells, observation.hits, observation.p_tp, observation.p_tn)
        self.record.look(observation.cells[observation.first], observation.p_tp[observation.first])
        self.sightings.add(observation.speaking, observation.sightings)
        self._place = None

    def go_back(self, belief: Belief, record: DetectionRecord, sightings: Sightings) -> None:
        """Take up an earlier state of these, which are ours from now on."""
        self.belief, self.record, self.sightings = belief, record, sightings
        self._place = self.confirmed = None

    def judge(self, cell: Cell, observation: Observation, *, confirmed: bool) -> None:
        """Take in what an operator says about the place around `cell`."""
        self.apply(observation)
        if confirmed:
            self.confirmed = cell
        else:
            self.sightings.forget(cell)
            self.confirmed = None

    def cell_at(self, place: tuple[float, float] | None) -> Cell:
        """The cell of a position (latitude, longitude), the nearest one when it is off the grid; without one, that
        of the present most likely place."""
        if place is None:
            return self.place.cell
        row, col = np.clip(self.grid.frame.to_cells([place])[0], 0, np.array(self.grid.frame.shape) - 1)
        return int(row), int(col)

    def found(self) -> Found | None:
        """Where the target is, when an operator has confirmed it or the posterior passes `search.found_at`."""
        place = self.place
        if self.confirmed is not None:
            place = place_at(self.belief.probability(), self.confirmed)
        elif place.probability < self.settings.search.found_at or not self.was_hit(place):
            return None
        return Found.at(self.grid.frame, place, self.sightings.at(place.cell))

    def was_hit(self, place: Place) -> bool:
        """True when a detection was ever reported at `place` or beside it: a sharp prior alone finds nobody."""
        return self.sightings.near(place.cell)

    @property
    def place(self) -> Place:
        """The most likely place of the target now."""
        if self._place is None:
            self._place = most_likely_place(self.belief.probability())
        return self._place

    async def decide(self, cell: Cell, heading: str, ahead: Sequence[Cell]) -> Decision:
        """A decision from `cell`, as if the looks from `ahead` will have been in vain; in a worker thread."""
        thought = self.belief.copy()
        for step in ahead:
            cells, p_tp, p_tn = self.fov.looks(step, heading, self.grid.frame.shape)
            thought.observe(cells, np.zeros(len(cells), dtype=np.bool_), p_tp, p_tn)
        state = SearchState(cell=cell, heading=heading)
        deadline = self.settings.search.deadline_s
        think = functools.partial(self.planner.plan, thought, state, self._rng, deadline_s=deadline)
        return await asyncio.get_running_loop().run_in_executor(self._thread, think)

    def reason(self, decision: Decision, cell: Cell) -> Reason:
        """The decision in words: where to, how much is there, how far, and what else was weighed."""
        return explain(decision, cell, self.belief.probability(), self.regions, self.grid.frame.cell_m)

    def nearest_flyable(self, cell: Cell) -> Cell:
        """The flyable cell nearest to `cell`, itself if it is flyable."""
        cells: NDArray[np.int64] = np.argwhere(self.grid.flyable)
        row, col = cells[np.abs(cells - np.array(cell)).sum(axis=1).argmin()]
        return int(row), int(col)

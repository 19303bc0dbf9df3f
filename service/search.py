"""The search as the mission sees it: one belief, one planner, and what has been looked at so far.

No search mathematics here: it holds the pieces of `roisearch` together, and keeps the belief out of the planner's
hands while it thinks in another thread.
"""

from __future__ import annotations

import asyncio
import functools
import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from roisearch import Belief, Decision, Motion, Regions, SearchState, make_planner, segment_regions
from roisearch.detection import DetectionRecord
from roisearch.directions import direction_between
from roisearch.motion_fit import Flown
from roisearch.place import Place
from roisearch.planners.base import Expects, Hasty, InSeconds, Planner
from roisearch.planners.ending import EndingPlanner
from roisearch.planners.ending.settings import EndingSettings
from roisearch.walk import MOST_S
from service.area import Grid
from service.chances import sure
from service.common import Common
from service.config import Settings, each_aircraft
from service.drafting import Drafting, plan_at_leisure
from service.drawing import Drawing
from service.evidence.cover import covered_p_tp
from service.evidence.found import Found
from service.evidence.plausible import ground_metres
from service.evidence.sensors import field_of_view
from service.evidence.suspects import Sightings
from service.explain import explain
from service.geometry import Cell
from service.ground.flown import flown_heights
from service.ground.relief import Floats
from service.ground.sight import seen_share
from service.known import Known, Said
from service.mission.energy import Left
from service.mission.states import SEARCHED_TO
from service.motion import MotionLimits, learnt_in_flight, limits_note, motion_of, within
from service.outside import from_outside
from service.reach import Reach
from service.reasons import Reason
from service.redrawing import Sketch, taking

log = logging.getLogger("roisearch")
PROBABLE_AT = 0.5
"""A place where something was seen is probable when the target is there rather than not."""


KEEPS_ITS_PLAN = "puct-regions-lite"
"""The default planner; it can fly on by its first plan without thinking."""
GETS_READY_S = 20.0
"""No aircraft arms, takes off and climbs to its height in less, in the time of the search."""
DRAFTED_AFTER_S = 3.0
"""A plan that is made beside the flight begins where the aircraft is so many seconds later."""
FORESEEING_S = 0.002
"""What a decision of another one may take where thousands are foreseen."""


class Foreseeing(NamedTuple):
    """A planner that foresees, and the seconds that each of its decisions may take."""

    planner: Planner
    deadline_s: float | None


def begin(grid: Grid, settings: Settings) -> Common:
    """A new search: what is known by the area file alone."""
    every = [each.sensor for each in each_aircraft(settings).values()]
    weakest = min(every, key=lambda sensor: sensor.p_tp / (1.0 - sensor.p_tn))  # whose hits prove least
    known = Known(grid, weakest.p_tp, weakest.p_tn)
    regions = segment_regions(known.belief.probability(), searchable=grid.searchable)
    return Common(grid, known, Drawing.of(0, regions))


class Search:
    """One target, one grid, one planner: a search as one aircraft has it.

    Several aircraft have one of these each, made by `beside`, and all that is known in common; so each decides with its
    own planner, by its own motion, and with what the others plan to look at taken as flown (`roisearch.Fleet`).

    Args:
        aircraft: whose search it is; empty for the only one.
        common: what it has in common with others; a new search unless given.
    """

    def __init__(
        self,
        grid: Grid,
        settings: Settings,
        *,
        aircraft: str = "",
        common: Common | None = None,
    ) -> None:
        self.common = common or begin(grid, settings)
        self.aircraft, self.grid = aircraft, grid
        self.settings = settings
        self.fov = field_of_view(settings, grid.frame.cell_m)
        self.as_set = motion_of(settings.flight, grid.frame.cell_m, diagonal=self.fov.is_point)
        """How the aircraft moves by the settings, and as far as its parameters allow."""
        self.motion = self.as_set
        """The same as far as is known by now."""
        self.heights = flown_heights(grid, settings.flight)
        """How high each cell is flown over, float [rows, cols]; None: the ground is taken as flat."""
        self.in_sight = seen_share(grid, settings)
        """In what share of directions a camera that looks ahead sees each cell, float [rows, cols]; None: in all."""
        self._see(grid)
        self.planner = self._make_planner()
        self.ending = self.ending_of(self.planner)
        """What plans the end of a battery."""
        self.reach = Reach(grid, settings.flight)
        # one thread: a dropped decision may still be thinking, and the planner is one object
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="planner")
        self._school = ThreadPoolExecutor(max_workers=1, thread_name_prefix="motion")
        self._learning: Future[None] | None = None
        self.drafting = Drafting(self._school)
        """Where a plan is made beside the flight."""
        self.expected_s: float | None = None
        """Seconds to the first detection, by the last decision; None: it did not count them."""
        self._rng = np.random.default_rng(settings.run.seed)
        self.common.new_ground.append(self._fly_on)
        self.common.new_drawing.append(self._redraw)

    def beside(self, aircraft: str, settings: Settings) -> Search:
        """The search as another aircraft has it, with settings of its own."""
        self._join()
        another = Search(self.common.grid, settings, aircraft=aircraft, common=self.common)
        number = len(self.common.new_ground)
        another._rng = np.random.default_rng((settings.run.seed, number))
        another._join()
        return another

    def _see(self, grid: Grid) -> None:
        """What can be seen of a grid, as far as is known by now."""
        self._overlooked = self.common.overlooked.changes
        shares = [each for each in (grid.visibility, self.in_sight) if each is not None]
        if self._overlooked:
            shares.append(np.where(self.common.overlooked.cells, 0.0, 1.0))
        self.visibility: Floats | None = np.prod(shares, axis=0) if shares else None
        """What a look may be expected to find in each cell as a share of what it finds in the open, float [rows, cols]:
        under cover, behind ridges, and where nothing is seen for whatever reason; None: all."""
        seen = grid.seen(self.visibility)
        (there, _), (_, elsewhere) = self.record.parts(seen), self.record.parts(~seen)
        self.enough = self.settings.search.stop_at_pos * there + elsewhere
        """The POS, given that the target is in the area, at which the search is at its end: so much of what can be seen
        now, beside what was found out before of ground that cannot be seen any more."""

    def _join(self) -> None:
        """From now on there are others: they are told what this one plans, and it is told what they do."""
        if self.aircraft not in self.common.others.searchers:
            step_s = self.grid.frame.cell_m / self.settings.flight.speed_mps
            self.common.others.join(self.aircraft, fov=self.fov, step_s=step_s, planner=self.planner)

    @property
    def _together(self) -> bool:
        """Whether there are others."""
        return self.aircraft in self.common.others.searchers

    def give_back(self) -> None:
        """It does not search now: what it was going to look at is open to the others again."""
        if self._together:
            self.common.others.forget(self.aircraft)

    @property
    def believing(self) -> asyncio.Lock:
        """Held while something is written down and then believed."""
        return self.common.believing

    @property
    def known(self) -> Known:
        """What is known of the target."""
        return self.common.known

    @property
    def belief(self) -> Belief:
        """Where the target may be."""
        return self.known.belief

    @property
    def drawing(self) -> Drawing:
        """The regions of interest as they are drawn now."""
        return self.common.drawing

    @property
    def regions(self) -> Regions:
        """The regions of interest."""
        return self.drawing.regions

    @property
    def record(self) -> DetectionRecord:
        """How well the ground has been searched."""
        return self.known.record

    @property
    def sightings(self) -> Sightings:
        """Where something was seen."""
        return self.known.sightings

    @property
    def confirmed(self) -> Cell | None:
        """The place that an operator said is the target's."""
        return self.known.confirmed

    def _make_planner(self, **options: Any) -> Planner:
        search = self.settings.search
        if search.planner == KEEPS_ITS_PLAN and self.fov.is_point:
            options = {"iterations": search.iterations, "looks": search.looks_ahead, **options}
        with from_outside(search.planner):
            return make_planner(
                search.planner,
                fov=self.fov,
                flyable=self.grid.flyable,
                regions=self.regions,
                visibility=self.visibility,
                motion=self.motion,
                heights=self.heights,
                **options,
            )

    def ending_of(self, planner: Planner) -> EndingPlanner:
        """`planner`, which at the end of a battery plans for what can be found until then: the default, that is."""
        default = self.settings.search.planner == KEEPS_ITS_PLAN
        horizon = self.settings.search.battery_end_s if default else 0.0
        return EndingPlanner(
            planner,
            fov=self.fov,
            motion=self.motion,
            flyable=self.grid.flyable,
            visibility=self.visibility,
            heights=self.heights,
            settings=EndingSettings(horizon_s=horizon),
        )

    def plan_anew(self, belief: Belief | None = None, deadline_s: float | None = None) -> None:
        """Make a plan from the start again: for the next flight of a search.

        `belief` is a copy that is ours, where reports may come meanwhile. Without a deadline it takes as long as it
        does, which depends on what is left, too.
        """
        if isinstance(self.planner, InSeconds):
            self.planner = self._make_planner()
            self.ending = self.ending_of(self.planner)
            self._plans_otherwise()
            thought = self.belief.copy() if belief is None else belief
            plan_at_leisure(self.planner, thought, SearchState(self.grid.start), self._rng, deadline_s)

    def redrawn(self, now: float) -> Sketch | None:
        """Regions that are ready to be written down and taken (`take_sketch`), if there are any; looks for the next.

        A call that costs no more than a copy of the belief, now and then.
        """
        redrawing = self.common.redrawing
        if redrawing is None:
            return None
        sketch = redrawing.ready()
        if sketch is None and redrawing.due(now):
            redrawing.look(now, self.belief.copy(), self.drawing, self.planner)
        return sketch

    def take_sketch(self, sketch: Sketch) -> None:
        """Go on with other regions; the planner, and those of the others, do from their next decisions on."""
        self.common.draw(sketch)

    def _redraw(self, sketch: Sketch) -> None:
        """Others are drawn: get ready for them beside the planner's thread, unless that is done."""
        if sketch.planner is self.planner:
            self._thread.submit(sketch.take)
        else:
            self._school.submit(self._get_ready, sketch.drawing)

    def _get_ready(self, drawing: Drawing) -> None:
        self._thread.submit(taking(self.planner, drawing.regions))

    def take_drawing(self, drawing: Drawing) -> None:
        """Go back, or on, to the regions of another time of the run.

        Raises:
            ValueError: when they are of another map.
        """
        if drawing.labels.shape != self.grid.frame.shape:
            raise ValueError(
                f"its regions lie on {drawing.labels.shape} cells, the search on {self.grid.frame.shape}"
            )
        self.common.draw(Sketch(drawing, self.planner, taking(self.planner, drawing.regions)))

    def replan(self) -> None:
        """The same in the planner's thread, while the aircraft gets ready: a decision waits for it, and so it takes no
        longer than that does."""
        self._thread.submit(self.plan_anew, self.belief.copy(), GETS_READY_S / self.settings.speedup)

    def currency(self) -> str:
        """What the planner counts, and where to it flies, for people."""
        if not isinstance(self.planner, InSeconds):
            several = "" if self.fov.is_point else ", as the sensor sees several cells at once"
            return f"in steps, to four neighbours{several}"
        return f"in seconds of flight, to {'eight' if self.motion.diagonal else 'four'} neighbours"

    def foreseeing(self) -> Foreseeing:
        """A planner like the one that flies, to foresee what it will do: it may be used in any thread."""
        if self.settings.search.planner == KEEPS_ITS_PLAN:
            return Foreseeing(self._make_planner(iterations=0), None)
        return Foreseeing(self._make_planner(), FORESEEING_S)

    def warm_up(self, progress: Callable[[str, int, int], None] | None = None) -> None:
        """Compile what the planner needs and let it make its first plan; `progress(name, done, total)` is told.

        A plan in seconds is kept and carried on from decision to decision: it is begun without a deadline, here.
        """
        with from_outside(self.settings.search.planner):
            self.ending.warm_up(progress)
        if isinstance(self.planner, InSeconds):
            self.planner.plan(self.belief, SearchState(self.grid.start), self._rng)

    def take(self, said: Said, time: float | None = None) -> None:
        """Believe what was seen, judged or told, exactly, at its time (seconds since the epoch); see `Known.take`."""
        self.common.take(said, time)

    def go_back(self, known: Known, grid: Grid | None = None) -> None:
        """Take up another state of what is known, which is ours from now on, with the ground of it."""
        self.common.go_back(known, grid)

    def ground_of(self, known: Known) -> Grid:
        """The grid of the area file without what is excluded by now. Raises BadInput when that leaves nothing."""
        return self.common.ground_of(known)

    def _fly_on(self, grid: Grid) -> None:
        """Other ground to fly over, or to see, needs another planner, whose kernels are compiled already."""
        flown_as_before = np.array_equal(grid.flyable, self.grid.flyable)
        seen_as_before = self._overlooked == self.common.overlooked.changes
        self.grid = grid
        self._see(grid)
        if flown_as_before and seen_as_before:
            return
        self.planner = self._make_planner()
        self.ending = self.ending_of(self.planner)
        if not flown_as_before:
            self.reach = Reach(grid, self.settings.flight)
        self._plans_otherwise()

    def _plans_otherwise(self) -> None:
        """The planner is another one now."""
        if self._together:
            self.common.others.replace(self.aircraft, self.planner)

    def cell_at(self, place: tuple[float, float] | None) -> Cell:
        """The cell of a position (latitude, longitude), the nearest one when it is off the grid; without one, that
        of the present most likely place."""
        if place is None:
            return self.place.cell
        row, col = np.clip(self.grid.frame.to_cells([place])[0], 0, np.array(self.grid.frame.shape) - 1)
        return int(row), int(col)

    def why_not_here(self, place: tuple[float, float]) -> str:
        """Why no word of a person can be about a place (latitude, longitude), as a sentence; empty if it can."""
        if self.grid.frame.locate(np.array([place]))[1][0]:
            return ""
        ((lat, lon),) = self.grid.frame.to_latlon(np.array([self.cell_at(place)]))
        off = ground_metres(*place, float(lat), float(lon))
        return f"{place[0]:.6f}, {place[1]:.6f} lies {off:.0f} m beside the area; are lat and lon swapped?"

    def found(self) -> Found | None:
        """Where the target is, when an operator has confirmed it or the posterior passes `search.found_at`."""
        if self.confirmed is not None:
            return self.common.confirmed
        return self.common.best if self._found_by_itself() and not self.common.doubt else None

    def over(self) -> str:
        """Why the search is over, whoever flies it; empty while it is not."""
        settings, pos = self.settings.search, self.record.searched
        ends = self.confirmed is not None or settings.on_found == "return"
        if ends and self.found() is not None:
            return "found"
        return f"{SEARCHED_TO} {sure(pos)}{self.left_out}" if pos >= self.enough else ""

    @property
    def left_out(self) -> str:
        """What of the ground is given up, as the end of a sentence; empty: nothing."""
        return f", without the ground around {self.grid.cut_off} that is cut off" if self.grid.cut_off else ""

    def best(self) -> Found:
        """The most likely place as it is told, with its probability and ellipse, however small that probability is."""
        return self.common.best

    def probable(self) -> Found | None:
        """The most likely place, when something was seen there and the target is there rather than not."""
        likely = self.place.probability >= PROBABLE_AT and self.was_hit(self.place)
        return self.best() if likely else None

    def doubt(self) -> str:
        """Why the most likely place waits for a person before it counts as found, for people; empty if it does not."""
        if self.confirmed is not None or not self._found_by_itself():
            return ""
        return self.common.doubt

    def _found_by_itself(self) -> bool:
        return self.place.probability >= self.settings.search.found_at and self.was_hit(self.place)

    def was_hit(self, place: Place) -> bool:
        """True when a detection was ever reported at `place` or beside it: a sharp prior alone finds nobody."""
        return self.sightings.near(place.cell)

    @property
    def place(self) -> Place:
        """The most likely place of the target now."""
        return self.common.place

    async def decide(
        self, state: SearchState, ahead: Sequence[Cell], left: Left | None = None, now: float | None = None
    ) -> Decision:
        """A decision from where `state` is, as if the looks from `ahead` will have been in vain; in a worker thread.

        `left` is what the battery leaves from there on; None: enough, or not known. A target that walks is searched for
        where it may be at `now`, seconds since the epoch, and later.
        """
        self._take_draft()
        thought = self.belief.copy()
        if now is not None and self.known.time is not None:
            thought.drift(min(max(0.0, now - self.known.time), MOST_S))
        self._look_in_vain(thought, ahead, state.heading)
        think = functools.partial(self._decide, thought, state, left, now)
        decision = await asyncio.get_running_loop().run_in_executor(self._thread, think)
        if self._together and now is not None:  # here, where what nobody waits for any more does not come
            self.common.others.commit(self.aircraft, decision, state, thought.shape, now_s=now)
        return decision

    def _look_in_vain(self, thought: Belief, path: Sequence[Cell], heading: str) -> None:
        """Let `thought` be as it will be when nothing was seen from `path`."""
        for step in path:
            cells, p_tp, p_tn = self.fov.looks(step, heading, self.grid.frame.shape)
            if self.visibility is not None:
                p_tp = covered_p_tp(p_tp, p_tn, self.visibility[cells[:, 0], cells[:, 1]])
            thought.observe(cells, np.zeros(len(cells), dtype=np.bool_), p_tp, p_tn)

    def _decide(self, thought: Belief, state: SearchState, left: Left | None, now: float | None) -> Decision:
        """In the planner's thread: plan, for the end of the battery when it is near enough to matter."""
        if self._together and now is not None:
            thought = self.common.others.beside(self.aircraft, thought, now_s=now)
        known = left is not None and self.reach.knows(left.home)  # else the battery's end is not planned yet
        near = left is not None and left.spare_s <= self.settings.search.battery_end_s
        endurance = self.reach.endurance(left) if left is not None and known and near else None
        deadline, planner = self.settings.search.deadline_s, self.planner
        decision = self.ending.plan(thought, state, self._rng, deadline_s=deadline, endurance=endurance)
        self.expected_s = planner.expected_s if isinstance(planner, Expects) else None
        if isinstance(planner, Hasty) and planner.hasty:
            self._begin_draft(planner, thought, state, decision)
        return decision

    def _begin_draft(self, hasty: Planner, thought: Belief, state: SearchState, decision: Decision) -> None:
        """A decision left no time for a good plan: have one made beside the flight, which goes on by the hasty one
        until then."""
        if self.drafting.under_way is not None:
            return
        times = self.arrivals(decision.path, state.cell, state.heading, state.speed_mps)
        flown = decision.path[: max(1, int(np.searchsorted(times, DRAFTED_AFTER_S)))]
        self._look_in_vain(thought, flown, state.heading)
        before = (state.cell, *flown)[-2]
        there = SearchState(flown[-1], direction_between(before, flown[-1]), self.motion.speed_mps)
        rng = self._rng.spawn(1)[0]
        self.drafting.begin(hasty, functools.partial(self._plan_beside, thought, there, rng))

    def _plan_beside(self, thought: Belief, state: SearchState, rng: np.random.Generator) -> Planner:
        planner = self._make_planner()
        plan_at_leisure(planner, thought, state, rng, GETS_READY_S / self.settings.speedup)
        return planner

    def _take_draft(self) -> None:
        """Go on by a plan that was made beside the flight, if one is ready."""
        drafted = self.drafting.taken(self.planner)
        if drafted is not None:
            self.planner = self.ending.planner = drafted
            self._thread.submit(self._catch_up, drafted)
            self._plans_otherwise()

    def _catch_up(self, planner: Planner) -> None:
        """In the planner's thread: what was learnt while `planner` made its plan."""
        if isinstance(planner, InSeconds):
            planner.reckon_with(self.motion)

    def arrivals(
        self, path: Sequence[Cell], start: Cell, heading: str = "north", speed_mps: float = 0.0
    ) -> Floats:
        """Seconds until each cell of `path` is reached, as `Motion.arrivals` says, over the ground that there is."""
        return self.motion.arrivals(path, start, heading, speed_mps, self._heights_along(start, path))

    def _heights_along(self, start: Cell, path: Sequence[Cell]) -> Floats | None:
        if self.heights is None:
            return None
        rows, cols = np.array([start, *path], dtype=np.int64).T
        return np.asarray(self.heights[rows, cols])

    def learn(self, flights: Sequence[Flown]) -> Future[None]:
        """Learn from flown paths how the aircraft moves, in a thread; once that is done the planner reckons with it.

        While it learns from others, these are left out: what is done then is that.
        """
        if self._learning is None or self._learning.done():
            self._learning = self._school.submit(self._learn, flights)
        return self._learning

    def _learn(self, flights: Sequence[Flown]) -> None:
        over = [replace(each, heights=self._heights_along(each.start, each.path)) for each in flights]
        as_set = self.as_set
        motion = learnt_in_flight(as_set, over)
        if (
            motion is not None and as_set is self.as_set
        ):  # the aircraft that flew it is not another one by now
            self._move_as(motion).result()

    def forget_motion(self) -> None:
        """The aircraft is another one: it moves as the settings say, until it has told or flown."""
        flight, cell_m = self.settings.flight, self.grid.frame.cell_m
        self.as_set = motion_of(flight, cell_m, diagonal=self.fov.is_point)
        self._move_as(self.as_set)

    def limit(self, limits: MotionLimits) -> None:
        """Reckon with what the aircraft's parameters allow; what was learnt in flight stays."""
        if self.heights is None:  # over flat ground it stays at one height
            limits = limits._replace(climb_mps=None, descent_mps=None)
        if note := limits_note(self.as_set, limits):
            log.warning("%s", note)
        if within(self.as_set, limits) != self.as_set:
            unlearnt = self.motion is self.as_set
            self.as_set = within(self.as_set, limits)
            if unlearnt:
                self._move_as(self.as_set)

    def _move_as(self, motion: Motion) -> Future[None]:
        """The aircraft moves so, as is known from now on; the planner reckons with it from its next decision."""
        self.motion = motion
        return self._thread.submit(self._reckon_with, motion)

    def _reckon_with(self, motion: Motion) -> None:
        self.ending.reckon_with(motion)
        if isinstance(self.planner, InSeconds):
            self.planner.reckon_with(motion)

    def reason(self, decision: Decision, cell: Cell) -> Reason:
        """The decision in words: where to, how much is there, how far, and what else was weighed."""
        return explain(decision, cell, self.belief.probability(), self.regions, self.grid.frame.cell_m)

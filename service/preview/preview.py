"""What a search of an area will be like, worked out before anybody flies.

The real planner is flown over the prior without a target: once with a detector that raises no alarm, for the path,
and a few times with as many false alarms as its p_tn says, for the times. How long that
takes says the motion that the planner plans by, and `pace` what comes before and after.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from roisearch import Motion, Regions
from service.area import Grid, SearchArea
from service.config import Settings
from service.errors import BadInput
from service.geometry import LatLon
from service.mission.energy import Energy, Left, WayHome
from service.preview.batteries import Help, OneBattery, Told, first_look_s, fly_batteries, what_would_help
from service.preview.foresight import Foresight, foresee
from service.preview.pace import farthest_from_launch, way_metres
from service.search import Search

GOALS = (0.5, 0.75, 0.95)
DRAWS = 3
MOST_STEPS = 2500
ENOUGH = 0.98
"""The simulation ends with so much of what can be reached: the rest takes longer than all before, and no battery."""

FIRST_S = 300.0
"""What counts as the first minutes."""


@dataclass(frozen=True)
class Goal:
    """When POS reaches a level, in seconds since take-off: the median, the least and the most of the draws that
    got there, which were `reached` of `draws`."""

    pos: float
    median_s: float | None
    least_s: float | None
    most_s: float | None
    reached: int
    draws: int


@dataclass(frozen=True)
class Region:
    """A region of interest: its number, its mass, its size, and its most probable place."""

    number: int
    mass: float
    hectares: float
    peak: LatLon


@dataclass(frozen=True, eq=False)
class Preview:
    """Everything there is to say. Seconds are of flight and count from take-off, `before_s` being the first look.

    Attributes:
        reachable: the most POS that any search of this grid can get to, with a wide footprint at most this.
        path: the search without alarms; `draws` those with.
        battery_s: how long one battery flies until it is time to go home; `pos_battery` is the POS by then.
        home: the longest way home, in no wind, landing included.
        kept_percent: what is left of the battery then, for that way and as a reserve; None: no battery is known.
        full_s: how long a full battery lasts, as told or set; `batteries` are flown one after another, their ends
            planned; `helps` is what one would find from higher up.
    """

    area: SearchArea
    grid: Grid
    settings: Settings
    regions: tuple[Region, ...]
    labels: Regions
    motion: Motion
    reachable: float
    before_s: float
    path: Foresight
    draws: tuple[Foresight, ...]
    goals: tuple[Goal, ...]
    battery_s: float
    pos_battery: tuple[float, ...]
    home: WayHome
    kept_percent: float | None
    full_s: float
    batteries: tuple[OneBattery, ...]
    helps: tuple[Help, ...] = ()


def preview(
    area: SearchArea,
    grid: Grid,
    settings: Settings,
    battery_min: float | None,
    told: Told,
    resurvey: Callable[[Settings], Grid] | None = None,
) -> Preview:
    """Work it out; `battery_min` minutes is what a full battery flies, None: `flight.max_flight_s` is the limit.

    `resurvey` lays the grid for other settings: with it, what would help is worked out where one battery is too little.
    """
    flight = settings.flight
    search = Search(grid, settings)
    regions = search.regions
    search.warm_up(lambda name, done, total: told(f"compiling {name}", done / total))
    seen = grid.reachable_mass if search.fov.is_point else 1.0  # a wider footprint sees over the edge
    reachable = (1.0 - grid.outside) * seen
    until = min(max(GOALS), ENOUGH * reachable)
    before = first_look_s(grid, settings)
    home = _longest_way_home(search)
    battery, kept = flight.max_flight_s, None
    if battery_min is not None:
        energy = Energy(100.0, 100.0 / (60.0 * battery_min), home)
        battery = min(battery, energy.seconds_left(flight) or 0.0)
        kept = 100.0 - 100.0 * battery / (60.0 * battery_min)
        if battery <= before:
            raise BadInput(
                f"a battery of {battery_min:g} minutes is too small: from the farthest cell the way home takes "
                f"{home.seconds / 60:.1f}, and flight.reserve_percent = {flight.reserve_percent:g} are kept"
            )

    def fly(name: str, alarms: bool, seed: int) -> Foresight:
        return foresee(
            Search(grid, settings),
            grid.start,
            most_s=np.inf,
            until=until,
            most_steps=MOST_STEPS,
            rng=np.random.default_rng([settings.run.seed, seed]),
            false_alarms=alarms,
            told=lambda seconds, pos: told(name, min(1.0, pos / until)),
        )

    full = flight.full_battery_s if battery_min is None else 60.0 * battery_min
    batteries = fly_batteries(grid, settings, full, until, told)
    helps = what_would_help(resurvey, settings, full, until, told) if resurvey and len(batteries) > 1 else ()
    path = fly("the path", False, DRAWS)
    draws = tuple(fly(f"search {n + 1} of {DRAWS} with false alarms", True, n) for n in range(DRAWS))
    return Preview(
        area=area,
        grid=grid,
        settings=settings,
        regions=_regions(grid, search),
        labels=regions,
        motion=search.motion,
        reachable=reachable,
        before_s=before,
        path=path,
        draws=draws,
        goals=tuple(_goal(pos, draws, before) for pos in GOALS),
        battery_s=battery,
        pos_battery=tuple(draw.pos_at(battery - before) for draw in draws),
        home=home,
        kept_percent=kept,
        full_s=full,
        batteries=batteries,
        helps=helps,
    )


def first_minutes(seen: Preview) -> list[tuple[float, str]]:
    """Where the search goes first: seconds since take-off and the ground that is entered then."""
    said: list[tuple[float, str]] = []
    here = -1
    for cell, seconds in zip(seen.path.cells, seen.path.seconds, strict=True):
        label = int(seen.labels.labels[cell])
        if seconds > FIRST_S:
            break
        if label != here:
            said.append((seen.before_s + float(seconds), f"ROI {label}" if label else "open ground"))
            here = label
    return said


def _goal(pos: float, draws: Sequence[Foresight], before: float) -> Goal:
    times = sorted(before + when for draw in draws if (when := draw.when(pos)) is not None)
    if 2 * len(times) <= len(draws):  # the median never gets there
        return Goal(pos, None, None, None, len(times), len(draws))
    return Goal(pos, float(np.median(times)), times[0], times[-1], len(times), len(draws))


def _regions(grid: Grid, search: Search) -> tuple[Region, ...]:
    mass, labels = search.belief.probability(), search.regions.labels
    hectare = grid.frame.cell_m**2 / 1e4
    found = []
    for number in range(1, search.regions.count + 1):
        inside = labels == number
        lat, lon = grid.frame.to_latlon([search.regions.peaks[number - 1]])[0]
        size = float(grid.covered[inside].sum()) * hectare
        found.append(Region(number, float(mass[inside].sum()), size, (float(lat), float(lon))))
    return tuple(found)


def _longest_way_home(search: Search) -> WayHome:
    """From the cell that is farthest from the launch point, as the flight itself will reckon it; over ground with
    heights, from the one with which climb and descent take longest."""
    grid, flight = search.grid, search.settings.flight
    if search.heights is None:
        points = way_metres(grid, farthest_from_launch(grid), grid.launch)
        return WayHome.along(
            [(east, -south) for east, south in points.tolist()], flight.altitude_m, None, flight
        )
    seconds = np.where(grid.flyable, search.reach.home_s(Left(0.0, 0.0, 0.0, 0.0, grid.launch)), -1.0)
    row, col = np.unravel_index(int(seconds.argmax()), seconds.shape)
    lat, lon = grid.frame.to_latlon([(row, col)])[0]
    length = float(
        np.hypot(*np.diff(way_metres(grid, (float(lat), float(lon)), grid.launch), axis=0).T).sum()
    )
    return WayHome(length, float(seconds[row, col]), 0.0)

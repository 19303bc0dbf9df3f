"""How many batteries a search takes, and what would make it fewer: flown ahead, each one's end planned as in flight.

How long a battery lasts is said by whoever previews, or by `flight.full_battery_s`. By the rules of the flight some of
it is kept; the next battery begins at the launch point, with what the ones before have left.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from roisearch import SearchState
from roisearch.endurance import Endurance
from service.area import Grid
from service.camera.detect import Detectability
from service.config import Settings
from service.evidence.sensors import cell_size
from service.mission.energy import Energy, Left, WayHome
from service.preview.foresight import HEED, Simulated
from service.preview.pace import climb_seconds, route_seconds
from service.search import Search

MOST = 8
"""More batteries than this are not flown ahead."""
MOST_CELLS = 20_000
HIGHER = (1.5, 2.0)
"""So many times as high it is tried whether fewer batteries would do."""

Told = Callable[[str, float], None]
"""Hears what is being worked out and how far it is, 0 to 1."""


@dataclass(frozen=True)
class OneBattery:
    """What a battery has done: POS after it, and the seconds in the air until it is on the ground again."""

    pos: float
    seconds: float


@dataclass(frozen=True)
class Help:
    """What one battery would find from another height: metres, metres, POS, and the p_tp that counts then."""

    altitude_m: float
    cell_m: float
    pos: float
    p_tp: float


def first_look_s(grid: Grid, settings: Settings) -> float:
    """Seconds from take-off to the first look."""
    lat, lon = grid.frame.to_latlon([grid.start])[0]
    way = route_seconds(grid, settings.flight, grid.launch, (float(lat), float(lon)))
    return climb_seconds(settings.flight, grid) + way


def fly_batteries(
    grid: Grid, settings: Settings, full_s: float, until: float, told: Told, most: int = MOST
) -> tuple[OneBattery, ...]:
    """Fly battery after battery of `full_s` seconds until POS is `until`; ends as well where one finds nothing more."""
    search, flown = Search(grid, settings), list[OneBattery]()
    rng = np.random.default_rng([settings.run.seed, len("batteries")])
    for number in range(most):
        told(f"battery {number + 1}", search.record.pos / until)
        before = search.record.pos
        seconds = _fly(search, full_s, until, rng)
        if search.record.pos <= before:
            break
        flown.append(OneBattery(search.record.pos, seconds))
        if search.record.pos >= until:
            break
        search.plan_anew()
    return tuple(flown)


def _fly(search: Search, full_s: float, until: float, rng: np.random.Generator) -> float:
    """Fly one battery; seconds in the air."""
    grid, flight = search.grid, search.settings.flight
    before = first_look_s(grid, search.settings)
    way = WayHome.along([(0.0, 0.0)], flight.altitude_m, None, flight)
    full = Energy(100.0, 100.0 / full_s, way).left(0.0, grid.launch, flight)
    assert full is not None
    left: Left = full.after(before)
    endurance = search.reach.endurance(left)
    own_way = search.reach.home_s(left)
    sim, late, now = Simulated(search, grid.start, rng, false_alarms=True), False, 0.0
    while not late and sim.pos[-1] < until and len(sim.cells) < MOST_CELLS:
        state = SearchState(
            sim.cells[-1], sim.heading, search.motion.speed_mps if len(sim.cells) > 1 else 0.0
        )
        rest = Endurance(endurance.remaining_s - now, endurance.home_s)
        decision = search.ending.plan(search.belief, state, rng, endurance=rest)
        path = decision.path[:HEED]
        times = search.arrivals([*sim.cells[1:], *path], grid.start)[-len(path) :]
        for cell, then in zip(path, times.tolist(), strict=True):
            late = then + endurance.home_s[cell] > endurance.remaining_s
            if late:
                break
            now = then
            if sim.enter(cell) or sim.pos[-1] >= until:
                break
    return before + now + float(own_way[sim.cells[-1]])


def what_would_help(
    resurvey: Callable[[Settings], Grid], settings: Settings, full_s: float, until: float, told: Told
) -> tuple[Help, ...]:
    """What one battery finds from higher up, with cells and p_tp as they are there; `resurvey` lays the grid anew."""
    found = []
    for height in (times * settings.flight.altitude_m for times in HIGHER):
        if height > settings.flight.max_height_m:
            continue
        told(f"from {height:g} m", 0.0)
        there = from_height(settings, height)
        flown = fly_batteries(resurvey(there), there, full_s, until, lambda name, part: None, most=1)
        if flown:
            found.append(Help(height, cell_size(there), flown[0].pos, there.sensor.p_tp))
    return tuple(found)


def from_height(settings: Settings, altitude_m: float) -> Settings:
    """The settings of a search from another height: cells as much larger, and p_tp by the pixels that a target has."""
    times = altitude_m / settings.flight.altitude_m
    sensor, flight = settings.sensor, settings.flight
    changed = {
        "flight": flight.model_copy(update={"altitude_m": altitude_m}),
        "sensor": sensor.model_copy(
            update={
                "cell_m": round(times * cell_size(settings), 1),
                "p_tp": p_tp_from(settings, altitude_m),
            }
        ),
    }
    return settings.model_copy(update=changed)


def p_tp_from(settings: Settings, altitude_m: float) -> float:
    """p_tp straight down from another height, by the model of `service.camera.detect`: as set at the set height."""
    sensor = settings.sensor
    focal = 0.5 * sensor.image_width_px / math.tan(math.radians(0.5 * sensor.horizontal_fov_deg))
    nominal = focal * sensor.target_size_m / settings.flight.altitude_m
    model = Detectability(sensor.p_tp, sensor.target_size_m, sensor.half_seen_px, nominal, 0.0)
    there = model.pixels(focal, np.array([altitude_m]), np.ones(1))
    return float(model.chance(there)[0])

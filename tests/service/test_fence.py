"""Where the aircraft may be sent, and what happens when it is where it must not be."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest
import shapely

from service.area import build_grid, parse_area
from service.clock import Clock
from service.config import FlightSettings, Settings
from service.mavlink import Vehicle
from service.mavlink.settings import LinkSettings
from service.mavlink.telemetry import Home, Telemetry
from service.mission.fence import Fence, Straying, height_objection
from service.mission.helm import Helm
from sim.soak import ground

# An L, 400 m high and wide, 100 m thick; the launch point in the crook, 50 m from both arms; a block near the launch.
ELL = shapely.Polygon([(0, 0), (100, 0), (100, 300), (400, 300), (400, 400), (0, 400)])
BLOCK = shapely.box(380, 200, 460, 260)
FENCE = Fence.around(ELL, [(150.0, 250.0)], BLOCK, 10.0, 20.0)


def test_the_search_keeps_to_the_area_and_its_margin_and_so_does_every_leg() -> None:
    assert FENCE.leg_objection((50.0, 50.0), (118.0, 50.0), on_way=False) == ""
    assert "lies outside the area" in FENCE.leg_objection((50.0, 50.0), (125.0, 50.0), on_way=False)
    across = FENCE.leg_objection((50.0, 50.0), (350.0, 350.0), on_way=False)
    assert "behind ground outside the area" in across  # both ends are in the area, the leg is not


def test_the_way_may_cross_the_hull_of_area_launch_and_exclusions_and_no_more() -> None:
    assert FENCE.leg_objection((350.0, 350.0), (150.0, 250.0), on_way=True) == ""
    assert FENCE.leg_objection((50.0, 50.0), (350.0, 350.0), on_way=True) == ""
    assert FENCE.leg_objection((150.0, 250.0), (470.0, 230.0), on_way=True) == ""  # around the block
    assert "lies outside the way" in FENCE.leg_objection((50.0, 50.0), (380.0, 50.0), on_way=True)


def test_the_way_may_go_around_what_stands_behind_an_exclusion() -> None:
    behind = shapely.box(470, 200, 520, 260)
    both = Fence.around(ELL, [(150.0, 250.0)], shapely.union_all([BLOCK, behind]), 10.0, 20.0)
    around = ((150.0, 250.0), (530.0, 230.0))
    assert both.leg_objection(*around, on_way=True) == ""
    assert FENCE.leg_objection(*around, on_way=True) != ""


def test_from_outside_a_leg_may_only_lead_in() -> None:
    assert FENCE.leg_objection((-80.0, 50.0), (50.0, 50.0), on_way=False) == ""
    assert FENCE.leg_objection((-80.0, 50.0), (-60.0, 50.0), on_way=False) != ""
    assert FENCE.leg_objection((200.0, -80.0), (50.0, 350.0), on_way=False) == ""
    in_and_out = FENCE.leg_objection((-80.0, 20.0), (350.0, 350.0), on_way=False)
    assert "behind ground" in in_and_out


def test_the_margin_is_never_too_narrow_for_the_outermost_cells() -> None:
    wide = Fence.around(ELL, [(150.0, 250.0)], shapely.Polygon(), 50.0, 0.0)
    assert wide.outside_m((-35.0, 50.0), on_way=False) == 0.0


def test_heights_are_told_with_their_limit() -> None:
    flight = FlightSettings(min_height_m=10, max_height_m=60)
    assert height_objection(60.0, flight) == height_objection(10.0, flight) == ""
    assert height_objection(63.0, flight) == "63 m above home, more than 60 m"
    assert height_objection(7.0, flight) == "7 m above home, less than 10 m"


def test_an_aircraft_strays_only_after_it_has_been_where_it_may() -> None:
    straying = Straying()
    assert [straying.read(said) for said in ("far", "far", "", "far")] == ["", "", "", "far"]
    straying.forget()
    assert straying.read("far") == ""


# ---- the helm asks


def helm(**flight: Any) -> Helm:
    """A helm over the soak's field, with the aircraft in its south-east."""
    settings = Settings.model_validate({"flight": {"altitude_m": 15.0, **flight}, "sensor": {"cell_m": 20.0}})
    lat, lon = place(200.0, 50.0)
    telemetry = Telemetry(
        heartbeat_time=100.0,
        position_time=100.0,
        lat=lat,
        lon=lon,
        alt_home_m=15.0,
        alt_amsl_m=415.0,
        home=Home(*ground.launch(), 400.0),
        fix=3,
        satellites=12,
        guided=True,
    )
    vehicle = SimpleNamespace(telemetry=telemetry, settings=LinkSettings(), stand_by=lambda reason: None)
    area = parse_area(json.dumps(ground.area()).encode(), source="field")

    async def write(kind: str, body: Mapping[str, object]) -> None:
        return None

    built = Helm(
        settings,
        Clock(1.0),
        build_grid(area, 20.0),
        cast(Vehicle, vehicle),
        may_move=lambda: True,
        write=write,
    )
    built.begin()
    return built


def place(east: float, north: float) -> tuple[float, float]:
    """A place so many metres from the field's south-west corner, in degrees."""
    ring: Any = ground._ring([(east, north)])
    return float(ring[0][1]), float(ring[0][0])


def put(built: Helm, east: float, north: float, height: float = 15.0) -> None:
    """Move the aircraft there."""
    lat, lon = place(east, north)
    vehicle: Any = built.vehicle
    vehicle.telemetry = replace(vehicle.telemetry, lat=lat, lon=lon, alt_home_m=height)


@pytest.mark.parametrize(
    ("point", "on_way", "flight", "words"),
    [
        ((250.0, 60.0), False, {}, ""),
        ((320.0, 60.0), False, {}, "outside the area"),
        ((80.0, 160.0), False, {}, "outside the area"),
        ((20.0, 50.0), False, {}, "behind an excluded area"),
        ((-20.0, 10.0), True, {}, ""),
        ((200.0, -60.0), True, {}, "outside the way"),
        ((250.0, 60.0), False, {"max_height_m": 20.0, "altitude_m": 15.0}, ""),
        ((250.0, 60.0), False, {"max_launch_distance_m": 100.0}, "more than 100 m from the launch"),
    ],
)
def test_no_waypoint_leaves_for_where_it_must_not_be_flown(
    point: tuple[float, float], on_way: bool, flight: dict[str, float], words: str
) -> None:
    objection = helm(**flight).objection(place(*point), on_way=on_way)
    assert (objection is None) if not words else (objection is not None and words in objection.reason)


def test_no_waypoint_leaves_when_home_has_moved_and_its_height_is_not_that_any_more() -> None:
    built = helm(max_height_m=20.0)
    vehicle: Any = built.vehicle
    vehicle.telemetry = replace(vehicle.telemetry, home=Home(*ground.launch(), 380.0))
    objection = built.objection(place(250.0, 60.0), on_way=False)
    assert objection is not None
    assert "35 m above home, more than 20 m" in objection.reason


@pytest.mark.parametrize(
    ("east", "north", "height", "words"),
    [
        (320.0, 50.0, 15.0, "outside the area and its margin"),
        (200.0, 50.0, 140.0, "140 m above home, more than 120 m"),
        (200.0, 50.0, 0.5, "0 m above home, less than 3 m"),
        (80.0, 60.0, 15.0, "over an excluded area"),
    ],
)
def test_an_aircraft_that_has_strayed_is_told_once_it_lasts(
    east: float, north: float, height: float, words: str
) -> None:
    built, clock = helm(), Frozen()
    built.clock = clock
    assert built.strayed() == ""
    put(built, east, north, height)
    assert built.strayed() == ""
    clock.time += 2.5
    assert words in built.strayed()
    built.rest()  # a resumed search may begin outside
    clock.time += 2.5
    assert built.strayed() == ""


class Frozen(Clock):
    """A clock that a test moves."""

    time = 1000.0

    def now(self) -> float:
        return self.time

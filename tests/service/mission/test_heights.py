"""No leg, stop or way home comes nearer to the ground than the clearance, whatever the ground is."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.config import Settings
from service.geometry import LatLon
from service.ground.relief import Relief
from service.mavlink.events import Home
from service.mavlink.telemetry import Telemetry
from service.mission.chart import Chart
from service.mission.effects import SendWaypoint
from service.mission.heights import Heights
from service.mission.helm import Helm
from sim.soak import ground
from tests.service.mission.flown import GRID, START, place, telemetry

STEP, CLEARANCE, ALTITUDE, NEAR = 10.0, 15.0, 30.0, 10.0
AROUND = 400.0


def relief_of(heights: Any) -> Relief:
    """Posts around the field; heights as given are made relative to the launch point."""
    made = Relief(np.asarray(heights, dtype=np.float64), STEP, -AROUND, -AROUND, NEAR, 400.0)
    east, south = GRID.frame.to_metres([GRID.launch])[0]
    return replace(made, heights=made.heights - float(made.height_at(np.array([[east, south]]))[0]))


def ground_of(seed: int, rough: float) -> Relief:
    """Waves of 80 m, and tops that stand out between two cells."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:110, 0:110]
    waves = sum(
        rng.uniform(0, 40) * np.sin(x * rng.uniform(0.02, 0.25) + y * rng.uniform(0.02, 0.25) + rng.uniform(0, 6))
        for _ in range(3)
    )  # fmt: skip
    return relief_of(waves + rough * (rng.random((110, 110)) < 0.02))


def settings_of(**flight: Any) -> Settings:
    return Settings.model_validate(
        {
            "flight": {"altitude_m": ALTITUDE, "clearance_m": CLEARANCE, "max_height_m": 120.0, **flight},
            "sensor": {"cell_m": 20.0},
        }
    )


def heights_over(relief: Relief, **flight: Any) -> Heights:
    made = Heights(Chart(replace(GRID, relief=relief)), settings_of(**flight))
    made.reckon(telemetry(armed=False), GRID.launch)
    return made


def at(point: LatLon, up: float, speed: tuple[float, float] = (0.0, 0.0), **more: Any) -> Telemetry:
    """The aircraft at a place and a height above the launch point, with a speed north and east."""
    return telemetry(
        lat=point[0], lon=point[1], alt_home_m=up, alt_amsl_m=400.0 + up, velocity_ned_mps=(*speed, 0.0), **more
    )  # fmt: skip


def metres(point: LatLon) -> Any:
    return GRID.frame.to_metres([point])[0]


def true_clearance(
    relief: Relief, start: LatLon, end: LatLon, z0: float, z1: float, sinks_at_once: bool
) -> float:
    """The least height above any ground within reach, for an autopilot that sinks at once or on a straight line."""
    a, b = metres(start), metres(end)
    length, least = float(np.hypot(*(b - a))), math.inf
    turn = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for share in np.linspace(0.0, 1.0, 60):
        along = share * length
        if z1 > z0:
            z = min(z1, z0 + min(2.0 / 8.0 * along, share * (z1 - z0)))
        else:
            z = z1 if sinks_at_once else z0 + share * (z1 - z0)
        middle = a + share * (b - a)
        around = np.vstack([middle[None], middle + NEAR * ring, middle + 0.5 * NEAR * ring])
        least = min(least, float(z - relief.height_at(around).max()))
    return least


spots = st.tuples(st.floats(0.0, 260.0), st.floats(0.0, 110.0))


@settings(max_examples=120, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.0, 60.0), spots, spots, st.floats(-20.0, 150.0), st.booleans())
def test_a_leg_that_is_planned_clears_the_ground_or_climbs_first(
    seed: int, rough: float, start: tuple[float, float], end: tuple[float, float], above: float, at_once: bool
) -> None:
    relief = ground_of(seed, rough)
    heights, here, there = heights_over(relief), place(*start), place(*end)
    up = float(relief.height_at(metres(here)[None])[0]) + above
    for _ in range(6):
        t = at(here, up)
        leg = heights.leg(there, t)
        if not leg.climbs:
            break
        assert leg.altitude_m > 400.0 + up
        assert heights.objection(here, leg.altitude_m, t, on_way=True) == ""
        up = leg.altitude_m - 400.0 - 0.9
    else:
        pytest.fail("it climbs and climbs")
    said = heights.objection(there, leg.altitude_m, t, on_way=True)
    assert said == ""
    assert true_clearance(relief, here, there, up, leg.altitude_m - 400.0, at_once) >= CLEARANCE


@settings(max_examples=120, deadline=None)
@given(
    st.integers(0, 2**32), st.floats(0.0, 60.0), spots, spots, st.floats(20.0, 300.0), st.floats(-8.0, 8.0)
)
def test_a_search_sinks_first_where_it_would_be_too_high_on_the_leg_and_not_for_ever(
    seed: int, rough: float, start: tuple[float, float], end: tuple[float, float], above: float, speed: float
) -> None:
    relief = ground_of(seed, rough)
    heights, here, there = heights_over(relief), place(*start), place(*end)
    up = float(relief.height_at(metres(here)[None])[0]) + above
    for _ in range(4):
        t = at(here, up, (speed, 0.0))
        leg = heights.leg(there, t, on_way=False)
        if not leg.sinks:
            break
        stop, sunk = heights.stop_place(t), leg.altitude_m - 400.0
        assert heights.objection(stop, leg.altitude_m, t, on_way=False) == ""
        assert sunk < up - 2.0
        assert heights.leg(there, t).sinks is False  # a way has to get there
        here, up, speed = stop, sunk, 0.0
    else:
        pytest.fail("it sinks and sinks")


def test_steep_ground_is_not_left_behind_faster_than_the_aircraft_sinks() -> None:
    """Down a slope of one in one, with 120 m above the ground as the most."""
    slope = np.broadcast_to(np.arange(110) * -STEP, (110, 110))
    heights, here, there = heights_over(relief_of(slope)), place(20.0, 55.0), place(220.0, 55.0)
    up = float(heights.relief.height_at(metres(here)[None])[0]) + ALTITUDE  # type: ignore[union-attr]
    near, far = place(40.0, 55.0), there
    assert not heights.leg(near, at(here, up), on_way=False).sinks
    high = at(here, up + 60.0)
    sunk = heights.leg(far, high, on_way=False)
    assert sunk.sinks
    assert 400.0 + up <= sunk.altitude_m <= 400.0 + up + 20.0  # clear of what is higher beside it


@settings(max_examples=200, deadline=None)
@given(
    st.integers(0, 2**32), st.floats(0.0, 60.0), spots, spots, st.floats(0.0, 100.0), st.floats(-60.0, 200.0)
)
def test_what_passes_the_gate_clears_the_ground(
    seed: int, rough: float, start: tuple[float, float], end: tuple[float, float], above: float, target: float
) -> None:
    relief = ground_of(seed, rough)
    heights, here, there = heights_over(relief), place(*start), place(*end)
    up = float(relief.height_at(metres(here)[None])[0]) + above
    said = heights.objection(there, 400.0 + target, at(here, up), on_way=True)
    climbs_here = math.dist(start, end) < 10.1 and target >= up - 1.0
    if not said and not climbs_here:
        for at_once in (True, False):
            assert true_clearance(relief, here, there, up, target, at_once) >= CLEARANCE - 0.5


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.0, 60.0), spots, spots)
def test_the_pieces_of_a_way_lead_to_its_end_clear_of_the_ground(
    seed: int, rough: float, start: tuple[float, float], end: tuple[float, float]
) -> None:
    relief = ground_of(seed, rough)
    heights, here, there = heights_over(relief), place(*start), place(*end)
    up = float(relief.height_at(metres(here)[None])[0]) + ALTITUDE
    for _ in range(60):
        point = heights.piece(there, at(here, up))
        leg = heights.leg(point, at(here, up))
        if leg.climbs:
            up = leg.altitude_m - 400.0
            continue
        assert true_clearance(relief, here, point, up, leg.altitude_m - 400.0, True) >= CLEARANCE
        here, up = point, leg.altitude_m - 400.0
        if here == there:
            return
    pytest.fail("the way does not end")


def hill(height: float, east: float, north: float) -> Relief:
    """Flat ground with one post that stands out."""
    heights = np.zeros((110, 110))
    x, y = metres(place(east, north))
    heights[round((y + AROUND) / STEP), round((x + AROUND) / STEP)] = height
    return relief_of(heights)


def test_a_hill_between_two_cells_is_climbed_before_it_is_met() -> None:
    heights, here = heights_over(hill(28.0, 190.0, 55.0)), place(220.0, 55.0)
    leg = heights.leg(place(160.0, 55.0), at(here, 30.0))
    assert leg.climbs
    assert leg.altitude_m >= 400.0 + 28.0 + CLEARANCE
    said = heights.objection(place(160.0, 55.0), 430.0, at(here, 30.0), on_way=False)
    assert "comes within 2 m of the ground" in said
    assert heights.objection(place(160.0, 55.0), 450.0, at(here, 50.0), on_way=False) == ""


def test_an_aircraft_that_may_climb_but_slowly_climbs_before_a_leg_that_another_flies() -> None:
    """28 m up over 300 m: with 2 m/s at 8 m/s it is high enough in time, with 0.5 m/s it is not."""
    ramp = np.clip((np.arange(110) * STEP - AROUND) * 0.12, 0.0, 60.0)
    relief = relief_of(np.broadcast_to(ramp, (110, 110)))
    here, there = place(20.0, 55.0), place(200.0, 55.0)
    usual, slow = heights_over(relief), heights_over(relief)
    t = at(here, float(relief.height_at(metres(here)[None])[0]) + ALTITUDE)
    slow.reckon(replace(t, armed=False, most_climb_mps=0.5), GRID.launch)
    assert not usual.leg(there, t).climbs
    assert slow.leg(there, t).climbs
    altitude = usual.leg(there, t).altitude_m
    assert usual.objection(there, altitude, t, on_way=False) == ""
    assert "comes within" in slow.objection(there, altitude, t, on_way=False)


def valley_between() -> Relief:
    """Two plateaus of 60 m, and 100 m wide ground at 0 m between them, with steep sides; east along the field."""
    across = np.full(110, 60.0)
    across[round((90.0 + AROUND) / STEP) : round((190.0 + AROUND) / STEP)] = 0.0
    return relief_of(np.broadcast_to(across, (110, 110)))


def test_what_lies_far_below_a_leg_is_not_seen_on_it() -> None:
    relief = valley_between()
    heights = heights_over(relief)
    west, east, low = place(60.0, 55.0), place(220.0, 55.0), place(140.0, 55.0)
    up = float(relief.height_at(metres(west)[None])[0]) + ALTITUDE
    t = at(west, up)
    assert heights.shows([west, place(66.0, 55.0)], east, t), "those behind it and on the plateau"
    assert not heights.shows([low], east, t)
    assert not heights_over(relief, clearance_m=29.0).shows([west], low, at(west, up - 40.0)), (
        "it climbs first"
    )
    deep = heights.level(low, at(low, up))
    assert deep is not None
    assert deep.sinks
    assert deep.altitude_m == pytest.approx(430.0 + float(relief.height_at(metres(low)[None])[0]), abs=2.0)
    assert heights.level(east, at(east, up)) is None
    assert heights.level(low, at(low, float(relief.height_at(metres(low)[None])[0]) + 0.8 * ALTITUDE)) is None


def test_on_the_way_down_into_a_valley_a_look_counts_only_where_every_autopilot_is_low_enough() -> None:
    """PX4 sinks as fast as it may at once, ArduCopter along the straight line."""
    ramp = np.clip((np.arange(110) * STEP - AROUND) * 0.3, 0.0, 60.0)
    relief = relief_of(np.broadcast_to(ramp, (110, 110)))
    heights, top, foot = heights_over(relief), place(200.0, 55.0), place(20.0, 55.0)
    t = at(top, float(relief.height_at(metres(top)[None])[0]) + ALTITUDE)
    assert heights.shows([place(190.0, 55.0)], foot, t)
    assert not heights.shows([place(60.0, 55.0)], foot, t)


def test_the_gate_of_the_helm_lets_no_such_leg_pass() -> None:
    """Seen red without the check in `Helm.objection`."""
    built = Helm(
        Chart(replace(GRID, relief=hill(28.0, 190.0, 55.0))), settings_of(), fresh_s=2.0, patience_s=15.0
    )
    built.reckon(telemetry(armed=False))
    t = at(place(220.0, 55.0), 30.0)
    built.reckon(t)
    low = built.objection(SendWaypoint(place(160.0, 55.0), 430.0), t, START)
    assert low is not None
    assert low.cause == "ground"
    assert "nearer than 15 m" in low.reason
    assert built.objection(SendWaypoint(place(235.0, 55.0), 430.0), t, START) is None


def test_it_climbs_before_a_hill_where_it_comes_to_a_stand_by_itself_and_not_where_a_stop_would_end() -> None:
    """Seen red while the place was where a gentle stop would have ended: on the flank of the hill."""
    built = Helm(
        Chart(replace(GRID, relief=hill(60.0, 190.0, 55.0))), settings_of(), fresh_s=2.0, patience_s=15.0
    )
    built.reckon(telemetry(armed=False))
    fast, target = at(place(258.0, 55.0), 30.0, speed=(0.0, -8.0)), place(240.0, 55.0)
    built.reckon(fast)
    assert built.stands(fast) == built.heights.stop_place(fast), "it is sent nowhere"
    built.sent(target, on_way=False)
    assert built.stands(fast) == target
    leg = built.leg(place(170.0, 55.0), fast, on_way=False)
    assert leg.climbs
    assert built.objection(SendWaypoint(target, leg.altitude_m), fast, START) is None
    coasts = built.objection(SendWaypoint(built.heights.stop_place(fast), leg.altitude_m), fast, START)
    assert coasts is not None
    assert coasts.cause == "ground"
    built.rest()
    assert built.stands(fast) == built.heights.stop_place(fast), "it was told to stop"


def test_an_aircraft_at_speed_clears_what_lies_ahead_of_it_whatever_it_is_sent_to() -> None:
    heights = heights_over(hill(28.0, 190.0, 55.0))
    fast = at(place(230.0, 55.0), 60.0, speed=(0.0, -8.0))
    back = place(250.0, 55.0)
    assert "comes within" in heights.objection(place(230.0, 100.0), 430.0, fast, on_way=False)
    assert heights.leg(back, fast).altitude_m >= 400.0 + 28.0 + CLEARANCE
    still = at(place(230.0, 55.0), 60.0)
    assert heights.objection(place(230.0, 100.0), 430.0, still, on_way=False) == ""


def test_a_stop_is_no_lower_than_the_clearance_above_what_it_coasts_over() -> None:
    heights = heights_over(hill(28.0, 190.0, 55.0))
    fast = at(place(215.0, 55.0), 35.0, speed=(0.0, -8.0))
    assert heights.least_stop_amsl_m(fast) == pytest.approx(443.0)
    measured = at(place(240.0, 20.0), 30.0, ground_distance_m=5.0)
    assert heights.least_stop_amsl_m(measured) == pytest.approx(440.0)
    assert math.isnan(Heights(Chart(GRID), settings_of()).least_stop_amsl_m(fast))


def test_ground_that_is_not_known_is_not_flown_over() -> None:
    relief = hill(math.nan, 190.0, 55.0)
    heights, t = heights_over(relief), at(place(220.0, 55.0), 30.0)
    there = place(160.0, 55.0)
    assert "not known" in heights.objection(there, heights.leg(there, t).altitude_m, t, on_way=True)
    assert "not known" in heights.objection(there, 480.0, t, on_way=True)


def test_heights_count_from_the_ground_where_the_flight_began_wherever_home_is_set_then() -> None:
    relief = ground_of(7, 0.0)
    elsewhere, here, next_cell = place(100.0, 80.0), place(220.0, 55.0), place(235.0, 55.0)
    there = float(relief.height_at(metres(elsewhere)[None])[0])
    heights = heights_over(relief)
    usual = heights.leg(next_cell, at(here, 60.0)).altitude_m
    begun = {"home": Home(*elsewhere, 400.0 + there), "lat": here[0], "lon": here[1]}
    aloft = {**begun, "alt_home_m": 60.0 - there, "alt_amsl_m": 460.0}
    heights.reckon(telemetry(**aloft, armed=False), elsewhere)  # another home, on the ground
    flying = telemetry(**aloft)
    heights.reckon(flying, elsewhere)
    assert heights.contradiction(flying) == ""
    assert heights.leg(next_cell, flying).altitude_m == pytest.approx(usual)
    lifted = telemetry(**{**aloft, "home": Home(*here, 460.0)}, home_lifted_m=60.0)
    heights.reckon(lifted, here)  # a home that is set in the air
    assert heights.contradiction(lifted) == ""
    assert heights.leg(next_cell, lifted).altitude_m == pytest.approx(usual)


def test_a_sea_level_that_moves_in_flight_is_doubted() -> None:
    heights = heights_over(ground_of(7, 0.0))
    moved = at(place(220.0, 55.0), 60.0)
    assert heights.contradiction(moved) == ""
    heights.reckon(moved, GRID.launch)
    assert "60 m above the launch point by home, and 85 m by the sea" in heights.contradiction(
        replace(moved, alt_amsl_m=485.0)
    )


def test_the_file_and_the_autopilot_may_count_from_different_seas_but_not_from_everywhere() -> None:
    heights = heights_over(ground_of(3, 0.0))
    assert heights.datum_note() == ""
    heights.reckon(
        telemetry(armed=False, home=Home(*ground.launch(), 1312.0), alt_amsl_m=1327.0), GRID.launch
    )
    assert "400 m above the sea by the ground file and 1312 m by the autopilot" in heights.datum_note()


def test_too_near_to_the_ground_is_told_by_the_model_and_by_the_sensor() -> None:
    heights = heights_over(hill(0.0, 190.0, 55.0))
    here = place(220.0, 55.0)
    assert heights.low(at(here, 30.0)) == ""
    assert "10 m above the ground by the model" in heights.low(at(here, 10.0))
    trees = at(here, 30.0, ground_distance_m=8.0)
    assert "8 m above the ground as it measures it" in heights.low(trees)
    before = heights.leg(place(235.0, 55.0), at(here, 30.0)).altitude_m
    heights.learn(trees)
    assert heights.leg(place(235.0, 55.0), at(here, 30.0)).altitude_m == pytest.approx(before + 22.0)


def test_the_autopilots_own_heights_warn_and_are_learnt_from_only_where_they_do() -> None:
    heights, here = heights_over(hill(28.0, 190.0, 55.0)), place(240.0, 20.0)
    other = at(here, 30.0, terrain_distance_m=20.0)
    assert heights.low(other) == ""
    heights.learn(other)
    assert heights.bias_m == 0.0
    near = at(here, 30.0, terrain_distance_m=8.0)
    assert "8 m above the ground by the autopilot's own heights" in heights.low(near)
    assert heights.least_stop_amsl_m(near) == pytest.approx(430.0 + CLEARANCE - 8.0)
    heights.learn(near)
    assert heights.bias_m == pytest.approx(22.0)


def test_the_autopilots_own_return_is_judged_against_the_ground() -> None:
    heights = heights_over(hill(60.0, 100.0, 30.0))
    far = place(225.0, 52.0)
    assert heights.return_clearance(far, 30.0, 30.0) < 0.0 <= heights.return_clearance(far, 30.0, 80.0)
    note = heights.return_note(30.0)
    assert "own return at 30 m above home would not clear the ground" in note
    needed = float(note.split("; ")[1].split(" m")[0])
    assert heights.return_note(needed + 0.5) == ""
    assert heights.return_note(15.0 + 80.0) == ""
    assert heights_over(hill(0.0, 100.0, 30.0)).return_note(30.0) == ""


def test_beside_a_steep_flank_the_closest_ground_counts_for_the_limit_of_height() -> None:
    """126 m above its foot, and 90 m from the flank."""
    foot = place(220.0, 55.0)
    east = (metres(foot)[0] + AROUND) / STEP
    ramp = np.clip((np.arange(110) - east - 1.0) * STEP, 0.0, 200.0)
    heights = heights_over(relief_of(np.broadcast_to(ramp, (110, 110))))
    base = float(heights.relief.height_at(metres(foot)[None])[0])  # type: ignore[union-attr]
    assert heights.wrong(at(foot, base + 126.0), on_way=False) == ""
    assert "from the closest ground, more than 120 m" in heights.wrong(at(foot, base + 190.0), on_way=False)
    flat = heights_over(relief_of(np.zeros((110, 110))))
    assert (
        flat.wrong(at(place(220.0, 55.0), 123.0), on_way=False)
        == "123 m from the closest ground, more than 120 m"
    )
    assert flat.wrong(at(place(220.0, 55.0), 123.0), on_way=True) == ""

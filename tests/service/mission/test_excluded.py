"""Ground that is excluded in flight counts for the leg that is being flown and for the very next one."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely

from service.area import Grid, build_grid, parse_area
from service.errors import BadInput
from service.mavlink.events import Home
from service.mission.effects import DropThought, SendWaypoint, Stop, Tell, Think
from service.mission.news import MapChanged, Order
from service.mission.states import Event, State
from tests.service.mission.flown import GRID, HERE, Talk, place, reached, searching, takes_off


def box(west: float, south: float, east: float, north: float) -> shapely.Polygon:
    """In metres from the field's south-west corner."""
    corners = [place(*at) for at in ((west, south), (east, south), (east, north), (west, north))]
    return shapely.Polygon([(lon, lat) for lat, lon in corners])


def wall() -> Grid:
    """North of the aircraft, as wide as three cells."""
    return GRID.excluding(box(170.0, 70.0, 230.0, 85.0))


def under_way(north: int = 4) -> Talk:
    """An aircraft on a leg of some cells to the north."""
    talk = searching()
    (row, col), _ = talk.core.chart.cell(talk.seen.telemetry)
    talk.tick()
    talk.decides(*((row - k, col) for k in range(1, north + 1)))
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    talk.core.sent(waypoint)
    talk.done()
    talk.wanted.clear()
    return talk


def sent(talk: Talk) -> list[SendWaypoint]:
    return [effect for effect in talk.wanted if isinstance(effect, SendWaypoint)]


def test_a_leg_that_would_cross_it_is_stopped_in_the_call_that_tells_it() -> None:
    talk = under_way()
    did = talk.on(MapChanged(wall()))
    assert Stop() in did
    assert DropThought() in did
    talk.pass_by(3.0)
    for waypoint in sent(talk):
        assert talk.core.chart.leg_allowed(HERE, waypoint.point)
    thought = [effect for effect in talk.wanted if isinstance(effect, Think)]
    assert thought
    assert wall().flyable[thought[-1].cell]


def test_a_leg_that_keeps_clear_of_it_is_not_stopped() -> None:
    talk = under_way()
    did = talk.on(MapChanged(GRID.excluding(box(20.0, 20.0, 60.0, 60.0))))
    assert Stop() not in did


def test_the_very_next_leg_keeps_clear_of_it() -> None:
    talk = searching()
    talk.tick()
    talk.on(MapChanged(wall()))
    talk.pass_by(2.0)
    (row, col), _ = talk.core.chart.cell(talk.seen.telemetry)
    talk.wanted.clear()
    talk.decides((row - 1, col), (row - 2, col), (row - 3, col))  # by a planner that has not heard of it
    assert not [each for each in sent(talk) if not talk.core.chart.leg_allowed(HERE, each.point)]


def test_an_aircraft_over_it_leaves_by_the_nearest_way_and_searches_on() -> None:
    talk = under_way()
    grid = GRID.excluding(box(180.0, 30.0, 220.0, 70.0))
    talk.on(MapChanged(grid))
    talk.pass_by(4.0)
    assert talk.state == State.SEARCHING  # and does not fly home for being where it must not be
    (first, *_) = sent(talk)
    assert first.on_way
    assert not talk.core.chart.too_near(first.point)


def test_the_way_home_goes_around_it() -> None:
    talk = reached(State.SEARCHING)
    talk.pass_by(1.0)
    talk.done()
    lat, lon = place(200.0, 95.0)  # beyond the pond
    talk.flew((lat, lon))
    talk.on(Order("return"))
    talk.tick()
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    talk.core.sent(waypoint)
    talk.done()
    across = GRID.excluding(box(105.0, 5.0, 125.0, 130.0))
    talk.wanted.clear()
    talk.on(MapChanged(across))
    talk.pass_by(2.0)
    (bend, *_) = sent(talk)
    assert bend.on_way
    assert talk.core.chart.leg_allowed((lat, lon), bend.point)


def test_the_pilot_is_told_when_the_autopilots_own_way_home_may_cross_it() -> None:
    talk = reached(State.RETURNING)
    talk.pass_by(1.0)
    assert talk.core.standing.autopilot_returns
    talk.wanted.clear()
    talk.on(MapChanged(GRID.excluding(box(90.0, 10.0, 110.0, 140.0))))
    assert [e.text for e in talk.wanted if isinstance(e, Tell) and "cut off" not in e.text] == [
        "search RETURNING: the autopilot's way home may cross ground that is excluded now"
    ]
    assert Stop() not in talk.wanted


def test_the_energy_for_the_way_home_is_that_of_the_way_around_it_while_the_aircraft_hovers() -> None:
    talk = reached(State.SEARCHING)
    talk.pass_by(1.0)
    talk.flew(place(200.0, 95.0))
    talk.tick()
    straight_s = talk.core.reserve.energy.home.seconds
    talk.on(MapChanged(GRID.excluding(box(105.0, 5.0, 125.0, 130.0))))
    talk.tick()
    around_s = talk.core.reserve.energy.home.seconds
    assert around_s > straight_s + 5.0
    lat, lon = place(200.0, 90.0)
    talk.shows(home=Home(lat, lon, 400.0))
    talk.tick()
    assert talk.core.reserve.energy.home.seconds < straight_s


def test_taken_back_it_may_be_flown_over_again() -> None:
    talk = under_way()
    talk.on(MapChanged(wall()))
    talk.on(MapChanged(GRID))
    assert talk.core.chart.leg_allowed(HERE, place(200.0, 120.0))


def test_an_exclusion_keeps_its_mass_and_only_its_ground_is_not_flown_over() -> None:
    grid = wall()
    assert np.array_equal(grid.prior, GRID.prior)
    assert np.array_equal(grid.searchable, GRID.searchable)
    lost = GRID.flyable & ~grid.flyable
    assert 0 < lost.sum() < 12


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ((-300.0, -300.0, 600.0, 600.0), "leaves no cell to fly over"),
        ((-40.0, -10.0, -2.0, 30.0), "the launch point lies in an exclusion"),
    ],
)
def test_an_exclusion_that_leaves_no_way_is_refused(corners: Any, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        GRID.excluding(box(*corners))


def texts(talk: Talk) -> list[str]:
    """What the pilot was told so far."""
    return [effect.text for effect in talk.wanted if isinstance(effect, Tell)]


@pytest.mark.parametrize(
    ("state", "settings"), [(State.HOLDING, None), (State.FOUND, {"search": {"on_found": "hover"}})]
)
def test_who_hovers_over_it_is_told_to_people(state: State, settings: Any) -> None:
    talk = reached(state, settings)
    talk.wanted.clear()
    talk.on(MapChanged(GRID.excluding(box(20.0, 20.0, 60.0, 60.0))))
    assert texts(talk) == []
    talk.on(MapChanged(GRID.excluding(box(180.0, 30.0, 220.0, 70.0))))
    assert texts(talk) == [f"search {state}: it hovers over ground that is excluded now"]
    assert "it hovers over ground that is excluded now" in talk.core.standing.why


def test_what_is_cut_off_is_told_to_the_pilot_once() -> None:
    talk = under_way()
    grid = GRID.excluding(box(90.0, 10.0, 110.0, 140.0))
    (note,) = grid.layout_notes[len(GRID.layout_notes) :]
    talk.on(MapChanged(grid))
    talk.on(MapChanged(replace(grid)))
    assert [each for each in texts(talk) if "cut off" in each] == [f"search SEARCHING: {note}"]


def test_told_on_the_ground_between_two_sorties_the_next_one_keeps_clear_of_it() -> None:
    talk = reached(State.GROUNDED)
    talk.on(MapChanged(wall()))
    assert talk.state == State.GROUNDED
    talk.happens(Event.AIRBORNE)
    talk.wanted.clear()
    talk.pass_by(2.0)
    talk.done()
    talk.pass_by(2.0)
    assert not talk.core.chart.leg_allowed(HERE, place(200.0, 120.0))
    assert not [each for each in sent(talk) if not talk.core.chart.leg_allowed(HERE, each.point)]


def test_told_while_it_takes_off_over_it_the_aircraft_leaves_by_the_nearest_way() -> None:
    talk = reached(State.TAKEOFF)
    talk.on(MapChanged(GRID.excluding(box(180.0, 30.0, 220.0, 70.0))))
    assert talk.state == State.TAKEOFF
    talk.tick()
    takes_off(talk)
    talk.flew()
    talk.tick()
    assert talk.state == State.SEARCHING
    talk.wanted.clear()
    talk.pass_by(1.0)
    talk.done()
    talk.pass_by(4.0)
    (first, *_) = sent(talk)
    assert first.on_way
    assert not talk.core.chart.too_near(first.point)


SQUARE = [(0.0, 0.0), (0.001, 0.0), (0.001, 0.001), (0.0, 0.001), (0.0, 0.0)]


def test_two_parts_whose_transit_is_cut_are_not_both_flown() -> None:
    """The ground between them is crossed, and not searched: what closes it gives one of them up."""
    rings = [[[8.3 + lon + by, 47.05 + lat] for lon, lat in SQUARE] for by in (0.0, 0.002)]
    feature = {
        "type": "Feature",
        "properties": {},
        "geometry": {"type": "MultiPolygon", "coordinates": [[r] for r in rings]},
    }
    area = {"type": "FeatureCollection", "features": [feature]}
    grid = build_grid(parse_area(json.dumps(area).encode(), source="parts"), 10.0)
    assert grid.flyable[grid.searchable].all()
    across = shapely.box(8.3014, 47.0495, 8.3016, 47.0515)
    cut = grid.excluding(across)
    assert 0.45 < float(cut.prior[cut.flyable].sum()) < 0.55
    assert cut.cut_off

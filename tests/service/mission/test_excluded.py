"""Ground that is excluded in flight counts for the leg that is being flown and for the very next one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from service.area import Grid
from service.errors import BadInput
from service.mavlink.events import Home
from service.mission.effects import DropThought, SendWaypoint, Stop, Tell, Think
from service.mission.news import MapChanged, Order
from service.mission.states import State
from tests.service.mission.flown import GRID, HERE, Talk, place, reached, searching


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
    assert [e.text for e in talk.wanted if isinstance(e, Tell)] == [
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

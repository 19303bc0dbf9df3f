"""Where the aircraft may be sent, and what happens when it is where it must not be."""

from __future__ import annotations

import shapely

from service.config import FlightSettings
from service.mission.fence import Fence, Straying, height_objection

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

"""Home, the estimator's origin and sea level: they move."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.events import ReferenceMoved

from .peer import ALT, GROUND, LAT, LON, Rig


def home(rig: Rig, lat: float, alt: float, set_at: int = 0) -> None:
    """HOME_POSITION from somewhere else."""
    place = (round(lat * 1e7), round(LON * 1e7), round(alt * 1000))
    rig.say(
        rig.peer.pack(
            mavlink.MAVLink_home_position_message(
                *place, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, set_at
            )
        )
    )


def moved(rig: Rig) -> list[Any]:
    return [(event.what, event.before.alt_amsl_m, event.after.alt_amsl_m) for event in rig.of(ReferenceMoved)]


def test_home_that_moves_is_told_with_both_values_once_two_messages_agree() -> None:
    rig = Rig().flying()
    rig.peer.home = False
    home(rig, LAT, GROUND + 47.0)
    assert rig.of(ReferenceMoved) == [], "one message is not believed"
    home(rig, LAT, GROUND + 47.0)
    assert moved(rig) == [("home", GROUND, GROUND + 47.0)]
    home(rig, LAT + 0.001, GROUND + 47.0)
    home(rig, LAT + 0.001, GROUND + 47.0)
    assert rig.of(ReferenceMoved)[-1].after.lat == LAT + 0.001


def test_a_home_that_is_stamped_with_when_it_was_set_is_told_as_well() -> None:
    """PX4 repeats it with one stamp, and what has the stamp of the one before was not listened to."""
    rig = Rig().flying()
    rig.peer.home = False
    home(rig, LAT, GROUND + 47.0, set_at=77)
    home(rig, LAT, GROUND + 47.0, set_at=77)
    assert moved(rig) == [("home", GROUND, GROUND + 47.0)]


@pytest.mark.parametrize("first", ["origin", "position"])
def test_an_origin_that_is_told_once_is_believed_where_the_position_jumps_with_it(first: str) -> None:
    """PX4 tells it when it changes, and not again."""
    rig = Rig().flying()
    rig.positioning = False

    def origin(lat: float) -> None:
        rig.say(
            rig.peer.pack(
                mavlink.MAVLink_gps_global_origin_message(round(lat * 1e7), round(LON * 1e7), 489_000, 5)
            )
        )

    def position(lat: float) -> None:
        rig.now += 0.2
        place = (round(lat * 1e7), round(LON * 1e7), round(ALT * 1000), 20_000, 0, 0, 0, 9000)
        rig.say(rig.peer.pack(mavlink.MAVLink_global_position_int_message(rig.peer.boot_ms(rig.now), *place)))

    origin(LAT)
    position(LAT)
    for what in ("origin", "position") if first == "origin" else ("position", "origin"):
        assert rig.of(ReferenceMoved) == []
        (origin if what == "origin" else position)(LAT + 0.001)
    assert [(event.what, event.position_too) for event in rig.of(ReferenceMoved)] == [("origin", True)]


def test_a_single_home_that_is_nonsense_is_no_event() -> None:
    rig = Rig().flying()
    home(rig, LAT, 5000.0)
    rig.run(5.0)
    assert rig.of(ReferenceMoved) == []


def test_a_correction_of_sea_level_is_told() -> None:
    rig = Rig().flying()
    t = rig.core.telemetry
    assert t.home_alt_amsl_m == GROUND
    for _ in range(2):
        rig.now += 0.1
        rig.say(
            rig.peer.pack(
                mavlink.MAVLink_global_position_int_message(
                    rig.peer.boot_ms(rig.now),
                    round(LAT * 1e7),
                    round(LON * 1e7),
                    round((ALT + 20.0) * 1000),
                    20_000,
                    0,
                    0,
                    0,
                    9000,
                )
            )
        )
    assert moved(rig) == [("sea level", GROUND, GROUND + 20.0)]


def test_an_origin_that_moves_is_told() -> None:
    rig = Rig().flying()
    for lat in (LAT, LAT, LAT + 0.01, LAT + 0.01):
        rig.say(
            rig.peer.pack(
                mavlink.MAVLink_gps_global_origin_message(round(lat * 1e7), round(LON * 1e7), 489_000)
            )
        )
    assert [event.what for event in rig.of(ReferenceMoved)] == ["origin"]


def test_a_climb_moves_nothing() -> None:
    rig = Rig().flying()
    for height in range(20, 120):
        rig.peer.height = float(height)
        rig.run(0.1)
    assert rig.of(ReferenceMoved) == []


def position(rig: Rig, amsl: float, over_home: float, climb: float = 0.0) -> None:
    """GLOBAL_POSITION_INT, a tenth of a second later."""
    rig.now += 0.1
    rig.say(
        rig.peer.pack(
            mavlink.MAVLink_global_position_int_message(
                rig.peer.boot_ms(rig.now),
                round(LAT * 1e7),
                round(LON * 1e7),
                round(amsl * 1000),
                round(over_home * 1000),
                0,
                0,
                round(-climb * 100),
                9000,
            )
        )
    )


def test_a_home_that_is_moved_in_the_air_does_not_move_the_height_that_is_flown_at() -> None:
    rig = Rig().flying()
    position(rig, GROUND + 20.0, 20.0)
    for lifted in (-8.0, 12.0, 0.0):
        for _ in range(2):
            position(rig, GROUND + 20.0, 20.0 - lifted)
            t = rig.core.telemetry
            assert (t.alt_home_m, t.home_alt_amsl_m, t.home_lifted_m) == (20.0, GROUND, lifted)
    position(rig, GROUND + 21.0, 21.0, climb=2.0)
    assert moved(rig) == []  # the sea has not moved, and home is told by its own message


def test_a_correction_of_sea_level_moves_the_height_that_is_flown_at() -> None:
    rig = Rig().flying()
    position(rig, GROUND + 20.0, 20.0)
    position(rig, GROUND + 28.0, 20.0)
    position(rig, GROUND + 28.2, 20.2, climb=2.0)
    t = rig.core.telemetry
    assert (t.alt_home_m, t.home_lifted_m) == (20.2, 0.0)
    assert abs(t.home_alt_amsl_m - (GROUND + 8.0)) < 1e-6


def test_a_home_that_moves_is_told_from_a_correction_after_a_gap_in_a_climb() -> None:
    rig = Rig().flying()
    position(rig, GROUND + 20.0, 20.0, climb=2.0)
    rig.now += 1.9
    position(rig, GROUND + 24.0, 14.0, climb=2.0)  # two seconds later, home ten metres higher
    assert rig.core.telemetry.alt_home_m == 24.0
    rig.now += 1.9
    position(rig, GROUND + 38.0, 18.0, climb=2.0)  # and all things ten metres higher
    assert rig.core.telemetry.alt_home_m == 28.0


def test_home_that_is_set_anew_on_the_ground_is_what_heights_are_over() -> None:
    rig = Rig()
    rig.peer.landed = 1
    rig.run(2.0)
    position(rig, GROUND, 5.0)
    position(rig, GROUND, 0.0)
    t = rig.core.telemetry
    assert (t.alt_home_m, t.home_alt_amsl_m, t.home_lifted_m) == (0.0, GROUND, 0.0)


@pytest.mark.parametrize(
    ("origin", "position", "too"), [(0.001, 0.001, True), (0.001, 0.0, False), (0.001, -0.001, False)]
)
def test_an_origin_that_moves_is_compared_with_the_position(
    origin: float, position: float, too: bool
) -> None:
    rig = Rig().flying()
    rig.say(
        rig.peer.pack(mavlink.MAVLink_gps_global_origin_message(round(LAT * 1e7), round(LON * 1e7), 489_000))
    )
    rig.run(2.0)
    rig.peer.lat += position
    rig.run(2.0)
    there = round((LAT + origin) * 1e7), round(LON * 1e7), 489_000
    for _ in range(2):
        rig.say(rig.peer.pack(mavlink.MAVLink_gps_global_origin_message(*there)))
        rig.run(1.0)
    assert [(event.what, event.position_too) for event in rig.of(ReferenceMoved)] == [("origin", too)]


def test_a_home_that_was_moved_is_not_forgotten_when_the_landed_state_stops() -> None:
    rig = Rig().flying()
    rig.positioning = False
    position(rig, GROUND + 20.0, 20.0)
    position(rig, GROUND + 20.0, 28.0)
    rig.peer.silent = {"landed"}
    for _ in range(120):
        position(rig, GROUND + 20.0, 28.0)
        rig.run(0.1)
    t = rig.core.telemetry
    assert (t.landed_state, t.alt_home_m, t.home_lifted_m) == ("undefined", 20.0, -8.0)

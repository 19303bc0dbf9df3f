"""What the vehicle tells is old, wrong, missing or doubled, what it counts from moves, and others take it: by name.

Short flights of the real service; each goes through several faults, one after the other, with the search in between.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.integration.scene import Scene, flight

pytestmark = pytest.mark.timeout(400)
HEIGHT_M = 15.0
Faults = list[tuple[str, dict[str, Any], str]]


def at_boot(folder: Path, kind: str, **options: Any) -> tuple[str, str]:
    """The mock's words for a fault that is there from the start."""
    path = folder / "faults.toml"
    lines = [f"{key} = {json.dumps(value)}" for key, value in {"kind": kind, "at": 0.0, **options}.items()]
    path.write_text("\n".join(["[[fault]]", *lines, ""]), encoding="utf-8")
    return ("--faults", str(path))


def goes_on(scene: Scene) -> None:
    """Two more waypoints are sent, and the search is never interrupted; a false alarm may be looked at."""
    rows = len(scene.transitions())
    scene.moves_again()
    scene.moves_again()
    since = {row.body["to"] for row in scene.transitions()[rows:]}
    assert since <= {"SEARCHING", "CONFIRMING"}, scene.service.said


DOUBTFUL: dict[str, Faults] = {
    "px4": [
        ("stream_stops", {"message": "GLOBAL_POSITION_INT"}, "no new position"),
        ("stream_freezes", {"message": "GLOBAL_POSITION_INT", "stamp": "stands"}, "no new position"),
        ("home_datum", {"metres": 47.0}, "m above the sea as told"),
        (
            "field",
            {"message": "GLOBAL_POSITION_INT", "field": "lat", "value": 2147483647.0},
            "no new position",
        ),
    ],
    "ardupilot": [
        ("stream_stops", {"message": "GPS_RAW_INT,GPS2_RAW"}, "GPS is not heard any longer"),
        ("field", {"message": "EXTENDED_SYS_STATE", "field": "landed_state", "value": 1.0}, "is in the air"),
        ("one_way", {"carries": "up"}, "the autopilot is silent"),
        (
            "field_shifts",
            {"message": "GLOBAL_POSITION_INT", "field": "alt", "by": 20_000.0},
            "as the position says",
        ),
    ],
}


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_what_is_told_no_longer_or_cannot_be_holds_the_search_until_it_passes(
    flavor: str, tmp_path: Path
) -> None:
    with flight(tmp_path, flavor, speedup=4.0, silent_after_s=60.0) as scene:
        scene.searching()
        for kind, options, words in DOUBTFUL[flavor]:
            scene.control.fault(kind, **options)
            scene.reaches("HOLDING", words)
            scene.control.clear(kind)
            scene.reaches("SEARCHING")
            scene.moves_again()


HARMLESS: dict[str, Faults] = {
    "px4": [
        ("second_gps", {"fix": 1}, ""),
        ("second_estimator", {"flags": 831}, ""),
        ("distance_sensor", {"rise": 4.0}, ""),
        ("origin_moved", {"north": 100.0}, "origin has moved"),
    ],
    "ardupilot": [
        ("field", {"message": "GLOBAL_POSITION_INT", "field": "hdg", "value": 65535.0}, ""),
        ("field", {"message": "ATTITUDE", "field": "time_boot_ms", "value": 4294967295.0, "times": 1}, ""),
        ("field", {"message": "GLOBAL_POSITION_INT", "field": "vx", "value": 32767.0}, ""),
        ("stream_freezes", {"message": "ATTITUDE", "stamp": "moves"}, ""),
        ("second_gps", {"fix": 0}, ""),
        ("terrain_report", {"rise": 4.0}, ""),
    ],
}


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_what_says_nothing_about_the_flight_does_not_touch_it(flavor: str, tmp_path: Path) -> None:
    with flight(tmp_path, flavor, speedup=4.0, silent_after_s=60.0) as scene:
        scene.searching()
        for kind, options, words in HARMLESS[flavor]:
            scene.control.fault(kind, **options)
            goes_on(scene)
            if words:
                scene.service.wait_for(words)
            scene.control.clear(kind)


@pytest.mark.parametrize(
    ("flavor", "kind", "options"),
    [("px4", "home_moved", {"up": -8.0}), ("ardupilot", "amsl_corrected", {"metres": 8.0})],
)
def test_the_height_over_the_ground_stays_when_what_it_is_counted_from_moves(
    flavor: str, kind: str, options: dict[str, float], tmp_path: Path
) -> None:
    with flight(tmp_path, flavor, speedup=4.0, silent_after_s=60.0) as scene:
        scene.searching()
        scene.control.fault(kind, **options)
        for _ in range(6):
            goes_on(scene)
            scene.fly(2.0)
            assert scene.control.state()["above_ground"] == pytest.approx(HEIGHT_M, abs=3.0)
        scene.control.clear(kind)
        goes_on(scene)


TAKEN: dict[str, Faults] = {
    "px4": [
        ("gcs_goes", {"north": 40.0, "east": 30.0}, "sends the aircraft to"),
        ("gcs_altitude", {"by": 10.0}, "sends the aircraft to"),
        ("gcs_speed", {"mps": 2.0}, "commands the aircraft"),
        ("gcs_pauses", {}, "sends the aircraft to"),
        ("gcs_velocity", {"north": 2.0, "east": 0.0}, "the pilot or the autopilot selected"),
        ("pilot_hold", {"way": "flick"}, "the pilot or the autopilot selected"),
        ("failsafe_hold", {"then": "recovers"}, "failsafe"),
    ],
    "ardupilot": [
        ("gcs_goes", {"north": 40.0, "east": 30.0}, "sends the aircraft to"),
        ("second_service", {"every_s": 3.0, "component": 191}, "sends the aircraft to"),
        ("gcs_pauses", {}, "commands the aircraft"),
        ("gcs_velocity", {"north": 2.0, "east": 0.0}, "commands the aircraft"),
        ("pilot_hold", {"way": "again"}, "the pilot or the autopilot selected LOITER"),
    ],
}


def takes(scene: Scene, kind: str, options: dict[str, Any]) -> None:
    """Somebody takes it, and tries again where the aircraft did not obey: a target that ours overtakes before the
    autopilot has named it, which it does twice a second, is one that nobody has heard of."""
    for _ in range(4):
        scene.control.fault(kind, **options)
        scene.fly(4.0)
        if scene.state() == "YIELDED":
            return
        scene.control.clear(kind)


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_who_takes_the_aircraft_has_it_until_an_operator_resumes(flavor: str, tmp_path: Path) -> None:
    with flight(tmp_path, flavor, speedup=5.0, silent_after_s=60.0) as scene:
        scene.searching()
        for kind, options, words in TAKEN[flavor]:
            takes(scene, kind, options)
            scene.reaches(
                "YIELDED", words, "sends the aircraft to"
            )  # a mode that holds has a target of its own
            scene.fly(1.0)  # what was on its way already
            scene.sends_nothing(6.0)
            scene.control.clear(kind)
            assert scene.order("resume") == "SEARCHING"
            scene.reaches("SEARCHING")
            scene.moves_again()


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("second_battery", {"percent": 12.0}, "battery at 12 %"),
        ("battery_drains", {"percent_per_s": 3.0}, "battery"),
        ("battery_unknown", {}, "reckoned since it is not told any longer"),
    ],
)
def test_a_battery_that_is_low_or_not_told_leads_home(
    kind: str, options: dict[str, Any], words: str, tmp_path: Path
) -> None:
    with flight(tmp_path, options=("--endurance", "10")) as scene:
        scene.searching()
        scene.control.fault("battery", percent=50.0)
        scene.fly(3.0)
        scene.control.fault(kind, **options)
        if kind == "battery_unknown":
            scene.service.wait_for("the battery's level is not told any longer")
            state = scene.door.get("/api/state").json()
            assert "reckoned" in state["battery_doubt"]
        scene.reaches("RETURNING", words)


def test_a_vehicle_of_the_old_protocol_is_flown(tmp_path: Path) -> None:
    options = at_boot(tmp_path, "mavlink1")
    with flight(tmp_path, "ardupilot", speedup=4.0, silent_after_s=60.0, options=options) as scene:
        scene.searching()
        goes_on(scene)


def test_arming_that_is_refused_for_a_while_is_tried_again(tmp_path: Path) -> None:
    with flight(tmp_path, options=at_boot(tmp_path, "arming_refused")) as scene:
        scene.service.wait_for("not armed yet")
        scene.control.clear("arming_refused")
        scene.searching()


@pytest.mark.parametrize(
    ("flavor", "kind", "options", "words"),
    [
        ("px4", "no_message", {"message": "EXTENDED_SYS_STATE"}, "does not tell whether it is in the air"),
        ("px4", "one_way", {"carries": "down"}, "the link may carry only one way"),
        ("ardupilot", "command_refused", {}, "does not know DO_REPOSITION"),
    ],
)
def test_what_a_vehicle_lacks_is_said_before_the_ground_is_left(
    flavor: str,
    kind: str,
    options: dict[str, Any],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ROISEARCH_LINK_CONNECT_TIMEOUT_S", "30")
    with flight(tmp_path, flavor, options=at_boot(tmp_path, kind, **options)) as scene:
        code, report = scene.ends()
        assert code == 4, scene.service.said
        assert words in report["stopped_because"], report
        assert not scene.control.state()["armed"]
        assert "MAV_CMD_NAV_TAKEOFF" not in [name for _, name in scene.tap.motions]

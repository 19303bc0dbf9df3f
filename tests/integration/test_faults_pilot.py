"""The pilot and the autopilot's own failsafes always win: nothing that moves the aircraft is sent against them."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest

from service.mavlink.modes import mode_title
from tests.integration.scene import Scene, flight

pytestmark = pytest.mark.timeout(300)
WALL_SLACK_S = 0.5


def quiet_within_a_second_of(scene: Scene, began: float) -> None:
    """Nothing moved the aircraft a second of vehicle time (and a busy host's slack) after `began`, or later."""
    late = began + 1.0 / scene.speedup + WALL_SLACK_S
    assert [name for at, name in scene.tap.motions if at > late] == [], scene.service.said


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_a_pilots_mode_change_stops_all_motion_until_an_operator_resumes(flavor: str, tmp_path: Path) -> None:
    with flight(tmp_path, flavor, speedup=5.0) as scene:
        scene.searching()
        scene.control.fault("pilot")
        began = time.monotonic()
        row = scene.reaches("YIELDED", "the pilot or the autopilot selected")
        scene.fly(20.0)
        quiet_within_a_second_of(scene, began)
        assert scene.state() == "YIELDED"
        assert mode_title(scene.control.state()["mode"]) in row.body["reason"]
        assert any(text.startswith("search YIELDED") for text in scene.tap.texts)
        scene.control.clear("pilot")
        assert scene.order("resume") == "SEARCHING"
        scene.moves_again()


def test_a_pilots_sticks_stop_all_motion(tmp_path: Path) -> None:
    with flight(tmp_path, "px4", speedup=5.0) as scene:
        scene.searching()
        scene.control.fault("pilot", mode="keep", pitch=0.8)
        began = time.monotonic()
        scene.reaches("YIELDED", "Position")
        scene.fly(15.0)
        quiet_within_a_second_of(scene, began)


def test_a_pilot_who_stops_the_climb_is_not_an_error(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot") as scene:
        scene.reaches("TAKEOFF")
        until_up(scene, 3.0)
        scene.control.fault("pilot", mode="LOITER")
        scene.reaches("YIELDED", "LOITER")
        scene.sends_nothing(10.0)
        scene.control.clear("pilot")
        assert scene.order("resume") == "SEARCHING"
        scene.moves_again()


def until_up(scene: Scene, height_m: float) -> None:
    """Wait until the aircraft is so high."""
    deadline = time.monotonic() + 30.0
    while scene.control.state()["up"] < height_m:
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
@pytest.mark.parametrize("height_m", [-1.0, 4.0])
def test_a_hold_ends_a_take_off_where_it_is(flavor: str, height_m: float, tmp_path: Path) -> None:
    with flight(tmp_path, flavor, speedup=2.0) as scene:
        scene.reaches("TAKEOFF")
        while "TAKEOFF" not in str(scene.tap.motions[-1:]):
            time.sleep(0.005)
        until_up(scene, height_m)
        assert scene.order("hold") == "HOLDING"
        scene.fly(25.0)
        assert scene.control.state()["up"] < 11.0
        if height_m < 0.0:
            assert not scene.control.state()["armed"]


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_a_hold_right_after_the_order_to_return_ends_the_return(flavor: str, tmp_path: Path) -> None:
    with flight(tmp_path, flavor, speedup=2.0) as scene:
        scene.searching()
        assert scene.order("return") == "RETURNING"
        while "RETURN" not in str(scene.tap.motions[-1:]):
            time.sleep(0.005)
        assert scene.order("hold") == "HOLDING"
        scene.fly(15.0)
        assert scene.control.state()["mode"] in ("AUTO_LOITER", "GUIDED")
        assert scene.state() == "HOLDING"


@pytest.mark.parametrize(
    ("flavor", "kind", "options", "words"),
    [
        ("ardupilot", "failsafe", {"text": "Critical battery failsafe"}, "Critical battery failsafe"),
        ("px4", "fence_breach", {}, "fence"),
    ],
)
def test_the_autopilots_own_return_is_left_alone_and_ends_the_run(
    flavor: str, kind: str, options: dict[str, str], words: str, tmp_path: Path
) -> None:
    with flight(tmp_path, flavor) as scene:
        scene.searching()
        scene.control.fault(kind, **options)
        scene.reaches("YIELDED", "RTL", "Return", "the autopilot's failsafe sends the aircraft")
        motions = len(scene.tap.motions)
        code, report = scene.ends()
        assert scene.tap.motions[motions:] == []
    assert code == 4
    assert report["outcome"] == "aborted"
    assert words in report["stopped_because"]


def test_a_reboot_in_flight_is_told_and_answered_by_nothing_that_moves(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot") as scene:
        scene.searching()
        scene.control.fault("reboot")
        scene.reaches("YIELDED")
        motions = len(scene.tap.motions)
        code, report = scene.ends()
        assert scene.tap.motions[motions:] == []
    assert code == 4
    assert "rebooted" in report["stopped_because"] or "disarmed" in report["stopped_because"]


def test_a_signal_does_not_take_the_aircraft_from_the_pilot(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", speedup=5.0) as scene:
        scene.searching()
        scene.control.fault("pilot", mode="LOITER")
        scene.reaches("YIELDED", "LOITER")
        motions = len(scene.tap.motions)
        scene.service.process.send_signal(signal.SIGTERM)
        code, report = scene.ends()
        assert scene.tap.motions[motions:] == []
        assert scene.control.state()["mode"] == "LOITER"
    assert (code, report["outcome"]) == (4, "aborted")

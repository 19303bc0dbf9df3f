"""A position that is not to be trusted: nothing is sent, nothing is believed, and the search comes back by itself."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.integration.scene import Scene, flight

pytestmark = pytest.mark.timeout(300)


def test_a_short_loss_of_gps_holds_and_passes(tmp_path: Path) -> None:
    with flight(tmp_path, speedup=4.0) as scene:
        scene.searching()
        scene.control.fault("gps_lost", seconds=2.5)
        held = scene.reaches("HOLDING", "the GPS has no 3D fix", "calls not healthy: GPS")
        again = scene.reaches("SEARCHING", "the position is good again")
        assert scene.commands(held, again) == ["brake"]  # and no stop, which would be a place
        scene.moves_again()


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_an_aircraft_that_has_lost_its_gps_stands_and_does_not_fly_on(flavor: str, tmp_path: Path) -> None:
    """By where it truly is: one flew on to its last waypoint at 5.6 m/s, since nobody sent a stop."""
    with flight(tmp_path, flavor, speedup=4.0) as scene:
        scene.searching()
        scene.control.fault("gps_lost", seconds=20.0, reckons_s=30.0)
        scene.reaches("HOLDING", "the GPS has no 3D fix", "calls not healthy: GPS")
        scene.fly(8.0)
        speeds = []
        for _ in range(4):
            speeds.append(scene.control.state()["speed"])
            scene.fly(1.0)
        assert max(speeds) < 1.0
        scene.reaches("SEARCHING", "the position is good again")
        scene.moves_again()


def test_a_jump_of_the_position_holds_and_what_is_reported_meanwhile_is_not_believed(tmp_path: Path) -> None:
    with flight(tmp_path, settle_s=40.0) as scene:
        scene.searching()
        scene.map()  # the first takes a second or two, in which ten times as much is flown
        scene.control.fault("gps_jump", north=40.0)
        held = scene.reaches("HOLDING", "the position jumped by")
        scene.fly(6.0)  # it brakes, by its autopilot's own means; told again while that is not acknowledged
        before, refused = scene.map(), reports(scene)["refused"]
        scene.sends_nothing(20.0)
        assert scene.map()["digest"] == before["digest"]
        assert reports(scene)["refused"] > refused
        again = scene.reaches("SEARCHING", "the position is good again")
        assert scene.commands(held, again) == ["brake"]
        scene.moves_again()
        wait_for_another_look(scene, before["digest"])


def test_an_unhealthy_estimate_holds_and_passes(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot") as scene:
        scene.searching()
        unhealthy = mavlink.MAVLink_ekf_status_report_message(1 | 4 | 32 | 128, 2.0, 2.0, 0.1, 0.1, 0.0)
        while scene.state() == "SEARCHING":  # the autopilot itself says the contrary all the time
            scene.tap.say(unhealthy)
        scene.reaches("HOLDING", "estimate is not healthy")
        scene.reaches("SEARCHING", "the position is good again")
        scene.moves_again()


@pytest.mark.parametrize(
    ("flavor", "kind", "mode"), [("px4", "gps_lost", "Land"), ("ardupilot", "ekf_bad", "LAND")]
)
def test_the_autopilots_own_landing_without_a_position_is_not_disturbed(
    flavor: str, kind: str, mode: str, tmp_path: Path
) -> None:
    with flight(tmp_path, flavor) as scene:
        scene.searching()
        scene.control.fault(kind)
        scene.reaches("YIELDED", f"selected {mode}")
        motions = len(scene.tap.motions)
        code, report = scene.ends()
        assert scene.tap.motions[motions:] == []
    assert code == 4
    assert mode in report["stopped_because"]


def test_a_search_goes_on_after_an_estimate_that_was_bad_for_a_while(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot") as scene:
        scene.searching()
        scene.control.fault("ekf_bad", seconds=3.0)
        scene.reaches("YIELDED", "LAND")
        deadline = time.monotonic() + 20.0
        while scene.order("resume") != "SEARCHING":
            assert time.monotonic() < deadline, scene.service.said
        scene.moves_again()


def reports(scene: Scene) -> dict[str, int]:
    """How many reports were accepted and refused."""
    counts: dict[str, int] = scene.door.get("/api/state").json()["reports"]
    return counts


def wait_for_another_look(scene: Scene, digest: str) -> None:
    """Wait until the belief has changed: what is reported now is believed again."""
    deadline = time.monotonic() + 60.0
    while scene.map()["digest"] == digest:
        assert time.monotonic() < deadline, scene.service.said
        time.sleep(0.1)

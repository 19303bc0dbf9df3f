"""Faults of the link, with the real service on a real socket: silence, bad packets, lost answers, strangers."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.integration.scene import TARGET, flight

pytestmark = pytest.mark.timeout(300)


def test_a_silent_autopilot_is_waited_for_and_nothing_is_sent_blindly(tmp_path: Path) -> None:
    with flight(tmp_path) as scene:
        scene.searching()
        scene.control.fault("link_lost", seconds=60.0)
        scene.reaches("HOLDING", "the autopilot is silent")
        scene.sends_nothing(15.0)
        scene.reaches("SEARCHING")  # the reason is that of the last cause to go: the link, or the position
        scene.moves_again()


def test_a_bad_radio_does_not_keep_the_search_from_its_target(tmp_path: Path) -> None:
    """The other autopilot's flights have such radios in the soak."""
    trouble = {"drop": 0.1, "corrupt": 0.1, "reorder": 0.2, "duplicate": 0.2, "delay_s": 0.1}
    with flight(tmp_path, "ardupilot", speedup=5.0, target=TARGET) as scene:
        scene.control.fault("packets", **trouble)
        code, report = scene.ends()
        assert code == 0, scene.service.said
    assert report["outcome"] == "found"
    assert report["position"]["lat"] == pytest.approx(47.0508, abs=3e-4)


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_over_a_link_that_has_become_slow_nothing_is_flown(flavor: str, tmp_path: Path) -> None:
    """All that it carries looks fresh: heartbeats come each second, and are as old as the link is slow."""
    with flight(tmp_path, flavor, speedup=4.0, silent_after_s=60.0) as scene:
        scene.searching()
        scene.control.fault("packets", delay_s=5.0)
        scene.reaches("HOLDING", "the link takes", "the autopilot is silent")
        scene.fly(20.0)
        assert scene.state() == "HOLDING"
        assert scene.door.get("/api/state").json()["link"]["round_trip_s"] > 8.0
        scene.sends_nothing(10.0)
        scene.control.clear("packets")
        scene.reaches("SEARCHING", "good again", "is heard again")
        scene.moves_again()


def test_lost_acknowledgements_do_not_keep_the_search_from_its_target(tmp_path: Path) -> None:
    with flight(tmp_path, target=TARGET) as scene:
        scene.control.fault("acks_lost")
        code, _ = scene.ends()
        assert code == 0, scene.service.said


def test_a_waypoint_that_is_accepted_and_not_flown_holds_until_an_operator_resumes(tmp_path: Path) -> None:
    with flight(tmp_path, "px4") as scene:
        scene.searching()
        scene.control.fault("not_flown")
        scene.reaches("HOLDING", "waypoint")  # not taken over, or no progress towards it
        scene.fly(20.0)
        assert scene.state() == "HOLDING"
        scene.control.clear("not_flown")
        assert scene.order("resume") == "SEARCHING"
        scene.moves_again()
        before = scene.door.get("/api/state").json()["steps"]
        scene.fly(20.0)
        assert scene.door.get("/api/state").json()["steps"] > before


def test_a_frozen_autopilot_that_still_heartbeats_is_not_steered(tmp_path: Path) -> None:
    with flight(tmp_path) as scene:
        scene.searching()
        scene.control.fault("frozen", seconds=60.0)
        reason = scene.reaches("HOLDING").body["reason"]  # for whichever of its streams is old first
        assert "no new position" in reason or "any longer" in reason, reason
        scene.fly(9.0)  # it is told to brake, a few times, as it does not answer
        scene.sends_nothing(15.0)
        scene.reaches("SEARCHING", "the position is good again")
        scene.moves_again()


def test_other_voices_on_the_link_change_nothing(tmp_path: Path) -> None:
    with flight(tmp_path, target=TARGET) as scene:
        scene.control.fault("gcs_heartbeat")
        scene.control.fault("camera_heartbeat")
        scene.reaches("TAKEOFF")
        scene.control.fault("second_autopilot", sysid=42, north=5000.0)
        code, report = scene.ends()
        assert code == 0, scene.service.said
        states = [row.body["to"] for row in scene.transitions() if row.body["to"] != "CONFIRMING"]
    assert not {"HOLDING", "YIELDED"} & set(states)
    assert report["position"]["lat"] == pytest.approx(47.0508, abs=3e-4)

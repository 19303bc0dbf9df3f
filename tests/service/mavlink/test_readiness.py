"""When a vehicle counts as ready to arm."""

from __future__ import annotations

import pytest

from .peer import Rig


def ready_after(rig: Rig, seconds: float) -> bool:
    rig.run(seconds)
    return rig.core.telemetry.ready_to_arm


def test_ready_to_arm_only_once_the_check_has_stayed_healthy() -> None:
    rig = Rig()
    rig.peer.prearm = False
    rig.say(rig.peer.heartbeat())
    assert not ready_after(rig, 10.0)
    rig.peer.prearm = True
    assert not ready_after(rig, 4.0)
    assert ready_after(rig, 3.0)
    rig.peer.prearm = False
    assert not ready_after(rig, 1.5)


@pytest.mark.parametrize(
    ("flavor", "text"),
    [("ardupilot", "PreArm: Need Position Estimate"), ("px4", "Preflight Fail: ekf2 missing data")],
)
def test_complaint_of_the_vehicle_outweighs_its_healthy_bit(flavor: str, text: str) -> None:
    rig = Rig(flavor)
    rig.say(rig.peer.heartbeat())
    assert ready_after(rig, 10.0)
    rig.say(rig.peer.text(text, 2))
    assert not ready_after(rig, 3.0)
    assert ready_after(rig, 4.0)


@pytest.mark.parametrize("lacking", ["position", "home", "fix", "status"])
def test_not_ready_without_position_home_fix_and_a_fresh_status(lacking: str) -> None:
    rig = Rig()
    rig.positioning = lacking != "position"
    rig.peer.home = lacking != "home"
    rig.peer.fix = 2 if lacking == "fix" else 3
    rig.say(rig.peer.heartbeat())
    rig.run(12.0)
    if lacking == "status":
        assert rig.core.telemetry.ready_to_arm
        rig.beating = False
        rig.run(8.0)
    assert not rig.core.telemetry.ready_to_arm

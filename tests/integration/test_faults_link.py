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
        scene.reaches("SEARCHING", "heard again")
        scene.moves_again()

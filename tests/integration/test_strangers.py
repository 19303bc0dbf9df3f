"""The flight beside all that strangers do at the doors, against the same flight undisturbed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from sim.soak.attacks import KINDS
from sim.soak.strangers import measure

MOSQUITTO = shutil.which("mosquitto") or Path("/usr/sbin/mosquitto").exists()


@pytest.mark.timeout(900)
def test_the_flight_does_not_feel_what_strangers_do(tmp_path: Path) -> None:
    """In one process, the gap in the heartbeat grew by eight seconds, and a Hold waited for nine."""
    kinds = [kind for kind in KINDS if kind != "MQTT" or MOSQUITTO]
    for name in ("quiet", "attacked"):
        (tmp_path / name).mkdir()
    quiet = measure(tmp_path / "quiet", [], holds=2, side_m=400.0)
    attacked = measure(tmp_path / "attacked", kinds, holds=3, side_m=400.0)
    assert attacked.acknowledged
    assert (attacked.lost, attacked.twice) == (0, 0)
    assert attacked.gap_s < 3.0 * quiet.gap_s
    # two cores carry the flight, its doors, the attackers and other tests: the quickest Hold tells of the mechanism
    assert min(attacked.holds) < quiet.hold_s + quiet.gap_s

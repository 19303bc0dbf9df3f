"""The control socket of a mock process."""

from __future__ import annotations

import time

import pytest

from sim.autopilot.control import Control
from tests.fixtures_autopilot import StartAutopilot, flavor, start_autopilot

__all__ = ["flavor", "start_autopilot"]

CONTROL = ("--control", "127.0.0.1:0")


def test_tells_the_state_and_takes_faults(start_autopilot: StartAutopilot, flavor: str) -> None:
    mock = start_autopilot(flavor, options=CONTROL)
    assert mock.control is not None
    with Control(mock.control) as control:
        state = control.state()
        assert (state["armed"], state["landed"], state["faults"]) == (False, "ON_GROUND", [])
        control.fault("gps_lost")
        control.fault("battery", percent=33.0)
        state = control.state()
        assert (state["faults"], state["battery_percent"]) == (["gps_lost"], 33)
        control.clear()
        assert control.state()["faults"] == []
        with pytest.raises(ValueError, match="no fault of kind"):
            control.fault("gremlins")
        with pytest.raises(ValueError, match="no 'dance'"):
            control.ask(dance=True)


def test_speed_is_changed_while_it_runs(start_autopilot: StartAutopilot) -> None:
    mock = start_autopilot("px4", options=CONTROL)
    assert mock.control is not None

    def pace(control: Control) -> float:
        began, start = time.monotonic(), control.state()["time"]
        time.sleep(0.5)
        gone: float = control.state()["time"] - start
        return gone / (time.monotonic() - began)

    with Control(mock.control) as control:
        slow = pace(control)
        control.speedup(20.0)
        assert pace(control) > 5.0 * slow

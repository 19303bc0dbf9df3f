"""The control socket of a mock process."""

from __future__ import annotations

import json
import time

import pytest

from sim.autopilot.control import Control, answer
from sim.autopilot.dialect import M
from sim.autopilot.faults import Fault
from sim.autopilot.settings import Settings
from sim.autopilot.transport import Driver
from tests.fixtures_autopilot import StartAutopilot, flavor, start_autopilot
from tests.sim.autopilot.hovering import Flight, flight

__all__ = ["flavor", "flight", "start_autopilot"]

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
        with pytest.raises(ValueError, match="waits is true or false"):
            control.ask(waits="perhaps")
        with pytest.raises(ValueError, match="no 'dance'"):
            control.ask(dance=True)


def test_another_vehicle_takes_its_place_on_the_same_line(flavor: str) -> None:
    """It speaks by its own name, has booted just now, has a full battery and knows nothing of what was told before."""
    flight = Flight(flavor, hovers=False, settings=Settings(flavor=flavor, seed=3, endurance_s=600.0))
    autopilot, other = flight.autopilot, "px4" if flavor == "ardupilot" else "ardupilot"
    autopilot.vehicle.battery.charge = 0.4
    autopilot.faults.add(Fault.of({"kind": "gps_lost"}))
    autopilot.replace(other, 7)
    flight.lockstep.drain()
    said = flight.heard(5.0)
    beats = [each for each in said if each.get_type() == "HEARTBEAT" and each.get_srcComponent() == 1]
    kinds = {"px4": M.MAV_AUTOPILOT_PX4, "ardupilot": M.MAV_AUTOPILOT_ARDUPILOTMEGA}
    assert {(each.get_srcSystem(), each.autopilot) for each in beats} == {(7, kinds[other])}
    assert autopilot.vehicle.time < 6.0
    assert (autopilot.vehicle.battery.percent, autopilot.faults.active) == (100, [])


def test_a_vehicle_in_the_air_is_not_replaced(flight: Flight) -> None:
    with pytest.raises(ValueError, match="replaced on the ground, with its motors off"):
        flight.autopilot.replace("px4", 7)


@pytest.mark.parametrize(
    ("words", "wrong"),
    [({"flavor": "px4"}, "wants a flavor and a sysid"), ({"flavor": "paper", "sysid": 7}, "no flavor 'paper'"),
     ({"flavor": "px4", "sysid": 0}, "sysid is from 1 to 255")],
)  # fmt: skip
def test_a_replacement_that_there_is_not_is_refused(words: object, wrong: str) -> None:
    flight = Flight("px4", hovers=False)
    reply = answer(flight.autopilot, json.dumps({"replace": words}).encode(), Driver([], 1.0))
    assert wrong in reply["error"]


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

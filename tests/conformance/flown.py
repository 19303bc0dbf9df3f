"""Facts that were learnt in whole flights with the real autopilots and not by the probe, held as exchanges too.

Flown with ArduCopter 4.7 and PX4 1.16 in their own simulators, by the service. `FLOWN` has what they did.
"""

from __future__ import annotations

from collections.abc import Callable

from tests.conformance.compare import Facts
from tests.conformance.wire import mav
from tests.sim.autopilot.hovering import Flight


def speed_before_the_first_waypoint(d: Flight) -> Facts:
    """A speed asked for after take-off and before the first waypoint; then once more after it."""
    d.long(mav.MAV_CMD_DO_CHANGE_SPEED, 1, 3, -1)
    leg = d.go(60, 0)
    facts: Facts = {"asked_before_peak_mps": leg.motion()["peak_speed_mps"]}
    d.long(mav.MAV_CMD_DO_CHANGE_SPEED, 1, 3, -1)
    return facts | {"asked_after_peak_mps": d.go(0, 0).motion()["peak_speed_mps"]}


def speed_after_another_mode(d: Flight) -> Facts:
    """A speed that was obeyed, then a pilot's mode and the guided one again: is it still obeyed?"""
    d.go(5, 0)
    d.long(mav.MAV_CMD_DO_CHANGE_SPEED, 1, 3, -1)
    d.fault("pilot")
    d.listen(2.0)
    d.autopilot.faults.clear("pilot")
    d.guided()
    d.listen(2.0)
    return {"peak_mps": d.go(65, 0).motion()["peak_speed_mps"]}


def hold_while_it_flies(d: Flight) -> Facts:
    """The pilot's Hold in the middle of a leg: does the mode change, and is the leg flown to its end?"""
    leg = d.go(60, 0, wait=0)
    d.listen(4.0)
    mode = d.mode
    d.fault("pilot_hold")
    d.listen(20.0)
    return {"mode_changes": d.mode != mode, "leg_is_flown": leg.remaining < 3.0}


def arming_before_the_estimator(d: Flight) -> Facts:
    """Arm while the ready bit is set and the estimator is not ready; it is a few seconds later."""
    d.select("AUTO_RTL" if d.px4 else "LAND")
    d.wait(lambda: not d.armed, 120.0)
    d.guided()
    d.fault("arming_refused", seconds=3.0)
    facts: Facts = {"ack": d.long(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)}
    facts["says_why"] = d.said("Need Position Estimate") if not d.px4 else d.said("Resolve system health")
    d.listen(3.5)
    return facts | {"later_ack": d.long(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)}


def fix_lost_on_a_leg(d: Flight) -> Facts:
    """The fix is lost on a leg and nothing is sent: PX4 goes on to its last waypoint."""
    leg = d.go(60, 0, wait=0)
    d.listen(4.0)
    d.fault("gps_lost", reckons_s=20.0)
    d.listen(12.0)
    return {"leg_is_flown": leg.remaining < 3.0}


Exchange = Callable[[Flight], Facts]

FLOWN: dict[str, dict[Exchange, Facts]] = {
    "px4": {
        hold_while_it_flies: {"mode_changes": False, "leg_is_flown": True},
        arming_before_the_estimator: {"ack": ["TEMPORARILY_REJECTED"], "says_why": True, "later_ack": ["ACCEPTED"]},
        fix_lost_on_a_leg: {"leg_is_flown": True},
    },
    "ardupilot": {
        # asked for 3 m/s the real one flew 6.5 to 7.7 over short legs and up to 9.9 over long ones
        speed_before_the_first_waypoint: {"asked_before_peak_mps": 8.5, "asked_after_peak_mps": 3.0},
        speed_after_another_mode: {"peak_mps": 8.5},
        hold_while_it_flies: {"mode_changes": True, "leg_is_flown": False},
        arming_before_the_estimator: {"ack": ["FAILED"], "says_why": True, "later_ack": ["ACCEPTED"]},
    },
}  # fmt: skip

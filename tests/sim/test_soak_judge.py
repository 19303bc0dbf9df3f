"""The judge of the soak on the wire: it is not blind, and it lets a search be."""

from __future__ import annotations

import math
import time
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.soak import ground
from sim.soak.cli import by_kind
from sim.soak.flight import Outcome
from sim.soak.judge import OPERATOR, Judge
from sim.soak.plan import draw_plan

PX4_HOLD, PX4_POSCTL = 4 << 16 | 3 << 24, 3 << 16


class Wire:
    """Frames for a judge, who has seen the search begin."""

    def __init__(self, *, hill: bool = False) -> None:
        self.judge = Judge("px4", 10.0, hill=hill)
        self.mode(PX4_HOLD)
        self.at(200.0, 50.0)
        self.battery(80)
        self.state("SEARCHING")

    def state(self, name: str) -> None:
        text = f"search {name}: for a test"
        self.judge.from_service(_from_us(mavlink.MAVLink_statustext_message(6, text.encode())), self.now)

    @property
    def now(self) -> float:
        return time.monotonic()

    def mode(self, custom_mode: int, ago_s: float = 0.0) -> None:
        message = mavlink.MAVLink_heartbeat_message(2, 12, 209, custom_mode, 4, 3)
        self.judge.from_autopilot(_from_autopilot(message), self.now - ago_s)

    def at(self, east: float, north: float) -> None:
        lon, lat = ground.ring([(east, north)])[0]
        message = mavlink.MAVLink_global_position_int_message(
            1, round(lat * 1e7), round(lon * 1e7), 415000, 15000, 0, 0, 0, 0
        )
        self.judge.from_autopilot(_from_autopilot(message), self.now)

    def battery(self, percent: int, ago_s: float = 0.0) -> None:
        message = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 15000, 0, percent, *(0,) * 6)
        self.judge.from_autopilot(_from_autopilot(message), self.now - ago_s)

    def says(self, command: int) -> list[str]:
        """A command of the service's; what the judge says."""
        before = len(self.judge.violations)
        message = mavlink.MAVLink_command_long_message(1, 1, command, 0, 1.0, *(0.0,) * 6)
        self.judge.from_service(_from_us(message), self.now)
        return self.judge.violations[before:]

    def goes(self, east: float, north: float, height: float = 15.0, param2: float = 0.0) -> list[str]:
        """Send the aircraft there; what the judge says."""
        lon, lat = ground.ring([(east, north)])[0]
        amsl = ground.GROUND_AMSL_M + height
        message = mavlink.MAVLink_command_int_message(
            1, 1, 0, 192, 0, 0, -1.0, param2, 0.0, 0.0, round(lat * 1e7), round(lon * 1e7), amsl
        )
        before = len(self.judge.violations)
        self.judge.from_service(_from_us(message), self.now)
        return self.judge.violations[before:]

    def named(self, east: float, north: float, height: float = 15.0, *, over_home: bool = False) -> None:
        """The autopilot names its target."""
        lon, lat = ground.ring([(east, north)])[0]
        frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT if over_home else mavlink.MAV_FRAME_GLOBAL_INT
        amsl = height if over_home else ground.GROUND_AMSL_M + height
        message = mavlink.MAVLink_position_target_global_int_message(
            0, frame, 0, round(lat * 1e7), round(lon * 1e7), amsl, *(0.0,) * 8
        )
        self.judge.from_autopilot(_from_autopilot(message), self.now)


def _from_autopilot(message: Any) -> Any:
    return _decoded(message, 1, 1)


def _from_us(message: Any) -> Any:
    return _decoded(message, 1, 191)


def _decoded(message: Any, system: int, component: int) -> Any:
    writer = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    (decoded,) = mavlink.MAVLink(None).parse_buffer(message.pack(writer))
    return decoded


def test_the_judge_lets_a_search_be() -> None:
    wire = Wire()
    assert wire.goes(220.0, 50.0) == []
    wire.state("HOLDING")
    assert wire.goes(205.0, 50.0) == wire.goes(205.0, 50.0) == []
    wire.state("RETURNING")
    assert wire.goes(-10.0, 50.0) != []  # straight through the pond
    assert wire.goes(130.0, 20.0) == []


def test_the_judge_knows_when_somebody_elses_target_has_reached_the_autopilot() -> None:
    wire = Wire()
    wire.goes(220.0, 50.0)
    assert not wire.judge.goes_elsewhere()  # nothing is named yet
    for over_home in (False, True):
        wire.named(220.0, 50.0, over_home=over_home)
        assert not wire.judge.goes_elsewhere()
        wire.named(220.0, 50.0, 35.0, over_home=over_home)
        assert wire.judge.goes_elsewhere()
    wire.named(240.0, 50.0)
    assert wire.judge.goes_elsewhere()
    wire.goes(240.0, 50.0)
    assert not wire.judge.goes_elsewhere()


def test_the_judge_keeps_what_went_over_the_wire_before_a_violation() -> None:
    wire = Wire()
    assert wire.judge.wire == []
    wire.named(220.0, 50.0)
    wire.state("YIELDED")
    wire.goes(220.0, 50.0)
    kept = "\n".join(wire.judge.wire)
    assert "POSITION_TARGET_GLOBAL_INT" in kept
    assert "COMMAND_INT" in kept


def test_ground_that_is_excluded_in_flight_is_judged_until_that_is_taken_back() -> None:
    wire = Wire()
    assert wire.goes(190.0, 40.0) == []
    wire.judge.excluded(wire.now - 5.0)
    (said,) = wire.goes(190.0, 40.0)
    assert "in the marsh" in said
    wire.judge.excluded(math.inf)
    assert wire.goes(190.0, 40.0) == []


@pytest.mark.parametrize("state", ["READY", "TAKEOFF", "YIELDED", "DONE"])
def test_the_judge_sees_motion_in_a_state_that_may_not_move(state: str) -> None:
    wire = Wire()
    wire.state(state)
    (said,) = wire.goes(220.0, 50.0)
    assert "not in this state" in said


@pytest.mark.parametrize(
    ("there", "words"),
    [
        ((320.0, 50.0), "outside the area"),
        ((40.0, 50.0), "crosses the pond"),
        ((220.0, 50.0, 45.0), "45.0 m above home"),
        ((220.0, 50.0, 15.0, 1.0), "may change the mode"),
    ],
)
def test_the_judge_sees_a_waypoint_outside_the_limits(there: tuple[float, ...], words: str) -> None:
    (said,) = Wire().goes(*there)
    assert words in said


def test_the_judge_sees_a_second_stop_and_one_that_is_none() -> None:
    wire = Wire()
    wire.state("HOLDING")
    assert wire.goes(205.0, 50.0) == []
    assert "a second stop" in wire.goes(215.0, 50.0)[0]
    wire.state("SEARCHING")
    wire.state("HOLDING")
    assert "a stop far away" in wire.goes(20.0, 10.0)[0]


def test_the_judge_sees_motion_against_the_pilot() -> None:
    wire = Wire()
    wire.mode(PX4_POSCTL, ago_s=5.0)
    said = wire.goes(220.0, 50.0)
    assert any("the pilot has had the aircraft" in each for each in said)
    wire.mode(PX4_HOLD)
    assert any("the pilot has had the aircraft" in each for each in wire.goes(220.0, 50.0))
    wire.judge.ordered(wire.now)
    assert wire.goes(220.0, 50.0) == []


def test_the_judge_knows_the_stops_that_need_no_position() -> None:
    nan = float("nan")
    nowhere = mavlink.MAVLink_command_long_message(1, 1, 192, 0, -1.0, 0.0, 0.0, nan, nan, nan, nan)
    still = mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0, *[0.0] * 11)
    moving = mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0, 0, 0, 0, 2.0, *[0.0] * 7)
    for message, allowed in ((nowhere, True), (still, True), (moving, False)):
        for state in ("HOLDING", "YIELDED"):
            wire = Wire()
            wire.state(state)
            wire.judge.from_service(_from_us(message), wire.now)
            assert (wire.judge.violations == []) == (allowed and state == "HOLDING")


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
@pytest.mark.parametrize("armed", [False, True])
def test_the_judge_knows_the_question_that_moves_nothing(flavor: str, armed: bool) -> None:
    wire = Wire()
    wire.judge = Judge(flavor, 10.0)
    base = 1 | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    wire.judge.from_autopilot(
        _from_autopilot(mavlink.MAVLink_heartbeat_message(2, 12, base, 4, 4, 3)), wire.now
    )
    probe = mavlink.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1.0, 0.0, 0.0, 0.0, 950_000_000, 0, 0.0)
    wire.judge.from_service(_from_us(probe), wire.now)
    assert (wire.judge.violations == []) == (flavor == "ardupilot" and not armed)
    assert not wire.judge.motions


@pytest.mark.parametrize("by", [OPERATOR, "a ground station's target"])
def test_the_judge_sees_motion_after_a_persons_stop(by: str) -> None:
    wire = Wire()
    wire.judge.stopped(wire.now, by)
    assert wire.goes(220.0, 50.0) == []  # it was on its way already
    wire.judge.stopped(wire.now - 5.0, by)
    (said,) = wire.goes(220.0, 50.0)
    assert f"after a person's stop ({by})" in said
    wire.judge.ordered(wire.now)
    assert wire.goes(220.0, 50.0) == []


def test_a_persons_stop_outlives_the_process() -> None:
    wire = Wire()
    wire.judge.stopped(wire.now - 5.0, OPERATOR)
    wire.judge.started_over()
    wire.state("TAKEOFF")
    (said,) = wire.says(mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
    assert "after a person's stop" in said
    wire = Wire()
    wire.mode(PX4_POSCTL, ago_s=5.0)
    wire.judge.started_over()
    assert wire.judge.is_stopped
    wire.mode(PX4_HOLD)
    wire.state("SEARCHING")
    assert any("the pilot has had the aircraft" in each for each in wire.goes(220.0, 50.0))


def test_an_operators_hold_still_lets_it_stop_and_fly_home_and_a_pilot_nothing() -> None:
    wire = Wire()
    wire.judge.stopped(wire.now - 5.0, OPERATOR)
    wire.state("HOLDING")
    assert wire.goes(205.0, 50.0) == []
    wire.state("RETURNING")
    assert wire.goes(130.0, 20.0) == []
    wire.judge.stopped(wire.now - 5.0, "the pilot")
    assert "after a person's stop" in wire.goes(130.0, 20.0)[0]


def test_the_judge_sees_a_flight_on_an_unknown_battery() -> None:
    wire = Wire()
    wire.battery(80, ago_s=20.0)  # 200 s of the vehicle's: 37 % are left at least
    assert wire.goes(220.0, 50.0) == []
    wire = Wire()
    wire.judge._level = None  # nothing on the wire unsays a level, and every wire begins with one
    assert "no level was ever told" in wire.goes(220.0, 50.0)[0]
    wire.battery(30, ago_s=10.0)
    (said,) = wire.goes(220.0, 50.0)
    assert "flew on an unknown battery: 30 % were told 100 s ago" in said
    wire.battery(-1)
    assert wire.goes(220.0, 50.0) != []
    wire.battery(80)
    assert wire.goes(220.0, 50.0) == []
    wire.state("TAKEOFF")
    assert wire.says(mavlink.MAV_CMD_NAV_TAKEOFF) == []
    wire.battery(80, ago_s=20.0)
    assert "took off on an unknown battery" in wire.says(mavlink.MAV_CMD_NAV_TAKEOFF)[0]


def test_the_judge_sees_an_aircraft_closer_than_allowed() -> None:
    wire = Wire()
    wire.judge.steady = True
    later = wire.now + 10.0

    def is_at(east: float, north: float, up: float, when: float = later) -> list[str]:
        lon, lat = ground.ring([(east, north)])[0]
        before = len(wire.judge.violations)
        wire.judge.truth(up, (lat, lon), when)
        return wire.judge.violations[before:]

    assert is_at(200.0, 50.0, 15.0) == []
    assert is_at(200.0, 50.0, 5.0, wire.now) == []  # it has not reached its height yet
    assert is_at(200.0, 50.0, 5.0) == ["closer than allowed in SEARCHING: 5.0 m above the ground"]
    assert is_at(200.0, 50.0, 4.9) == []  # once is enough
    assert is_at(55.0, 50.0, 15.0) == []
    assert is_at(80.0, 50.0, 15.0) == ["closer than allowed in SEARCHING: over the pond"]
    assert is_at(200.0, 50.0, 15.0) == []
    wire.judge.steady = False  # somebody else flies it
    assert is_at(200.0, 50.0, 5.0) == []


def test_the_judge_sees_a_crash_once() -> None:
    wire = Wire()
    for _ in range(3):
        wire.judge.truth(0.0, ground.launch(), wire.now, crashed=True)
    assert wire.judge.violations == ["the aircraft has crashed in SEARCHING"]


@pytest.mark.parametrize(("mode", "seen"), [(PX4_HOLD, 1), (4 << 16 | 6 << 24, 0)], ids=["ours", "it lands"])
def test_a_landing_of_the_autopilots_own_by_a_position_that_jumps_is_nobody_elses_crash(
    mode: int, seen: int
) -> None:
    wire = Wire()
    wire.judge.during = "gps_jump"
    wire.mode(mode)
    wire.judge.truth(0.0, ground.launch(), wire.now, crashed=True)
    assert len(wire.judge.violations) == seen


def test_a_landing_where_it_is_is_for_an_autopilot_that_has_answered_the_return() -> None:
    wire = Wire()
    wire.state("RETURNING")
    assert "never answered" in wire.says(mavlink.MAV_CMD_NAV_LAND)[0]
    answer = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, 2)
    wire.judge.from_autopilot(_from_autopilot(answer), wire.now)
    assert wire.says(mavlink.MAV_CMD_NAV_LAND) == []
    wire.state("SEARCHING")
    assert wire.says(mavlink.MAV_CMD_NAV_LAND)


def test_violations_are_counted_by_the_fault_that_came_last() -> None:
    wire = Wire()
    wire.judge.during = "home_moved"
    wire.state("YIELDED")
    wire.goes(220.0, 50.0)
    outcome = Outcome(draw_plan(1, ground.BOUNDS, 1))
    outcome.violations = [*wire.judge.violations, "rows are missing"]
    assert by_kind([outcome]) == {"home_moved": 1, "the whole flight": 1}


def test_a_waypoint_is_judged_by_where_home_is_now() -> None:
    wire = Wire()
    message = mavlink.MAVLink_global_position_int_message(1, 0, 0, 435000, 15000, 0, 0, 0, 0)
    for _ in range(12):
        wire.judge.from_autopilot(_from_autopilot(message), wire.now)
    wire.judge._positions.clear()  # as if the old ones were long ago: this test has no clock of its own
    wire.at(200.0, 50.0)
    assert wire.goes(220.0, 50.0, height=35.0) == []  # home is 20 m higher than it was
    assert "above home" in wire.goes(220.0, 50.0, height=25.0)[0]
    # at 415 m it is 5 m above the ground: somebody has moved home, and not the sea level
    wire.judge.truth(5.0, (0.0, 0.0), wire.now)
    assert wire.goes(220.0, 50.0, height=25.0) == []


HILLTOP = (200.0, 80.0)


def test_over_a_hill_a_waypoint_is_judged_by_the_ground_there() -> None:
    wire = Wire(hill=True)
    assert wire.goes(*HILLTOP, height=26.0) == []
    assert wire.goes(*HILLTOP, height=18.0) == ["MAV_CMD_DO_REPOSITION in SEARCHING: 7.0 m above the ground"]
    assert wire.goes(40.0, 20.0, height=15.0) == []
    assert wire.goes(40.0, 20.0, height=80.0) != []


def test_over_a_hill_an_aircraft_is_judged_by_what_it_clears_and_home_is_not_the_hilltop() -> None:
    wire = Wire(hill=True)
    wire.judge.steady = True
    lon, lat = ground.ring([HILLTOP])[0]
    later = wire.now + 60.0
    wire.judge.truth(9.0, (lat, lon), later)
    assert wire.judge.violations == []
    wire.judge.truth(4.0, (lat, lon), later)
    assert wire.judge.violations == ["closer than allowed in SEARCHING: 4.0 m above the ground"]

"""How slow the link is: what comes late looks fresh, and is old."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.events import ModeChanged

from .peer import FLAVORS, Rig


def answers(rig: Rig, late_s: float, seconds: float) -> None:
    """Each question is answered so much later, for so long."""
    waiting: list[tuple[float, int]] = []
    for _ in range(round(seconds * 10)):
        before = len(rig.sent)
        rig.run(0.1)
        asked = [m for m in rig.sent[before:] if m.get_type() == "TIMESYNC"]
        waiting += [(rig.now + late_s, m.ts1) for m in asked]
        for _due, stamp in [each for each in waiting if each[0] <= rig.now + 1e-6]:
            rig.say(rig.peer.pack(mavlink.MAVLink_timesync_message(12345, stamp)))
        waiting = [each for each in waiting if each[0] > rig.now + 1e-6]


@FLAVORS
def test_the_round_trip_is_measured_once_a_second_and_forgotten_when_nobody_answers(flavor: str) -> None:
    rig = Rig(flavor).flying()
    assert rig.core.telemetry.round_trip_s is None
    before = len(rig.messages("TIMESYNC"))
    answers(rig, 0.3, 10.0)
    assert len(rig.messages("TIMESYNC")) - before == pytest.approx(10, abs=1)
    assert rig.core.telemetry.round_trip_s == pytest.approx(0.3, abs=0.11)
    answers(rig, 5.0, 10.0)
    assert rig.core.telemetry.round_trip_s == pytest.approx(5.0, abs=0.11)
    rig.run(12.0)
    assert rig.core.telemetry.round_trip_s is None


def test_the_autopilots_own_questions_and_others_answers_say_nothing() -> None:
    rig = Rig("px4").flying()
    rig.run(3.0)
    (*_, last) = rig.messages("TIMESYNC")
    rig.say(rig.peer.pack(mavlink.MAVLink_timesync_message(0, last.ts1)))
    rig.say(rig.peer.pack(mavlink.MAVLink_timesync_message(12345, last.ts1 + 1)))
    assert rig.core.telemetry.round_trip_s is None


def test_of_an_answer_that_comes_by_two_ways_the_faster_one_counts() -> None:
    rig = Rig("px4").flying()
    rig.run(1.0)
    (*_, last) = rig.messages("TIMESYNC")
    answer = mavlink.MAVLink_timesync_message(12345, last.ts1)
    rig.say(rig.peer.pack(answer))
    rig.run(4.0)
    rig.say(rig.peer.pack(answer))
    assert rig.core.telemetry.round_trip_s == pytest.approx(0.0, abs=1.1)


def test_an_answer_that_waited_while_we_stood_still_says_nothing_about_the_link() -> None:
    rig = Rig("px4").flying()
    answers(rig, 0.2, 5.0)
    (*_, last) = rig.messages("TIMESYNC")
    rig.now += 8.0
    rig.core.tick(rig.now)
    rig.say(rig.peer.pack(mavlink.MAVLink_timesync_message(12345, last.ts1)))
    assert rig.core.telemetry.round_trip_s in (None, pytest.approx(0.2, abs=0.11))


def test_a_link_that_is_heard_again_is_not_taken_for_a_fast_one_before_it_answers() -> None:
    rig = Rig("px4").flying()
    answers(rig, 0.2, 5.0)
    rig.beating = False
    rig.run(8.0)
    rig.beating = True
    rig.run(1.5)
    assert rig.core.telemetry.round_trip_s == math.inf
    answers(rig, 0.2, 2.0)
    assert rig.core.telemetry.round_trip_s == pytest.approx(0.2, abs=0.11)


def test_a_link_that_never_answered_is_not_waited_for() -> None:
    rig = Rig("ardupilot").flying()
    rig.beating = False
    rig.run(8.0)
    rig.beating = True
    rig.run(1.5)
    assert rig.core.telemetry.round_trip_s is None


@pytest.mark.parametrize(("late_s", "ours"), [(4.0, True), (0.2, False)])
def test_a_mode_that_we_asked_for_over_a_slow_link_is_ours_when_it_shows_late(
    late_s: float, ours: bool
) -> None:
    rig = Rig("ardupilot").flying()
    answers(rig, late_s, 12.0)
    rig.acking = True
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.say(rig.peer.ack(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, mavlink.MAV_RESULT_ACCEPTED))
    answers(rig, late_s, 7.0)
    rig.peer.mode = "RTL"
    rig.run(1.0)
    (*_, change) = rig.of(ModeChanged)
    assert change.commanded == ours

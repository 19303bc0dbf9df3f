"""Nothing that can be sent to a mock makes it fall over."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim.autopilot.core import Autopilot
from sim.autopilot.link import Link
from sim.autopilot.settings import Settings
from tests.conformance.wire import codec, mav

FLOATS = st.one_of(
    st.floats(width=32),
    st.sampled_from([0.0, 1.0, 2.0, 4.0, 6.0, 20.0, -1.0, math.nan, math.inf, -math.inf, 21196.0]),
)
INT32 = st.integers(-(2**31), 2**31 - 1)
COMMANDS = [16, 20, 21, 22, 176, 178, 179, 192, 207, 224, 246, 300, 400, 410, 510, 511, 512, 520, 31999]
FRAMES = st.integers(0, 11)


@st.composite
def messages(draw: st.DrawFn) -> Any:
    """A message a mock acts on, with any values in its fields."""

    def real(count: int) -> list[float]:
        return [draw(FLOATS) for _ in range(count)]

    number = draw(st.sampled_from(COMMANDS))
    match draw(st.integers(0, 7)):
        case 0:
            return mav.MAVLink_command_long_message(1, 1, number, 0, *real(7))
        case 1:
            place = draw(INT32), draw(INT32), draw(FLOATS)
            return mav.MAVLink_command_int_message(1, 1, draw(FRAMES), number, 0, 0, *real(4), *place)
        case 2:
            mask = draw(st.integers(0, 65535))
            head = (0, 1, 1, draw(FRAMES), mask, draw(INT32), draw(INT32))
            return mav.MAVLink_set_position_target_global_int_message(*head, *real(9))
        case 3:
            mask = draw(st.integers(0, 65535))
            return mav.MAVLink_set_position_target_local_ned_message(0, 1, 1, draw(FRAMES), mask, *real(11))
        case 4:
            name = draw(
                st.sampled_from([b"GF_ACTION", b"RTL_RETURN_ALT", b"FENCE_ACTION", b"MIS_TAKEOFF_ALT"])
            )
            return mav.MAVLink_param_set_message(1, 1, name, draw(FLOATS), 9)
        case 5:
            kind = draw(st.integers(0, 2))
            return mav.MAVLink_mission_count_message(1, 1, draw(st.integers(0, 3)), kind)
        case 6:
            seq, kind = draw(st.integers(0, 3)), draw(st.integers(0, 2))
            command = draw(st.sampled_from([16, 18, 19, 20, 21, 22, 178, 5001, 5003]))
            place = draw(INT32), draw(INT32), draw(FLOATS)
            return mav.MAVLink_mission_item_int_message(
                1, 1, seq, draw(FRAMES), command, 0, 1, *real(4), *place, kind
            )
        case _:
            number = draw(st.integers(0, 2**32 - 1))
            return mav.MAVLink_set_mode_message(1, 1, number)


def hovering(flavor: str) -> tuple[Autopilot, Link]:
    """A mock in the air that tells all it can."""
    autopilot = Autopilot(Settings(flavor=flavor, ready_after_s=1.0))
    link = autopilot.add_link()
    autopilot.advance(100)
    autopilot.firmware.arm("Armed")
    body = autopilot.vehicle.body
    body.up, body.on_ground, autopilot.vehicle.flew = 20.0, False, True
    autopilot.firmware.set_mode(autopilot.firmware.flavor.guided_mode, autopilot.firmware.holding())
    for number in (24, 30, 31, 32, 33, 74, 87, 141, 147, 230, 242, 245, 1, 2, 42):
        link.set_interval(number, 100_000)
    return autopilot, link


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(sent=st.lists(messages(), min_size=1, max_size=6))
def test_no_message_makes_it_fall_over(flavor: str, sent: list[Any]) -> None:
    autopilot, link = hovering(flavor)
    sender = codec()
    for message in sent:
        autopilot.receive(link, message.pack(sender))
        autopilot.advance(40)
    body = autopilot.vehicle.body
    assert all(map(math.isfinite, (body.north, body.east, body.up, body.yaw)))
    link.outbox.clear()
    autopilot.advance(100)
    assert link.outbox or autopilot.steps < 300  # it may have been told to reboot


def test_no_bytes_make_it_fall_over() -> None:
    autopilot, link = hovering("px4")
    chance = random.Random(1)
    for _ in range(300):
        autopilot.receive(link, chance.randbytes(chance.randrange(1, 300)))
        autopilot.advance()
    assert link.outbox

"""The same exchanges with a mock process over a real socket, faster than real time.

In lockstep (test_conformance) nothing can come late. Here UDP, TCP, the event loop and the speed-up are in
the way, as they are for everybody else who uses the mock.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from sim.autopilot.process import AutopilotProcess
from tests.conformance.compare import differences, record
from tests.conformance.dialogue import Dialogue
from tests.conformance.exchanges import hold
from tests.conformance.wire import Socket

SPEEDUPS = (10.0, 2.5)
"""A busy host that stands still for 0.1 s costs a second of the vehicle's: what went otherwise is tried slower."""
NAMES = (
    "request_message",
    "message_interval",
    "parameters",
    "mode_commands",
    "command_sources",
    "mavlink1_frame",
    "garbage_bytes",
    "mission_protocol",
    "takeoff_20m",
    "telemetry_fields",
    "hop_20m",
    "train_corners",
    "setpoint_stream",
    "fence_reposition",
    "pilot_takeover",
    "sticks_lost",
    "rtl_land",
)


def test_mocks_answer_as_the_real_autopilots_over_sockets() -> None:
    """Both at a time: most of it is waiting."""
    links = {"px4": "udpin://127.0.0.1:0", "ardupilot": "tcpin://127.0.0.1:0"}
    with ThreadPoolExecutor() as both:
        wrong = list(both.map(differing, links, links.values()))
    assert wrong == [{}, {}]


def differing(flavor: str, url: str) -> dict[str, list[str]]:
    """What a mock process answers otherwise than the real one did, at every speed: by the names of the exchanges."""
    wrong = {name: ["not tried yet"] for name in NAMES}
    for speedup in SPEEDUPS:
        if wrong:
            wrong = at_speed(flavor, url, speedup, tuple(wrong))
    return wrong


def at_speed(flavor: str, url: str, speedup: float, names: tuple[str, ...]) -> dict[str, list[str]]:
    """What it answers otherwise in these exchanges, one after the other."""
    with AutopilotProcess(flavor, listen=(url, url), speedup=speedup, options=("--sysid", "7")) as mock:
        wire = Socket(mock.urls[0], mock.urls[1], speedup)
        dialogue = Dialogue(wire, flavor)
        dialogue.wait(lambda: dialogue.system, 60)
        told = {name: list(differences(record(flavor)[name], hold(dialogue, name))) for name in names}
        wire.close()
    return {name: lines for name, lines in told.items() if lines}

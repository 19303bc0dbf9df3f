"""The list of all exchanges, in the order they are run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tests.conformance import exchanges_flight, exchanges_ground, exchanges_modes, exchanges_motion
from tests.conformance.compare import Facts
from tests.conformance.dialogue import Dialogue

Exchange = Callable[[Dialogue], Facts]


@dataclass(frozen=True, slots=True)
class Entry:
    """One exchange: where the vehicle is to be (boot, ground, air) and what is said."""

    need: str
    hold: Exchange


_ground, _flight = exchanges_ground, exchanges_flight
_motion, _modes = exchanges_motion, exchanges_modes

EXCHANGES: dict[str, Entry] = {
    entry.hold.__name__: entry
    for entry in (
        Entry("boot", _ground.arm_before_ready),
        Entry("boot", _ground.discovery),
        Entry("boot", _ground.default_streams),
        Entry("boot", _ground.readiness),
        Entry("ground", _ground.request_message),
        Entry("ground", _ground.message_interval),
        Entry("ground", _ground.parameters),
        Entry("ground", _ground.wrong_target),
        Entry("ground", _ground.unknown_command),
        Entry("ground", _ground.mode_commands),
        Entry("ground", _ground.command_sources),
        Entry("ground", _ground.companion_heartbeat),
        Entry("ground", _ground.mavlink1_frame),
        Entry("ground", _ground.garbage_bytes),
        Entry("ground", _ground.mission_protocol),
        Entry("ground", _ground.reposition_disarmed),
        Entry("ground", _ground.takeoff_refused),
        Entry("ground", _ground.arm_and_wait),
        Entry("ground", _flight.takeoff_20m),
        Entry("air", _flight.telemetry_fields),
        Entry("air", _flight.disarm_airborne),
        Entry("air", _motion.hop_20m),
        Entry("air", _motion.hop_100m),
        Entry("air", _flight.reposition_frames),
        Entry("air", _flight.reposition_options),
        Entry("air", _flight.reposition_absurd),
        Entry("air", _flight.reposition_command_long),
        Entry("air", _motion.position_target),
        Entry("air", _motion.train_straight),
        Entry("air", _motion.train_corners),
        Entry("air", _motion.reversal),
        Entry("air", _motion.change_speed),
        Entry("air", _motion.altitude_step),
        Entry("air", _motion.heading),
        Entry("air", _modes.gcs_silence),
        Entry("air", _modes.setpoint_stream),
        Entry("air", _modes.fence_reposition),
        Entry("air", _modes.rtl_abort),
        Entry("air", _modes.pilot_takeover),
        Entry("air", _modes.stale_reposition),
        Entry("air", _modes.sticks_lost),
        Entry("air", _modes.land_and_abort),
        Entry("air", _modes.rtl_land),
        Entry("ground", _modes.takeoff_wrong_altitude),
    )
}


def hold(dialogue: Dialogue, name: str) -> Facts:
    """Bring the vehicle where an exchange starts, hold it, and return its facts."""
    entry = EXCHANGES[name]
    if entry.need == "ground":
        dialogue.on_ground()
    elif entry.need == "air":
        dialogue.in_air()
    dialogue.begin()
    if entry.need == "air":
        dialogue.origin_home()
    facts = entry.hold(dialogue)
    return {key: list(value) if isinstance(value, list) else value for key, value in facts.items()}

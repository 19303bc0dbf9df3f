"""What can be set on the link, with defaults that fit a telemetry radio as well as a cable."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

_SHORTEST_SILENCE_WALL_S = 0.75
_SHORTEST_ANSWER_WALL_S = 0.3


@dataclass(frozen=True, slots=True)
class MavlinkSettings:
    """Settings of one link. All times are in seconds of the service's clock."""

    system_id: int | None = None
    """Pair only with this MAVLink system; None pairs with the first autopilot heard."""
    component_id: int = 191
    """Our own component: MAV_COMP_ID_ONBOARD_COMPUTER."""
    allow_arming: bool = False
    """Whether this process may arm and take off at all (`--takeoff`, or the built-in mock)."""
    signing_key: bytes | None = field(default=None, repr=False)
    """32 bytes: sign everything (MAVLink 2 signing) and believe nothing that is not signed with it."""
    signing_timestamp_file: Path | None = None
    """Where the signing timestamp outlives a restart."""

    position_hz: float = 10.0
    attitude_hz: float = 10.0
    history_s: float = 120.0
    """How far back a pose can be looked up."""

    heartbeat_period_s: float = 1.0
    heartbeat_fresh_s: float = 2.0
    """Nothing that moves the aircraft is sent on a heartbeat older than this."""
    position_fresh_s: float = 2.0
    """Nothing that moves the aircraft is sent on a position older than this."""
    link_lost_s: float = 3.5
    """Silence after which the link counts as lost."""
    shortest_age_s: float = 0.0
    """No message counts as old sooner than this, whatever the table of sources says."""
    stall_s: float = 1.0
    """A pause of our own process after which everything known counts as old."""

    ack_timeout_s: float = 1.0
    command_attempts: int = 4
    in_progress_timeout_s: float = 10.0
    mode_window_s: float = 5.0
    """How long after a command a change to the mode it asks for counts as ours."""
    arming_patience_s: float = 0.0
    """How long arming is tried again when the vehicle refuses it."""
    wait_for_ever: bool = False
    """Whether a link that cannot be opened is tried again, and a vehicle that is not heard waited for, as long as that
    takes: it may be in the air."""
    ready_hold_s: float = 5.0
    """How long the pre-arm check must have stayed healthy (ArduPilot reports it healthy too early)."""

    target_timeout_s: float = 2.0
    target_attempts: int = 3
    target_tolerance_m: float = 2.0
    max_hop_m: float = 10_000.0
    """A target farther away than this is a mistake, not a waypoint."""
    max_height_change_m: float = 150.0
    """A target this much above or below the aircraft is an altitude in another reference, not a waypoint."""
    max_speed_mps: float = 30.0
    read_return_height: bool = False
    """Ask for the parameter that says how high the autopilot flies home."""
    read_motion: bool = False
    """Ask for those that say how fast it may fly, and how hard it may speed up."""

    def for_speedup(self, speedup: float) -> MavlinkSettings:
        """The same settings with no limit shorter than what a busy host may need in wall time.

        At 20 times real time, two seconds of silence are a tenth of a second on the wall: the pause of a
        compiler must not look like a lost aircraft. Unchanged at a speedup of 1.
        """
        silence, answer = _SHORTEST_SILENCE_WALL_S * speedup, _SHORTEST_ANSWER_WALL_S * speedup
        return replace(
            self,
            heartbeat_fresh_s=max(self.heartbeat_fresh_s, silence),
            position_fresh_s=max(self.position_fresh_s, silence),
            link_lost_s=max(self.link_lost_s, 1.5 * silence),
            shortest_age_s=max(self.shortest_age_s, silence) if speedup > 1.0 else self.shortest_age_s,
            stall_s=max(self.stall_s, silence),
            ack_timeout_s=max(self.ack_timeout_s, answer),
            mode_window_s=max(self.mode_window_s, 2 * silence),
            target_timeout_s=max(self.target_timeout_s, answer),
        )

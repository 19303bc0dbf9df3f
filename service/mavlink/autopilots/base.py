"""What the service has to know about an autopilot that MAVLink itself does not say.

One interface, two implementations (`px4`, `ardupilot`). Where a method has a body here, both real autopilots
were seen to behave that way.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.command import Command
from service.mavlink.events import Target
from service.mavlink.framing import Message
from service.mavlink.modes import ModeKind


class Autopilot(ABC):
    """The differences between autopilots, as seen by one aircraft."""

    name: ClassVar[str]
    title: ClassVar[str]
    guided_mode: ClassVar[str]
    """The mode that flies repositions."""
    guided_title: ClassVar[str]
    """What a ground station calls that mode."""
    take_over_advice: ClassVar[str] = ""
    """What the pilot must know to take over, when not every mode does it; fits into one STATUSTEXT."""
    takeoff_mode: ClassVar[str]
    """The mode the heartbeat shows during the climb."""
    return_mode: ClassVar[str]
    land_mode: ClassVar[str]
    stop_mode: ClassVar[str] = ""
    """A mode that only stops, where `brake` enters one beside the guided mode."""
    kinds: ClassVar[Mapping[str, ModeKind]]
    """Of every mode name that is not OTHER."""
    deceleration_mps2: ClassVar[float]
    """How hard it brakes for a reposition that is closer than it can stop."""
    answers_reposition: ClassVar[bool]
    """Its answer to DO_REPOSITION is true, and it denies a place that is not on earth."""
    not_ready_texts: ClassVar[tuple[str, ...]]
    """How a STATUSTEXT begins that says why it cannot be armed."""

    @abstractmethod
    def mode_name(self, base_mode: int, custom_mode: int) -> str:
        """Name of the mode in a HEARTBEAT; "UNKNOWN(...)" when there is none."""

    @abstractmethod
    def set_mode(self, mode: str) -> Command:
        """MAV_CMD_DO_SET_MODE."""

    @abstractmethod
    def take_off(self, height_m: float, home_alt_amsl_m: float) -> Command:
        """MAV_CMD_NAV_TAKEOFF to a height above home."""

    @abstractmethod
    def follows(self, previous: str, mode: str, *, armed: bool, climbed: bool) -> bool:
        """Whether `mode` comes by itself after `previous`, when we had commanded `previous`.

        Args:
            armed: it is armed now.
            climbed: it is as high as the take-off was to go.
        """

    @abstractmethod
    def refuses_reposition(self, result: int) -> bool:
        """Whether this MAV_RESULT of DO_REPOSITION really means that the target is not flown."""

    @abstractmethod
    def brake(self) -> Command:
        """Stop as fast as is sensible and stay, by the autopilot's own estimate: no position of ours is needed."""

    def break_off_climb(self) -> Command:
        """Stop a take-off that is under way, or about to begin: where it is, and on the ground if it is there still."""
        return self.set_mode(self.guided_mode)

    def stand_still(self, system: int, component: int) -> list[Message]:
        """What stops it in the guided mode when it refuses `brake`; nothing where there is no such thing."""
        return []

    def mode_kind(self, mode: str) -> ModeKind:
        """What this mode means to a search."""
        return self.kinds.get(mode, ModeKind.OTHER)

    def arm(self) -> Command:
        """MAV_CMD_COMPONENT_ARM_DISARM, never forced."""
        return Command(
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,), motion=True, goal_armed=True, label="arm"
        )

    def return_to_launch(self) -> Command:
        """MAV_CMD_NAV_RETURN_TO_LAUNCH."""
        return Command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, motion=True, goal_mode=self.return_mode)

    def land(self) -> Command:
        """MAV_CMD_NAV_LAND, here."""
        params = (0.0, 0.0, 0.0, math.nan, 0.0, 0.0, 0.0)
        return Command(mavlink.MAV_CMD_NAV_LAND, params, motion=True, goal_mode=self.land_mode)

    def change_speed(self, speed_mps: float) -> Command:
        """MAV_CMD_DO_CHANGE_SPEED, ground speed; it lasts until the next one."""
        params = (float(mavlink.SPEED_TYPE_GROUNDSPEED), speed_mps, -1.0)
        number, label = mavlink.MAV_CMD_DO_CHANGE_SPEED, f"{speed_mps:g} m/s"
        return Command(number, params, motion=True, label=label, speed_mps=speed_mps)

    def reposition(self, target: Target, system: int, component: int) -> Message:
        """MAV_CMD_DO_REPOSITION as COMMAND_INT, frame GLOBAL with AMSL altitude, and never a mode change.

        It is the one form that both understand. param2 = 0 leaves out MAV_DO_REPOSITION_FLAGS_CHANGE_MODE: in
        the pilot's mode, or on the way home, the aircraft then neither moves nor changes its mode. Yaw NaN
        turns the nose to the target.
        """
        return mavlink.MAVLink_command_int_message(
            system,
            component,
            mavlink.MAV_FRAME_GLOBAL,
            mavlink.MAV_CMD_DO_REPOSITION,
            0,
            0,
            -1.0,
            0.0,
            0.0,
            math.nan,
            round(target.lat * 1e7),
            round(target.lon * 1e7),
            target.alt_amsl_m,
        )

    def stopping_distance_m(self, speed_mps: float) -> float:
        """How far it flies on from this speed before it stands."""
        return speed_mps * speed_mps / (2.0 * self.deceleration_mps2)

    def says_not_ready(self, text: str) -> bool:
        """Whether a STATUSTEXT says that the vehicle cannot be armed."""
        return text.startswith(self.not_ready_texts)

    def holds_by_failsafe(self, mode: str, system_status: int, texts: Iterable[str]) -> bool:
        """Whether the guided mode is now the autopilot's own failsafe, and not ours any longer."""
        return False

    def looks_like_failsafe(self, mode: str, system_status: int, texts: Iterable[str]) -> bool:
        """Whether a change to `mode` that nobody commanded looks like the autopilot's own failsafe.

        A mode alone does not tell (a pilot returns home by switch, too): the vehicle must also call its state
        critical, or have spoken of a failsafe just before.
        """
        if self.mode_kind(mode) is ModeKind.GUIDED:
            return False
        critical = system_status in (mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY)
        return critical or any("failsafe" in text.lower() for text in texts)

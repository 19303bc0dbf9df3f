"""What a link remembers of its vehicle, the gates asked with it, and how anything leaves for it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink import gates
from service.mavlink.autopilots.base import Autopilot
from service.mavlink.boot import BootClock
from service.mavlink.command import Command, CommandBook
from service.mavlink.company import Company
from service.mavlink.control import Control
from service.mavlink.cruise import Cruise
from service.mavlink.events import (
    CommandDone,
    Refused,
    StatusText,
    Target,
    TargetNotTaken,
    VehicleEvent,
)
from service.mavlink.framing import Codec, Message, Receiver
from service.mavlink.heard import Heard
from service.mavlink.hearing import Hearing
from service.mavlink.history import PoseHistory
from service.mavlink.parameters import MOTION, RETURN_HEIGHT, Parameters
from service.mavlink.probe import NOWHERE, RepositionProbe
from service.mavlink.quality import LinkQuality
from service.mavlink.readiness import Readiness
from service.mavlink.references import References
from service.mavlink.roundtrip import RoundTrip
from service.mavlink.settings import MavlinkSettings
from service.mavlink.signing import Signer
from service.mavlink.streams import Streams
from service.mavlink.target import Strangers, TargetWatch
from service.mavlink.telemetry import Telemetry
from service.mavlink.texts import TextReader

_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_BEFORE_PAIRING_SYSTEM = 1
_TEXT_MEMORY_S = 10.0


class LinkMemory:
    """The state of one link, and its way out. `core.LinkCore` says what follows from what.

    Args:
        settings: rates, limits and time-outs.
        speaks_first: whether to send heartbeats before a vehicle was heard, so that the peer learns our
            address (a `udpout` link). Where we only listen, nothing is sent to anybody before that.
        codec: our own voice on the link, where there was another vehicle before; a new one by default.
    """

    def __init__(
        self, settings: MavlinkSettings, *, speaks_first: bool = False, codec: Codec | None = None
    ) -> None:
        self.settings = settings
        self.autopilot: Autopilot | None = None
        self._heard = Heard(settings)
        self.history = PoseHistory(settings.history_s)
        self.destination: Hashable = None
        """The source the vehicle is heard from; None before that."""
        self.rejected = ""
        """Why the last autopilot heard was not paired with, as a sentence's end."""
        self.bytes_received = 0
        self.messages_received = 0
        self.datagrams_dropped = 0
        """From other addresses than the vehicle's, while that was heard."""
        self.quality = LinkQuality()
        self._speaks_first = speaks_first
        self.codec = codec or _codec(settings)
        self._receiver = Receiver(self.codec)
        self._boot = BootClock()
        self._streams = Streams(())
        self._parameters = Parameters("", ())
        self._book = CommandBook(
            self._transmit,
            ack_timeout_s=settings.ack_timeout_s,
            attempts=settings.command_attempts,
            in_progress_timeout_s=settings.in_progress_timeout_s,
        )
        self._watch = TargetWatch(
            timeout_s=settings.target_timeout_s,
            attempts=settings.target_attempts,
            tolerance_m=settings.target_tolerance_m,
        )
        self._strangers = Strangers(settings.target_tolerance_m)
        self._company = Company()
        self._references = References()
        self._hearing = Hearing()
        self._round_trip = RoundTrip()
        self._probe = RepositionProbe()
        self._control = Control()
        self._cruise = Cruise()
        self._texts = TextReader()
        self._recent_texts: deque[StatusText] = deque(maxlen=20)
        self._outgoing: list[bytes] = []
        self._events: list[VehicleEvent] = []
        self._now: float | None = None
        self._stalled_at = -math.inf
        self._last_heard = -math.inf
        self._beat_at = -math.inf
        self._readiness = Readiness(settings)
        self._text_id = 0
        self._brake: int | None = None
        self._stop: Command | None = None
        """The last stop without a target; it is sent several times."""
        self._climbs = False
        """A take-off was ordered, and has not ended as far as is heard."""
        self._stop_sent = -math.inf
        """When a stop without a target was sent last, until a target is sent."""
        self._told_of: set[tuple[int, str]] = set()
        """Autopilots that were heard in the place of ours, while it was silent."""

    def _go_on_from(self, before: LinkMemory) -> None:
        """What is ours and not a vehicle's goes on: our clock, the numbers of commands and of texts, what was said."""
        self._now, self._stalled_at = before._now, before._stalled_at
        self._book.number_after(before._book)
        self._text_id, self._outgoing = before._text_id, before.data_to_send()

    def data_to_send(self) -> list[bytes]:
        """The frames to send now, in order, each to be one datagram; they are handed out once."""
        frames, self._outgoing = self._outgoing, []
        return frames

    @property
    def telemetry(self) -> Telemetry:
        """What can be believed of what the vehicle has said, as of the last call."""
        return self.telemetry_at(-math.inf if self._now is None else self._now)

    def telemetry_at(self, now: float) -> Telemetry:
        """What can be believed of it at a time."""
        return self._heard.view(now)

    @property
    def paired(self) -> bool:
        """Whether a vehicle that can be flown has been heard."""
        return self.autopilot is not None

    @property
    def in_control(self) -> bool:
        """Whether the aircraft is ours to move."""
        return self._control.held

    @property
    def target(self) -> Target | None:
        """The last target sent, unless it was given up."""
        return self._watch.target

    def recent_texts(self, since: float) -> list[StatusText]:
        """What the vehicle has said since then (the last 20 at most)."""
        return [text for text in self._recent_texts if text.time >= since]

    def missing(self) -> list[str]:
        """What this vehicle lacks that must be there before it leaves the ground, as sentences' ends."""
        return [*self._hearing.missing(self.telemetry.told), *self._probe.missing()]

    def why_not_command(self, now: float, *, ordered: bool = False) -> str | None:
        """Why nothing that moves the aircraft may be sent now, or None; `ordered` by an operator just now."""
        return gates.why_not_command(
            self.autopilot,
            self.telemetry,
            self.settings,
            now=now,
            stalled_at=self._stalled_at,
            ordered=ordered,
        )

    def why_not_reposition(self, now: float) -> str | None:
        """Why no target may be sent now, or None."""
        reason = self.why_not_command(now)
        if reason is not None or self.autopilot is None:
            return reason
        t = self.telemetry
        return gates.why_not_guided(self.autopilot, t) or gates.why_not_flying(t, self.settings, now=now)

    def _send_target(self, target: Target, now: float) -> None:
        assert self.autopilot is not None
        self._stop_sent = -math.inf
        self._strangers.sent(target, now)
        message = self.autopilot.reposition(target, self.telemetry.system_id, _AUTOPILOT)
        self._send(message, mavlink.MAV_CMD_DO_REPOSITION)

    @property
    def reposition_known(self) -> bool:
        """Whether it knows how to be sent somewhere has been asked for, as far as it can be."""
        return self.autopilot is not None and self._probe.settled(self.autopilot)

    def _ask_for_reposition(self, now: float) -> None:
        if self.autopilot is not None and self._probe.due(self.autopilot, self.telemetry, now):
            self._send(self.autopilot.reposition(NOWHERE, self.telemetry.system_id, _AUTOPILOT))

    def _give_up_target(self, reason: str, now: float) -> None:
        target, attempts = self._watch.target, self._watch.attempts
        if target is not None and not self._watch.taken:
            self._events.append(TargetNotTaken(now, target, attempts, reason))
        self._watch.clear()

    def _stop_repeating(self, reason: str, now: float) -> None:
        self._done(self._book.cancel(reason, now, only_motion=True))
        if not self._watch.taken:
            self._give_up_target(reason, now)

    def _stand_down(self, reason: str, now: float) -> None:
        """Control is lost: nothing that was under way is sent again."""
        self._done(self._book.cancel(reason, now, only_motion=True))
        self._give_up_target(reason, now)
        self._show_control()

    def _show_control(self) -> None:
        held, reason = self._control.held, self._control.reason
        if (self.telemetry.in_control, self.telemetry.control_reason) != (held, reason):
            self._heard.base = replace(self._heard.base, in_control=held, control_reason=reason)

    def _transmit(self, command: Command, confirmation: int) -> None:
        now = self._now
        assert now is not None
        if command.goal_mode is not None:
            until = now + self.settings.mode_window_s + self._round_trip.allowance_s(now)
            if self._control.asked_for(now) or command.goal_mode != self.telemetry.mode:
                self._strangers.look_away(until)
            self._control.expect(command.goal_mode, until)
        if command is self._stop:
            self._stop_sent = now
            self._strangers.start_over()
        if command.height_m is not None:
            self._control.climb_to(command.height_m)
            self._climbs = True
        if command.number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self._control.expect_armed(True, now + self.settings.mode_window_s)
        self._send(command.message(self.telemetry.system_id, _AUTOPILOT, confirmation), command.number)

    def _send(self, message: Message, command: int | None = None) -> None:
        frame = self.codec.encode(message)
        self._company.sent(frame, command, -math.inf if self._now is None else self._now)
        self._outgoing.append(frame)

    def _done(self, done: list[CommandDone]) -> None:
        for event in done:
            if event.ticket == self._brake:
                self._strangers.start_over()  # until now it may have named where it flew to before
                self._brake_again(event)
            if not self._streams.on_answer(event.ticket, refused=isinstance(event.outcome, Refused)):
                self._events.append(event)

    def _brake_again(self, done: CommandDone) -> None:
        """The stop was refused: stop in the guided mode, where the autopilot has a way to."""
        self._brake = None
        autopilot = self.autopilot
        if autopilot is None or not isinstance(done.outcome, Refused) or not self.telemetry.guided:
            return
        if self.why_not_command(done.time) is None:
            for message in autopilot.stand_still(self.telemetry.system_id, _AUTOPILOT):
                self._send(message)

    def _pop_events(self) -> list[VehicleEvent]:
        events, self._events = self._events, []
        return events

    def _lately_said(self, now: float) -> list[str]:
        return [text.text for text in self.recent_texts(now - _TEXT_MEMORY_S)]

    def _send_speed(self, speed_mps: float | None, now: float) -> None:
        if speed_mps is not None and self.autopilot is not None and self.why_not_command(now) is None:
            self._book.end(mavlink.MAV_CMD_DO_CHANGE_SPEED, "it is sent again", now)
            self._book.submit(self.autopilot.change_speed(speed_mps), now)

    def _parameters_of(self, autopilot: Autopilot) -> Parameters:
        """What is to be asked for of this autopilot."""
        height = (RETURN_HEIGHT,) if self.settings.read_return_height else ()
        return Parameters(autopilot.name, (*height, *(MOTION if self.settings.read_motion else ())))


def _codec(settings: MavlinkSettings) -> Codec:
    """Our voice on a link that is new."""
    signer = Signer(settings.signing_key) if settings.signing_key is not None else None
    return Codec(speaks_as(settings), settings.component_id, signer)


def speaks_as(settings: MavlinkSettings) -> int:
    """The MAVLink system that we speak as before a vehicle is heard, whose own it is from then on."""
    return settings.system_id or _BEFORE_PAIRING_SYSTEM

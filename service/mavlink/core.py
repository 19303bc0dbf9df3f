"""The link without its wires: bytes and the time go in, events and bytes come out.

Nothing here opens a socket, sleeps or looks at a clock. The owner calls `receive_data` with what has arrived,
`tick` every few hundredths of a second, and sends what `data_to_send` gives it, to `destination`. All times
are those of the service's clock, handed in, and never go back.

What moves the aircraft passes one of two gates, right before it is sent:

* `why_not_command`: the vehicle is heard now, our process has not been standing still, and control is ours
  (see `control`) or an operator has just ordered it;
* `why_not_reposition`: all that, and the last heartbeat shows the guided mode and armed motors, the vehicle
  says that it is in the air, and its position is fresh. Repeating a target passes it again.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink import gates
from service.mavlink.autopilots.base import Autopilot
from service.mavlink.autopilots.registry import autopilot_for
from service.mavlink.boot import BootClock
from service.mavlink.command import Command, CommandBook, result_name, set_message_interval
from service.mavlink.control import Control
from service.mavlink.errors import NotPermitted
from service.mavlink.events import (
    ArmedChanged,
    CommandDone,
    LandedChanged,
    LinkBack,
    LinkLost,
    ModeChanged,
    Paired,
    Rebooted,
    Refused,
    Stalled,
    StatusText,
    Target,
    TargetNotTaken,
    TargetReplaced,
    TargetTaken,
    VehicleEvent,
)
from service.mavlink.framing import Codec, Message, Receiver, own_heartbeat
from service.mavlink.history import PoseHistory
from service.mavlink.quality import LinkQuality
from service.mavlink.readiness import Readiness
from service.mavlink.settings import LinkSettings
from service.mavlink.signing import Signer
from service.mavlink.streams import Streams, common_streams
from service.mavlink.target import Step, TargetWatch
from service.mavlink.telemetry import READERS, Telemetry, after_reboot, heartbeat, stopping_point
from service.mavlink.texts import TextReader, text_messages

_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_BEFORE_PAIRING_SYSTEM = 1
_TEXT_MEMORY_S = 10.0
_ARMS = (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF)


class LinkCore:
    """One link to one vehicle.

    Args:
        settings: rates, limits and time-outs.
        speaks_first: whether to send heartbeats before a vehicle was heard, so that the peer learns our
            address (a `udpout` link). Where we only listen, nothing is sent to anybody before that.
    """

    def __init__(self, settings: LinkSettings, *, speaks_first: bool = False) -> None:
        self.settings = settings
        self.autopilot: Autopilot | None = None
        self.telemetry = Telemetry()
        self.history = PoseHistory(settings.history_s)
        self.destination: Hashable = None
        """The source the vehicle is heard from; None before that."""
        self.rejected = ""
        """Why the last autopilot heard was not paired with, as a sentence's end."""
        self.bytes_received = 0
        self.messages_received = 0
        self.quality = LinkQuality()
        self._speaks_first = speaks_first
        signer = Signer(settings.signing_key) if settings.signing_key is not None else None
        self.codec = Codec(settings.system_id or _BEFORE_PAIRING_SYSTEM, settings.component_id, signer)
        self._receiver = Receiver(self.codec)
        self._boot = BootClock()
        self._streams = Streams(())
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
        self._control = Control()
        self._texts = TextReader()
        self._recent_texts: deque[StatusText] = deque(maxlen=20)
        self._outgoing: list[bytes] = []
        self._events: list[VehicleEvent] = []
        self._now: float | None = None
        self._stalled_at = -math.inf
        self._heard_at = -math.inf
        self._beat_at = -math.inf
        self._readiness = Readiness(settings)
        self._text_id = 0

    # ---- what the owner calls

    def receive_data(self, data: bytes, now: float, source: Hashable = None) -> list[VehicleEvent]:
        """Take bytes that arrived from a source (None where there is only one). Never raises."""
        self._wake(now)
        self.bytes_received += len(data)
        for message in self._receiver.feed(data, now, source):
            self._take(message, source, now)
        return self._pop_events()

    def tick(self, now: float) -> list[VehicleEvent]:
        """Do what is due by time."""
        self._wake(now)
        for source, message in self._receiver.expire(now):
            self._take(message, source, now)
        if now - self._beat_at >= self.settings.heartbeat_period_s and (self.paired or self._speaks_first):
            self._beat_at = now
            self._send(own_heartbeat())
        if self.paired:
            self._check_silence(now)
            self._ask_for_streams(now)
            self._book.motion_waits = self.why_not_command(now, ordered=True) is not None
            self._done(self._book.tick(now))
            self._push_target(now)
            self._heard_texts(self._texts.tick(now), now)
            self._judge_readiness(now)
        return self._pop_events()

    def data_to_send(self) -> list[bytes]:
        """The frames to send now, in order, each to be one datagram; they are handed out once."""
        frames, self._outgoing = self._outgoing, []
        return frames

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

    # ---- the gates

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

    # ---- what moves the aircraft

    def take_control(self, now: float) -> None:
        """On an operator's order: the aircraft, in its guided mode already, is ours to move from now on.

        Raises:
            NotPermitted: it is not, or it is not heard.
        """
        self._wake(now)
        reason = self.why_not_command(now, ordered=True)
        if reason is None and self.autopilot is not None:
            reason = gates.why_not_guided(self.autopilot, self.telemetry)
        if reason is not None:
            raise NotPermitted(f"cannot take control: {reason}")
        self._control.take(self.telemetry.mode)
        self._show_control()

    def release_control(self, reason: str, now: float) -> None:
        """Give control up: nothing that moves the aircraft is sent any more, nor repeated."""
        self._wake(now)
        self._control.lose(reason)
        self._stand_down(reason, now)

    def stand_by(self, reason: str, now: float) -> None:
        """What was sent is not wanted any more: nothing that moves the aircraft is repeated."""
        self._wake(now)
        self._done(self._book.cancel(reason, now, only_motion=True))
        self._watch.clear()

    def reposition(self, lat: float, lon: float, alt_amsl_m: float, now: float) -> Target:
        """Send the aircraft to a place; the next one replaces it.

        Raises:
            NotPermitted: it is not ours to move now, or the place is not one to fly to. Nothing was sent.
        """
        self._wake(now)
        target = Target(lat, lon, alt_amsl_m)
        reason = self.why_not_reposition(now) or gates.why_not_there(self.telemetry, self.settings, target)
        if reason is not None:
            raise NotPermitted(f"no waypoint was sent: {reason}")
        self._send_target(target)
        self._watch.start(target, now)
        return target

    def hold(self, now: float) -> Target:
        """Stop here, in the guided mode: at the place where the aircraft can just stop, not behind it.

        Raises:
            NotPermitted: as for `reposition`.
        """
        t, autopilot = self.telemetry, self.autopilot
        if autopilot is None or not t.position_known:
            raise NotPermitted("no waypoint was sent: the position of the aircraft is not known")
        stop = stopping_point(t, autopilot.stopping_distance_m(t.ground_speed_mps))
        return self.reposition(stop.lat, stop.lon, stop.alt_amsl_m, now)

    def request(self, command: Command, now: float, *, ordered: bool = False) -> int:
        """Send a command; returns the ticket of its CommandDone.

        Raises:
            NotPermitted: it moves the aircraft and may not be sent now, or it arms and that is not allowed at
                all.
        """
        self._wake(now)
        if command.number in _ARMS and not self.settings.allow_arming:
            raise NotPermitted("this service was not allowed to arm or take off")
        reason = self.why_not_command(now, ordered=ordered or not command.motion)
        if reason is not None:
            raise NotPermitted(f"{command.name} was not sent: {reason}")
        self._book.motion_waits = False
        return self._book.submit(command, now)

    def status_text(self, text: str, severity: int) -> bool:
        """Say something to the pilot (STATUSTEXT, see `text_messages`); False before a vehicle is heard."""
        if not self.paired:
            return False
        self._text_id = self._text_id % 0xFFFF + 1
        for message in text_messages(text, severity, self._text_id):
            self._send(message)
        return True

    # ---- receiving

    def _take(self, message: Message, source: Hashable, now: float) -> None:
        self.messages_received += 1
        name = message.get_type()
        if message.get_srcComponent() != _AUTOPILOT or name == "RADIO_STATUS":
            return  # a radio's word is never the autopilot's: it needs no signature
        if not self.paired:
            if name == "HEARTBEAT":
                self._pair(message, source, now)
            return
        if message.get_srcSystem() != self.telemetry.system_id:
            return
        if source != self.destination:
            if now - self._heard_at <= self.settings.link_lost_s:
                return  # somebody else speaks in the vehicle's name while it is still heard
            self.destination = source
        self._heard_at = now
        self.quality.note(message.get_seq())
        if self._boot.read(message):
            self._rebooted(now)
        self._streams.on_message(message.get_msgId(), now)
        if name == "HEARTBEAT":
            self._heartbeat(message, now)
        elif name == "COMMAND_ACK":
            self._ack(message, now)
        elif name == "STATUSTEXT":
            self._heard_texts(self._texts.read(message, now), now)
        elif name in READERS:
            self._read(name, message, now)

    def _pair(self, message: Message, source: Hashable, now: float) -> None:
        system = message.get_srcSystem()
        if self.settings.system_id not in (None, system):
            self.rejected = f"system {system} is not the system {self.settings.system_id} asked for"
            return
        autopilot = autopilot_for(message.autopilot, message.type)
        if isinstance(autopilot, str):
            self.rejected = f"system {system} {autopilot}"
            return
        self.autopilot = autopilot
        self.destination = source
        self._heard_at = now
        self.codec.system_id = system
        self._streams = Streams((*common_streams(self.settings), *autopilot.extra_streams))
        self.telemetry = t = heartbeat(
            replace(self.telemetry, system_id=system, autopilot=autopilot.name), message, autopilot, now
        )
        self._events.append(Paired(now, system, autopilot.name, t.mode, t.armed))

    def _heartbeat(self, message: Message, now: float) -> None:
        autopilot, before = self.autopilot, self.telemetry
        assert autopilot is not None
        same = autopilot_for(message.autopilot, message.type)
        if isinstance(same, str) or same.name != autopilot.name:
            return
        self.telemetry = after = heartbeat(before, message, autopilot, now)
        if before.link_lost:
            self._events.append(LinkBack(now, now - before.heartbeat_time))
            self._streams.start_over()
        if after.mode != before.mode:
            self._mode_changed(autopilot, before.mode, now)
        self._done(self._book.on_mode(after.mode, now))
        self._done(self._book.on_armed(after.armed, now))
        if after.armed != before.armed:
            commanded = self._control.on_armed(after.armed, now)
            if not after.armed:
                self._stand_down("the aircraft has disarmed", now)
            self._events.append(ArmedChanged(now, after.armed, commanded))
        self._show_control()

    def _mode_changed(self, autopilot: Autopilot, previous: str, now: float) -> None:
        t = self.telemetry
        commanded = self._control.on_mode(autopilot, previous, t, now)
        texts = [text.text for text in self.recent_texts(now - _TEXT_MEMORY_S)]
        failsafe = not commanded and autopilot.looks_like_failsafe(t.mode, t.system_status, texts)
        kind = autopilot.mode_kind(t.mode)
        self._events.append(ModeChanged(now, t.mode, previous, kind, t.guided, commanded, failsafe))
        if not commanded:
            self._stand_down(f"the mode was changed to {t.mode} and not by us", now)
        elif not t.guided:
            self._watch.clear()

    def _ack(self, message: Message, now: float) -> None:
        ours = (message.target_system, message.target_component)
        if ours not in (
            (0, 0),
            (self.codec.system_id, 0),
            (self.codec.system_id, self.codec.component_id),
        ):
            return
        if message.command == mavlink.MAV_CMD_DO_REPOSITION:
            assert self.autopilot is not None
            if self.autopilot.refuses_reposition(message.result):
                self._watch.on_refusal(result_name(message.result))
            return
        self._done(self._book.on_ack(message.command, message.result, now))

    def _read(self, name: str, message: Message, now: float) -> None:
        before = self.telemetry
        after = replace(READERS[name](before, message, now), boot_time_s=self._boot.seconds)
        self.telemetry = after
        if name == "GLOBAL_POSITION_INT":
            if after.position_time == now:
                self.history.record(after)
        elif name == "EXTENDED_SYS_STATE" and after.landed_state != before.landed_state:
            self._events.append(LandedChanged(now, after.landed_state, before.landed_state))
        elif name == "SYS_STATUS":
            self._readiness.on_status(after.prearm_ok, now)
            self._judge_readiness(now)
        elif name == "POSITION_TARGET_GLOBAL_INT":
            self._named(after.target, now)

    def _named(self, named: Target | None, now: float) -> None:
        target = self._watch.target
        taken_after, stranger = self._watch.on_named(named, now)
        if target is None:
            return
        if taken_after is not None:
            self._events.append(TargetTaken(now, target, taken_after))
        if stranger is not None:
            self._watch.clear()
            self._events.append(TargetReplaced(now, target, stranger))

    def _heard_texts(self, texts: list[StatusText], now: float) -> None:
        for text in texts:
            self._recent_texts.append(text)
            self._events.append(text)
            if self.autopilot and self.autopilot.says_not_ready(text.text):
                self._readiness.on_complaint(now)

    def _rebooted(self, now: float) -> None:
        self._control.lose("the vehicle has rebooted")
        self._stand_down("the vehicle has rebooted", now)
        self._done(self._book.cancel("the vehicle has rebooted", now))
        self._streams.start_over()
        self.history.clear()
        self._readiness.forget()
        self.telemetry = after_reboot(self.telemetry)
        self._events.append(Rebooted(now))

    # ---- what is due by time

    def _wake(self, now: float) -> None:
        last, self._now = self._now, now
        if last is None or now - last <= self.settings.stall_s:
            return
        self._stalled_at = now
        self._events.append(Stalled(now, now - last))
        self._stop_repeating("the service stood still", now)

    def _check_silence(self, now: float) -> None:
        silent_s = now - self.telemetry.heartbeat_time
        if self.telemetry.link_lost or silent_s <= self.settings.link_lost_s:
            return
        self.telemetry = replace(self.telemetry, link_lost=True)
        self._events.append(LinkLost(now, silent_s))
        self._stop_repeating("the link was lost", now)
        self._done(self._book.cancel("the link was lost", now))

    def _ask_for_streams(self, now: float) -> None:
        if self.telemetry.link_lost:
            return
        for stream in self._streams.due(now):
            self._streams.asked(
                self._book.submit(set_message_interval(stream.message_id, stream.hz), now), stream
            )

    def _push_target(self, now: float) -> None:
        step, target = self._watch.due(now), self._watch.target
        if step is None or target is None:
            return
        reason = self.why_not_reposition(now)
        if step is Step.RESEND and reason is None:
            self._send_target(target)
            self._watch.sent_again(now)
            return
        refusal = self._watch.refusal
        answer = (
            f"the autopilot answered {refusal}" if refusal else "the autopilot does not name it as its target"
        )
        self._give_up_target(reason or answer, now)

    def _judge_readiness(self, now: float) -> None:
        ready = self._readiness.ready(self.telemetry, now)
        if ready != self.telemetry.ready_to_arm:
            self.telemetry = replace(self.telemetry, ready_to_arm=ready)

    # ---- helpers

    def _send_target(self, target: Target) -> None:
        assert self.autopilot is not None
        self._send(self.autopilot.reposition(target, self.telemetry.system_id, _AUTOPILOT))

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
            self.telemetry = replace(self.telemetry, in_control=held, control_reason=reason)

    def _transmit(self, command: Command, confirmation: int) -> None:
        now = self._now
        assert now is not None
        if command.goal_mode is not None:
            self._control.expect(command.goal_mode, now + self.settings.mode_window_s)
        if command.height_m is not None:
            self._control.climb_to(command.height_m)
        if command.number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self._control.expect_armed(True, now + self.settings.mode_window_s)
        self._send(command.message(self.telemetry.system_id, _AUTOPILOT, confirmation))

    def _send(self, message: Message) -> None:
        self._outgoing.append(self.codec.encode(message))

    def _done(self, done: list[CommandDone]) -> None:
        for event in done:
            if not self._streams.on_answer(event.ticket, refused=isinstance(event.outcome, Refused)):
                self._events.append(event)

    def _pop_events(self) -> list[VehicleEvent]:
        events, self._events = self._events, []
        return events

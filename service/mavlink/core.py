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
from collections.abc import Hashable
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink import gates
from service.mavlink.autopilots.base import Autopilot
from service.mavlink.autopilots.registry import autopilot_for
from service.mavlink.command import Command, result_name, set_message_interval
from service.mavlink.company import TAKES
from service.mavlink.errors import NotPermitted
from service.mavlink.events import (
    AnotherService,
    ArmedChanged,
    LandedChanged,
    LinkBack,
    LinkLost,
    ModeChanged,
    Notice,
    Paired,
    Rebooted,
    Stalled,
    StatusText,
    Target,
    TargetReplaced,
    TargetTaken,
    VehicleEvent,
)
from service.mavlink.framing import Message, own_heartbeat
from service.mavlink.modes import BY_ITSELF, mode_title
from service.mavlink.sources import SOURCES
from service.mavlink.state import LinkMemory, speaks_as
from service.mavlink.streams import Streams, streams_of
from service.mavlink.target import Step
from service.mavlink.telemetry import after_reboot, heartbeat, stopping_point
from service.mavlink.texts import text_messages

_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_V2_START = b"\xfd"
_ARMS = (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF)
_STOP_ARRIVES_S = 10.0
"""So long a stop may be on its way over a bad radio."""


class LinkCore(LinkMemory):
    """One link to one vehicle: see `state.LinkMemory` for its arguments and for what it remembers."""

    # ---- what the owner calls

    def receive_data(self, data: bytes, now: float, source: Hashable = None) -> list[VehicleEvent]:
        """Take bytes that arrived from a source (None where there is only one). Never raises."""
        self._wake(now)
        if self.paired and source != self.destination and now - self._last_heard <= self.settings.link_lost_s:
            self.datagrams_dropped += 1  # not the vehicle's, and that is heard: not even looked at
            return self._pop_events()
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
            self.codec.speaks_v1 = self._hearing.wants_v1(now) or self.codec.speaks_v1
            self._check_silence(now)
            self._ask_how_long(now)
            self._ask_for_streams(now)
            self._ask_for_parameters(now)
            self._ask_for_reposition(now)
            self._book.motion_waits = self.why_not_command(now, ordered=True) is not None
            self._done(self._book.tick(now))
            self._push_target(now)
            self._heard_texts(self._texts.tick(now), now)
            self._judge_readiness(now)
        return self._pop_events()

    def forget(self, system_id: int | None, now: float) -> tuple[LinkCore, list[VehicleEvent]]:
        """On an operator's order: another aircraft is to come on this link, the next that is heard or, with a system
        id, that one alone.

        Returns the core that waits for it, and what ends with this one, which is not to be used any more. All that was
        known of the vehicle is new in it because it is another core: kind, parameters, home, battery, clocks, past,
        what it answers to. Only what is ours goes on.
        """
        self._wake(now)
        self.release_control("another aircraft is waited for", now)
        self._done(self._book.cancel("another aircraft is waited for", now))
        settings = replace(self.settings, system_id=system_id)
        self.codec.forget_vehicle(speaks_as(settings))
        core = LinkCore(settings, speaks_first=self._speaks_first, codec=self.codec)
        core._go_on_from(self)
        return core, self._pop_events()

    # ---- what moves the aircraft

    def take_control(self, now: float) -> None:
        """On an operator's order: the aircraft, in its guided mode already, is ours to move from now on. One that
        stands in the mode that only stops is ours to be sent home.

        Raises:
            NotPermitted: it is not, or it is not heard.
        """
        self._wake(now)
        reason = self.why_not_command(now, ordered=True)
        if reason is None and self.autopilot is not None and not self.telemetry.stopped:
            reason = gates.why_not_guided(self.autopilot, self.telemetry)
        if reason is not None:
            raise NotPermitted(f"cannot take control: {reason}")
        self._control.take(self.telemetry.mode)
        self._strangers.start_over()
        self._cruise.start_over()
        if self.autopilot is not None and self.autopilot.take_over_advice:
            self.status_text(self.autopilot.take_over_advice, mavlink.MAV_SEVERITY_WARNING)
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
        return self._go_to(Target(lat, lon, alt_amsl_m), now, stops=False)

    def _go_to(self, target: Target, now: float, *, stops: bool) -> Target:
        self._wake(now)
        reason = self.why_not_reposition(now) or gates.why_not_there(self.telemetry, self.settings, target)
        if reason is None and not stops and self._strangers.suspects(now):
            reason = "somebody else may just have given the aircraft a target"
        if reason is not None:
            raise NotPermitted(f"no waypoint was sent: {reason}")
        self._book.end(mavlink.MAV_CMD_DO_REPOSITION, "a waypoint follows", now)
        self._send_target(target, now)
        self._watch.start(target, now)
        return target

    def hold(self, now: float, least_amsl_m: float = math.nan) -> None:
        """Stop here, in the guided mode: at the place where the aircraft can just stop, not behind it, and at the
        present altitude, or at the least that it may have (NaN: any). What it does by itself for us, or is about to,
        ends; a climb where it is, without a target.

        Raises:
            NotPermitted: as for `reposition`.
        """
        if self._broke_off(now):
            return
        t, autopilot = self.telemetry, self.autopilot
        if autopilot is None or not t.position_known:
            raise NotPermitted("no waypoint was sent: the position of the aircraft is not known")
        stop = stopping_point(t, autopilot.stopping_distance_m(t.ground_speed_mps))
        altitude = max(stop.alt_amsl_m, least_amsl_m) if math.isfinite(least_amsl_m) else stop.alt_amsl_m
        self._go_to(replace(stop, alt_amsl_m=altitude), now, stops=True)

    def brake(self, now: float) -> None:
        """Stop where it can, without a position of ours: the autopilot's own way; see `hold` for what ends with it.

        Raises:
            NotPermitted: it is not ours to move now, or not flying to our waypoints. Nothing was sent.
        """
        if self._broke_off(now):
            return
        reason = self.why_not_command(now)
        if reason is None and self.autopilot is not None:
            reason = gates.why_not_guided(self.autopilot, self.telemetry)
        if reason is None and not self.telemetry.armed:
            reason = "the aircraft is not armed"
        if reason is not None or self.autopilot is None:
            raise NotPermitted(f"no stop was sent: {reason}")
        self._stop_by(self.autopilot.brake(), now)

    def goes_by_itself(self, now: float) -> bool:
        """Whether it takes off, returns or lands by our order, or is about to, which the last heartbeat need not show
        yet: such an order is on its way, and neither a waypoint nor silence takes it back."""
        t, autopilot = self.telemetry, self.autopilot
        if autopilot is None or not t.armed:
            return False
        mode = self._control.asked_for(now) or t.mode
        return self._takes_off or autopilot.mode_kind(mode) in BY_ITSELF

    @property
    def _takes_off(self) -> bool:
        return self._climbs and self.telemetry.landed_state != "in_air"

    def _broke_off(self, now: float) -> bool:
        """End what it does by itself, before a stop; whether it stands by that alone, or did already."""
        t, autopilot = self.telemetry, self.autopilot
        if autopilot is None or self.why_not_command(now) is not None:
            return False
        if t.mode == autopilot.brake().goal_mode:
            return True
        if not self.goes_by_itself(now):
            return False
        if self._takes_off:
            self._stop_by(autopilot.break_off_climb(), now)
            return True
        self._book.submit(autopilot.set_mode(autopilot.guided_mode), now)
        return False

    def _stop_by(self, command: Command, now: float) -> None:
        self._watch.clear()
        self._stop = command
        self._brake = self.request(command, now)

    def request(self, command: Command, now: float, *, ordered: bool = False) -> int:
        """Send a command; returns the ticket of its CommandDone.

        Raises:
            NotPermitted: it moves the aircraft and may not be sent now, or it arms and that is not allowed at
                all.
        """
        self._wake(now)
        if command.number in _ARMS and not self.settings.allow_arming:
            raise NotPermitted("this service was not allowed to arm or take off")
        if command.speed_mps is not None:  # refused, it is still wanted: sent with the next waypoint
            self._cruise.want(command.speed_mps)
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
            self._heard_other(message, now)
            return  # a radio's word is never the autopilot's: it needs no signature
        if not self.paired:
            if name == "HEARTBEAT":
                self._pair(message, source, now)
            return
        if message.get_srcSystem() != self.telemetry.system_id:
            self._heard_in_its_place(message, now)
            return
        if source != self.destination:
            if now - self._last_heard <= self.settings.link_lost_s:
                return  # somebody else speaks in the vehicle's name while it is still heard
            was, self.destination = self.destination, source
            self._events.append(Notice(now, f"the autopilot is heard from {source} now, and not from {was}"))
        self._last_heard = now
        self.quality.note(message.get_seq())
        self._hearing.on_message(v2=message.get_msgbuf()[:1] == _V2_START)
        if self._boot.read(message, now):
            self._rebooted(now)
        self._streams.on_message(message.get_msgId(), now)
        if name == "HEARTBEAT":
            self._heartbeat(message, now)
        elif name == "COMMAND_ACK":
            self._ack(message, now)
        elif name == "STATUSTEXT":
            self._heard_texts(self._texts.read(message, now), now)
        elif name == "TIMESYNC":
            self._round_trip.on_message(message, now)
            self._show_round_trip(now)
        elif name == "PARAM_VALUE":
            told = self._parameters.read(message.param_id.rstrip("\0"), message.param_value)
            if told is not None:
                self._heard.base = replace(self._heard.base, **dict([told]))  # type: ignore[arg-type]
        else:
            self._read(name, message, now)

    def _heard_in_its_place(self, message: Message, now: float) -> None:
        """Another autopilot, while ours is silent on the ground: whoever has exchanged the aircraft has to say so."""
        kept = self.settings.system_id not in (None, message.get_srcSystem())
        if message.get_type() != "HEARTBEAT" or kept or self.telemetry.armed or not self.telemetry.link_lost:
            return
        other = autopilot_for(message.autopilot, message.type)
        if isinstance(other, str) or (message.get_srcSystem(), other.name) in self._told_of:
            return
        self._told_of.add((message.get_srcSystem(), other.name))
        who = f"system {message.get_srcSystem()} ({other.title})"
        said = f"{who} is heard, and not the aircraft that was there: if it is another one now, order replace"
        self._events.append(Notice(now, said))

    def _heard_other(self, message: Message, now: float) -> None:
        us = (self.codec.system_id, self.codec.component_id)
        speaks_as_us = (message.get_srcSystem(), message.get_srcComponent()) == us
        if self.paired and speaks_as_us and message.get_type() == "HEARTBEAT":
            self._tell_another(self._company.on_heartbeat(message, now), now)

    def _tell_another(self, reason: str, now: float) -> None:
        if reason:
            self._events.append(AnotherService(now, reason))

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
        self._last_heard = now
        self._hearing.began(now)
        self.codec.system_id = system
        self._streams = Streams(streams_of(self.settings, autopilot.name))
        self._parameters = self._parameters_of(autopilot)
        named = replace(self._heard.base, system_id=system, autopilot=autopilot.name)
        self._heard.base = t = heartbeat(named, message, autopilot, now)
        self._events.append(Paired(now, system, autopilot.name, t.mode, t.armed))

    def _heartbeat(self, message: Message, now: float) -> None:
        autopilot, before = self.autopilot, self.telemetry
        assert autopilot is not None
        same = autopilot_for(message.autopilot, message.type)
        if isinstance(same, str) or same.name != autopilot.name:
            self._heard_in_its_place(message, now)
            return
        self._heard.base = after = heartbeat(self._heard.base, message, autopilot, now)
        if before.link_lost:
            self._events.append(LinkBack(now, now - before.heartbeat_time))
            self._round_trip.heard_again(now)
            self._show_round_trip(now)
            self._streams.start_over()
        if after.mode != before.mode:
            self._mode_changed(autopilot, before.mode, now)
            self._done(self._book.on_mode(after.mode, now))
        elif self._control.held and autopilot.holds_by_failsafe(
            after.mode, after.system_status, self._lately_said(now)
        ):
            self._failsafe_holds(autopilot, after.mode, now)
        self._climbs &= after.armed and self.telemetry.landed_state != "in_air"
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
        said = self._lately_said(now)
        failsafe = not commanded and autopilot.looks_like_failsafe(t.mode, t.system_status, said)
        kind = autopilot.mode_kind(t.mode)
        self._events.append(ModeChanged(now, t.mode, previous, kind, t.guided, commanded, failsafe))
        self._strangers.start_over()
        if not self._control.asked_for(now):
            self._strangers.look_again()
        self._cruise.start_over()
        if not commanded:
            self._stand_down(f"the mode was changed to {mode_title(t.mode)} and not by us", now)
        elif not t.guided:
            self._watch.clear()

    def _failsafe_holds(self, autopilot: Autopilot, mode: str, now: float) -> None:
        """The mode is the one in which it follows us, and it is not for us that it is in it."""
        self._control.lose("the autopilot's failsafe holds the aircraft")
        self._stand_down("the autopilot's failsafe holds the aircraft", now)
        kind = autopilot.mode_kind(mode)
        self._events.append(ModeChanged(now, mode, mode, kind, True, commanded=False, failsafe=True))

    def _ack(self, message: Message, now: float) -> None:
        named = (message.target_system, message.target_component)
        us = (self.codec.system_id, self.codec.component_id)
        reason = self._company.on_ack(message, ours=named == us, now=now) if named[1] else ""
        self._tell_another(reason, now)
        command = message.command
        unnamed = named == (0, 0) and command in TAKES and self._company.not_ours(command, now)
        if unnamed or named not in ((0, 0), (us[0], 0), us):
            t, accepted = self.telemetry, message.result == mavlink.MAV_RESULT_ACCEPTED
            if accepted and message.command in TAKES and t.in_control and t.guided and t.armed:
                self._replaced(None, self._company.commander(now), now)
            return
        self._hearing.on_answer()
        if message.command == mavlink.MAV_CMD_DO_REPOSITION:
            assert self.autopilot is not None
            if named == us and now - self._stop_sent < _STOP_ARRIVES_S:
                self._strangers.start_over()  # each one that comes ends somewhere else
            self._probe.on_answer(message.result)
            if self.autopilot.refuses_reposition(message.result):
                self._watch.on_refusal(result_name(message.result))
            return
        self._done(self._book.on_ack(message.command, message.result, now))

    def _read(self, name: str, message: Message, now: float) -> None:
        self._heard.boot_s = self._boot.seconds
        landed = self.telemetry.landed_state if name == "EXTENDED_SYS_STATE" else ""
        sea_m = self._heard.sea_m
        if not self._heard.take(message, now):
            return
        if self._heard.sea_m != sea_m:
            self._sea_moved(self._heard.sea_m - sea_m, now)
        if (moved := self._references.read(self.telemetry, name, now)) is not None:
            self._events.append(moved)
        if name == "GLOBAL_POSITION_INT":
            self.history.record(self.telemetry)
            self._judge_speed(now)
        elif name == "EXTENDED_SYS_STATE" and self.telemetry.landed_state != landed:
            self._events.append(LandedChanged(now, self.telemetry.landed_state, landed))
        elif name == "SYS_STATUS":
            self._readiness.on_status(self.telemetry.prearm_ok, now)
            self._judge_readiness(now)
        elif name == "POSITION_TARGET_GLOBAL_INT":
            self._named(self.telemetry.target_amsl, now)
        elif name == "POSITION_TARGET_LOCAL_NED" and SOURCES[name].told_by(self.telemetry.autopilot):
            self._steered(now)

    def _sea_moved(self, by_m: float, now: float) -> None:
        """Altitudes were corrected: a target of ours may have another name now, and is not repeated by its old one."""
        self._strangers.sea_moved(by_m)
        if not self._watch.taken:
            self._give_up_target("sea level has moved", now)

    def _named(self, named: Target | None, now: float) -> None:
        target = self._watch.target
        taken_after = self._watch.on_named(named, now)
        if target is not None and taken_after is not None:
            self._events.append(TargetTaken(now, target, taken_after))
            self._send_speed(self._cruise.on_taken(), now)
        t = self.telemetry
        if named is None or not (t.in_control and t.guided and t.armed and t.landed_state == "in_air"):
            self._strangers.start_over()
            return
        stranger = self._strangers.on_named(named, now)
        if stranger is not None:
            failsafe = any("failsafe" in text.lower() for text in self._lately_said(now))
            by = "the autopilot's failsafe" if failsafe else self._company.commander(now)
            self._replaced(stranger, by, now)

    def _steered(self, now: float) -> None:
        t = self.telemetry
        flies = t.in_control and t.guided and t.armed and t.landed_state == "in_air"
        if flies and self._strangers.on_steered(t.steered_mps, now):
            self._replaced(None, self._company.commander(now), now)

    def _replaced(self, found: Target | None, by: str, now: float) -> None:
        """Somebody else sends it somewhere, or has it do something else: it is theirs."""
        ours = self._watch.target
        self._watch.clear()
        self._control.lose(f"{by} has given the aircraft another target")
        self._stand_down("the aircraft was given another target", now)
        self._strangers.start_over()
        self._events.append(TargetReplaced(now, ours, found, by))

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
        self.history.forget_boot()
        self._readiness.forget()
        self._references.forget()
        if self.autopilot is not None:
            self._parameters = self._parameters_of(self.autopilot)
        self._heard.forget(after_reboot(self.telemetry))
        self._events.append(Rebooted(now))

    # ---- what is due by time

    def _wake(self, now: float) -> None:
        last, self._now = self._now, now
        if last is None or now - last <= self.settings.stall_s:
            return
        self._stalled_at = now
        self._round_trip.forget_asked()
        self._events.append(Stalled(now, now - last))
        self._stop_repeating("the service stood still", now)

    def _check_silence(self, now: float) -> None:
        silent_s = now - self.telemetry.heartbeat_time
        if self.telemetry.link_lost or silent_s <= self.settings.link_lost_s:
            return
        self._heard.base = replace(self._heard.base, link_lost=True)
        self._events.append(LinkLost(now, silent_s))
        self._stop_repeating("the link was lost", now)
        self._done(self._book.cancel("the link was lost", now))

    def _ask_how_long(self, now: float) -> None:
        question = None if self.telemetry.link_lost else self._round_trip.due(now)
        if question is not None:
            self._send(question)
            self._show_round_trip(now)

    def _show_round_trip(self, now: float) -> None:
        seconds = self._round_trip.seconds(now)
        if seconds != self._heard.base.round_trip_s:
            self._heard.base = replace(self._heard.base, round_trip_s=seconds)

    def _ask_for_streams(self, now: float) -> None:
        if self.telemetry.link_lost:
            return
        for stream in self._streams.due(now):
            self._streams.asked(
                self._book.submit(set_message_interval(stream.message_id, stream.hz), now), stream
            )

    def _ask_for_parameters(self, now: float) -> None:
        for name in [] if self.telemetry.link_lost else self._parameters.due(now):
            system, word = self.telemetry.system_id, name.encode().ljust(16, b"\0")
            self._send(mavlink.MAVLink_param_request_read_message(system, _AUTOPILOT, word, -1))

    def _push_target(self, now: float) -> None:
        step, target = self._watch.due(now), self._watch.target
        if step is None or target is None or self._strangers.suspects(now):
            return  # who may just have given it another is not overridden by a repetition either
        reason = self.why_not_reposition(now)
        if step is Step.RESEND and reason is None:
            self._send_target(target, now)
            self._watch.sent_again(now)
            return
        refusal = self._watch.refusal
        answer = (
            f"the autopilot answered {refusal}" if refusal else "the autopilot does not name it as its target"
        )
        self._give_up_target(reason or answer, now)

    def _judge_speed(self, now: float) -> None:
        t = self.telemetry
        if t.in_control and t.guided and self._watch.taken:
            again, said = self._cruise.on_speed(t.ground_speed_mps, now, climb_mps=t.velocity_ned_mps[2])
            self._send_speed(again, now)
            if said:
                self._events.append(Notice(now, said))

    def _judge_readiness(self, now: float) -> None:
        ready = self._readiness.ready(self.telemetry, now)
        if ready != self.telemetry.ready_to_arm:
            self._heard.base = replace(self._heard.base, ready_to_arm=ready)

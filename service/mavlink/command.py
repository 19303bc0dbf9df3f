"""Commands as values, and the book that sends, repeats and ends them.

MAVLink's command protocol matches an answer to a command by the command's number only, so at most one command
of each number is on its way. A command is repeated (with a growing `confirmation`) until it is acknowledged,
and given up after some attempts. Two habits of real autopilots shape this:

* PX4 acknowledges DO_SET_MODE twice, and the two may disagree. A command that asks for a mode (`goal_mode`)
  therefore ends when the heartbeat shows that mode, whatever the acknowledgements say.
* A late second acknowledgement must not answer the next command of the same number, so after a repeated or
  twice-acknowledged command its number rests for a moment.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.events import Accepted, Cancelled, CommandDone, Outcome, Refused, Silent
from service.mavlink.framing import Message

_REST_S = 0.3


@dataclass(frozen=True, slots=True)
class Command:
    """One MAV_CMD with its seven parameters (COMMAND_LONG).

    `motion` marks what moves the aircraft or arms it: such a command is dropped, not repeated, once the pilot
    has taken over or our own process has stalled, and waits while the vehicle is not heard.
    """

    number: int
    params: tuple[float, ...] = ()
    motion: bool = False
    goal_mode: str | None = None
    goal_armed: bool | None = None
    """What the heartbeat shows once it has done its work, as with `goal_mode`."""
    acked_twice: bool = False
    attempts: int | None = None
    """How often it is sent at most; None: as often as the link's settings say."""
    label: str = ""
    height_m: float | None = None
    """Of a take-off: how far it climbs above home."""
    speed_mps: float | None = None
    """Of a change of speed."""

    @property
    def name(self) -> str:
        """For a log: MAV_CMD without its prefix, and what it is about."""
        return f"{command_name(self.number)} {self.label}".rstrip()

    def message(self, system: int, component: int, confirmation: int) -> Message:
        """The COMMAND_LONG."""
        params = (*self.params, *[0.0] * (7 - len(self.params)))
        return mavlink.MAVLink_command_long_message(system, component, self.number, confirmation, *params)


def command_name(number: int) -> str:
    """MAV_CMD entry without its prefix, or the number."""
    entry = mavlink.enums["MAV_CMD"].get(number)
    return str(entry.name).removeprefix("MAV_CMD_") if entry else str(number)


def result_name(result: int) -> str:
    """MAV_RESULT entry without its prefix, or the number."""
    entry = mavlink.enums["MAV_RESULT"].get(result)
    return str(entry.name).removeprefix("MAV_RESULT_") if entry else str(result)


def set_message_interval(message_id: int, hz: float) -> Command:
    """MAV_CMD_SET_MESSAGE_INTERVAL for one message."""
    entry = mavlink.mavlink_map.get(message_id)
    label = str(entry.msgname) if entry else str(message_id)
    interval_us = float(round(1e6 / hz))
    return Command(
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (float(message_id), interval_us), attempts=2, label=label
    )


@dataclass(slots=True)
class _Active:
    ticket: int
    command: Command
    attempts: int = 0
    deadline: float = -math.inf


@dataclass(slots=True)
class _Lane:
    """All commands of one number: one on its way, the others waiting."""

    waiting: deque[_Active] = field(default_factory=deque)
    active: _Active | None = None
    rests_until: float = -math.inf


class CommandBook:
    """Every command that has not ended yet.

    Args:
        send: is called with (command, confirmation) whenever one has to go out.
        ack_timeout_s: time before a command is repeated.
        attempts: how often it is sent before it counts as unanswered.
        in_progress_timeout_s: how long an IN_PROGRESS is believed.
    """

    def __init__(
        self,
        send: Callable[[Command, int], None],
        *,
        ack_timeout_s: float,
        attempts: int,
        in_progress_timeout_s: float,
    ) -> None:
        self._send = send
        self._ack_timeout_s = ack_timeout_s
        self._attempts = attempts
        self._in_progress_timeout_s = in_progress_timeout_s
        self.motion_waits = False
        """Whether commands that move the aircraft are neither sent nor repeated for now."""
        self._lanes: dict[int, _Lane] = {}
        self._next_ticket = 1

    def number_after(self, other: CommandBook) -> None:
        """Go on with the tickets of another book, so that none of its has a namesake here."""
        self._next_ticket = other._next_ticket

    def submit(self, command: Command, now: float) -> int:
        """Send a command as soon as its number is free; returns the ticket of its CommandDone."""
        ticket = self._next_ticket
        self._next_ticket += 1
        lane = self._lanes.setdefault(command.number, _Lane())
        lane.waiting.append(_Active(ticket, command))
        self._start(lane, now)
        return ticket

    def waiting_for(self, number: int) -> int:
        """How many commands of this number have not ended."""
        lane = self._lanes.get(number)
        return 0 if lane is None else len(lane.waiting) + (lane.active is not None)

    def on_ack(self, number: int, result: int, now: float) -> list[CommandDone]:
        """Take a COMMAND_ACK that is meant for us."""
        lane = self._lanes.get(number)
        if lane is None or lane.active is None:
            return []
        active = lane.active
        if result == mavlink.MAV_RESULT_IN_PROGRESS:
            active.deadline = now + self._in_progress_timeout_s
            return []
        if result == mavlink.MAV_RESULT_ACCEPTED:
            return self._end(lane, Accepted(), now)
        return self._end(lane, Refused(result, result_name(result)), now)

    def on_mode(self, mode: str, now: float) -> list[CommandDone]:
        """A heartbeat shows this mode: a command that asked for it has done its work and is not repeated."""
        done: list[CommandDone] = []
        for lane in self._lanes.values():
            if lane.active is not None and lane.active.command.goal_mode == mode:
                done += self._end(lane, Accepted(), now)
        return done

    def on_armed(self, armed: bool, now: float) -> list[CommandDone]:
        """A heartbeat shows the motors armed or not: a command that asked for it has done its work."""
        done: list[CommandDone] = []
        for lane in self._lanes.values():
            if lane.active is not None and lane.active.command.goal_armed == armed:
                done += self._end(lane, Accepted(), now)
        return done

    def tick(self, now: float) -> list[CommandDone]:
        """Repeat what is due, give up what was repeated often enough."""
        done: list[CommandDone] = []
        for lane in self._lanes.values():
            active = lane.active
            if active is not None and now >= active.deadline and not self._waits(active):
                if active.attempts >= (active.command.attempts or self._attempts):
                    done += self._end(lane, Silent(active.attempts), now)
                else:
                    self._transmit(active, now)
            self._start(lane, now)
        return done

    def cancel(self, reason: str, now: float, *, only_motion: bool = False) -> list[CommandDone]:
        """End commands without an answer; nothing of them is sent again."""
        done: list[CommandDone] = []
        for lane in self._lanes.values():
            kept = [a for a in lane.waiting if only_motion and not a.command.motion]
            done += self._closed((a for a in lane.waiting if a not in kept), Cancelled(reason), now)
            lane.waiting = deque(kept)
            if lane.active is not None and not (only_motion and not lane.active.command.motion):
                done += self._end(lane, Cancelled(reason), now)
        return done

    def end(self, number: int, reason: str, now: float) -> list[CommandDone]:
        """End the commands of one number; nothing of them is sent again."""
        lane = self._lanes.get(number)
        if lane is None:
            return []
        done = self._closed(lane.waiting, Cancelled(reason), now)
        lane.waiting.clear()
        return done + (self._end(lane, Cancelled(reason), now) if lane.active is not None else [])

    def _start(self, lane: _Lane, now: float) -> None:
        if lane.active is not None or not lane.waiting or now < lane.rests_until:
            return
        if not self._waits(lane.waiting[0]):
            lane.active = lane.waiting.popleft()
            self._transmit(lane.active, now)

    def _waits(self, entry: _Active) -> bool:
        return self.motion_waits and entry.command.motion

    def _transmit(self, active: _Active, now: float) -> None:
        self._send(active.command, min(active.attempts, 255))
        active.attempts += 1
        active.deadline = now + self._ack_timeout_s

    def _end(self, lane: _Lane, outcome: Outcome, now: float) -> list[CommandDone]:
        active = lane.active
        assert active is not None
        lane.active = None
        if active.attempts > 1 or active.command.acked_twice or isinstance(outcome, Cancelled):
            lane.rests_until = now + _REST_S
        done = self._closed([active], outcome, now)
        self._start(lane, now)
        return done

    @staticmethod
    def _closed(ended: Iterable[_Active], outcome: Outcome, now: float) -> list[CommandDone]:
        return [CommandDone(now, a.ticket, a.command.name, outcome) for a in ended]

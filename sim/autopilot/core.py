"""A whole mock autopilot without any input or output: bytes in, vehicle time on, bytes out.

`receive` takes what came on a link, `advance` moves vehicle time by steps of STEP_S, and each link's
`outbox` fills with frames. The same settings, bytes and steps give the same flight, bit by bit.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from sim.autopilot.ardupilot import ArduCopter
from sim.autopilot.commands import ReceivedCommand, Result, Results
from sim.autopilot.dialect import M
from sim.autopilot.faults import Faults
from sim.autopilot.firmware import CRITICAL, Firmware
from sim.autopilot.host import Handler, Line
from sim.autopilot.link import Link
from sim.autopilot.missions import Missions
from sim.autopilot.parameter_protocol import ParameterProtocol
from sim.autopilot.px4 import Px4
from sim.autopilot.requests import Requests
from sim.autopilot.setpoints import Setpoints
from sim.autopilot.settings import STEP_S, Settings
from sim.autopilot.telemetry import BUILDERS, heartbeat
from sim.autopilot.trouble import Trouble
from sim.autopilot.voice import Voice

FIRMWARES: dict[str, type[Firmware]] = {"px4": Px4, "ardupilot": ArduCopter}

_TICK_STEPS = round(0.1 / STEP_S)
_REBOOT_STEPS = round(2.0 / STEP_S)  # a booting autopilot says nothing for so long
_STEP_US = round(STEP_S * 1e6)
_CHUNK = 50  # characters of one STATUSTEXT
_HEARTBEAT = M.MAVLINK_MSG_ID_HEARTBEAT


class Autopilot:
    """One mock: a firmware with its vehicle, and the protocol services that serve its links."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.steps = 0  # since the first boot; `vehicle.steps` starts again at each
        self.trouble, self.chance = Trouble(), random.Random(settings.seed + 1)
        self.voice = Voice()
        self.frozen = self.old_wire = False
        self.unknown_messages: set[int] = set()
        self.refusals: dict[int, tuple[Result, str]] = {}
        self._later: list[tuple[float, Callable[[], None]]] = []
        self._boot()
        self.faults = Faults(self)
        self.links: list[Link] = []
        self.carriers: list[Any] = []  # the transport's; the core does not look inside
        self._text_id = 0
        self._silent_until = 0
        self._idle_since = 0.0
        self._serve()

    def _serve(self) -> None:
        """The protocols of a vehicle, of which none has begun."""
        self.missions = Missions(self)
        self.requests = Requests(self)
        self._handlers: dict[int, Handler] = {
            M.MAVLINK_MSG_ID_COMMAND_LONG: self._on_command,
            M.MAVLINK_MSG_ID_COMMAND_INT: self._on_command,
            M.MAVLINK_MSG_ID_SET_MODE: self._on_set_mode,
            M.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            M.MAVLINK_MSG_ID_MANUAL_CONTROL: self._on_manual_control,
            M.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE: self._on_rc_override,
            **self.missions.handlers,
            **self.requests.message_handlers,
            **ParameterProtocol(self).handlers,
            **Setpoints(self).handlers,
        }

    def _boot(self) -> None:
        self.firmware = FIRMWARES[self.settings.flavor](self.settings)
        self.vehicle = self.firmware.vehicle
        self._home_sent, self._reached = False, -1
        if self.firmware.flavor.heartbeat_on_mode_change:
            self.firmware.mode_changed = lambda: self.broadcast(heartbeat(self))

    def reboot(self) -> None:
        """Start again, as after a brown-out: the motors stop, the body and the stored things stay."""
        old = self.firmware
        self._boot()
        self.firmware.keep(old)
        self._silent_until = self.steps + _REBOOT_STEPS
        for link in self.links:
            link.reset()

    def replace(self, flavor: str, sysid: int) -> None:
        """Another vehicle stands at the launch point, on the same lines: nothing of this one is there any more.

        Raises:
            ValueError: there is no such vehicle, or this one is not on the ground with its motors off.
        """
        if flavor not in FIRMWARES:
            raise ValueError(f"no flavor {flavor!r}; there are: {', '.join(sorted(FIRMWARES))}")
        if not 1 <= sysid <= 255:
            raise ValueError("sysid is from 1 to 255")
        if self.vehicle.armed or not self.vehicle.body.on_ground:
            raise ValueError("a vehicle is replaced on the ground, with its motors off")
        self.settings = replace(self.settings, flavor=flavor, sysid=sysid)
        self._boot()
        self.faults.clear()
        self._later.clear()
        self._idle_since, self._silent_until = self.clock, self.steps + _REBOOT_STEPS
        self.unknown_messages, self.refusals = set(), {}
        self._serve()
        for link in self.links:
            link.begin()

    def later(self, seconds: float, act: Callable[[], None]) -> None:
        """Do something after some seconds."""
        self._later.append((self.clock + seconds, act))

    @property
    def clock(self) -> float:
        """Seconds since the first boot."""
        return self.steps * STEP_S

    # ---- what the telemetry builders read
    @property
    def time_ms(self) -> int:
        """Vehicle time since boot, milliseconds."""
        return self.vehicle.steps * 20

    # ---- input and output
    def add_link(self) -> Link:
        """A new connection."""
        link = Link(self)
        self.links.append(link)
        return link

    def remove_link(self, link: Link) -> None:
        """The connection is gone."""
        self.links.remove(link)

    def receive(self, link: Link, data: bytes) -> None:
        """Take bytes that came on a link."""
        if link.shaky:
            if not self.trouble.deaf:
                link.into.put(data, self.clock)
        else:
            self.take(link, data)

    def take(self, link: Link, data: bytes) -> None:
        """Obey bytes that have made it through the radio."""
        messages = link.parse(data)
        if self.frozen or self.steps < self._silent_until:
            return
        for message in messages:
            self._dispatch(link, message)
        self._flush_texts()

    def advance(self, steps: int = 1) -> None:
        """Move vehicle time on by some steps."""
        for _ in range(steps):
            self.steps += 1
            vehicle = self.vehicle
            vehicle.step()
            if self.steps % _TICK_STEPS == 0:
                self._do_what_is_due()
                self.faults.tick()
                for link in self.links:
                    link.shake()
                if not self.frozen and self.steps >= self._silent_until:
                    self._tick()
            if self.steps < self._silent_until:
                continue
            now = self.vehicle.steps * _STEP_US
            for link in self.links:
                if self.frozen:
                    link.beat(now)
                else:
                    link.stream(now)

    def broadcast(self, message: Any) -> None:
        """Send a message on every link."""
        for link in self.links:
            link.send(message)

    def announce_current(self) -> None:
        """Tell every link the current mission item."""
        self.broadcast(BUILDERS[M.MAVLINK_MSG_ID_MISSION_CURRENT](self))

    # ---- inside
    def _do_what_is_due(self) -> None:
        due = [each for each in self._later if each[0] <= self.clock]
        for each in due:
            self._later.remove(each)
            each[1]()

    def _tick(self) -> None:
        self.firmware.tick()
        if self._battery_is_swapped():
            return
        self.missions.tick()
        plan = self.firmware.plan
        if plan.reached != self._reached:
            self._reached = plan.reached
            if plan.reached >= 0:
                self.broadcast(M.MAVLink_mission_item_reached_message(plan.reached))
                self.announce_current()
        if not self._home_sent and self.vehicle.home is not None:
            self._home_sent = True
            self.broadcast(BUILDERS[M.MAVLINK_MSG_ID_HOME_POSITION](self))
            self.broadcast(BUILDERS[M.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN](self))
        self._flush_texts()

    def _battery_is_swapped(self) -> bool:
        """On the ground with the motors off somebody puts a full battery in, which starts the autopilot again."""
        patience, vehicle = self.settings.swap_battery_s, self.vehicle
        if patience is None or vehicle.armed or not vehicle.body.on_ground or vehicle.battery.percent > 90:
            self._idle_since = self.clock
            return False
        if self.clock - self._idle_since < patience:
            return False
        vehicle.battery.charge, vehicle.battery.used_mah = 1.0, 0.0
        self.reboot()
        return True

    def _flush_texts(self) -> None:
        texts = self.vehicle.texts
        while texts:
            severity, text = texts.popleft()
            if len(text) <= _CHUNK:
                self.broadcast(M.MAVLink_statustext_message(severity, text.encode("ascii", "replace")))
                continue
            self._text_id = self._text_id % 65535 + 1
            for k, start in enumerate(range(0, len(text), _CHUNK)):
                part = text[start : start + _CHUNK].encode("ascii", "replace")
                self.broadcast(M.MAVLink_statustext_message(severity, part, self._text_id, k))

    def _dispatch(self, link: Line, message: Any) -> None:
        number = message.get_msgId()
        handler = self._handlers.get(number)
        if handler is None:
            return
        firmware = self.firmware
        if not firmware.obeys(message.get_srcSystem(), message.get_srcComponent()):
            return
        if number != _HEARTBEAT:
            target = getattr(message, "target_system", getattr(message, "target", None))
            if target is not None and not firmware.hears(target, getattr(message, "target_component", 0)):
                return
        handler(link, message)

    def _on_command(self, link: Line, message: Any) -> None:
        command = ReceivedCommand.of(message)
        results = self._obey(link, command)
        to = message.get_srcSystem(), message.get_srcComponent()
        for result in results:
            link.send(M.MAVLink_command_ack_message(command.number, int(result), 0, 0, *to))

    def _obey(self, link: Line, command: ReceivedCommand) -> Results:
        refusal = self.refusals.get(command.number)
        if refusal is not None:
            if refusal[1]:
                self.vehicle.say(CRITICAL, refusal[1])
            return (refusal[0],)
        service = self.requests.handlers.get(command.number)
        return self.firmware.handle(command) if service is None else service(link, command)

    def _on_set_mode(self, link: Line, message: Any) -> None:
        to = message.get_srcSystem(), message.get_srcComponent()
        for result in self.firmware.on_set_mode_message(message.custom_mode):
            link.send(M.MAVLink_command_ack_message(M.MAV_CMD_DO_SET_MODE, int(result), 0, 0, *to))

    def _on_heartbeat(self, link: Line, message: Any) -> None:
        is_companion = message.get_srcSystem() == self.settings.sysid and message.get_srcComponent() != 1
        if is_companion and message.type == M.MAV_TYPE_ONBOARD_CONTROLLER:
            self.firmware.companion_heard_at = self.vehicle.time

    def _on_manual_control(self, link: Line, message: Any) -> None:
        sticks = self.vehicle.sticks
        sticks.heard_at = self.vehicle.time
        sticks.pitch, sticks.roll = message.x / 1000.0, message.y / 1000.0
        sticks.throttle, sticks.yaw = (message.z - 500) / 500.0, message.r / 1000.0

    def _on_rc_override(self, link: Line, message: Any) -> None:
        sticks = self.vehicle.sticks
        sticks.heard_at = self.vehicle.time
        raw = (message.chan1_raw, message.chan2_raw, message.chan3_raw, message.chan4_raw)
        roll, pitch, throttle, yaw = ((each - 1500) / 500.0 if 900 <= each <= 2100 else 0.0 for each in raw)
        sticks.roll, sticks.pitch, sticks.throttle, sticks.yaw = roll, -pitch, throttle, yaw

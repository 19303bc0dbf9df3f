"""The vehicle as the rest of the service sees it: what is known of it, and what it can be told to do.

    async with Vehicle.open("udpin://0.0.0.0:14540", clock=clock, settings=MavlinkSettings()) as vehicle:
        await vehicle.connect(30.0)
        await vehicle.enter_guided()  # an order: the aircraft is ours to move until its pilot takes it
        vehicle.reposition(47.3977, 8.5456, 520.0)
        async for event in vehicle.events():
            ...

Waiting is done here and in the shell, deciding in the core. Before anything that moves the aircraft is sent, everything
that the wire has is read first (`Shell.pump`), so that the decision is taken on the last heartbeat there is.
"""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import AsyncIterator, Callable

from service.clock import Clock
from service.mavlink.autopilots.base import Autopilot
from service.mavlink.command import Command
from service.mavlink.core import LinkCore
from service.mavlink.errors import CommandFailed, NotAnswered, NotPermitted, NoVehicle
from service.mavlink.events import (
    Accepted,
    Cancelled,
    Notice,
    Outcome,
    Refused,
    Silent,
    Target,
    VehicleEvent,
)
from service.mavlink.history import PastPose, PoseHistory
from service.mavlink.modes import mode_title
from service.mavlink.settings import MavlinkSettings
from service.mavlink.shell import Shell
from service.mavlink.telemetry import Telemetry
from service.mavlink.transports import make_transport
from service.mavlink.url import parse_url

log = logging.getLogger("roisearch")
_MODE_S = 6.0
_COMPLAINT_S = 0.3
_ARM_AGAIN_S = 2.0
_LATELY_S = 10.0
_CLIMB_START_S = 20.0
_CLIMB_MPS = 0.7  # at least, unless its parameters say that it climbs more slowly
_CLIMB_SHARE = 0.7  # of what they say, on the whole way up
_CLOCKS_APART_S = 60.0
_SEVERITY_INFO = 6
_SEVERITY_WARNING = 4


class Vehicle:
    """One aircraft on one link. Made by `Vehicle.open`."""

    def __init__(self, shell: Shell) -> None:
        self._shell = shell
        self._clock = shell.clock
        self.settings = shell.core.settings

    @classmethod
    @contextlib.asynccontextmanager
    async def open(
        cls, url: str, *, clock: Clock, settings: MavlinkSettings | None = None
    ) -> AsyncIterator[Vehicle]:
        """Open the link and keep it up for as long as the block lasts.

        Raises:
            BadInput: the address cannot be used, or the signing timestamp cannot be kept.
            LinkError: the port or device cannot be opened, and is not waited for.
        """
        shell = Shell(make_transport(parse_url(url)), clock, settings or MavlinkSettings())
        async with shell.running():
            yield cls(shell)

    @property
    def _core(self) -> LinkCore:
        return self._shell.core

    # ---- what is known

    @property
    def address(self) -> str:
        """The link's address, with the port in use."""
        return self._shell.address

    @property
    def telemetry(self) -> Telemetry:
        """What can be believed now of what the vehicle has said."""
        return self._core.telemetry_at(self._clock.now())

    @property
    def received(self) -> float | None:
        """The part of the autopilot's last messages that arrived, 0 to 1; None before there were any."""
        return self._core.quality.received

    @property
    def history(self) -> PoseHistory:
        """Where it has been."""
        return self._core.history

    @property
    def autopilot(self) -> Autopilot | None:
        """Its kind, once it has been heard."""
        return self._core.autopilot

    @property
    def in_control(self) -> bool:
        """Whether it is ours to move."""
        return self._core.in_control

    @property
    def target(self) -> Target | None:
        """The last target sent, unless it was given up."""
        return self._core.target

    def missing(self) -> list[str]:
        """What this vehicle lacks that must be there before it leaves the ground, as sentences' ends."""
        return self._core.missing()

    def pose_at(self, time: float) -> PastPose | None:
        """Where it was at a time of the service's clock, or None if that is not known."""
        return self._core.history.pose_at(time)

    def time_of_boot(self, boot_s: float) -> float | None:
        """The service's time at its time since boot, or None if that is not known."""
        return self._core.history.time_of_boot(boot_s)

    def why_not_reposition(self) -> str | None:
        """Why `reposition` would refuse now, as a sentence's end, or None."""
        return self._core.why_not_reposition(self._clock.now())

    def events(self) -> AsyncIterator[VehicleEvent]:
        """Everything that happens, in order, from the opening of the link on; ends when the link is closed.

        There is one stream of events, for one reader.
        """
        return self._shell.events()

    @property
    def events_waiting(self) -> bool:
        """True while `telemetry` is ahead of what the reader of `events` has been told."""
        return self._shell.events_waiting

    async def wait_until(self, condition: Callable[[Telemetry], bool], timeout_s: float) -> bool:
        """Wait until what is known fulfils a condition; False if it did not in time."""
        return await self._shell.until(lambda: condition(self.telemetry) or None, timeout_s) is not None

    # ---- waiting for a vehicle

    async def connect(self, timeout_s: float) -> Telemetry:
        """Wait for a vehicle and its first position.

        Raises:
            NoVehicle: none was heard in time, or not one that can be flown.
        """
        while not await self.wait_until(lambda t: self._core.paired and t.position_known, timeout_s):
            why = self._why_none(timeout_s)
            if not self.settings.wait_for_ever:
                raise NoVehicle(why)
            log.warning("%s; it is still waited for, as it may be in the air", why)
        return self.telemetry

    def _why_none(self, timeout_s: float) -> str:
        """Why no vehicle was heard in time."""
        core, where = self._core, self._shell.address
        if core.autopilot is not None:
            return (
                f"system {core.telemetry.system_id} ({core.autopilot.title}) is heard on {where} "
                f"but has sent no position in {timeout_s:g} s; it may have no GPS fix yet"
            )
        if core.rejected:
            return f"the only autopilot heard on {where} cannot be flown: {core.rejected}"
        signer = core.codec.signer
        if signer is not None and signer.behind_s > _CLOCKS_APART_S and not core.messages_received:
            return (
                f"MAVLink is heard on {where}, signed with our key at a time that is {signer.behind_s:.0f} s behind "
                f"ours: our clock is wrong, or was, as {self.settings.signing_timestamp_file} has it; set it, delete "
                "that file"
            )
        if core.codec.refused and not core.messages_received:
            return (
                f"MAVLink is heard on {where}, but not signed with our key ({core.codec.refused} frames refused); "
                "is the key that of the vehicle, and does this link of it sign?"
            )
        if core.messages_received:
            return f"MAVLink is heard on {where}, but no autopilot's heartbeat in {timeout_s:g} s"
        if core.bytes_received:
            return f"bytes arrive on {where}, but they are not MAVLink; is the baud rate right?"
        return f"nothing was heard on {where} in {timeout_s:g} s"

    async def wait_ready(self, timeout_s: float) -> None:
        """Wait until the vehicle can be armed.

        Raises:
            CommandFailed: it could not in time; the message has what it complained about.
        """
        since = self._clock.now()
        if not await self.wait_until(lambda t: t.ready_to_arm, timeout_s):
            t = self.telemetry
            missing = [
                name
                for name, there in (
                    ("a healthy pre-arm check", t.prearm_ok),
                    ("a 3D fix", t.fix >= 3),
                    ("a home position", t.home is not None),
                )
                if not there
            ]
            lacks = ", ".join(missing) or "a pre-arm check that stays healthy"
            lacks += self._complaint(since)
            raise CommandFailed(f"the vehicle is not ready to arm after {timeout_s:g} s: it lacks {lacks}")

    # ---- orders of an operator

    def forget(self, system_id: int | None = None) -> None:
        """On an operator's order: this is another aircraft from now on, the next that is heard on the link or, with a
        system id, that one alone; `connect` waits for it. Nothing is known of it until then, and it is not ours."""
        self._shell.forget(system_id)

    async def enter_guided(self, *, there: bool = False, out_of: str | None = None) -> None:
        """On an operator's order: enter the guided mode if need be, and take control.

        Args:
            there: nobody has ordered it: its pilot gives the aircraft over by having selected the mode, or an earlier
                process has left it in that, or in the one that only stops, where it stays.
            out_of: nobody has ordered it just now: only out of this mode, which its pilot may have left since.

        Raises:
            NotPermitted: the vehicle is not heard, or is not in the mode where it has to be `there`.
            CommandFailed: it does not enter the mode.
        """
        self._shell.pump()
        stays = there and self.telemetry.stopped
        if not (self.telemetry.guided or stays) and (there or out_of not in (None, self.telemetry.mode)):
            raise NotPermitted(f"its pilot has selected {mode_title(self.telemetry.mode)}")
        if not (self.telemetry.guided or stays) or self._core.goes_by_itself(self._clock.now()):
            autopilot = self._need_autopilot()
            await self._reach(autopilot.set_mode(autopilot.guided_mode), autopilot.guided_mode, ordered=True)
        self._core.take_control(self._clock.now())

    async def arm(self) -> None:
        """On the ground, in our control (`enter_guided`): arm; tried again for `settings.arming_patience_s`, while what
        the vehicle says against it is told as notices.

        Raises:
            NotPermitted: arming is not allowed to this process, or the vehicle is not in our control.
            CommandFailed: it does not arm.
        """
        until, told = self._clock.now() + self.settings.arming_patience_s, ""
        while refusal := await self._arm_once():
            if self._clock.now() >= until and (self.missing() or not self.telemetry.ready_to_arm):
                raise NotPermitted(f"the vehicle was not armed: {refusal}")
            if self._clock.now() >= until:
                raise CommandFailed(f"the vehicle did not arm: {refusal}")
            if refusal != told:
                self._shell.publish([Notice(self._clock.now(), f"not armed yet: {refusal}")])
                told = refusal
            await self._clock.sleep(_ARM_AGAIN_S)

    async def _arm_once(self) -> str:
        """Arm; returns why it did not, or nothing."""
        self._shell.pump()
        if not self.settings.allow_arming:
            raise NotPermitted("this service was not allowed to arm or take off (--takeoff)")
        if self.telemetry.armed:
            return ""
        since = self._clock.now()
        if self.in_control:
            await self.wait_until(lambda _: self._core.reposition_known, self._shell.patience(5.0))
        if missing := self.missing():
            return "; ".join(missing)
        if not self.telemetry.ready_to_arm:
            return "it is not ready" + self._complaint(since - _LATELY_S)
        if not self.in_control:
            raise NotPermitted(f"the vehicle was not armed: {self.telemetry.control_reason}")
        outcome = await self._shell.ask(self._need_autopilot().arm())
        if await self.wait_until(lambda t: t.armed, self._shell.patience(3.0)):
            return ""
        return await self._explain(outcome, since)

    async def take_off(self, height_m: float) -> None:
        """Climb to a height above home, armed and in our control; returns when up there in the guided mode.

        Raises:
            NotPermitted: not armed, not on the ground, not in our control, or not allowed to this process.
            CommandFailed: it did not get there; whatever it does then, it does by itself.
        """
        self._shell.pump()
        autopilot, t, since = self._need_autopilot(), self.telemetry, self._clock.now()
        if not 1.0 <= height_m <= self.settings.max_height_change_m:
            limit = self.settings.max_height_change_m
            raise NotPermitted(
                f"no take-off to {height_m} m: between 1 and {limit:g} m above home is possible"
            )
        if not t.armed or t.landed_state != "on_ground":
            state = "armed" if t.armed else "not armed"
            raise NotPermitted(f"no take-off: the vehicle is {state} and says {t.landed_state!r}")
        command = autopilot.take_off(height_m, t.home_alt_amsl_m)
        outcome = await self._shell.ask(command)
        if not isinstance(outcome, Accepted) and not self._climbing():
            raise CommandFailed(f"the vehicle did not take off: {await self._explain(outcome, since)}")

        def ended() -> str | None:
            t = self.telemetry
            if not t.in_control:
                return t.control_reason
            up = t.landed_state == "in_air" and t.alt_home_m >= height_m - max(0.1 * height_m, 1.0)
            return "up" if up and t.guided else None

        result = await self._shell.until(ended, self._shell.patience(climb_s(height_m, t.most_climb_mps)))
        if result != "up":
            t = self.telemetry
            why = (
                result
                or f"it is at {t.alt_home_m:.1f} m and says {t.landed_state!r}, mode {mode_title(t.mode)}"
            )
            raise CommandFailed(f"the take-off to {height_m:g} m did not end: {why}{self._complaint(since)}")

    async def return_to_launch(self, *, ordered: bool = False) -> None:
        """Fly home and land there.

        Args:
            ordered: an operator has just ordered it, so it may be taken from the pilot's hands.

        Raises:
            NotPermitted, CommandFailed: the heartbeat does not show the mode.
        """
        autopilot = self._need_autopilot()
        await self._go(autopilot.return_to_launch(), autopilot.return_mode, ordered=ordered)

    async def land(self, *, ordered: bool = False) -> None:
        """Land here. Arguments and errors as for `return_to_launch`."""
        autopilot = self._need_autopilot()
        await self._go(autopilot.land(), autopilot.land_mode, ordered=ordered)

    # ---- the search's own steps

    def reposition(self, lat: float, lon: float, alt_amsl_m: float) -> float:
        """Send the aircraft to a place; returns the time at which that went out.

        Whether it flies there is told by TargetTaken or TargetNotTaken.

        Raises:
            NotPermitted: it is not ours to move now, or the place is not one to fly to. Nothing was sent.
        """
        self._shell.pump()
        self._core.reposition(lat, lon, alt_amsl_m, self._clock.now())
        self._shell.flush()
        return self._clock.now()

    def hold(self, least_amsl_m: float = math.nan) -> float:
        """Stop here, in the guided mode, not below an altitude above the sea (NaN: at the present one); returns the
        time at which that went out. Raises NotPermitted."""
        self._shell.pump()
        self._core.hold(self._clock.now(), least_amsl_m)
        self._shell.flush()
        return self._clock.now()

    def brake(self) -> float:
        """Stop here without knowing where 'here' is; returns the time at which that went out. Raises NotPermitted.

        ArduCopter stops in its mode BRAKE, which was asked for and so is no pilot's: `enter_guided` leads out of it.
        PX4 stays in Hold.
        """
        self._shell.pump()
        self._core.brake(self._clock.now())
        self._shell.flush()
        return self._clock.now()

    async def set_speed(self, speed_mps: float) -> None:
        """Fly at this ground speed from now on.

        Raises:
            NotPermitted: it is not ours to move now, or not a speed to fly at.
            CommandFailed: the vehicle refused.
        """
        if not 0.1 <= speed_mps <= self.settings.max_speed_mps:
            limit = self.settings.max_speed_mps
            raise NotPermitted(f"no speed of {speed_mps} m/s: between 0.1 and {limit:g} m/s is possible")
        self._shell.pump()
        since = self._clock.now()
        outcome = await self._shell.ask(self._need_autopilot().change_speed(speed_mps))
        if not isinstance(outcome, Accepted):
            why = await self._explain(outcome, since)
            raise CommandFailed(f"the vehicle did not take a speed of {speed_mps:g} m/s: {why}")

    def release_control(self, reason: str) -> None:
        """Give control up until `enter_guided`: nothing that moves the aircraft is sent any more."""
        self._core.release_control(reason, self._clock.now())
        self._shell.flush()

    def stand_by(self, reason: str) -> None:
        """What was sent is not wanted any more: neither the last target nor a command that moves it is repeated."""
        self._core.stand_by(reason, self._clock.now())

    def status_text(self, text: str, severity: int = _SEVERITY_INFO) -> bool:
        """Say something to the pilot; False if no vehicle was heard yet."""
        said = self._core.status_text(text, severity)
        self._shell.flush()
        return said

    # ---- what orders share

    def _need_autopilot(self) -> Autopilot:
        if self._core.autopilot is None:
            raise NotPermitted("no vehicle has been heard")
        return self._core.autopilot

    def _climbing(self) -> bool:
        return self.telemetry.landed_state in ("takeoff", "in_air")

    async def _go(self, command: Command, mode: str, *, ordered: bool) -> None:
        self._shell.pump()
        if self.telemetry.mode == mode and self.telemetry.armed:
            return
        await self._reach(command, mode, ordered=ordered)

    async def _reach(self, command: Command, mode: str, *, ordered: bool) -> None:
        """Send a command and wait for the mode it leads to; the heartbeat is the judge, not the answer."""
        since = self._clock.now()
        before = self.telemetry.mode
        outcome = await self._shell.ask(command, ordered=ordered)
        wait = 0.0 if isinstance(outcome, Cancelled) else self._shell.patience(_MODE_S)
        if not await self.wait_until(lambda t: t.mode == mode, wait):
            why, (was, wanted) = await self._explain(outcome, since), map(mode_title, (before, mode))
            failed = NotAnswered if isinstance(outcome, Silent) else CommandFailed
            raise failed(f"the vehicle did not go from {was} to {wanted}: {why}")

    async def _explain(self, outcome: Outcome, since: float) -> str:
        """What became of a command that did not do what it should, for a person."""
        await self._clock.sleep(_COMPLAINT_S)
        match outcome:
            case Accepted():
                said = "it accepted, and did not do it"
            case Refused(name=name):
                said = f"it answered {name}"
            case Cancelled(reason=reason):
                said = reason
            case _:
                said = "it did not answer"
        return said + self._complaint(since)

    def _complaint(self, since: float) -> str:
        """What the vehicle has said about it, if anything."""
        texts = [t.text for t in self._core.recent_texts(since) if t.severity <= _SEVERITY_WARNING]
        return f" (it says: {texts[-1]})" if texts else ""


def climb_s(height_m: float, most_climb_mps: float | None) -> float:
    """How long a take-off to a height may last, of an aircraft that climbs so fast at most (None: not told)."""
    told = math.inf if most_climb_mps is None else _CLIMB_SHARE * most_climb_mps
    return _CLIMB_START_S + height_m / min(_CLIMB_MPS, told)

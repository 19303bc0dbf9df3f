"""What PX4 and ArduCopter have in common, and the interface behind which they differ.

A firmware owns the vehicle, decides what it does (modes, arming, take-off, failsafes) and how it answers.
`Px4` and `ArduCopter` each fill in this class; nothing outside them asks which one it talks to.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

from sim.autopilot.behaviours import GoTo, Hold, Stand
from sim.autopilot.commands import ACCEPTED, UNSUPPORTED, ReceivedCommand, Results, whole
from sim.autopilot.dialect import M
from sim.autopilot.fence import Fence
from sim.autopilot.flavors import Flavor
from sim.autopilot.parameters import ParameterStore
from sim.autopilot.plan import Plan
from sim.autopilot.settings import Settings
from sim.autopilot.vehicle import Behaviour, Landed, Point, Vehicle

FORCE = 21196.0  # param2 of COMPONENT_ARM_DISARM: do it whatever the checks say
INFO, WARNING, CRITICAL, EMERGENCY = 6, 4, 2, 0  # MAV_SEVERITY
RECKONS_S = 3.0  # without GPS the estimate is worth nothing after this long


def link_floor_s(speedup: float) -> float:
    """Vehicle time in which a lost link may not be called lost yet: 0.1 s of wall time.

    The talk of others comes at the pace of the wall clock; the real simulators stretch these time-outs too.
    """
    return 0.1 * speedup


class Firmware(ABC):
    """One flavour's mind. Times are vehicle time in seconds."""

    flavor: ClassVar[Flavor]

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.vehicle = Vehicle(
            settings,
            self.flavor.limits,
            error_m=self.flavor.position_error_m,
            error_mps=self.flavor.velocity_error_mps,
            cells=self.flavor.cells,
        )
        self.vehicle.behaviour = Stand()
        self.mode = self.flavor.boot_mode
        self.failsafe = False
        self.link_floor_s = link_floor_s(settings.speedup)
        self.parameters = ParameterStore(self.flavor.parameters)
        self.plan, self.fence = Plan(), Fence()
        self.ready = False
        self.companion_heard_at: float | None = None
        self.gps_lost_at: float | None = None
        self.reckons_s = RECKONS_S
        self.arming_refusal: str | None = None  # a fault: why it does not arm although it says it is ready
        self.mode_changed: Callable[[], None] = lambda: None
        self.handlers: dict[int, Callable[[ReceivedCommand], Results]] = {
            M.MAV_CMD_COMPONENT_ARM_DISARM: self.on_arm,
            M.MAV_CMD_NAV_TAKEOFF: self.on_takeoff,
            M.MAV_CMD_NAV_LAND: self.on_land,
            M.MAV_CMD_NAV_RETURN_TO_LAUNCH: self.on_return,
            M.MAV_CMD_DO_REPOSITION: self.on_reposition,
            M.MAV_CMD_DO_SET_MODE: self.on_set_mode,
            M.MAV_CMD_DO_CHANGE_SPEED: self.on_change_speed,
            M.MAV_CMD_DO_FENCE_ENABLE: self.on_fence_enable,
            M.MAV_CMD_DO_SET_HOME: self.on_set_home,
            M.MAV_CMD_MISSION_START: self.on_mission_start,
            M.MAV_CMD_DO_SET_MISSION_CURRENT: self.on_set_current,
            M.MAV_CMD_DO_PAUSE_CONTINUE: self.on_pause_continue,
        }
        self.boot()

    # ---- the interface a flavour fills in
    @abstractmethod
    def behaviour_of(self, mode: str) -> Behaviour:
        """What the vehicle does on entering a mode."""

    @abstractmethod
    def hears(self, system: int, component: int) -> bool:
        """Does it take a message addressed to this system and component?"""

    @abstractmethod
    def obeys(self, system: int, component: int) -> bool:
        """Does it take a message from this sender?"""

    @abstractmethod
    def on_arm(self, command: ReceivedCommand) -> Results:
        """COMPONENT_ARM_DISARM."""

    @abstractmethod
    def on_takeoff(self, command: ReceivedCommand) -> Results:
        """NAV_TAKEOFF."""

    @abstractmethod
    def on_reposition(self, command: ReceivedCommand) -> Results:
        """DO_REPOSITION."""

    @abstractmethod
    def on_set_mode(self, command: ReceivedCommand) -> Results:
        """DO_SET_MODE."""

    @abstractmethod
    def on_set_mode_message(self, custom_mode: int) -> Results:
        """The SET_MODE message."""

    @abstractmethod
    def on_change_speed(self, command: ReceivedCommand) -> Results:
        """DO_CHANGE_SPEED."""

    @abstractmethod
    def on_setpoint(
        self, position: Point | None, velocity: tuple[float, float, float] | None, yaw: float | None
    ) -> None:
        """A position or velocity setpoint (SET_POSITION_TARGET_*), in the home frame."""

    @abstractmethod
    def on_mission_start(self, command: ReceivedCommand) -> Results:
        """MISSION_START."""

    @abstractmethod
    def disarmed(self, landed: bool) -> None:
        """The motors have stopped."""

    @abstractmethod
    def watch(self) -> None:
        """Ten times a second: what only this flavour watches (failsafes, texts)."""

    @abstractmethod
    def system_status(self) -> int:
        """MAV_STATE of the heartbeat."""

    @abstractmethod
    def boot(self) -> None:
        """Start from nothing: the flavour's own state."""

    def keep(self, old: Firmware) -> None:
        """Take over from before a reboot what a reboot does not change: the world and the stored things."""
        vehicle, before = self.vehicle, old.vehicle
        vehicle.body, vehicle.battery, vehicle.gps = before.body, before.battery, before.gps
        vehicle.wind, vehicle.air, vehicle.estimator = before.wind, before.air, before.estimator
        self.parameters, self.plan, self.fence = old.parameters, old.plan, old.fence
        self.link_floor_s = old.link_floor_s

    def stored_items(self, items: list[Any]) -> list[Any]:
        """How uploaded mission items are kept."""
        return items

    @abstractmethod
    def plan_received(self, kind: int) -> None:
        """A mission, fence or rally upload is complete."""

    @abstractmethod
    def upload_timed_out(self) -> None:
        """A mission upload was given up."""

    def kind_after_set(self, kind: int) -> int:
        """MAV_PARAM_TYPE in the answer to a PARAM_SET."""
        return kind

    # ---- what both do alike
    def handle(self, command: ReceivedCommand) -> Results:
        """Obey one command and say how it is acknowledged."""
        handler = self.handlers.get(command.number)
        if handler is None:
            return UNSUPPORTED
        return handler(command)

    def set_mode(self, mode: str, behaviour: Behaviour | None = None) -> None:
        """Enter a mode; without a behaviour, the one that belongs to it."""
        changed = mode != self.mode
        self.mode = mode
        if behaviour is not None or changed:
            self.vehicle.behaviour = self.behaviour_of(mode) if behaviour is None else behaviour
        if changed:
            self.mode_changed()

    def fly(self, behaviour: Behaviour) -> None:
        """Do something else in the same mode, unless a fault keeps the vehicle from it."""
        if not self.vehicle.stuck:
            self.vehicle.behaviour = behaviour

    def arm(self, text: str) -> None:
        """Start the motors."""
        vehicle = self.vehicle
        if not vehicle.armed:
            vehicle.armed, vehicle.armed_at, vehicle.flew = True, vehicle.time, False
            vehicle.say(INFO, text)
            vehicle.behaviour = self.behaviour_of(self.mode)

    def disarm(self, text: str, *, landed: bool) -> None:
        """Stop the motors."""
        vehicle = self.vehicle
        if vehicle.armed:
            vehicle.armed, vehicle.flew, self.failsafe = False, False, False
            vehicle.say(INFO, text)
            if vehicle.body.on_ground:
                vehicle.behaviour = Stand()
            self.disarmed(landed)

    def on_land(self, command: ReceivedCommand) -> Results:
        """NAV_LAND."""
        self.set_mode(self.flavor.land_mode)
        return ACCEPTED

    def on_return(self, command: ReceivedCommand) -> Results:
        """NAV_RETURN_TO_LAUNCH."""
        self.set_mode(self.flavor.return_mode)
        return ACCEPTED

    def on_fence_enable(self, command: ReceivedCommand) -> Results:
        """DO_FENCE_ENABLE."""
        return UNSUPPORTED

    def on_pause_continue(self, command: ReceivedCommand) -> Results:
        """DO_PAUSE_CONTINUE."""
        return UNSUPPORTED

    def on_set_home(self, command: ReceivedCommand) -> Results:
        """DO_SET_HOME: to where it is, or to a place."""
        vehicle = self.vehicle
        place = command.place_e7
        if command.param1 == 1.0 or place is None:
            vehicle.home = vehicle.seen
        else:
            vehicle.home = Point(*vehicle.frame.from_e7(*place), self.up_of_amsl(command.z))
        return ACCEPTED

    def pilot(self, mode: str) -> None:
        """The pilot selects a mode."""
        self.failsafe = False
        self.set_mode(mode)

    def fail_to(self, mode: str, text: str) -> None:
        """A failsafe of its own: say so and change the mode."""
        self.vehicle.say(CRITICAL, text)
        self.set_mode(mode)
        self.failsafe = True

    def on_reboot(self, command: ReceivedCommand) -> Results:
        """PREFLIGHT_REBOOT_SHUTDOWN: only while disarmed."""
        return self.flavor.reboot_refusal if self.vehicle.armed else ACCEPTED

    @abstractmethod
    def on_breach(self, forced: bool) -> None:
        """It has left the fence; `forced`: come home whatever the parameters say."""

    def on_set_current(self, command: ReceivedCommand) -> Results:
        """DO_SET_MISSION_CURRENT."""
        return ACCEPTED if self.plan.select(whole(command.param1)) else UNSUPPORTED

    @property
    def prearm_healthy(self) -> bool:
        """The pre-arm bit of SYS_STATUS."""
        return self.ready

    @property
    def position_known(self) -> bool:
        """Does the vehicle know where it is?"""
        lost = self.gps_lost_at
        known = lost is None or self.vehicle.time - lost < self.reckons_s
        return known and not self.vehicle.estimator.bad and self.vehicle.home is not None

    def home_or_here(self) -> Point:
        """Home, or the place of take-off before there is one."""
        return self.vehicle.home or Point(0.0, 0.0, 0.0)

    def place(self, command: ReceivedCommand) -> tuple[float, float] | None:
        """Metres north and east of a command's place; None is "here"."""
        place = command.place_e7
        return None if place is None else self.vehicle.frame.from_e7(*place)

    def holding(self) -> Behaviour:
        """Hold what it flies to now, or brake and hold, as on entering the guided mode."""
        vehicle = self.vehicle
        if not vehicle.armed or vehicle.body.on_ground:
            return Stand()
        if vehicle.body.speed < 0.3:
            seen = vehicle.seen
            return (
                GoTo(Point(seen.north, seen.east, seen.up)) if abs(vehicle.body.velocity_up) < 0.2 else Hold()
            )
        return Hold()

    def tick(self) -> None:
        """Ten times a second: readiness, landing, disarming, what the flavour watches."""
        vehicle = self.vehicle
        time = vehicle.time
        if (
            vehicle.home is None
            and time >= self.flavor.home_share * self.settings.ready_after_s
            and not vehicle.gps.lost
        ):
            vehicle.home = Point(vehicle.seen.north, vehicle.seen.east, 0.0)
        if vehicle.gps.lost:
            if self.gps_lost_at is None:
                self.gps_lost_at = time
        else:
            self.gps_lost_at = None
        if vehicle.crashed and vehicle.armed:
            vehicle.say(EMERGENCY, "Crash: Disarming")
            self.disarm("Motors stopped", landed=False)
        if vehicle.battery.charge <= 0.0 and vehicle.flying:
            vehicle.say(EMERGENCY, "Battery is empty")
            self.disarm("Motors stopped", landed=False)
        self.ready = time >= self.settings.ready_after_s and self.position_known
        if vehicle.armed:
            self._watch_landing(time)
        elif vehicle.body.on_ground:
            vehicle.landed = Landed.ON_GROUND
        self.watch()

    def _watch_landing(self, time: float) -> None:
        vehicle = self.vehicle
        if not vehicle.body.on_ground:
            vehicle.landed = vehicle.behaviour.landed
        elif vehicle.flew:
            if (
                time - vehicle.touched_at >= self.flavor.landing_takes_s
                and vehicle.landed != Landed.ON_GROUND
            ):
                vehicle.landed = Landed.ON_GROUND
                self.landing_seen()
            if time - vehicle.touched_at >= self.flavor.landing_takes_s + self.flavor.disarm_after_landing_s:
                self.disarm(self.disarm_text(landed=True), landed=True)
        else:
            vehicle.landed = Landed.ON_GROUND
            if time - vehicle.armed_at >= self.flavor.idle_disarm_s:
                self.disarm(self.disarm_text(landed=False), landed=False)

    @abstractmethod
    def landing_seen(self) -> None:
        """It has noticed that it stands on the ground."""

    @abstractmethod
    def disarm_text(self, *, landed: bool) -> str:
        """What it says when it disarms by itself."""

    def breaches_fence(self, north: float, east: float) -> bool:
        """Is a point in the home frame forbidden by the fence?"""
        return not self.fence.empty and not self.fence.allows(*self.vehicle.frame.to_e7(north, east))

    def up_of_amsl(self, altitude: float) -> float:
        """Height in the home frame of an altitude above mean sea level; NaN keeps the present height."""
        if not math.isfinite(altitude):
            return self.target_or_seen().up
        return altitude - self.vehicle.ground_amsl

    @property
    def steered(self) -> tuple[float, float, float] | None:
        """The velocity (north, east, up) that somebody gives it, where it flies that and to no place."""
        return None

    def target_or_seen(self) -> Point:
        """Where it is going, or where it is."""
        return self.vehicle.behaviour.target or self.vehicle.seen

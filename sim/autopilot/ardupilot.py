"""ArduCopter 4.7: its modes, refusals and failsafes, as recorded from the real one."""

from __future__ import annotations

import copy
import math
import random
from typing import Any

from sim.autopilot.behaviours import (
    FollowSetpoints,
    FollowSticks,
    GoTo,
    Land,
    Paused,
    Return,
    Stand,
    TakeOff,
)
from sim.autopilot.commands import ACCEPTED, DENIED, FAILED, UNSUPPORTED, ReceivedCommand, Results, whole
from sim.autopilot.dialect import M
from sim.autopilot.firmware import CRITICAL, FORCE, INFO, WARNING, Firmware
from sim.autopilot.flavors import ARDUCOPTER
from sim.autopilot.parameters import REAL32
from sim.autopilot.plan import FlyPlan
from sim.autopilot.vehicle import Behaviour, Landed, Point

_MODE_OF = {number: name for name, (_, number) in ARDUCOPTER.modes.items()}
_ARMABLE = ("STABILIZE", "ACRO", "ALT_HOLD", "GUIDED", "LOITER", "POSHOLD", "AUTO")
_STICK_MODES = ("STABILIZE", "ACRO", "ALT_HOLD", "LOITER", "POSHOLD")
_NEED_POSITION = ("AUTO", "GUIDED", "LOITER", "RTL", "CIRCLE", "POSHOLD", "BRAKE", "SMART_RTL")
_ABSOLUTE = (M.MAV_FRAME_GLOBAL, M.MAV_FRAME_GLOBAL_INT)
_RELATIVE = (M.MAV_FRAME_GLOBAL_RELATIVE_ALT, M.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_VELOCITY_TIMEOUT_S = 3.0
_EARLY = (0.40, 0.55)  # of the time from boot to ready: the pre-arm bit reads healthy too early


class ArduCopter(Firmware):
    """ArduCopter 4.7.0-dev as its SITL quad answers on the first port."""

    flavor = ARDUCOPTER

    def boot(self) -> None:
        self._too_early = random.Random(self.settings.seed).random() < 2 / 3
        self._told: dict[str, bool] = {}
        self._low_said = 0
        self._breached = False
        self._fence_on = False
        self._velocity_at: float | None = None
        self._setpoints = FollowSetpoints()
        self._steers_to_place = False  # GUIDED's position control runs
        self._boot_texts = [
            (0.0, "Barometer 1 calibration complete"),
            (0.0, "Barometer 2 calibration complete"),
            (1.5, "ArduPilot Ready"),
            (1.5, "AHRS: DCM active"),
            (3.0, "EKF3 IMU0 initialised"),
            (3.0, "AHRS: EKF3 active"),
            (4.0, "EKF3 IMU0 tilt alignment complete"),
            (6.0, "GPS 1: detected u-blox"),
        ]
        if self._too_early:
            when = (_EARLY[1] + 0.05) * self.settings.ready_after_s
            self._boot_texts.append((max(when, 6.0), "PreArm: Need Position Estimate"))

    def kind_after_set(self, kind: int) -> int:
        return REAL32

    def hears(self, system: int, component: int) -> bool:
        return system in (0, self.settings.sysid)

    def obeys(self, system: int, component: int) -> bool:
        return (system, component) != (self.settings.sysid, 1)

    @property
    def prearm_healthy(self) -> bool:
        """The bit reads healthy for a moment long before there is a position, as in two boots of three."""
        share = self.vehicle.time / max(self.settings.ready_after_s, 1e-9)
        return self.ready or (self._too_early and _EARLY[0] <= share < _EARLY[1])

    def system_status(self) -> int:
        if self.vehicle.time < 1.5:
            return int(M.MAV_STATE_BOOT)
        if self.failsafe:
            return int(M.MAV_STATE_CRITICAL)
        up = self.vehicle.armed and self.vehicle.flew and self.vehicle.landed != Landed.ON_GROUND
        return int(M.MAV_STATE_ACTIVE if up else M.MAV_STATE_STANDBY)

    # ---- modes
    def behaviour_of(self, mode: str) -> Behaviour:
        if not self.vehicle.armed:
            return self.holding()
        if mode == "LAND":
            return self._landing(None)
        if mode in ("RTL", "SMART_RTL"):
            return self._return()
        if mode == "AUTO":
            return FlyPlan(
                self.plan, first=1, take_off=self._climb_to, land=self._landing, go_home=self._return
            )
        if mode in _STICK_MODES:
            return FollowSticks()
        return self.holding()

    def _climb_to(self, up: float) -> TakeOff:
        return TakeOff(up, spool_s=2.6, slow_below=0.0, slow_climb=self.flavor.limits.climb)

    def _landing(self, place: tuple[float, float] | None) -> Land:
        return Land(fast=1.5, slow=0.5, slow_below=10.0, place=place)

    def _return(self) -> Return:
        home, seen = self.home_or_here(), self.vehicle.seen
        height = max(seen.up, home.up + self.parameters["RTL_ALT_M"])
        land = self._landing((home.north, home.east))
        return Return(home, height, wait_s=5.0, land=land, say=lambda text: None)

    def on_set_mode(self, command: ReceivedCommand) -> Results:
        if not whole(command.param1) & M.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return DENIED
        return ACCEPTED if self._enter(whole(command.param2)) else FAILED

    def on_set_mode_message(self, custom_mode: int) -> Results:
        self._enter(custom_mode)
        return ()

    def _enter(self, number: int) -> bool:
        vehicle = self.vehicle
        mode = _MODE_OF.get(number)
        if mode is None:
            vehicle.say(WARNING, f"No such mode {number}")
            return False
        if vehicle.armed and mode in _NEED_POSITION and not self.position_known:
            vehicle.say(WARNING, f"Mode change to {mode} failed: requires position")
            return False
        if mode == "AUTO" and vehicle.armed and len(self.plan.mission) < 2:
            vehicle.say(WARNING, "Mode change to AUTO failed: No Mission")
            return False
        self.failsafe = False
        self.set_mode(mode)
        return True

    # ---- commands
    def on_arm(self, command: ReceivedCommand) -> Results:
        vehicle = self.vehicle
        force = command.param2 == FORCE
        if command.param1 == 0.0:
            if vehicle.flying and not force:
                return FAILED
            self.disarm("Disarming motors", landed=False)
            return ACCEPTED
        if vehicle.armed:
            return ACCEPTED
        reason = None if force else self._why_not_arm()
        if reason is not None:
            vehicle.say(CRITICAL, f"Arm: {reason}")
            return FAILED
        self.arm("Arming motors")
        return ACCEPTED

    def _why_not_arm(self) -> str | None:
        vehicle = self.vehicle
        if vehicle.time < 2.0:
            return "System not initialised"
        if self.mode not in _ARMABLE:
            return f"{self.mode} mode not armable"
        if self.arming_refusal is not None or not self.ready:
            return self.arming_refusal or self.flavor.not_ready_text
        sticks = vehicle.sticks
        if (
            self.mode in ("GUIDED", "AUTO")
            and vehicle.time - sticks.heard_at < 3.0
            and sticks.throttle > -0.9
        ):
            return "Throttle (RC3) is not neutral"
        return None

    def on_takeoff(self, command: ReceivedCommand) -> Results:
        vehicle = self.vehicle
        if not vehicle.armed or self.mode != "GUIDED" or vehicle.flying or not 0 < command.z < math.inf:
            return FAILED
        if not vehicle.stuck:
            self._steers_to_place = False
            vehicle.behaviour = self._climb_to(self.home_or_here().up + command.z)
        return ACCEPTED

    def on_reposition(self, command: ReceivedCommand) -> Results:
        vehicle = self.vehicle
        if command.frame is None:
            return UNSUPPORTED
        if command.frame in _ABSOLUTE:
            up = command.z - vehicle.ground_amsl
        elif command.frame in _RELATIVE:
            up = command.z + self.home_or_here().up
        else:
            vehicle.say(INFO, f"Unknown mavlink coordinate frame {command.frame}")
            return DENIED
        if not self._is_place(command) or not math.isfinite(command.z):
            return DENIED
        flags = whole(command.param2)
        if self.mode != "GUIDED" and (not flags & 1 or not self.position_known):
            return DENIED
        north, east = vehicle.frame.from_e7(command.x, command.y)
        if self._fence_on and self.breaches_fence(north, east):
            return FAILED
        if vehicle.flying and not vehicle.stuck:
            self.failsafe = False
            self.set_mode("GUIDED")
            self._steer_to(GoTo(Point(north, east, up)))
        elif self.mode != "GUIDED" and not vehicle.stuck:
            self.set_mode("GUIDED")
        return ACCEPTED

    def _steer_to(self, leg: GoTo) -> None:
        """Fly to a place in GUIDED. Its position control begins with the default speed, whatever was asked before."""
        self._velocity_at = None
        if not self._steers_to_place:
            self._steers_to_place = True
            self.vehicle.speed_limit = None
        paused = isinstance(self.vehicle.behaviour, Paused)  # until it is continued, or the mode is left
        self.vehicle.behaviour = Paused(leg) if paused else leg

    def set_mode(self, mode: str, behaviour: Behaviour | None = None) -> None:
        if mode != self.mode:
            self._steers_to_place = False
        super().set_mode(mode, behaviour)

    @staticmethod
    def _is_place(command: ReceivedCommand) -> bool:
        place = command.place_e7
        if place is None or (place[0] == 0 and place[1] == 0):
            return False
        return abs(place[0]) <= 90e7 and abs(place[1]) <= 180e7

    def on_change_speed(self, command: ReceivedCommand) -> Results:
        if not command.param2 > 0:
            return DENIED
        self.vehicle.speed_limit = min(command.param2, 20.0)
        return ACCEPTED

    def on_fence_enable(self, command: ReceivedCommand) -> Results:
        if command.param1 not in (0.0, 1.0, 2.0):
            return FAILED
        self._fence_on = command.param1 == 1.0
        return ACCEPTED

    def on_pause_continue(self, command: ReceivedCommand) -> Results:
        """In GUIDED it stays where it is, whatever target it is given, until it is continued (`ModeGuided::pause`)."""
        vehicle = self.vehicle
        if self.mode != "GUIDED" or not vehicle.flying or command.param1 not in (0.0, 1.0):
            return FAILED
        behaviour = vehicle.behaviour
        if command.param1 == 0.0 and not isinstance(behaviour, Paused):
            self.fly(Paused(behaviour))
        elif command.param1 == 1.0 and isinstance(behaviour, Paused):
            self.fly(behaviour.leg)
        return ACCEPTED

    @property
    def steered(self) -> tuple[float, float, float] | None:
        follows = self.mode == "GUIDED" and self.vehicle.behaviour is self._setpoints
        return self._setpoints.velocity if follows else None

    def on_mission_start(self, command: ReceivedCommand) -> Results:
        if len(self.plan.mission) < 2 or not self.vehicle.armed:
            return FAILED
        if not self._enter(ARDUCOPTER.modes["AUTO"][1]):
            return FAILED
        return ACCEPTED

    def on_setpoint(
        self, position: Point | None, velocity: tuple[float, float, float] | None, yaw: float | None
    ) -> None:
        vehicle = self.vehicle
        if self.mode != "GUIDED" or not vehicle.flying or vehicle.stuck:
            return
        if position is not None:
            if self._fence_on and self.breaches_fence(position.north, position.east):
                return
            if vehicle.behaviour.target != position or not isinstance(vehicle.behaviour, GoTo):
                self._steer_to(GoTo(position, yaw=yaw))
            self._velocity_at = None
        elif velocity is not None:
            self._steers_to_place = False
            self._setpoints.position, self._setpoints.velocity = None, velocity
            self._setpoints.yaw, self._velocity_at = yaw, vehicle.time
            vehicle.behaviour = self._setpoints

    def stored_items(self, items: list[Any]) -> list[Any]:
        kept = [copy.copy(each) for each in items]
        for each in kept:
            each.frame = {5: 0, 6: 3, 11: 10}.get(each.frame, each.frame)
            each.current = 0
            if math.isnan(each.param4):
                each.param4 = 0.0
        if kept:  # item 0 is home
            home, frame = self.home_or_here(), self.vehicle.frame
            each = kept[0]
            each.command, each.frame = M.MAV_CMD_NAV_WAYPOINT, M.MAV_FRAME_GLOBAL
            each.param1 = each.param2 = each.param3 = each.param4 = 0.0
            each.x, each.y = frame.to_e7(home.north, home.east)
            each.z = self.vehicle.amsl(home.up)
        return kept

    def upload_timed_out(self) -> None:
        self.vehicle.say(WARNING, "Mission upload timeout")

    def landing_seen(self) -> None:
        """Nothing is said."""

    def plan_received(self, kind: int) -> None:
        if kind == M.MAV_MISSION_TYPE_MISSION:
            self.vehicle.say(INFO, "Flight plan received")
        elif kind == M.MAV_MISSION_TYPE_FENCE:
            self.vehicle.say(7, "Fence Indexed OK")

    # ---- what it watches
    def disarmed(self, landed: bool) -> None:
        """The mode stays what it was."""

    def disarm_text(self, *, landed: bool) -> str:
        return "Disarming motors"

    def watch(self) -> None:
        vehicle, time = self.vehicle, self.vehicle.time
        while self._boot_texts and time >= self._boot_texts[0][0]:
            text = self._boot_texts.pop(0)[1]
            vehicle.say(CRITICAL if text.startswith("PreArm") else INFO, text)
        behaviour = vehicle.behaviour
        if isinstance(behaviour, TakeOff) and behaviour.done and self.mode == "GUIDED":
            vehicle.behaviour = GoTo(behaviour.target)
        if self._velocity_at is not None and time - self._velocity_at > max(
            _VELOCITY_TIMEOUT_S, self.link_floor_s
        ):
            self._velocity_at = None
            if self.mode == "GUIDED":
                vehicle.behaviour = self.holding()
        if vehicle.flew and vehicle.armed and isinstance(behaviour, Stand) and vehicle.flying:
            vehicle.behaviour = self.behaviour_of(self.mode)
        self._watch_position()
        self._watch_battery()
        self._watch_fence()

    def _watch_position(self) -> None:
        lost = not self.position_known and self.vehicle.home is not None
        if lost and not self._told.get("ekf"):
            self.vehicle.say(CRITICAL, "EKF variance")
            if self.vehicle.flying and self.mode in _NEED_POSITION:
                self.vehicle.say(WARNING, "EKF Failsafe: changed to LAND Mode")
                self.set_mode("LAND")
                self.failsafe = True
        self._told["ekf"] = lost

    def _watch_battery(self) -> None:
        battery = self.vehicle.battery
        levels = (
            (0.20, "BATT_FS_LOW_ACT", "Battery 1 is low"),
            (0.10, "BATT_FS_CRT_ACT", "Battery 1 is critical"),
        )
        while self._low_said < len(levels) and battery.charge < levels[self._low_said][0]:
            _, parameter, text = levels[self._low_said]
            self._low_said += 1
            self.vehicle.say(WARNING, f"{text} {battery.voltage:.2f}V used {battery.used_mah:.0f} mAh")
            action = int(self.parameters[parameter])
            if action in (1, 2) and self.vehicle.flying:
                self.set_mode("LAND" if action == 1 else "RTL")
                self.failsafe = True

    def _watch_fence(self) -> None:
        seen = self.vehicle.seen
        outside = self.vehicle.flying and self._fence_on and self.breaches_fence(seen.north, seen.east)
        if outside and not self._breached:
            self.on_breach(False)
        self._breached = outside

    def on_breach(self, forced: bool) -> None:
        self.vehicle.say(WARNING, "Polygon fence breached")
        if forced or int(self.parameters["FENCE_ACTION"]) == 1:
            self.set_mode("RTL")
            self.failsafe = True

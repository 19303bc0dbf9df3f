"""PX4 v1.16: its modes, refusals and failsafes, as recorded from the real one."""

from __future__ import annotations

import math

from sim.autopilot.behaviours import (
    FollowSetpoints,
    FollowSticks,
    GoTo,
    Land,
    Return,
    TakeOff,
)
from sim.autopilot.commands import ACCEPTED, REJECTED, UNSUPPORTED, ReceivedCommand, Results, whole
from sim.autopilot.dialect import M
from sim.autopilot.firmware import CRITICAL, FORCE, INFO, Firmware
from sim.autopilot.flavors import PX4, PX4_MAIN, px4_mode
from sim.autopilot.plan import FlyPlan
from sim.autopilot.vehicle import Behaviour, Point

_MODE_OF = {custom: name for name, (_, custom) in PX4.modes.items()}
_STICK_MODES = ("MANUAL", "ALTCTL", "POSCTL", "ACRO", "STABILIZED")
_STICK_OVERRIDE = 0.3  # COM_RC_STICK_OV: deflection that takes the vehicle out of an automatic mode
_NO_FAILSAFE = ("AUTO_RTL", "AUTO_LAND", "AUTO_TAKEOFF", "AUTO_PRECLAND")


class Px4(Firmware):
    """PX4 v1.16.0 as its SIH quadrotor answers on the ground station link."""

    flavor = PX4

    def boot(self) -> None:
        self._setpoint_at = -1e9
        self._setpoints = FollowSetpoints()
        self._takeoff_up: float | None = None
        self._sticks_held = False
        self._hold_until: float | None = None  # holding after the sticks were lost, before returning
        self._low_said = 0
        self._breached = False
        self._companion_lost = False

    def plan_received(self, kind: int) -> None:
        """Nothing is said."""

    def upload_timed_out(self) -> None:
        self.vehicle.say(CRITICAL, "Operation timeout")

    def hears(self, system: int, component: int) -> bool:
        return system == self.settings.sysid and component in (0, 1)

    def obeys(self, system: int, component: int) -> bool:
        return True

    def system_status(self) -> int:
        if self.vehicle.time < 1.0:
            return int(M.MAV_STATE_UNINIT)
        if self.failsafe:
            return int(M.MAV_STATE_CRITICAL)
        return int(M.MAV_STATE_ACTIVE if self.vehicle.armed else M.MAV_STATE_STANDBY)

    # ---- modes
    def behaviour_of(self, mode: str) -> Behaviour:
        if not self.vehicle.armed:
            return self.holding()
        if mode == "AUTO_TAKEOFF" and self._takeoff_up is not None:
            return self._climb_to(self._takeoff_up)
        if mode == "AUTO_LAND" or mode == "AUTO_PRECLAND":
            return self._landing(None)
        if mode == "AUTO_RTL":
            return self._return()
        if mode == "AUTO_MISSION":
            return FlyPlan(
                self.plan, first=0, take_off=self._climb_to, land=self._landing, go_home=self._return
            )
        if mode == "OFFBOARD":
            return self._setpoints
        if mode in _STICK_MODES:
            return FollowSticks()
        return self.holding()

    def _climb_to(self, up: float) -> TakeOff:
        return TakeOff(up, spool_s=1.5, slow_below=10.0, slow_climb=self.parameters["MPC_TKO_SPEED"])

    def _landing(self, place: tuple[float, float] | None) -> Land:
        return Land(fast=1.5, slow=0.6, slow_below=7.5, place=place)

    def _return(self) -> Return:
        vehicle, home = self.vehicle, self.home_or_here()
        seen = vehicle.seen
        far = math.hypot(seen.north - home.north, seen.east - home.east) > 10.0
        height = max(seen.up, home.up + self.parameters["RTL_RETURN_ALT"]) if far else seen.up
        if vehicle.armed:
            amsl, above = vehicle.amsl(height), height - home.up
            vehicle.say(INFO, f"RTL: start return at {amsl:.0f} m ({above:.0f} m above destination)")
        land = self._landing((home.north, home.east))
        return Return(home, height, wait_s=0.0, land=land, say=lambda text: vehicle.say(INFO, text))

    def set_mode(self, mode: str, behaviour: Behaviour | None = None) -> None:
        if mode != "OFFBOARD":
            self._hold_until = None
        if mode == self.mode and behaviour is None and mode == "AUTO_LOITER":
            return
        super().set_mode(mode, behaviour)

    def on_set_mode(self, command: ReceivedCommand) -> Results:
        if not whole(command.param1) & M.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return ACCEPTED + REJECTED
        main = whole(command.param2)
        return ACCEPTED + self._enter(
            px4_mode(main, whole(command.param3) if main == PX4_MAIN["AUTO"] else 0)
        )

    def on_set_mode_message(self, custom_mode: int) -> Results:
        return self._enter(custom_mode)

    def _enter(self, custom_mode: int) -> Results:
        mode = _MODE_OF.get(custom_mode)
        if mode is None:
            return ACCEPTED  # and nothing changes
        if mode == "OFFBOARD" and self.vehicle.time - self._setpoint_at > self._setpoint_timeout:
            self.vehicle.say(CRITICAL, "Switching to Offboard is currently not available")
            return REJECTED
        if mode == "AUTO_MISSION" and not self.plan.mission:
            self.vehicle.say(CRITICAL, "Switching to Mission is currently not available")
            return REJECTED
        needs_position = mode in ("POSCTL", "OFFBOARD") or (mode.startswith("AUTO_") and mode != "AUTO_LAND")
        if needs_position and self.vehicle.armed and not self.position_known:
            self.vehicle.say(CRITICAL, f"Switching to {mode} is currently not available")
            return REJECTED
        self.failsafe = False
        self.set_mode(mode)
        return ACCEPTED

    # ---- commands
    def on_arm(self, command: ReceivedCommand) -> Results:
        vehicle = self.vehicle
        force = command.param2 == FORCE
        if command.param1 == 0.0:
            if vehicle.flying and not force:
                vehicle.say(CRITICAL, "Disarming denied: not landed")
                return REJECTED
            self.disarm("Disarmed by external command", landed=False)
            return ACCEPTED
        if vehicle.armed:
            return ACCEPTED
        refusal = self.arming_refusal or (None if self.ready else self.flavor.not_ready_text)
        if refusal is not None and not force:
            vehicle.say(CRITICAL, f"Arming denied: {refusal}")
            return REJECTED
        self.arm("Armed by external command")
        return ACCEPTED

    def on_takeoff(self, command: ReceivedCommand) -> Results:
        vehicle = self.vehicle
        height = self.parameters["MIS_TAKEOFF_ALT"] + vehicle.seen.up
        up = command.z - vehicle.ground_amsl if math.isfinite(command.z) else height
        if vehicle.armed and up <= vehicle.seen.up:
            vehicle.say(CRITICAL, "Already higher than takeoff altitude")
            self._takeoff_up = None
        else:
            self._takeoff_up = up
        self.set_mode("AUTO_TAKEOFF", self.behaviour_of("AUTO_TAKEOFF"))
        return ACCEPTED

    def on_land(self, command: ReceivedCommand) -> Results:
        self.vehicle.say(INFO, "Landing at current position")
        return super().on_land(command)

    def on_return(self, command: ReceivedCommand) -> Results:
        self.vehicle.say(INFO, "Returning to launch")
        return super().on_return(command)

    def on_reposition(self, command: ReceivedCommand) -> Results:
        flags = whole(command.param2)
        plain = flags == 1
        if not plain and self.mode != "AUTO_LOITER":
            return UNSUPPORTED
        result = ACCEPTED if plain else UNSUPPORTED  # the guided mode flies there all the same
        vehicle = self.vehicle
        place = self.place(command)
        if place is not None and self.breaches_fence(*place):
            vehicle.say(CRITICAL, "Reposition is outside geofence")
            if plain:
                self.set_mode("AUTO_LOITER")
            return result
        here = self.target_or_seen() if place is None else None
        north, east = (here.north, here.east) if here is not None else place or (0.0, 0.0)
        yaw = math.degrees(command.param4) % 360.0 if math.isfinite(command.param4) else None
        speed = command.param1 if command.param1 > 0 else None
        leg: Behaviour = GoTo(
            Point(north, east, self.up_of_amsl(command.z)), yaw=yaw, speed=speed, straight=True
        )
        if place is None and yaw is None and not math.isfinite(command.z):
            leg = self.behaviour_of("AUTO_LOITER")  # nowhere: it pauses where it can stop
        self.failsafe = False
        if vehicle.flying:
            if not vehicle.stuck:
                self.set_mode("AUTO_LOITER", leg)
        elif plain:
            self.set_mode("AUTO_LOITER")
        return result

    def on_change_speed(self, command: ReceivedCommand) -> Results:
        if command.param2 > 0:
            self.vehicle.speed_limit = min(command.param2, 12.0)
        elif command.param2 < -1.5:
            self.vehicle.speed_limit = None
        return ACCEPTED

    def on_mission_start(self, command: ReceivedCommand) -> Results:
        if not self.plan.mission:
            return REJECTED
        return self._enter(PX4.modes["AUTO_MISSION"][1])

    def on_setpoint(
        self, position: Point | None, velocity: tuple[float, float, float] | None, yaw: float | None
    ) -> None:
        self._setpoint_at = self.vehicle.time
        if self.vehicle.stuck:
            return
        self._setpoints.position, self._setpoints.yaw = position, yaw
        self._setpoints.velocity = velocity or (0.0, 0.0, 0.0)

    @property
    def _setpoint_timeout(self) -> float:
        return max(self.parameters["COM_OF_LOSS_T"], self.link_floor_s)

    # ---- what it watches
    def disarmed(self, landed: bool) -> None:
        if landed:
            self.set_mode("AUTO_LOITER")

    def disarm_text(self, *, landed: bool) -> str:
        return "Disarmed by landing" if landed else "Disarmed by auto preflight disarming"

    def landing_seen(self) -> None:
        self.vehicle.say(INFO, "Landing detected")

    def watch(self) -> None:
        vehicle, time = self.vehicle, self.vehicle.time
        behaviour = vehicle.behaviour
        if self.mode == "AUTO_TAKEOFF" and isinstance(behaviour, TakeOff) and behaviour.done:
            self.set_mode("AUTO_LOITER", GoTo(behaviour.target))
        if self.mode == "AUTO_MISSION" and isinstance(behaviour, FlyPlan) and behaviour.holds is not None:
            vehicle.say(INFO, "Mission finished, loitering")
            self.set_mode("AUTO_LOITER", behaviour.holds)
        if self.mode == "OFFBOARD" and vehicle.armed and time - self._setpoint_at > self._setpoint_timeout:
            self.fail_to("POSCTL", "Failsafe activated")
        self._watch_sticks(time)
        self._watch_companion(time)
        self._watch_position(time)
        self._watch_battery()
        self._watch_fence()

    def _watch_sticks(self, time: float) -> None:
        timeout = max(self.parameters["COM_RC_LOSS_T"], self.link_floor_s) + 0.5
        held = time - self.vehicle.sticks.heard_at < timeout
        lost = self._sticks_held and not held
        self._sticks_held = held
        sticks = self.vehicle.sticks
        pushed = held and max(abs(sticks.pitch), abs(sticks.roll)) > _STICK_OVERRIDE
        if pushed and self.vehicle.flying and self.mode.startswith("AUTO_"):
            self.vehicle.say(INFO, "Pilot took over using sticks")
            self.pilot("POSCTL")
        if lost and self.vehicle.flying and self.mode not in _NO_FAILSAFE and self.mode != "OFFBOARD":
            self.fail_to("AUTO_LOITER", "Failsafe activated: entering Hold for 5 seconds")
            self._hold_until = time + 5.0
        if self._hold_until is not None and time >= self._hold_until:
            self._hold_until = None
            if self.failsafe and self.vehicle.flying:
                self.fail_to("AUTO_RTL", "Failsafe activated")

    def _watch_companion(self, time: float) -> None:
        heard = self.companion_heard_at
        lost = heard is not None and time - heard > max(self.parameters["COM_OBC_LOSS_T"], self.link_floor_s)
        if lost and not self._companion_lost:
            self.vehicle.say(CRITICAL, "Connection to mission computer lost")
        self._companion_lost = lost

    def _watch_position(self, time: float) -> None:
        if self.vehicle.flying and not self.position_known and self.mode not in ("AUTO_LAND", "ALTCTL"):
            self.fail_to("AUTO_LAND", "Failsafe activated")

    def _watch_battery(self) -> None:
        charge = self.vehicle.battery.charge
        levels = (
            (self.parameters["BAT_LOW_THR"], "Low battery level, return advised"),
            (self.parameters["BAT_CRIT_THR"], "Critical battery level, land now"),
            (self.parameters["BAT_EMERGEN_THR"], "Dangerous battery level, land now"),
        )
        while self._low_said < len(levels) and charge < levels[self._low_said][0]:
            self._low_said += 1
            self.vehicle.say(CRITICAL, levels[self._low_said - 1][1])
            action = int(self.parameters["COM_LOW_BAT_ACT"])
            if action > 0 and self._low_said >= 2 and self.vehicle.flying:
                lands = action == 2 or (action == 3 and self._low_said >= 3)
                self.fail_to("AUTO_LAND" if lands else "AUTO_RTL", "Failsafe activated")

    def _watch_fence(self) -> None:
        vehicle = self.vehicle
        outside = vehicle.flying and self.breaches_fence(vehicle.seen.north, vehicle.seen.east)
        if outside and not self._breached:
            self.on_breach(False)
        self._breached = outside

    def on_breach(self, forced: bool) -> None:
        self.vehicle.say(CRITICAL, "Geofence violation: approaching or outside geofence")
        actions = {2: "AUTO_LOITER", 3: "AUTO_RTL", 5: "AUTO_LAND"}
        mode = "AUTO_RTL" if forced else actions.get(int(self.parameters["GF_ACTION"]))
        if mode is not None:
            self.fail_to(mode, "Failsafe activated")

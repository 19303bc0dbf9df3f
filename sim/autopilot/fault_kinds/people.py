"""Those who take the vehicle: its pilot, a ground station, another service, its own failsafes."""

from __future__ import annotations

import math

from sim.autopilot.commands import ReceivedCommand
from sim.autopilot.dialect import M
from sim.autopilot.fault_kinds.kind import Kind, Options
from sim.autopilot.host import Host
from sim.autopilot.vehicle import Point

_HOLD_S = 5.0  # COM_FAIL_ACT_T
_STATION = (255, M.MAV_COMP_ID_MISSIONPLANNER)  # a ground station, as most call themselves


# ---- the pilot
def _pilot(a: Host, options: Options) -> None:
    if options["mode"] != "keep":  # "keep": only moves the sticks
        a.firmware.pilot(options["mode"] or a.firmware.flavor.pilot_mode)


def _pilot_sticks(a: Host, options: Options) -> None:
    sticks = a.vehicle.sticks
    sticks.heard_at = a.vehicle.time
    sticks.pitch, sticks.roll = options["pitch"], options["roll"]
    sticks.throttle, sticks.yaw = options["throttle"], options["yaw"]


def _pilot_lets_go(a: Host, options: Options) -> None:
    sticks = a.vehicle.sticks
    sticks.pitch = sticks.roll = sticks.throttle = sticks.yaw = 0.0


def _pilot_hold(a: Host, options: Options) -> None:
    flavor = a.firmware.flavor
    if options["way"] == "flick" and flavor.hold_mode == flavor.guided_mode:
        a.firmware.pilot(flavor.pilot_mode)
        a.later(options["away_s"], lambda: a.firmware.pilot(flavor.hold_mode))
    else:
        a.firmware.pilot(flavor.hold_mode)


# ---- its own failsafes
def _failsafe(a: Host, options: Options) -> None:
    a.firmware.fail_to(options["mode"] or a.firmware.flavor.return_mode, options["text"])


def _failsafe_hold(a: Host, options: Options) -> None:
    mode, text = a.firmware.flavor.failsafe_hold
    a.firmware.fail_to(mode, text)
    a.later(_HOLD_S, lambda: _hold_is_over(a, options["then"]))


def _hold_is_over(a: Host, then: str) -> None:
    if not a.firmware.failsafe:
        return  # somebody has taken it in the meantime
    if then == "return":
        a.firmware.fail_to(a.firmware.flavor.return_mode, "Failsafe activated")
    else:
        a.firmware.failsafe = False


def _fence_breach(a: Host, options: Options) -> None:
    a.firmware.on_breach(True)


# ---- others who command
def _go_to(a: Host, place: Point) -> None:
    """DO_REPOSITION with the flag that takes the mode, as a ground station sends it; nothing of it is on our wire."""
    latitude, longitude = a.vehicle.frame.to_e7(place.north, place.east)
    frame, command = M.MAV_FRAME_GLOBAL, M.MAV_CMD_DO_REPOSITION
    params = (-1.0, 1.0, 0.0, math.nan)
    a.firmware.handle(ReceivedCommand(command, *params, latitude, longitude, a.vehicle.amsl(place.up), frame))


def _gcs_goes(a: Host, options: Options) -> None:
    home, here = a.firmware.home_or_here(), a.firmware.target_or_seen()
    up = here.up if math.isnan(options["up"]) else home.up + options["up"]
    _go_to(a, Point(home.north + options["north"], home.east + options["east"], up))


def _gcs_altitude(a: Host, options: Options) -> None:
    here = a.firmware.target_or_seen()
    _go_to(a, Point(here.north, here.east, here.up + options["by"]))


def _answered(a: Host, number: int, *given: float) -> None:
    """A command of up to three parameters, whose answer goes over all wires, as a router carries it."""
    one, two, three = (*given, 0.0, 0.0)[:3]
    for result in a.firmware.handle(ReceivedCommand(number, one, two, three, 0.0, 0.0, 0.0, 0.0, None)):
        for link in a.links:
            link.send(M.MAVLink_command_ack_message(number, int(result), 0, 0, *_STATION))


def _gcs_speed(a: Host, options: Options) -> None:
    ground_speed = 1.0
    _answered(a, M.MAV_CMD_DO_CHANGE_SPEED, ground_speed, options["mps"], -1.0)


def _gcs_pauses(a: Host, options: Options) -> None:
    """As ground stations do: PX4 is sent nowhere, and nothing of that is on our wire; ArduCopter pauses."""
    if a.firmware.flavor.pauses_by == M.MAV_CMD_DO_PAUSE_CONTINUE:
        _answered(a, M.MAV_CMD_DO_PAUSE_CONTINUE, 0.0)
        return
    nowhere = (math.nan,) * 4
    a.firmware.handle(ReceivedCommand(M.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, *nowhere, None))


def _gcs_continues(a: Host, options: Options) -> None:
    if a.firmware.flavor.pauses_by == M.MAV_CMD_DO_PAUSE_CONTINUE:
        _answered(a, M.MAV_CMD_DO_PAUSE_CONTINUE, 1.0)


def _gcs_velocity(a: Host, options: Options) -> None:
    a.firmware.on_setpoint(None, (options["north"], options["east"], 0.0), None)


def _gcs_velocity_begins(a: Host, options: Options) -> None:
    _gcs_velocity(a, options)
    if a.firmware.mode != a.firmware.flavor.setpoint_mode and a.vehicle.flying:
        a.firmware.pilot(a.firmware.flavor.setpoint_mode)


def _second_service(a: Host, options: Options) -> None:
    text = b"search SEARCHING: the other one's first waypoint"
    for link in a.links:
        link.send_as(M.MAVLink_statustext_message(6, text), a.settings.sysid, options["component"])


def _second_service_goes_on(a: Host, options: Options) -> None:
    _beat(a, (a.settings.sysid, options["component"]), M.MAV_TYPE_ONBOARD_CONTROLLER)
    every = options["every_s"]
    if every > 0 and a.vehicle.flying and a.steps % max(round(every * 50), 5) == 0:
        _gcs_goes(a, {**options, "up": math.nan})


# ---- others who only speak
def _beat(a: Host, who: tuple[int, int], kind: int, autopilot: int = M.MAV_AUTOPILOT_INVALID) -> None:
    if a.steps % 50 == 0:
        message = M.MAVLink_heartbeat_message(kind, autopilot, 0, 0, M.MAV_STATE_STANDBY, 3)
        for link in a.links:
            link.send_as(message, *who)


def _second_autopilot(a: Host, options: Options) -> None:
    system, component = options["sysid"], M.MAV_COMP_ID_AUTOPILOT1
    _beat(a, (system, component), M.MAV_TYPE_QUADROTOR, a.firmware.flavor.autopilot)
    latitude, longitude = a.vehicle.frame.to_e7(options["north"], options["east"])
    amsl = round(a.vehicle.ground_amsl * 1000.0)
    message = M.MAVLink_global_position_int_message(a.time_ms, latitude, longitude, amsl, 0, 0, 0, 0, 0)
    for link in a.links:
        link.send_as(message, system, component)


def _gcs(a: Host, options: Options) -> None:
    _beat(a, (options["sysid"], M.MAV_COMP_ID_MISSIONPLANNER), M.MAV_TYPE_GCS)


def _camera(a: Host, options: Options) -> None:
    _beat(a, (a.settings.sysid, options["component"]), M.MAV_TYPE_CAMERA)


_STICKS: Options = {"mode": "", "pitch": 0.0, "roll": 0.0, "throttle": 0.0, "yaw": 0.0}

PEOPLE: dict[str, Kind] = {
    "pilot": Kind(
        "The pilot selects a mode (none: the flavour's pilot mode; `keep`: only moves the sticks) and holds sticks "
        "(-1 to 1), on the ground or in the air.",
        _pilot,
        _STICKS,
        step=_pilot_sticks,
        end=_pilot_lets_go,
    ),
    "pilot_hold": Kind(
        "The pilot wants it to hold: on PX4 that is the guided mode, so nothing changes and it flies on (`again`), "
        "or the mode is left and entered within `away_s` (`flick`); on ArduCopter LOITER.",
        _pilot_hold,
        {"way": "again", "away_s": 0.4},
        choices={"way": ("again", "flick")},
    ),
    "failsafe": Kind(
        "A failsafe of its own: it changes the mode (none: return) and says so.",
        _failsafe,
        {"mode": "", "text": "Failsafe activated"},
    ),
    "failsafe_hold": Kind(
        "A failsafe that holds for 5 seconds first, and then returns or recovers.",
        _failsafe_hold,
        {"then": "return"},
        choices={"then": ("return", "recovers")},
    ),
    "fence_breach": Kind("It thinks that it has left its fence, and returns.", _fence_breach),
    "gcs_goes": Kind(
        "A ground station's 'Go to', metres from home; `up` nan: at the height it has.",
        _gcs_goes,
        {"north": 60.0, "east": 0.0, "up": math.nan},
    ),
    "gcs_altitude": Kind(
        "A ground station's 'Change altitude', by metres.",
        _gcs_altitude,
        {"by": 20.0},
    ),
    "gcs_speed": Kind(
        "A ground station's 'Change speed'; its answer is heard on our wire.",
        _gcs_speed,
        {"mps": 2.0},
    ),
    "gcs_pauses": Kind(
        "A ground station's 'Pause': PX4 is told to stop where it is; ArduCopter stays where it is, whatever target "
        "it is given, and its answer is heard on our wire.",
        _gcs_pauses,
        end=_gcs_continues,
    ),
    "gcs_velocity": Kind(
        "Somebody flies it by a velocity, m/s, ten times a second: ArduCopter in the guided mode, PX4 in OFFBOARD.",
        _gcs_velocity_begins,
        {"north": 2.0, "east": 0.0},
        step=_gcs_velocity,
    ),
    "second_service": Kind(
        "A second service on the same aircraft speaks, and sends it metres from home every so many seconds (0: never).",
        _second_service,
        {"component": 191, "every_s": 5.0, "north": 40.0, "east": 0.0},
        step=_second_service_goes_on,
    ),
    "second_autopilot": Kind(
        "Another vehicle speaks on the same link.",
        options={"sysid": 42, "north": 100.0, "east": 0.0},
        step=_second_autopilot,
    ),
    "gcs_heartbeat": Kind("A ground station speaks.", options={"sysid": 254}, step=_gcs),
    "camera_heartbeat": Kind("A camera speaks.", options={"component": 100}, step=_camera),
}

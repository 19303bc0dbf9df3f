"""Every kind of fault: what it does when it begins, while it lasts (ten times a second), when it ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from sim.autopilot.dialect import M
from sim.autopilot.sensors import Wind

if TYPE_CHECKING:
    from sim.autopilot.core import Autopilot

Options = dict[str, Any]
Act = Callable[["Autopilot", Options], None]


def _nothing(autopilot: Autopilot, options: Options) -> None:
    """All of it happens while it lasts."""


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind; `options` are what it can be told, with the defaults, `choices` what some of them may be."""

    begin: Act
    options: Options = field(default_factory=dict)
    step: Act | None = None
    end: Act | None = None
    choices: dict[str, tuple[str, ...]] = field(default_factory=dict)


# ---- the link
def _link_lost(a: Autopilot, options: Options) -> None:
    a.trouble.lost = True
    _shake(a)


def _link_back(a: Autopilot, options: Options) -> None:
    a.trouble.lost = False


def _packets(a: Autopilot, options: Options) -> None:
    for name, value in options.items():
        setattr(a.trouble, name, value)
    _shake(a)


def _packets_well(a: Autopilot, options: Options) -> None:
    for name in options:
        setattr(a.trouble, name, 0.0)


def _acks_lost(a: Autopilot, options: Options) -> None:
    a.trouble.acks_lost = True
    _shake(a)


def _acks_back(a: Autopilot, options: Options) -> None:
    a.trouble.acks_lost = False


def _shake(a: Autopilot) -> None:
    for link in a.links:
        link.shake()


# ---- the vehicle
def _not_flown(a: Autopilot, options: Options) -> None:
    a.vehicle.stuck = True


def _flown_again(a: Autopilot, options: Options) -> None:
    a.vehicle.stuck = False


def _frozen(a: Autopilot, options: Options) -> None:
    a.frozen = True


def _thawed(a: Autopilot, options: Options) -> None:
    a.frozen = False


def _gps_lost(a: Autopilot, options: Options) -> None:
    a.vehicle.gps.lost = True


def _gps_back(a: Autopilot, options: Options) -> None:
    a.vehicle.gps.lost = False


def _gps_jump(a: Autopilot, options: Options) -> None:
    a.vehicle.gps.jump = a.vehicle.estimator.jump = (options["north"], options["east"])


def _gps_jump_back(a: Autopilot, options: Options) -> None:
    a.vehicle.gps.jump = a.vehicle.estimator.jump = (0.0, 0.0)


def _ekf_bad(a: Autopilot, options: Options) -> None:
    a.vehicle.estimator.bad = True


def _ekf_good(a: Autopilot, options: Options) -> None:
    a.vehicle.estimator.bad = False


def _battery(a: Autopilot, options: Options) -> None:
    a.vehicle.battery.charge = min(max(options["percent"] / 100.0, 0.0), 1.0)


def _battery_critical(a: Autopilot, options: Options) -> None:
    parameter, actions = a.firmware.critical_battery
    a.firmware.parameters.set(parameter, actions[options["action"]])
    _battery(a, options)


def _wind(a: Autopilot, options: Options) -> None:
    a.vehicle.wind = Wind((options["north"], options["east"]), options["gust"], a.chance)


def _calm(a: Autopilot, options: Options) -> None:
    a.vehicle.wind = Wind(a.settings.wind_mps, a.settings.gust_mps, a.chance)


def _reboot(a: Autopilot, options: Options) -> None:
    a.reboot()


# ---- who is in charge
def _pilot(a: Autopilot, options: Options) -> None:
    if options["mode"] != "keep":  # "keep": only moves the sticks
        a.firmware.pilot(options["mode"] or a.firmware.pilot_mode)


def _pilot_sticks(a: Autopilot, options: Options) -> None:
    sticks = a.vehicle.sticks
    sticks.heard_at = a.vehicle.time
    sticks.pitch, sticks.roll = options["pitch"], options["roll"]
    sticks.throttle, sticks.yaw = options["throttle"], options["yaw"]


def _pilot_lets_go(a: Autopilot, options: Options) -> None:
    sticks = a.vehicle.sticks
    sticks.pitch = sticks.roll = sticks.throttle = sticks.yaw = 0.0


def _failsafe(a: Autopilot, options: Options) -> None:
    a.firmware.fail_to(options["mode"] or a.firmware.return_mode, options["text"])


def _fence_breach(a: Autopilot, options: Options) -> None:
    a.firmware.on_breach(True)


# ---- others on the wire
def _beat(a: Autopilot, system: int, component: int, kind: int, autopilot: int) -> None:
    if a.steps % 50 == 0:
        message = M.MAVLink_heartbeat_message(kind, autopilot, 0, 0, M.MAV_STATE_STANDBY, 3)
        for link in a.links:
            link.send_as(message, system, component)


def _second_autopilot(a: Autopilot, options: Options) -> None:
    system, autopilot = options["sysid"], a.firmware.autopilot
    _beat(a, system, M.MAV_COMP_ID_AUTOPILOT1, M.MAV_TYPE_QUADROTOR, autopilot)
    latitude, longitude = a.vehicle.frame.to_e7(options["north"], options["east"])
    amsl = round(a.vehicle.ground_amsl * 1000.0)
    message = M.MAVLink_global_position_int_message(a.time_ms, latitude, longitude, amsl, 0, 0, 0, 0, 0)
    for link in a.links:
        link.send_as(message, system, M.MAV_COMP_ID_AUTOPILOT1)


def _gcs(a: Autopilot, options: Options) -> None:
    _beat(a, options["sysid"], M.MAV_COMP_ID_MISSIONPLANNER, M.MAV_TYPE_GCS, M.MAV_AUTOPILOT_INVALID)


def _camera(a: Autopilot, options: Options) -> None:
    _beat(a, a.settings.sysid, options["component"], M.MAV_TYPE_CAMERA, M.MAV_AUTOPILOT_INVALID)


_STICKS: Options = {"mode": "", "pitch": 0.0, "roll": 0.0, "throttle": 0.0, "yaw": 0.0}
_RATES: Options = {"drop": 0.0, "duplicate": 0.0, "reorder": 0.0, "delay_s": 0.0, "corrupt": 0.0}

KINDS: dict[str, Kind] = {
    "link_lost": Kind(_link_lost, end=_link_back),
    "packets": Kind(_packets, _RATES, end=_packets_well),
    "acks_lost": Kind(_acks_lost, end=_acks_back),
    "not_flown": Kind(_not_flown, end=_flown_again),
    "frozen": Kind(_frozen, end=_thawed),
    "gps_lost": Kind(_gps_lost, end=_gps_back),
    "gps_jump": Kind(_gps_jump, {"north": 30.0, "east": 0.0}, end=_gps_jump_back),
    "ekf_bad": Kind(_ekf_bad, end=_ekf_good),
    "battery": Kind(_battery, {"percent": 10.0}),
    "battery_critical": Kind(
        _battery_critical,
        {"percent": 6.0, "action": "return"},  # below both autopilots' critical level
        choices={"action": ("return", "land", "warn")},
    ),
    "wind": Kind(_wind, {"north": 0.0, "east": 20.0, "gust": 0.0}, end=_calm),
    "reboot": Kind(_reboot),
    "pilot": Kind(_pilot, _STICKS, step=_pilot_sticks, end=_pilot_lets_go),
    "failsafe": Kind(_failsafe, {"mode": "", "text": "Failsafe activated"}),
    "fence_breach": Kind(_fence_breach),
    "second_autopilot": Kind(_nothing, {"sysid": 42, "north": 100.0, "east": 0.0}, step=_second_autopilot),
    "gcs_heartbeat": Kind(_nothing, {"sysid": 254}, step=_gcs),
    "camera_heartbeat": Kind(_nothing, {"component": 100}, step=_camera),
}

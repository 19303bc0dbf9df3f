"""Faults of the vehicle and its world: sensors, references, battery, wind, a mind of its own."""

from __future__ import annotations

from typing import Any

from sim.autopilot.dialect import M
from sim.autopilot.fault_kinds.kind import Kind, Options
from sim.autopilot.firmware import CRITICAL, RECKONS_S
from sim.autopilot.host import Host
from sim.autopilot.sensors import Wind
from sim.autopilot.telemetry import BUILDERS, battery_status, ekf_status_report, estimator_status, gps2_raw
from sim.autopilot.vehicle import Point

_TICK_S = 0.1


def _not_flown(a: Host, options: Options) -> None:
    a.vehicle.stuck = True


def _flown_again(a: Host, options: Options) -> None:
    a.vehicle.stuck = False


def _frozen(a: Host, options: Options) -> None:
    a.frozen = True


def _thawed(a: Host, options: Options) -> None:
    a.frozen = False


def _reboot(a: Host, options: Options) -> None:
    a.reboot()


def _arming_refused(a: Host, options: Options) -> None:
    a.firmware.arming_refusal = options["text"] or a.firmware.flavor.not_ready_text
    a.vehicle.say(CRITICAL, a.firmware.flavor.not_ready_warning)


def _arming_possible(a: Host, options: Options) -> None:
    a.firmware.arming_refusal = None


# ---- position
def _gps_lost(a: Host, options: Options) -> None:
    a.vehicle.gps.lost = True
    a.firmware.reckons_s = options["reckons_s"]


def _gps_gone(a: Host, options: Options) -> None:
    north, east = a.vehicle.estimator.jump
    step = options["drift_mps"] * _TICK_S
    a.vehicle.estimator.jump = (north + step, east)


def _gps_back(a: Host, options: Options) -> None:
    a.vehicle.gps.lost = False
    a.firmware.reckons_s = RECKONS_S
    a.vehicle.estimator.jump = a.vehicle.gps.jump


def _gps_jump(a: Host, options: Options) -> None:
    a.vehicle.gps.jump = a.vehicle.estimator.jump = (options["north"], options["east"])


def _gps_jump_back(a: Host, options: Options) -> None:
    a.vehicle.gps.jump = a.vehicle.estimator.jump = (0.0, 0.0)


def _ekf_bad(a: Host, options: Options) -> None:
    a.vehicle.estimator.bad = True


def _ekf_good(a: Host, options: Options) -> None:
    a.vehicle.estimator.bad = False


# ---- what heights and places are counted from
def _amsl_corrected(a: Host, options: Options) -> None:
    a.vehicle.ground_amsl += options["metres"]
    _announce_home(a)


def _amsl_as_before(a: Host, options: Options) -> None:
    a.vehicle.ground_amsl -= options["metres"]
    _announce_home(a)


def _home_moved(a: Host, options: Options, sign: float = 1.0) -> None:
    home = a.firmware.home_or_here()
    north, east, up = (sign * options[name] for name in ("north", "east", "up"))
    a.vehicle.home = Point(home.north + north, home.east + east, home.up + up)
    _announce_home(a)


def _home_moved_back(a: Host, options: Options) -> None:
    _home_moved(a, options, -1.0)


def _announce_home(a: Host) -> None:
    if a.vehicle.home is not None:
        a.broadcast(BUILDERS[M.MAVLINK_MSG_ID_HOME_POSITION](a))


def _origin_moved(a: Host, options: Options) -> None:
    a.vehicle.origin = Point(options["north"], options["east"], options["up"])
    a.broadcast(BUILDERS[M.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN](a))


def _origin_moved_back(a: Host, options: Options) -> None:
    a.vehicle.origin = Point(0.0, 0.0, 0.0)
    a.broadcast(BUILDERS[M.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN](a))


def _distance_sensor(a: Host, options: Options) -> None:
    a.vehicle.rangefinder_rise = options["rise"]


def _no_distance_sensor(a: Host, options: Options) -> None:
    a.vehicle.rangefinder_rise = None


def _terrain_report(a: Host, options: Options) -> None:
    a.vehicle.terrain_rise = options["rise"]


def _no_terrain_report(a: Host, options: Options) -> None:
    a.vehicle.terrain_rise = None


# ---- battery
def _battery(a: Host, options: Options) -> None:
    a.vehicle.battery.charge = min(max(options["percent"] / 100.0, 0.0), 1.0)


def _battery_critical(a: Host, options: Options) -> None:
    parameter, actions = a.firmware.flavor.critical_battery
    a.firmware.parameters.set(parameter, actions[options["action"]])
    _battery(a, options)


def _battery_drains(a: Host, options: Options) -> None:
    battery = a.vehicle.battery
    battery.charge = max(0.0, battery.charge - options["percent_per_s"] / 100.0 * _TICK_S)


# ---- more than one of a thing
def _each_second(a: Host, message: Any, beside: int) -> None:
    """Send a second one's message where the first one's is sent."""
    if a.steps % 50 == 0:
        for link in a.links:
            if link.interval_us(beside) >= 0:
                link.send(message)


def _second_battery(a: Host, options: Options) -> None:
    message = battery_status(a)
    message.id, message.battery_remaining = 1, round(options["percent"])
    _each_second(a, message, M.MAVLINK_MSG_ID_BATTERY_STATUS)


def _second_gps(a: Host, options: Options) -> None:
    message = gps2_raw(a)
    message.fix_type, message.satellites_visible = options["fix"], options["satellites"]
    _each_second(a, message, M.MAVLINK_MSG_ID_GPS_RAW_INT)


def _second_estimator(a: Host, options: Options) -> None:
    number = a.firmware.flavor.estimator_message
    message = estimator_status(a) if number == M.MAVLINK_MSG_ID_ESTIMATOR_STATUS else ekf_status_report(a)
    message.flags = options["flags"]
    _each_second(a, message, number)


# ---- air
def _wind(a: Host, options: Options) -> None:
    a.vehicle.wind = Wind((options["north"], options["east"]), options["gust"], a.chance)
    a.vehicle.tells_wind = options["told"] == "yes"


def _calm(a: Host, options: Options) -> None:
    a.vehicle.wind = Wind(a.settings.wind_mps, a.settings.gust_mps, a.chance)
    a.vehicle.tells_wind = False


_METRES: Options = {"north": 0.0, "east": 0.0, "up": 0.0}

VEHICLE: dict[str, Kind] = {
    "not_flown": Kind("Commands are accepted and not flown.", _not_flown, end=_flown_again),
    "frozen": Kind("Only the heart still beats: no telemetry, no answers.", _frozen, end=_thawed),
    "reboot": Kind("A brown-out: it starts again, in flight it falls.", _reboot),
    "arming_refused": Kind(
        "It says it is ready and refuses to arm, as while the estimator is not ready yet.",
        _arming_refused,
        {"text": ""},
        end=_arming_possible,
    ),
    "gps_lost": Kind(
        "No fix; it flies on by dead reckoning for `reckons_s`, drifting north, and then lands.",
        _gps_lost,
        {"reckons_s": RECKONS_S, "drift_mps": 0.0},
        step=_gps_gone,
        end=_gps_back,
    ),
    "gps_jump": Kind(
        "Receiver and estimate jump by metres.",
        _gps_jump,
        {"north": 30.0, "east": 0.0},
        end=_gps_jump_back,
    ),
    "ekf_bad": Kind("The estimator has diverged.", _ekf_bad, end=_ekf_good),
    "amsl_corrected": Kind(
        "The vehicle's sea level is corrected: every AMSL it tells and obeys, of home too, is metres more.",
        _amsl_corrected,
        {"metres": 20.0},
        end=_amsl_as_before,
    ),
    "home_moved": Kind(
        "Somebody moves home by metres; heights above home change with it.",
        _home_moved,
        {**_METRES, "up": 20.0},
        end=_home_moved_back,
    ),
    "origin_moved": Kind(
        "The estimator's origin moves by metres: local positions change, global ones do not.",
        _origin_moved,
        {**_METRES, "north": 100.0, "up": 5.0},
        end=_origin_moved_back,
    ),
    "distance_sensor": Kind(
        "It has a downward distance sensor, over ground that is `rise` metres higher than at home.",
        _distance_sensor,
        {"rise": 0.0},
        end=_no_distance_sensor,
    ),
    "terrain_report": Kind(
        "ArduPilot's own heights of the ground have it `rise` metres higher than it is.",
        _terrain_report,
        {"rise": 0.0},
        end=_no_terrain_report,
    ),
    "battery": Kind("The charge drops to some percent; at 0 the motors stop.", _battery, {"percent": 10.0}),
    "battery_critical": Kind(
        "The charge drops below the critical level, with the autopilot told what to do then.",
        _battery_critical,
        {"percent": 6.0, "action": "return"},  # below both autopilots' critical level
        choices={"action": ("return", "land", "warn")},
    ),
    "battery_drains": Kind(
        "The charge falls by so many percent a second beside what flying takes.",
        step=_battery_drains,
        options={"percent_per_s": 2.0},
    ),
    "second_battery": Kind(
        "There is a second battery, with a level of its own.",
        step=_second_battery,
        options={"percent": 20.0},
    ),
    "second_gps": Kind(
        "There is a second receiver (GPS2_RAW); its fix may be none.",
        step=_second_gps,
        options={"fix": 1, "satellites": 3},
    ),
    "second_estimator": Kind(
        "A second lane of the estimator tells its own flags on the same message.",
        step=_second_estimator,
        options={"flags": 0},
    ),
    "wind": Kind(
        "Wind towards north and east (m/s) with gusts; a stock multicopter does not tell it.",
        _wind,
        {"north": 0.0, "east": 20.0, "gust": 0.0, "told": "no"},
        end=_calm,
        choices={"told": ("no", "yes")},
    ),
}

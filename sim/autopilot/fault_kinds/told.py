"""Faults of what the vehicle tells: streams that stop or freeze, fields that lie, messages it does not know."""

from __future__ import annotations

from sim.autopilot.commands import Result
from sim.autopilot.dialect import M
from sim.autopilot.fault_kinds.kind import Kind, Options
from sim.autopilot.host import Host
from sim.autopilot.voice import (
    fitting,
    names_of,
    number_of,
    put_field,
    replaced,
    shift_field,
    silence,
    still,
)

_BATTERY_SENTINELS: dict[str, dict[str, float]] = {
    "SYS_STATUS": {"battery_remaining": -1, "voltage_battery": 65535, "current_battery": -1},
    "BATTERY_STATUS": {
        "battery_remaining": -1,
        "voltages": 65535,
        "current_battery": -1,
        "current_consumed": -1,
        "charge_state": 0,
    },
}


def _quiet(a: Host, options: Options) -> None:
    a.voice.drop(id(options))


def _stream_stops(a: Host, options: Options) -> None:
    a.voice.put(id(options), silence(names_of(options["message"])))


def _stream_freezes(a: Host, options: Options) -> None:
    moves = options["stamp"] == "moves"
    a.voice.put(id(options), still(names_of(options["message"]), stamps_move=moves))


def _message_named(options: Options) -> None:
    names_of(options["message"])


def _no_message(a: Host, options: Options) -> None:
    names = names_of(options["message"])
    a.unknown_messages |= {number_of(name) for name in names}
    a.voice.put(id(options), silence(names))


def _message_known(a: Host, options: Options) -> None:
    a.unknown_messages -= {number_of(name) for name in names_of(options["message"])}
    _quiet(a, options)


def _field(a: Host, options: Options) -> None:
    name, field = options["message"], options["field"]
    change = put_field(field, fitting(name, field, options["value"]))
    a.voice.put(id(options), replaced(name, change, times=options["times"]))


def _field_fits(options: Options) -> None:
    fitting(options["message"], options["field"], options["value"])


def _field_shifts(a: Host, options: Options) -> None:
    a.voice.put(id(options), replaced(options["message"], shift_field(options["field"], options["by"])))


def _field_there(options: Options) -> None:
    fitting(options["message"], options["field"], 0.0)


def _battery_unknown(a: Host, options: Options) -> None:
    for name, fields in _BATTERY_SENTINELS.items():
        for field, value in fields.items():
            rule = replaced(name, put_field(field, fitting(name, field, value)))
            a.voice.put((id(options), name, field), rule)


def _battery_known(a: Host, options: Options) -> None:
    for name, fields in _BATTERY_SENTINELS.items():
        for field in fields:
            a.voice.drop((id(options), name, field))


def _home_datum(a: Host, options: Options) -> None:
    change = shift_field("altitude", 1000.0 * options["metres"])
    a.voice.put(id(options), replaced("HOME_POSITION", change))


def _command_refused(a: Host, options: Options) -> None:
    a.refusals[_command(options)] = (Result[options["result"]], options["text"])


def _command_taken(a: Host, options: Options) -> None:
    a.refusals.pop(_command(options), None)


def _command(options: Options) -> int:
    name = options["command"]
    number = getattr(M, name, None) if name.startswith("MAV_CMD_") else None
    if number is None:
        raise ValueError(f"MAVLink has no command '{name}'")
    return int(number)


def _command_named(options: Options) -> None:
    _command(options)


TOLD: dict[str, Kind] = {
    "stream_stops": Kind(
        "Some messages (names with commas between) are not sent any more.",
        _stream_stops,
        {"message": "SYS_STATUS"},
        end=_quiet,
        check=_message_named,
    ),
    "stream_freezes": Kind(
        "Some messages say for ever what they said first; their time stamps go on or stand.",
        _stream_freezes,
        {"message": "ATTITUDE", "stamp": "moves"},
        end=_quiet,
        choices={"stamp": ("moves", "stands")},
        check=_message_named,
    ),
    "no_message": Kind(
        "An autopilot that does not know some messages: never sent, and refused to whoever asks.",
        _no_message,
        {"message": "EXTENDED_SYS_STATE"},
        end=_message_known,
        check=_message_named,
    ),
    "field": Kind(
        "A field has another value, such as its sentinel (nan too), in each message or in so many `times`.",
        _field,
        {"message": "GLOBAL_POSITION_INT", "field": "hdg", "value": 65535.0, "times": 0},
        end=_quiet,
        check=_field_fits,
    ),
    "field_shifts": Kind(
        "A field is told with something added to it, in its own unit.",
        _field_shifts,
        {"message": "GLOBAL_POSITION_INT", "field": "alt", "by": 20000.0},
        end=_quiet,
        check=_field_there,
    ),
    "home_datum": Kind(
        "HOME_POSITION has its altitude in another datum (above the ellipsoid): so many metres more.",
        _home_datum,
        {"metres": 47.0},
        end=_quiet,
    ),
    "battery_unknown": Kind(
        "The battery's monitor is gone: all that is told of it are sentinels, while it drains.",
        _battery_unknown,
        end=_battery_known,
    ),
    "command_refused": Kind(
        "A command is answered with a result and perhaps a text, and not obeyed.",
        _command_refused,
        {"command": "MAV_CMD_DO_REPOSITION", "result": "UNSUPPORTED", "text": ""},
        end=_command_taken,
        choices={"result": tuple(result.name for result in Result)},
        check=_command_named,
    ),
}

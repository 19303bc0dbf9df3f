"""Exchanges at boot and on the ground, disarmed: identity, streams, parameters, missions, refusals."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v10 import common as v1

from tests.conformance import transfer
from tests.conformance.compare import Facts
from tests.conformance.dialogue import NAN, Dialogue, entry
from tests.conformance.wire import codec, mav

_ARM, _REQUEST = mav.MAV_CMD_COMPONENT_ARM_DISARM, mav.MAV_CMD_REQUEST_MESSAGE
_VERSION = mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION
_POSITION = mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
_TOLD = (
    "HEARTBEAT",
    "GLOBAL_POSITION_INT",
    "ATTITUDE",
    "SYS_STATUS",
    "BATTERY_STATUS",
    "GPS_RAW_INT",
    "EXTENDED_SYS_STATE",
    "HOME_POSITION",
    "VFR_HUD",
    "POSITION_TARGET_GLOBAL_INT",
)


def arm_before_ready(d: Dialogue) -> Facts:
    """On the first heartbeat after boot: arm, then select the guided mode."""
    d.wait(lambda: d.system, 60)
    facts: Facts = {"mode_at_first_heartbeat": d.mode, "arm_ack": d.long(_ARM, 1)}
    facts["guided_mode_ack"] = d.guided()
    d.listen(1.5)
    return facts | {"armed_after": d.armed}


def discovery(d: Dialogue) -> Facts:
    """What the heartbeat says, and how often."""
    start = d.now
    d.first_bytes = set()
    d.listen(6)
    beat = d.latest["HEARTBEAT"]
    return {
        "component_id": beat.get_srcComponent(),
        "type": entry("MAV_TYPE", beat.type),
        "autopilot": entry("MAV_AUTOPILOT", beat.autopilot),
        "custom_mode_enabled_flag": bool(beat.base_mode & 1),
        "armed": d.armed,
        "mavlink_version_field": beat.mavlink_version,
        "wire_version": sorted({2 if first == 0xFD else 1 for first in d.first_bytes}),
        "heartbeat_hz": d.rate("HEARTBEAT", start),
    }


def default_streams(d: Dialogue) -> Facts:
    """What comes in ten seconds to somebody who asks for nothing."""
    start = d.now
    d.listen(10)
    facts: Facts = {}
    for kind in _TOLD:
        facts[f"sends_{kind}"] = kind in d.arrivals
        rate = d.rate(kind, start)
        if rate:
            facts[f"{kind}_hz"] = rate
    return facts


def readiness(d: Dialogue) -> Facts:
    """When the pre-arm check reads healthy, and where else its bit is set."""
    d.stream()
    facts: Facts = {"becomes_ready": d.wait(lambda: d.ready, 120)}
    status, bit = d.latest["SYS_STATUS"], mav.MAV_SYS_STATUS_PREARM_CHECK
    facts["prearm_bit_present"] = bool(status.onboard_control_sensors_present & bit)
    facts["prearm_bit_enabled"] = bool(status.onboard_control_sensors_enabled & bit)
    facts["home_known_when_ready"] = d.wait(lambda: "HOME_POSITION" in d.latest, 5)
    facts["system_status_when_ready"] = entry("MAV_STATE", d.latest["HEARTBEAT"].system_status)
    return facts


def request_message(d: Dialogue) -> Facts:
    """REQUEST_MESSAGE for the version, for home, for an id nobody knows."""
    d.latest.pop("AUTOPILOT_VERSION", None)
    facts: Facts = {"autopilot_version_ack": d.long(_REQUEST, _VERSION)}
    facts["autopilot_version_sent"] = d.wait(lambda: "AUTOPILOT_VERSION" in d.latest, 2)
    version = d.latest["AUTOPILOT_VERSION"]
    facts["flight_sw_version"] = ".".join(str(version.flight_sw_version >> s & 255) for s in (24, 16, 8))
    for name in (
        "COMMAND_INT",
        "MISSION_INT",
        "MISSION_FENCE",
        "SET_POSITION_TARGET_GLOBAL_INT",
        "MAVLINK2",
        "PARAM_ENCODE_BYTEWISE",
        "PARAM_ENCODE_C_CAST",
    ):
        facts[f"capability_{name}"] = bool(
            version.capabilities & getattr(mav, f"MAV_PROTOCOL_CAPABILITY_{name}")
        )
    facts["home_position_ack"] = d.long(_REQUEST, mav.MAVLINK_MSG_ID_HOME_POSITION)
    facts["unknown_message_ack"] = d.long(_REQUEST, 54321)
    return facts


def message_interval(d: Dialogue) -> Facts:
    """One stream at 10 Hz, off, at 20 Hz; its interval read back in two ways; an id nobody knows."""
    facts: Facts = {}
    for label, interval in (("10hz", 1e5), ("off", -1), ("20hz", 5e4)):
        facts[f"{label}_ack"] = d.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, _POSITION, interval)
        d.listen(1)
        start = d.now
        d.listen(4)
        facts[f"{label}_measured_hz"] = d.rate("GLOBAL_POSITION_INT", start)
    facts["unknown_id_ack"] = d.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, 54321, 1e5)
    for label, command in (
        ("request_message_244", (_REQUEST, 244, _POSITION)),
        ("get_message_interval", (mav.MAV_CMD_GET_MESSAGE_INTERVAL, _POSITION)),
    ):
        first = len(d.kept)
        facts[f"{label}_ack"] = d.long(*command)
        facts[f"{label}_us"] = [m.interval_us for m in d.kept[first:] if m.get_type() == "MESSAGE_INTERVAL"]
    return facts


def parameters(d: Dialogue) -> Facts:
    """Read and set a real, an integer and a missing parameter."""
    real, integer = ("MIS_TAKEOFF_ALT", "GF_ACTION") if d.px4 else ("FENCE_RADIUS", "FENCE_ACTION")

    def ask(message: Any) -> list[Any]:
        first = len(d.kept)
        d.send(message)
        d.wait(lambda: any(m.get_type() == "PARAM_VALUE" for m in d.kept[first:]), 2)
        d.listen(0.3)
        return [m for m in d.kept[first:] if m.get_type() == "PARAM_VALUE"]

    def put(name: str, value: float, kind: int) -> list[Any]:
        return ask(mav.MAVLink_param_set_message(d.system, 1, name.encode(), value, kind))

    facts: Facts = {}
    for label, name in (("real", real), ("integer", integer), ("missing", "NO_SUCH_PARAM")):
        got = ask(mav.MAVLink_param_request_read_message(d.system, 1, name.encode(), -1))
        facts[f"read_{label}_replies"] = [m.get_type() for m in got]
        if not got:
            continue
        old = got[0]
        facts[f"read_{label}_type"] = entry("MAV_PARAM_TYPE", old.param_type).removeprefix("MAV_PARAM_TYPE_")
        new = old.param_value + 1 if label == "real" else old.param_value
        echoed = put(name, new, old.param_type)
        facts[f"set_{label}_replies"] = [m.get_type() for m in echoed]
        facts[f"set_{label}_echoes_value"] = bool(echoed) and abs(echoed[-1].param_value - new) < 1e-3
        put(name, old.param_value, old.param_type)
    missing = put("NO_SUCH_PARAM", 1.0, mav.MAV_PARAM_TYPE_REAL32)
    return facts | {"set_missing_replies": [m.get_type() for m in missing]}


def wrong_target(d: Dialogue) -> Facts:
    """One command to another system, to another component, to component 0, to everyone."""
    targets = {
        "system_42": (42, 1),
        "component_42": (d.system, 42),
        "component_0": (d.system, 0),
        "broadcast": (0, 0),
    }
    return {
        f"{label}_ack": d.long(_REQUEST, _VERSION, target=target, seconds=1.5)
        for label, target in targets.items()
    }


def unknown_command(d: Dialogue) -> Facts:
    """A command nobody implements, as LONG and as INT."""
    return {"long_ack": d.long(31999), "int_ack": d.whole(31999, 0, (0, 0, 0, 0), 0, 0, 0)}


def mode_commands(d: Dialogue) -> Facts:
    """DO_SET_MODE to the guided mode and to one that does not exist; the SET_MODE message."""
    facts: Facts = {"guided_ack": d.guided()}
    d.listen(1.5)
    facts["mode_after"] = d.mode
    facts["no_such_mode_ack"] = d.long(mav.MAV_CMD_DO_SET_MODE, 1, 99, 0)
    d.send(mav.MAVLink_set_mode_message(d.system, 1, d.latest["HEARTBEAT"].custom_mode))
    return facts | {"set_mode_message_ack": d.answers(mav.MAV_CMD_DO_SET_MODE, 1.5)}


def command_sources(d: Dialogue) -> Facts:
    """The guided mode asked for by several senders, and a request on a second link."""
    sources = {
        "gcs_255_190": (255, 190),
        "gcs_42_190": (42, 190),
        "companion_191": (d.system, 191),
        "same_as_vehicle": (d.system, 1),
    }
    mode = (1, 4, 3) if d.px4 else (1, 4)
    facts: Facts = {
        f"{label}_ack": d.long(mav.MAV_CMD_DO_SET_MODE, *mode, source=source, seconds=1.5)
        for label, source in sources.items()
    }
    ask = mav.MAVLink_command_long_message(d.system, 1, _REQUEST, 0, _VERSION, *(0.0,) * 6)
    heard = d.wire.second(ask.pack(codec((254, 190))))
    acks = [m for m in heard if m.get_type() == "COMMAND_ACK" and m.command == _REQUEST]
    return facts | {"second_link_ack": [entry("MAV_RESULT", m.result) for m in acks][:1]}


def companion_heartbeat(d: Dialogue) -> Facts:
    """Five heartbeats of a companion computer, then ten seconds of its silence."""

    def state() -> tuple[int, ...]:
        beat = d.latest["HEARTBEAT"]
        return beat.type, beat.base_mode, beat.custom_mode, beat.system_status

    before, start = state(), d.now
    beat = mav.MAVLink_heartbeat_message(
        mav.MAV_TYPE_ONBOARD_CONTROLLER, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3
    )
    for _ in range(5):
        d.send(beat, (d.system, 191))
        d.listen(1)
    facts: Facts = {"heartbeat_unchanged": before == state(), "heartbeat_hz": d.rate("HEARTBEAT", start)}
    facts["commands_still_work"] = d.long(_REQUEST, _VERSION)[:1]
    heard = len(d.texts)
    d.listen(10)
    return facts | {"text_when_it_falls_silent": len(d.texts) > heard}


def mavlink1_frame(d: Dialogue) -> Facts:
    """A MAVLink 1 command: is it obeyed, and in which version is it answered?"""
    old = v1.MAVLink(None, srcSystem=255, srcComponent=190)
    command = old.command_long_encode(d.system, 1, _REQUEST, 0, _VERSION, 0, 0, 0, 0, 0, 0)
    d.wire.write(command.pack(old))
    facts: Facts = {"ack": d.answers(_REQUEST)}
    facts["ack_wire_version"] = [2 if a.get_msgbuf()[0] == 0xFD else 1 for a in d.acks][:1]
    d.first_bytes = set()
    d.listen(1)
    return facts | {"stream_wire_version_after": sorted({2 if b == 0xFD else 1 for b in d.first_bytes})}


def garbage_bytes(d: Dialogue) -> Facts:
    """Noise before a frame, a frame with a bad checksum, a false start that swallows one, a clean one."""
    message = mav.MAVLink_command_long_message(d.system, 1, _REQUEST, 0, _VERSION, 0, 0, 0, 0, 0, 0)
    frame = bytes(message.pack(d.codec))
    cases = {
        "noise_then_frame": b"\x00\x11\x22hello\r\n" + frame,
        "bad_checksum": frame[:-1] + bytes([frame[-1] ^ 0x55]),
        "false_start_then_frame": b"\xfd\x10\x00" + frame,
        "clean_frame_after": frame,
    }
    facts: Facts = {}
    for label, data in cases.items():
        d.wire.write(data)
        facts[f"{label}_ack"] = d.answers(_REQUEST, 1.5)
    return facts


def mission_protocol(d: Dialogue) -> Facts:
    """Upload, download, clear, download; then an upload that answers with the wrong item."""
    frame = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    plan = [
        transfer.item(d, 0, mav.MAV_CMD_NAV_TAKEOFF, frame, 0, 0, 20),
        transfer.item(d, 1, mav.MAV_CMD_NAV_WAYPOINT, frame, 40, 0, 20),
        transfer.item(d, 2, mav.MAV_CMD_NAV_WAYPOINT, frame, 40, 40, 20),
    ]
    facts = transfer.prefixed("upload", transfer.upload(d, plan, 0))
    facts |= transfer.prefixed("download", transfer.download(d, 0))
    facts["clear_result"] = transfer.clear(d, 0)
    facts["count_after_clear"] = transfer.download(d, 0)["count"]
    wrong = transfer.upload(d, plan, 0, wrong=True)
    facts["wrong_seq_result"] = wrong["result"]
    facts["wrong_seq_is_asked_again"] = len(wrong["requested"]) > 1
    d.listen(3)
    transfer.clear(d, 0)
    return facts


def reposition_disarmed(d: Dialogue) -> Facts:
    """DO_REPOSITION without and with the change-mode flag, disarmed."""
    facts: Facts = {f"flags_{flags}_ack": d.go(20, 0, flags=flags, wait=0).acks for flags in (0, 1)}
    d.listen(1.5)
    return facts | {"mode_after": d.mode, "armed_after": d.armed}


def takeoff_refused(d: Dialogue) -> Facts:
    """Take-off and RTL while disarmed; ArduCopter: arming in RTL, taking off in STABILIZE."""
    z = d.amsl(20.0) if d.px4 else 20.0
    facts: Facts = {"takeoff_disarmed_ack": d.long(mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, z)}
    d.listen(1.5)
    facts["mode_after_takeoff_disarmed"] = d.mode
    facts["rtl_disarmed_ack"] = d.long(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    d.listen(1.5)
    facts["mode_after_rtl_disarmed"] = d.mode
    if not d.px4:
        facts["arm_in_rtl_mode_ack"] = d.long(_ARM, 1)
        d.select("STABILIZE")
        facts["arm_in_stabilize_ack"] = d.long(_ARM, 1)
        facts["takeoff_in_stabilize_ack"] = d.long(mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, 0, 0, 20)
        facts["disarm_on_ground_ack"] = d.long(_ARM, 0)
    d.guided()
    d.listen(1.5)
    return facts | {"still_on_ground": d.landed[-1] == "ON_GROUND"}


def arm_and_wait(d: Dialogue) -> Facts:
    """Arm, arm again, and wait until it disarms by itself."""
    facts: Facts = {"arm_ack": d.long(_ARM, 1)}
    start = d.now
    facts["armed_flag_follows"] = d.wait(lambda: d.armed, 3)
    facts["system_status_armed"] = entry("MAV_STATE", d.latest["HEARTBEAT"].system_status)
    facts["arm_again_ack"] = d.long(_ARM, 1)
    facts["disarms_itself"] = d.wait(lambda: not d.armed, 40)
    return facts | {"auto_disarm_s": d.now - start, "mode_sequence": d.modes}

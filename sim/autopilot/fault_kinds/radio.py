"""Faults of the link: silence, noise, one direction only, an old version of the protocol."""

from __future__ import annotations

from sim.autopilot.fault_kinds.kind import Kind, Options
from sim.autopilot.host import Host


def _shake(a: Host) -> None:
    for link in a.links:
        link.shake()


def _link_lost(a: Host, options: Options) -> None:
    a.trouble.lost = True
    _shake(a)


def _link_back(a: Host, options: Options) -> None:
    a.trouble.lost = False


def _one_way(a: Host, options: Options) -> None:
    a.trouble.deaf, a.trouble.mute = options["carries"] == "down", options["carries"] == "up"
    _shake(a)


def _both_ways(a: Host, options: Options) -> None:
    a.trouble.deaf = a.trouble.mute = False


def _packets(a: Host, options: Options) -> None:
    for name, value in options.items():
        setattr(a.trouble, name, value)
    _shake(a)


def _packets_well(a: Host, options: Options) -> None:
    for name in options:
        setattr(a.trouble, name, 0.0)


def _acks_lost(a: Host, options: Options) -> None:
    a.trouble.acks_lost = True
    _shake(a)


def _acks_back(a: Host, options: Options) -> None:
    a.trouble.acks_lost = False


def _mavlink1(a: Host, options: Options) -> None:
    a.old_wire = True


def _mavlink2(a: Host, options: Options) -> None:
    a.old_wire = False


_RATES: Options = {"drop": 0.0, "duplicate": 0.0, "reorder": 0.0, "delay_s": 0.0, "corrupt": 0.0}

RADIO: dict[str, Kind] = {
    "link_lost": Kind("Nothing is carried either way.", _link_lost, end=_link_back),
    "one_way": Kind(
        "Only what the vehicle says is carried (`down`), or only what is said to it (`up`).",
        _one_way,
        {"carries": "down"},
        end=_both_ways,
        choices={"carries": ("down", "up")},
    ),
    "packets": Kind(
        "A bad radio: shares (0 to 1) of frames lost, doubled, overtaken or damaged, and a delay.",
        _packets,
        _RATES,
        end=_packets_well,
    ),
    "acks_lost": Kind("No acknowledgement of a command arrives.", _acks_lost, end=_acks_back),
    "mavlink1": Kind(
        "It speaks MAVLink 1: no extension fields, no message above 255; it understands both versions.",
        _mavlink1,
        end=_mavlink2,
    ),
}

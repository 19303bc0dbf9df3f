"""Cursor on Target, version 2.0: aircraft, suspects, the find and searched ground as events for the maps of a TAK team.

The small XML of MITRE's Event-PUBLIC.xsd (a point, a time, until when it holds) with the details that ATAK, WinTAK
and iTAK read: contact, remarks, track, colour. Heights are above launch, which is no height above the ellipsoid:
`hae` stays unknown (9999999), and remarks tell it.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, field

from service.chances import sure
from service.telling.news import iso
from service.telling.searched import POD_AT_LEAST, Outline
from service.view.state import PoseState, RunState

AIRCRAFT = "a-f-A-M-H-Q"
"""Friendly, air, rotary wing, drone (MIL-STD-2525 by CoT's table)."""
SUSPECT = "a-u-G"
"""Unknown, ground."""
FOUND = "b-m-p-s-m"
"""A spot on the map; its colour says the rest."""
SEARCHED = "u-d-f"
"""A shape drawn by hand: a ring of links, each with a place."""
GONE = "t-x-d-d"
"""Takes another event off the maps."""

AIRCRAFT_S, PLACE_S, LASTING_S = 15.0, 120.0, 24 * 3600.0
"""How long an event holds when no other comes; TAK greys it out then."""
_UNKNOWN = "9999999.0"
_RED, _YELLOW = "-65536", "-256"
_GREEN, _PALE_GREEN = "-16744448", "1073774592"  # signed 32 bits: opacity, red, green, blue


@dataclass(frozen=True)
class _Aircraft:
    """What is told of one aircraft; `suffix` ends its identity."""

    suffix: str
    callsign: str
    state: str
    pose: PoseState | None
    battery: float | None


@dataclass
class Events:
    """Makes events of states; remembers what is on the maps, so that it can be taken off."""

    run: str
    callsign: str
    _shown: dict[str, tuple[float, float]] = field(default_factory=dict)
    _outlined: dict[str, tuple[float, float]] = field(default_factory=dict)

    def aircraft(self, state: RunState, time: float) -> list[bytes]:
        """The aircraft, each with its own name where there are several; none of one that nobody knows the place of."""
        if len(state["aircraft"]) < 2:
            only = _Aircraft("", self.callsign, state["state"], state["pose"], state["battery_percent"])
            return self._aircraft(only, state["pos"], time)
        return [
            event
            for each in state["aircraft"]
            for event in self._aircraft(
                _Aircraft(
                    f"-{each['name']}",
                    f"{self.callsign} {each['name']}",
                    each["state"],
                    each["pose"],
                    each["battery"],
                ),
                state["pos"],
                time,
            )
        ]

    def _aircraft(self, one: _Aircraft, pos: float, time: float) -> list[bytes]:
        """One of them, if it is known where it is."""
        pose, battery = one.pose, one.battery
        if pose is None:
            return []
        told = "" if battery is None else f", battery {battery:.0f} %"
        uid = f"roisearch-{self.run}-aircraft{one.suffix}"
        event = _event(uid, AIRCRAFT, time, AIRCRAFT_S, how="m-g")
        _point(event, pose["lat"], pose["lon"])
        detail = ET.SubElement(event, "detail")
        ET.SubElement(detail, "contact", callsign=one.callsign)
        if pose["heading_deg"] is not None:
            ET.SubElement(detail, "track", course=f"{pose['heading_deg'] % 360.0:.1f}")
        if battery is not None:
            ET.SubElement(detail, "status", battery=f"{battery:.0f}")
        _remarks(detail, f"{one.state}, {pose['height_m']:.0f} m above launch, POS {pos:.0%}{told}")
        return [_bytes(event)]

    def places(self, state: RunState, time: float) -> list[bytes]:
        """Suspects, the find, and what is none any more."""
        events, now = [], {}
        found = state["found"]
        if found is not None:
            uid = f"roisearch-{self.run}-found"
            now[uid] = (found["lat"], found["lon"])
            event = _event(uid, FOUND, time, LASTING_S)
            _point(event, found["lat"], found["lon"], found["ellipse"]["semi_major_m"])
            said = f"FOUND at {found['written']}, probability {sure(found['probability'])}"
            _mark(event, f"{self.callsign} FOUND", said, _RED)
            events.append(_bytes(event))
        for each in state["suspects"]:
            uid = f"roisearch-{self.run}-suspect-{each['lat']:.4f},{each['lon']:.4f}"
            now[uid] = (each["lat"], each["lon"])
            event = _event(uid, SUSPECT, time, PLACE_S)
            _point(event, each["lat"], each["lon"])
            said = f"{each['written']}, probability {sure(each['probability'])}, {each['hits']} detections"
            _mark(event, f"{self.callsign} suspect", said, _YELLOW)
            events.append(_bytes(event))
        events += [_gone(uid, place, time) for uid, place in self._shown.items() if uid not in now]
        self._shown = now
        return events

    def searched(self, ground: Sequence[Outline], time: float) -> list[bytes]:
        """The ground that was searched, and outlines that are none any more."""
        events, now = [], {}
        for number, each in enumerate(ground, start=1):
            uid = f"roisearch-{self.run}-searched-{number}"
            now[uid] = each.inside
            event = _event(uid, SEARCHED, time, LASTING_S)
            _point(event, *each.inside)
            detail = ET.SubElement(event, "detail")
            for lat, lon in each.ring:
                ET.SubElement(detail, "link", point=f"{lat:.7f},{lon:.7f}")
            for tag, value in (("strokeColor", _GREEN), ("strokeWeight", "2.0"), ("fillColor", _PALE_GREEN)):
                ET.SubElement(detail, tag, value=value)
            ET.SubElement(detail, "contact", callsign=f"{self.callsign} searched {number}")
            ET.SubElement(detail, "labels_on", value="false")
            _remarks(detail, f"searched: {each.hectares:.1f} ha with a POD of {POD_AT_LEAST:.0%} or more")
            events.append(_bytes(event))
        events += [_gone(uid, place, time) for uid, place in self._outlined.items() if uid not in now]
        self._outlined = now
        return events


def _gone(uid: str, place: tuple[float, float], time: float) -> bytes:
    event = _event(f"{uid}-gone", GONE, time, PLACE_S)
    _point(event, *place)
    detail = ET.SubElement(event, "detail")
    ET.SubElement(detail, "link", uid=uid, relation="p-p", type="none")
    ET.SubElement(detail, "__forcedelete")
    return _bytes(event)


def _event(uid: str, kind: str, time: float, holds_s: float, *, how: str = "m-p") -> ET.Element:
    when = iso(time)
    return ET.Element(
        "event", version="2.0", uid=uid, type=kind, time=when, start=when, stale=iso(time + holds_s), how=how
    )


def _point(event: ET.Element, lat: float, lon: float, within_m: float | None = None) -> None:
    error = _UNKNOWN if within_m is None else f"{within_m:.1f}"
    ET.SubElement(event, "point", lat=f"{lat:.7f}", lon=f"{lon:.7f}", hae=_UNKNOWN, ce=error, le=_UNKNOWN)


def _mark(event: ET.Element, callsign: str, said: str, colour: str) -> None:
    detail = ET.SubElement(event, "detail")
    ET.SubElement(detail, "contact", callsign=callsign)
    ET.SubElement(detail, "color", argb=colour)
    if event.get("type") == FOUND:
        ET.SubElement(detail, "usericon", iconsetpath=f"COT_MAPPING_SPOTMAP/{FOUND}/{colour}")
    _remarks(detail, said)


def _remarks(detail: ET.Element, text: str) -> None:
    ET.SubElement(detail, "remarks").text = "".join(sign for sign in text if sign.isprintable())


def _bytes(event: ET.Element) -> bytes:
    text = ET.tostring(event, encoding="unicode")
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n{text}'.encode()
    )  # nothing after it: on a stream the next begins

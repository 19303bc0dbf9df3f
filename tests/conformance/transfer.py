"""The mission protocol from the ground station's side."""

from __future__ import annotations

from typing import Any

from tests.conformance.compare import Facts
from tests.conformance.dialogue import NAN, Dialogue, entry
from tests.conformance.wire import mav


def item(
    d: Dialogue, seq: int, command: int, frame: int, north: float, east: float, z: float, kind: int = 0
) -> Any:
    """A mission or fence item at a place; a fence corner says how many corners there are (4)."""
    x, y = d.point(north, east)
    first, yaw = (4.0, 0.0) if kind else (0.0, NAN)
    current = int(seq == 0 and kind == 0)
    return mav.MAVLink_mission_item_int_message(
        d.system, 1, seq, frame, command, current, 1, first, 0, 0, yaw, x, y, z, kind
    )


def _results(messages: list[Any]) -> list[str]:
    return [entry("MAV_MISSION_RESULT", m.type) for m in messages if m.get_type() == "MISSION_ACK"]


def upload(d: Dialogue, items: list[Any], kind: int, *, wrong: bool = False) -> Facts:
    """Push items as they are asked for; `wrong`: answer the first request with item 2, then say nothing."""
    first = handled = len(d.kept)
    asked: list[int] = []
    kinds = set()
    d.send(mav.MAVLink_mission_count_message(d.system, 1, len(items), kind))
    until = d.now + (12 if wrong else 6)
    while d.now < until and not _results(d.kept[first:]):
        d.pump()
        new, handled = d.kept[handled:], len(d.kept)
        for message in new:
            if message.get_type().startswith("MISSION_REQUEST"):
                kinds.add(message.get_type())
                asked.append(message.seq)
                if wrong and len(asked) == 1:
                    d.send(items[2])
                elif not wrong:
                    d.send(items[min(message.seq, len(items) - 1)])
    return {"result": _results(d.kept[first:]), "request_messages": sorted(kinds), "requested": asked}


def download(d: Dialogue, kind: int) -> Facts:
    """Read the items back."""
    d.latest.pop("MISSION_COUNT", None)
    d.send(mav.MAVLink_mission_request_list_message(d.system, 1, kind))
    if not d.wait(lambda: "MISSION_COUNT" in d.latest, 3):
        return {"count": None}
    count = d.latest["MISSION_COUNT"].count
    rows: list[Any] = []
    for seq in range(count):
        d.latest.pop("MISSION_ITEM_INT", None)
        d.send(mav.MAVLink_mission_request_int_message(d.system, 1, seq, kind))
        d.wait(lambda: "MISSION_ITEM_INT" in d.latest, 3)
        got = d.latest.get("MISSION_ITEM_INT")
        rows.append([got.seq, entry("MAV_CMD", got.command), got.frame] if got else None)
    d.send(mav.MAVLink_mission_ack_message(d.system, 1, mav.MAV_MISSION_ACCEPTED, kind))
    return {"count": count, "items": rows}


def clear(d: Dialogue, kind: int) -> list[str]:
    """Clear the items and return the acknowledgements."""
    first = len(d.kept)
    d.send(mav.MAVLink_mission_clear_all_message(d.system, 1, kind))
    d.wait(lambda: _results(d.kept[first:]), 3)
    return _results(d.kept[first:])


def prefixed(prefix: str, facts: Facts) -> Facts:
    """The facts with a word in front of their names."""
    return {f"{prefix}_{key}": value for key, value in facts.items()}

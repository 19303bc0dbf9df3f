"""How the target moves, as an area file says it: `properties.target` of the search area."""

from __future__ import annotations

import difflib
import math
from typing import Any

from service.area.geojson import Where, number, quote
from service.area.model import TargetMotion

STILL, WALKS = "still", "walks"
FASTEST_MPS = 10.0
"""What walks faster is no walker: metres a second."""
LONGEST_STRAIGHT_S = 3600.0
MOST_STOPS = 1000.0
_RANGES = {
    "speed_mps": (0.0, FASTEST_MPS, "the metres that it walks in a second, such as 0.4"),
    "stops_per_hour": (-1.0, MOST_STOPS, "how often in an hour it stops for good, 0 for never"),
    "straight_s": (0.0, LONGEST_STRAIGHT_S, "the mean seconds between its changes of direction, such as 60"),
}
"""Above what, up to what, and what each is."""
EXAMPLE = '{"moves": "walks", "speed_mps": 0.4, "stops_per_hour": 0.3}'


def read_target(given: Any, where: Where) -> TargetMotion | None:
    """How the target moves; None: it stands still. Raises BadInput."""
    if not isinstance(given, dict):
        raise where.bad(f"target is {quote(given)}; write {EXAMPLE}")
    known = ("moves", *_RANGES)
    for key in given:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, n=1, cutoff=0.6)
            hint = f"did you mean '{near[0]}'?" if near else f"it has {', '.join(known)}"
            raise where.bad(f"target has no property {quote(key)}; {hint}")
    moves = given.get("moves")
    if moves == "evades":
        raise where.bad(
            "a target that evades is out of scope: it is searched for as if it walked without regard to the search; "
            'write "walks"'
        )
    if moves not in (STILL, WALKS):
        raise where.bad(f"target moves {quote(moves)}; write '{STILL}' or '{WALKS}'")
    if moves == STILL:
        if len(given) > 1:
            raise where.bad(
                f"a target that stands still has no other properties; write '{WALKS}' if it moves"
            )
        return None
    if "speed_mps" not in given:
        raise where.bad("a target that walks needs speed_mps, metres a second, such as 0.4")
    return TargetMotion(**{key: _number(given[key], key, where) for key in _RANGES if key in given})


def _number(given: Any, key: str, where: Where) -> float:
    above, most, what = _RANGES[key]
    value = number(given)
    if value is None or not math.isfinite(value) or not (above < value <= most) or value < 0.0:
        least = "at least 0" if above < 0.0 else "above 0"
        raise where.bad(f"{key} of the target is {quote(given)}; give {what}, {least} and up to {most:g}")
    return value

"""What pydantic finds wrong, in the words of whoever sent it."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

_OURS = {
    "command": ("cmd", "order"),
    "captured_at": ("timestamp", "time", "ts", "capturedat"),
    "detections": ("objects", "boxes", "predictions"),
    "class": ("label", "name", "class_name", "category"),
    "score": ("confidence", "conf", "probability"),
    "lat": ("latitude",),
    "lon": ("longitude", "lng", "long"),
    "box": ("bbox", "xyxy"),
    "source": ("camera",),
}
"""What others call what we call so."""
_NAMES = {other: ours for ours, others in _OURS.items() for other in others}


def complaint(found: Mapping[str, Any], fields: Iterable[str] = ()) -> str:
    """One thing that is wrong (of `ValidationError.errors()`); `fields` are names that it could have meant."""
    if found["type"] != "extra_forbidden":
        return str(found["msg"]).removeprefix("Value error, ")
    name = str(found["loc"][-1])
    near = difflib.get_close_matches(name.lower(), sorted({*_OURS, *fields}), n=1, cutoff=0.75)
    meant = _NAMES.get(name.lower()) or (near[0] if near else "")
    return (
        f"there is no field of that name; did you mean '{meant}'?"
        if meant
        else "there is no field of that name"
    )

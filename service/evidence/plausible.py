"""Whether a detection can be where its frame looked; where it cannot, how far off it is and what is probably wrong.

A detection that lies elsewhere is no news of the cells in view, and still somebody was seen: to take the frame for a
look in vain would clear the very ground where the target is. So its report is refused, with words for who sent it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from service.evidence.observe import FramePose, Unreadable
from service.evidence.reports import CameraPose, Detection

Gap = Callable[[float, float], float]
"""How far a position (latitude, longitude) lies beside what the frame shows, in metres; 0 within it."""
SIGMAS = 3.0  # so many standard deviations may a detection lie beside what its frame shows
MOST_APART_M = 50.0  # between a report's pose and the telemetry's: far more than either's error
MOST_APART_UP_M = 10.0
"""The same for the height, or half of it where that is more: a look from the ground is none from above it."""
_EARTH_M = 6_371_000.0
_BESIDE_IMAGE = (
    0.05  # part of the image's side by which the middle of a box may lie outside: clipped and grown boxes
)


def check_place(seen: Detection, gap: Gap, slack_m: float) -> None:
    """Refuse a detection on the ground that lies more than `slack_m` beside what its frame shows.

    Raises:
        Unreadable: says how far off it is, with a guess at what is wrong.
    """
    assert seen.lat is not None
    assert seen.lon is not None
    off = gap(seen.lat, seen.lon)
    if off <= slack_m:
        return
    raise Unreadable(
        f"a detection at {seen.lat:.6f}, {seen.lon:.6f} lies {_metres(off)} from what its frame shows; "
        f"{_guess(seen.lat, seen.lon, gap, slack_m)}"
    )


def _guess(lat: float, lon: float, gap: Gap, slack_m: float) -> str:
    """What is most likely wrong with a position."""
    if abs(lat) < 1e-3 and abs(lon) < 1e-3:
        return "0/0 is what a camera without a position tells"
    others = (
        (lon, lat, "are lat and lon swapped?"),
        (lat, -lon, "has lon lost its sign (west is below 0)?"),
        (-lat, lon, "has lat lost its sign (south is below 0)?"),
    )
    for other_lat, other_lon, question in others:
        if abs(other_lat) <= 90.0 and gap(other_lat, other_lon) <= slack_m:
            return question
    if gap(lat, lon) > 5_000.0:
        return "is it in WGS84 degrees, and of this flight?"
    return "are captured_at, the heading and the camera's mounting as the detector takes them?"


def check_box(box: tuple[float, float, float, float], width: float, height: float) -> None:
    """Refuse a box that is no box of pixels in an image of that size; raises Unreadable with a guess."""
    x0, y0, x1, y1 = box
    told = f"the box [{x0:g}, {y0:g}, {x1:g}, {y1:g}]"
    if max(map(abs, box)) <= 1.5 and (x1 - x0 < 1.0 or y1 - y0 < 1.0):
        raise Unreadable(
            f'{told} is smaller than a pixel; if it is in parts of the image, say "box_unit": "share"'
        )
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    beside = max(-x / width, x / width - 1.0, -y / height, y / height - 1.0)
    if beside > _BESIDE_IMAGE:
        raise Unreadable(
            f"{told} lies outside the image of {width:g} x {height:g} pixels; give the report's intrinsics, or the "
            "image's size in sensor.image_width_px and sensor.image_height_px"
        )


def check_pose(told: CameraPose, known: FramePose) -> None:
    """Refuse a report's own pose that is not where the telemetry has the aircraft; raises Unreadable."""
    off = ground_metres(told.lat, told.lon, known.lat, known.lon)
    if off > MOST_APART_M:
        raise Unreadable(
            f"the report's pose lies {_metres(off)} from where the telemetry has the aircraft at that time; is it of "
            "another time or aircraft? Leave pose out to have it looked up"
        )
    off = told.height_m - known.height_m
    if abs(off) > max(MOST_APART_UP_M, 0.5 * abs(known.height_m)):
        raise Unreadable(
            f"the report's pose is {abs(off):.0f} m {'above' if off > 0 else 'below'} where the telemetry has the "
            "aircraft; height_m counts from the launch point, not from sea level"
        )


def ground_metres(lat: float, lon: float, other_lat: float, other_lon: float) -> float:
    """The way between two positions over a round earth: right to half a per cent, wherever they are."""
    a, b = math.radians(lat), math.radians(other_lat)
    half = math.radians(other_lon - lon) / 2.0
    chord = math.sin((b - a) / 2.0) ** 2 + math.cos(a) * math.cos(b) * math.sin(half) ** 2
    return 2.0 * _EARTH_M * math.asin(math.sqrt(min(1.0, chord)))


def _metres(distance: float) -> str:
    return f"{distance:.0f} m" if distance < 10_000.0 else f"{distance / 1000.0:.0f} km"

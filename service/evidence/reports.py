"""What comes through the door: detector reports and operator commands, as checked by pydantic.

A report is one camera frame, looked at by a detector. This is version 1 of its schema; `config/report.schema.json`
is the same as JSON Schema, and `roisearch-service schema` prints it. A field that a sender leaves out means what
its description says; a field that is not in the schema is refused, so that a misspelt one is not lost.

Conventions. Degrees, metres, seconds. Angles turn as in MAVLink's ATTITUDE, in the order yaw, pitch, roll: yaw
clockwise from above, pitch up, roll to the right. A camera whose angles to the vehicle are all zero looks along the
nose, with the right of the image to the right wing and its top up; pitch -90 looks straight down, with the top of
the image to the nose. Pixels count from the corner of the image that is at the top left, x to the right and y down.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

SCHEMA_ID = "urn:roisearch:report:1"

Latitude = Annotated[float, Field(ge=-90, le=90, allow_inf_nan=False)]
Longitude = Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)]
Score = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Pixel = Annotated[float, Field(ge=-100_000, le=100_000, allow_inf_nan=False)]
FocalLength = Annotated[float, Field(ge=10, le=1_000_000, allow_inf_nan=False)]


def _one_of(first: dict[str, str], second: dict[str, str]) -> dict[str, Any]:
    """JSON Schema of 'either these fields or those': names with their types."""
    sides = []
    for given, absent in ((first, second), (second, first)):
        properties = {name: {"type": kind} for name, kind in given.items()}
        properties |= {name: {"type": "null"} for name in absent}
        sides.append({"required": list(given), "properties": properties})
    return {"oneOf": sides}


class DoorModel(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Detection(DoorModel):
    """One object that the detector saw: what, how sure it is, and where, either on the ground or in the image."""

    model_config = ConfigDict(json_schema_extra=_one_of({"lat": "number", "lon": "number"}, {"box": "array"}))

    kind: str = Field(default="target", max_length=64, alias="class", description="what it is")
    score: Score = Field(default=1.0, description="the detector's score; see sensor.calibration_file")
    lat: Latitude | None = Field(default=None, description="where it is on the ground, WGS84 degrees")
    lon: Longitude | None = Field(default=None, description="where it is on the ground, WGS84 degrees")
    accuracy_m: float | None = Field(
        default=None,
        gt=0,
        le=10_000,
        allow_inf_nan=False,
        description="standard deviation of lat and lon on the ground, in each direction; without it, that of the "
        "service's own camera model",
    )
    box: tuple[Pixel, Pixel, Pixel, Pixel] | None = Field(
        default=None, description="[x0, y0, x1, y1] in the image, x0 < x1 and y0 < y1; instead of lat and lon"
    )
    thumbnail: str | None = Field(
        default=None,
        max_length=2048,
        pattern=r"^https?://[^\s]+$",
        description="where an operator finds a picture of it",
    )

    @model_validator(mode="after")
    def _placed_once(self) -> Self:
        on_the_ground = self.lat is not None and self.lon is not None
        if (self.lat is None) != (self.lon is None) or on_the_ground == (self.box is not None):
            raise ValueError("a detection has either lat and lon or a pixel box")
        if self.box is not None:
            x0, y0, x1, y1 = self.box
            if not (x0 < x1 and y0 < y1):
                raise ValueError("a pixel box is [x0, y0, x1, y1] with x0 < x1 and y0 < y1")
            if self.accuracy_m is not None:
                raise ValueError("accuracy_m belongs to lat and lon; a pixel box has its own")
        return self


class CameraPose(DoorModel):
    """Where the aircraft with its camera was at the time of capture, when the detector knows it better than the
    service, which otherwise looks it up in the telemetry."""

    lat: Latitude
    lon: Longitude
    height_m: float = Field(description="metres above the launch point", allow_inf_nan=False)
    heading_deg: float = Field(
        ge=0, le=360, allow_inf_nan=False, description="where the nose points, clockwise from true north"
    )
    pitch_deg: Angle | None = Field(
        default=None, description="nose up; without it, the telemetry's, else level"
    )
    roll_deg: Angle | None = Field(
        default=None, description="right wing down; without it, the telemetry's, else level"
    )


class Gimbal(DoorModel):
    """Where the camera looked. Without it, the camera looks as `sensor` in the settings says."""

    pitch_deg: Angle = Field(description="up from the horizon or from the nose: -90 is straight down")
    yaw_deg: Angle = Field(default=0.0, description="clockwise from true north (earth) or the nose (vehicle)")
    roll_deg: Angle = Field(default=0.0, description="about the line of sight, to the right")
    relative_to: Literal["vehicle", "earth"] = Field(
        default="vehicle",
        description="vehicle: angles to the aircraft, which turn with its attitude; earth: angles to true north and "
        "the horizon, as a stabilised gimbal tells them",
    )


class Intrinsics(DoorModel):
    """How the camera maps the world to pixels: a pinhole without distortion, given by its focal lengths or by its
    horizontal field of view (then pixels are square)."""

    model_config = ConfigDict(
        json_schema_extra=_one_of({"fx": "number", "fy": "number"}, {"horizontal_fov_deg": "number"})
    )

    width: int = Field(gt=0, le=100_000, description="pixels")
    height: int = Field(gt=0, le=100_000, description="pixels")
    fx: FocalLength | None = Field(default=None, description="focal length in pixels, along the width")
    fy: FocalLength | None = Field(default=None, description="focal length in pixels, along the height")
    cx: Pixel | None = Field(default=None, description="principal point; without it, half the width")
    cy: Pixel | None = Field(default=None, description="principal point; without it, half the height")
    horizontal_fov_deg: float | None = Field(
        default=None, ge=0.1, le=179, allow_inf_nan=False, description="from the left to the right edge"
    )

    @model_validator(mode="after")
    def _given_once(self) -> Self:
        by_focal_length = self.fx is not None and self.fy is not None
        if (self.fx is None) != (self.fy is None) or by_focal_length == (self.horizontal_fov_deg is not None):
            raise ValueError("intrinsics have either fx and fy or horizontal_fov_deg")
        return self


class Report(DoorModel):
    """One camera frame, looked at by a detector. No detections means that nothing was seen: send it all the same,
    it is what clears the ground."""

    version: Literal[1] = Field(default=1, description="of this schema")
    id: str = Field(min_length=1, max_length=128, description="unique; a repeated id is not counted twice")
    source: str = Field(default="detector", max_length=64, description="which detector or camera")
    frame_id: str | None = Field(
        default=None, max_length=128, description="the camera's own name of the frame"
    )
    captured_at: float = Field(
        description="when the frame was taken, seconds in the clock that `clock` names", allow_inf_nan=False
    )
    clock: Literal["unix", "boot"] = Field(
        default="unix",
        description="unix: seconds since the epoch in the service's clock (GET /api/state tells it as `time`); "
        "boot: the autopilot's time since it booted, as in MAVLink's time_boot_ms, in seconds",
    )
    usable: bool = Field(
        default=True, description="false: the frame shows nothing (blur, glare); no evidence"
    )
    threshold: Score | None = Field(
        default=None,
        description="the score from which on this detector reports; lower ones it keeps to itself",
    )
    pose: CameraPose | None = None
    gimbal: Gimbal | None = None
    intrinsics: Intrinsics | None = Field(default=None, description="without it, those of the settings")
    footprint: (
        Annotated[tuple[tuple[Latitude, Longitude], ...], Field(min_length=3, max_length=256)] | None
    ) = Field(
        default=None,
        description="the ground that the frame shows, when the sender knows it: corners [lat, lon] in order",
    )
    detections: tuple[Detection, ...] = Field(default=(), max_length=256)


EXAMPLES: dict[str, dict[str, Any]] = {
    "nothing seen": {"id": "cam0-000417", "captured_at": 1767225600.25},
    "a person on the ground": {
        "version": 1,
        "id": "cam0-000418",
        "source": "cam0",
        "captured_at": 1767225600.75,
        "threshold": 0.4,
        "detections": [
            {"class": "person", "score": 0.83, "lat": 47.05412, "lon": 8.30471, "accuracy_m": 4.0}
        ],
    },
    "a person in the image of a gimbal's camera": {
        "version": 1,
        "id": "cam1-a93f",
        "source": "cam1",
        "frame_id": "a93f",
        "captured_at": 512.34,
        "clock": "boot",
        "threshold": 0.4,
        "gimbal": {"pitch_deg": -60.0, "yaw_deg": 0.0, "relative_to": "earth"},
        "intrinsics": {"width": 1920, "height": 1080, "horizontal_fov_deg": 70.0},
        "detections": [
            {
                "class": "person",
                "score": 0.83,
                "box": [911.0, 402.5, 934.0, 446.0],
                "thumbnail": "https://camera.example/a93f.jpg",
            }
        ],
    },
    "a camera that knows its own pose and footprint": {
        "id": "survey-12",
        "source": "mapper",
        "captured_at": 1767225601.5,
        "pose": {
            "lat": 47.0541,
            "lon": 8.3047,
            "height_m": 60.0,
            "heading_deg": 84.0,
            "pitch_deg": -2.5,
            "roll_deg": 1.0,
        },
        "footprint": [[47.0544, 8.3043], [47.0544, 8.3051], [47.0538, 8.3051], [47.0538, 8.3043]],
    },
    "a frame that shows nothing": {"id": "cam0-000419", "captured_at": 1767225601.25, "usable": False},
}
"""Reports that the schema shows, by what they say."""


def report_schema() -> dict[str, Any]:
    """The schema of a report as JSON Schema (draft 2020-12), with examples."""
    schema = Report.model_json_schema(by_alias=True)
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": SCHEMA_ID}
    return {**head, **schema, "examples": list(EXAMPLES.values())}


def schema_text() -> str:
    """The schema as the file that ships, `config/report.schema.json`."""
    return json.dumps(report_schema(), indent=2, ensure_ascii=False) + "\n"


class Receipt(DoorModel):
    """What became of a report."""

    id: str
    status: Literal["accepted", "duplicate", "refused"]
    reason: str = ""
    looks: int = Field(default=0, description="cells that this frame counted as a look for")
    hits: int = Field(default=0, description="cells of those with a hit")


class Command(DoorModel):
    """An order of the operator."""

    command: Literal["hold", "resume", "return", "abort", "confirm", "reject"]
    lat: Latitude | None = Field(default=None, description="of the place to confirm or reject")
    lon: Longitude | None = Field(default=None, description="without it, the present suspect or found place")

    @model_validator(mode="after")
    def _a_place_or_none(self) -> Self:
        if (self.lat is None) != (self.lon is None):
            raise ValueError("a place has both lat and lon")
        if self.lat is not None and self.command not in ("confirm", "reject"):
            raise ValueError(f"'{self.command}' has no place; only confirm and reject do")
        return self

    @property
    def place(self) -> tuple[float, float] | None:
        """Latitude and longitude, if given."""
        return None if self.lat is None or self.lon is None else (self.lat, self.lon)

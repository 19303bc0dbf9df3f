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

import base64
import binascii
import json
import re
from datetime import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue, StrictInt, model_validator

SCHEMA_ID = "urn:roisearch:report:1"
RECEIPT_SCHEMA_ID = "urn:roisearch:receipt:1"

Latitude = Annotated[float, Field(ge=-90, le=90, allow_inf_nan=False)]
Longitude = Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)]
Score = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
_LATEST_S = 1e11  # what is later is in milliseconds
_NO_TIME = 10**15  # in whatever unit
Box = tuple[float, float, float, float]
Pixel = Annotated[float, Field(ge=-100_000, le=100_000, allow_inf_nan=False)]
FocalLength = Annotated[float, Field(ge=10, le=1_000_000, allow_inf_nan=False)]


MOST_IMAGE_BYTES = 65_536
KEPT_AT = "/api/pictures/"
"""Where the service serves a picture that it has kept; `service.evidence.images` puts this in place of the picture."""
_ADDRESS = re.compile(r"https?://[^\s]+|/api/pictures/[0-9a-f]{64}\.jpg")
_MOST_ADDRESS = 2048
_MOST_BASE64 = 4 * ((MOST_IMAGE_BYTES + 2) // 3)
_JPEG = (b"\xff\xd8\xff", b"\xff\xd9")


def _checked_image(given: str | None) -> str | None:
    """An address, or a JPEG in base64; what it shows is not looked at. Raises ValueError with one sentence."""
    if given is None or (len(given) <= _MOST_ADDRESS and _ADDRESS.fullmatch(given)):
        return given
    if len(given) > _MOST_BASE64:
        raise ValueError(
            f"image is larger than {MOST_IMAGE_BYTES // 1024} kB; send a smaller JPEG, or its URL"
        )
    try:
        data = base64.b64decode(given, validate=True)
    except (binascii.Error, ValueError):
        raise ValueError("image is neither an http(s) URL nor base64; send a JPEG file as base64") from None
    if len(data) > MOST_IMAGE_BYTES:
        raise ValueError(
            f"image is larger than {MOST_IMAGE_BYTES // 1024} kB; send a smaller JPEG, or its URL"
        )
    if not (data.startswith(_JPEG[0]) and data.endswith(_JPEG[1])):
        raise ValueError("image is no whole JPEG; send a JPEG file as base64, or the URL of a picture")
    return given


Image = Annotated[str | None, AfterValidator(_checked_image)]


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

    kind: Annotated[str, Field(max_length=64)] | StrictInt = Field(
        default="target",
        alias="class",
        description="what it is, a name or the model's number; which of them are the target, sensor.classes says",
    )
    score: Score | None = Field(
        default=None,
        description="the detector's score in the report's score_unit, without it the best; see "
        "sensor.calibration_file",
    )
    lat: Latitude | None = Field(default=None, description="where it is on the ground, WGS84 degrees")
    lon: Longitude | None = Field(default=None, description="where it is on the ground, WGS84 degrees")
    accuracy_m: float | None = Field(
        default=None,
        ge=0.01,
        le=10_000,
        allow_inf_nan=False,
        description="standard deviation of lat and lon on the ground, in each direction; without it, that of the "
        "service's own camera model",
    )
    box: tuple[Pixel, Pixel, Pixel, Pixel] | None = Field(
        default=None,
        description="[x0, y0, x1, y1] in the image, x0 < x1 and y0 < y1, in the report's box_unit; instead of lat and "
        "lon",
    )
    thumbnail: str | None = Field(
        default=None,
        max_length=2048,
        pattern=r"^https?://[^\s]+$",
        description="where an operator finds a picture of it",
    )
    image: Image = Field(
        default=None,
        description="a picture of it for the operator: a JPEG of at most 64 kB as base64, which is kept with the "
        "run, or the URL of one",
    )

    @model_validator(mode="after")
    def _placed_once(self) -> Self:
        on_the_ground = self.lat is not None and self.lon is not None
        if (self.lat is None) != (self.lon is None) or on_the_ground == (self.box is not None):
            raise ValueError("a detection has either lat and lon or a pixel box")
        if self.box is not None:
            x0, y0, x1, y1 = self.box
            if not (x0 < x1 and y0 < y1):
                raise ValueError(
                    "a box is [x0, y0, x1, y1] with x0 < x1 and y0 < y1; is this [x, y, width, height]?"
                )
            if self.accuracy_m is not None:
                raise ValueError("accuracy_m belongs to lat and lon; a pixel box has its own")
        return self


class CameraPose(DoorModel):
    """Where the aircraft with its camera was at the time of capture, when the detector knows it better than the
    service, which otherwise looks it up in the telemetry."""

    lat: Latitude
    lon: Longitude
    height_m: float = Field(
        ge=-20_000, le=100_000, description="metres above the launch point", allow_inf_nan=False
    )
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


def _unless(field: str, values: list[JsonValue], otherwise: dict[str, JsonValue]) -> JsonValue:
    """JSON Schema of 'where this field is none of these values, those properties are such'."""
    said: dict[str, JsonValue] = {"properties": {field: {"enum": values}}, "required": [field]}
    return {"if": said, "else": {"properties": otherwise}}


_AS_DECLARED: list[JsonValue] = [
    _unless(
        "score_unit",
        ["percent"],
        {
            "threshold": {"maximum": 1},
            "detections": {"items": {"properties": {"score": {"maximum": 1}}}},
        },
    ),
    _unless("clock", ["iso"], {"captured_at": {"type": "number"}}),
    _unless(
        "clock", ["unix_ms", "iso", "service", "boot", "boot_ms"], {"captured_at": {"maximum": _LATEST_S}}
    ),
]
"""What the values of a report may be goes by the units that it declares."""


ANY_SOURCE = "detector"
"""The source of a report that names none."""


def name_of_frame(id: str, source: str) -> str:
    """What tells a report from all others of its aircraft: two detectors may both count from 1."""
    return id if source == ANY_SOURCE else f"{id} from {source}"


class Report(DoorModel):
    """One camera frame, looked at by a detector. No detections means that nothing was seen: send it all the same,
    it is what clears the ground."""

    model_config = ConfigDict(json_schema_extra={"allOf": _AS_DECLARED})

    version: Literal[1] = Field(default=1, description="of this schema")
    id: str = Field(
        min_length=1,
        max_length=128,
        description="of this frame alone among those of the source; a repeated id is not counted twice",
    )
    source: str = Field(default=ANY_SOURCE, max_length=64, description="which detector or camera")
    aircraft: str | None = Field(
        default=None,
        max_length=24,
        description="whose camera it is, where several aircraft fly and the settings do not pair the source with one",
    )
    frame_id: str | None = Field(
        default=None, max_length=128, description="the camera's own name of the frame"
    )
    captured_at: float = Field(
        ge=-_NO_TIME,
        le=_NO_TIME,
        description="when the frame was taken, in the clock that `clock` names",
        allow_inf_nan=False,
        json_schema_extra={"type": ["number", "string"]},
    )
    clock: Literal["unix", "unix_ms", "iso", "service", "boot", "boot_ms"] = Field(
        default="unix",
        description="unix: seconds since the epoch by the computer's clock; unix_ms: the same in milliseconds; iso: "
        "the same as ISO 8601 text with its offset, such as 2026-01-01T00:00:00.25Z; service: the service's own time, "
        "which GET /api/state tells as `time` and with each pose; boot: the autopilot's time since it booted, in "
        "seconds; boot_ms: the same in milliseconds, as MAVLink's time_boot_ms",
    )
    score_unit: Literal["share", "percent"] = Field(
        default="share", description="of score and threshold. share: 0 to 1; percent: 0 to 100"
    )
    box_unit: Literal["pixel", "share"] = Field(
        default="pixel",
        description="of boxes. pixel: pixels; share: parts of the image's width and height, 0 to 1",
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
    image: Image = Field(
        default=None,
        description="the frame for the operator, where a detection has no picture of its own: a JPEG of at most 64 kB "
        "as base64, or the URL of one",
    )

    @model_validator(mode="before")
    @classmethod
    def _time_as_text(cls, given: Any) -> Any:
        """Text is a time where the report says so."""
        if not isinstance(given, dict) or not isinstance(told := given.get("captured_at"), str):
            return given
        if given.get("clock") != "iso":
            raise ValueError(
                'captured_at is text; for an ISO 8601 time say "clock": "iso", else give a number'
            )
        try:
            moment = datetime.fromisoformat(told)
        except ValueError:
            raise ValueError(f"captured_at '{told[:40]}' is no ISO 8601 time") from None
        if moment.tzinfo is None:
            raise ValueError(f"captured_at '{told[:40]}' has no offset; end it with Z for UTC")
        return {**given, "captured_at": moment.timestamp()}

    @model_validator(mode="after")
    def _in_the_units_it_says(self) -> Self:
        if self.clock == "unix" and self.captured_at > _LATEST_S:
            raise ValueError('captured_at is far in the future; for milliseconds say "clock": "unix_ms"')
        scores = [seen.score for seen in self.detections if seen.score is not None]
        if self.score_unit == "share" and max([*scores, self.threshold or 0.0]) > 1.0:
            raise ValueError('a score or threshold is above 1; for per cent say "score_unit": "percent"')
        return self

    def picture_of(self, seen: Detection) -> str | None:
        """Where a person finds a picture of a detection; None when there is none, or it has not been kept."""
        offered = (seen.image, seen.thumbnail, self.image)
        return next((each for each in offered if each is not None and _ADDRESS.fullmatch(each)), None)

    @property
    def name(self) -> str:
        """What tells it from all other reports of its aircraft."""
        return name_of_frame(self.id, self.source)

    @property
    def captured_s(self) -> float:
        """When the frame was taken, in seconds of its clock."""
        return self.captured_at / 1000.0 if self.clock in ("unix_ms", "boot_ms") else self.captured_at

    @property
    def by_boot(self) -> bool:
        """Whether that is the autopilot's time since it booted."""
        return self.clock in ("boot", "boot_ms")

    def share(self, score: float | None) -> float:
        """A score of this report from 0 to 1; a detection without one is as sure as can be."""
        if score is None:
            return 1.0
        return score / 100.0 if self.score_unit == "percent" else score

    @property
    def threshold_share(self) -> float | None:
        """The threshold from 0 to 1, if the report has one."""
        return None if self.threshold is None else self.share(self.threshold)

    def in_pixels(self, box: Box, width: float, height: float) -> Box:
        """A box of this report in pixels of an image of that size."""
        x0, y0, x1, y1 = box
        return box if self.box_unit == "pixel" else (x0 * width, y0 * height, x1 * width, y1 * height)


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


def field_names() -> frozenset[str]:
    """All names that a field has which comes through a door."""
    fields = [each for model in DoorModel.__subclasses__() for each in model.model_fields.items()]
    return frozenset(field.alias or name for name, field in fields)


def report_schema() -> dict[str, Any]:
    """The schema of a report as JSON Schema (draft 2020-12), with examples."""
    schema = Report.model_json_schema(by_alias=True)
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": SCHEMA_ID}
    return {**head, **schema, "examples": list(EXAMPLES.values())}


def receipt_schema() -> dict[str, Any]:
    """The schema of a receipt, which answers each report, as JSON Schema (draft 2020-12)."""
    schema = Receipt.model_json_schema(mode="serialization")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": RECEIPT_SCHEMA_ID, **schema}


def schema_text(schema: dict[str, Any] | None = None) -> str:
    """A schema, that of a report unless given, as the file that ships: `config/report.schema.json`."""
    return json.dumps(schema or report_schema(), indent=2, ensure_ascii=False) + "\n"


class Receipt(DoorModel):
    """What became of a report."""

    id: str
    status: Literal["accepted", "duplicate", "refused"] = Field(
        description="accepted: it is in the journal and has been believed; duplicate: its id was taken in before; "
        "refused: it counts for nothing, and `reason` says why"
    )
    reason: str = Field(
        default="",
        description="why it was refused, why an accepted report has no looks or not all its hits, or that a duplicate "
        "is another frame under a known id, which is lost",
    )
    looks: int = Field(default=0, description="cells that this frame counted as a look for")
    hits: int = Field(default=0, description="cells of those with a hit")


class OrderRequest(DoorModel):
    """An order of the operator."""

    command: Literal["hold", "resume", "return", "launch", "replace", "finish", "abort", "confirm", "reject"]
    lat: Latitude | None = Field(default=None, description="of the place to confirm or reject")
    lon: Longitude | None = Field(default=None, description="without it, the present suspect or found place")
    aircraft: str | None = Field(
        default=None, max_length=24, description="which one is meant, where several fly; without it, all"
    )
    system_id: int | None = Field(
        default=None,
        ge=1,
        le=255,
        description="of replace: the MAVLink system id of the aircraft that comes; without it, the next one heard",
    )

    @model_validator(mode="after")
    def _a_place_or_none(self) -> Self:
        if (self.lat is None) != (self.lon is None):
            raise ValueError("a place has both lat and lon")
        if self.lat is not None and self.command not in ("confirm", "reject"):
            raise ValueError(f"'{self.command}' has no place; only confirm and reject do")
        if self.system_id is not None and self.command != "replace":
            raise ValueError(f"'{self.command}' has no system_id; only replace does")
        return self

    @property
    def place(self) -> tuple[float, float] | None:
        """Latitude and longitude, if given."""
        return None if self.lat is None or self.lon is None else (self.lat, self.lon)


class OrderReceipt(DoorModel):
    """What became of an order."""

    state: str = Field(description="of the search, after it")
    refused: str | None = Field(
        default=None, description="why the order was refused or came to nothing; not there when it was obeyed"
    )

"""What comes through the door: detector reports and operator commands, as checked by pydantic."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Latitude = Annotated[float, Field(ge=-90, le=90, allow_inf_nan=False)]
Longitude = Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)]


class DoorModel(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Detection(DoorModel):
    """One object that the detector saw: where on the ground, and how sure it is."""

    kind: str = Field(default="target", max_length=64, alias="class")
    score: float = Field(default=1.0, ge=0, le=1, allow_inf_nan=False)
    lat: Latitude
    lon: Longitude


class CameraPose(DoorModel):
    """Where the camera was at the time of capture, when the detector knows it better than the service."""

    lat: Latitude
    lon: Longitude
    height_m: float = Field(description="metres above the launch point", allow_inf_nan=False)
    heading_deg: float = Field(ge=0, le=360, allow_inf_nan=False)


class Report(DoorModel):
    """One camera frame, looked at by a detector. No detections means that nothing was seen: send it all the same,
    it is what clears the ground."""

    id: str = Field(min_length=1, max_length=128, description="unique; a repeated id is not counted twice")
    source: str = Field(default="detector", max_length=64)
    captured_at: float = Field(
        description="seconds since the epoch, in the service's clock", allow_inf_nan=False
    )
    usable: bool = Field(
        default=True, description="false: the frame shows nothing (blur, glare); no evidence"
    )
    pose: CameraPose | None = None
    detections: tuple[Detection, ...] = Field(default=(), max_length=256)


class Receipt(DoorModel):
    """What became of a report."""

    id: str
    status: Literal["accepted", "duplicate", "refused"]
    reason: str = ""
    looks: int = Field(default=0, description="cells that this frame counted as a look for")
    hits: int = Field(default=0, description="cells of those with a hit")


class Command(DoorModel):
    """An order of the operator."""

    command: Literal["hold", "resume", "return", "abort"]

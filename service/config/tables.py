"""The tables of the settings, and what their values may be."""

from __future__ import annotations

import difflib
import importlib.metadata
import re
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    field_validator,
    model_serializer,
)

from service.places import Coordinates

PlannerName = Literal[
    "puct-regions-lite",
    "survey",
    "puct-regions",
    "puct",
    "greedy",
    "direct-policy-search",
    "coverage",
    "spiral",
    "index",
]


PLANNER_POINTS = "roisearch.planners"
"""The group of entry points by which installed packages offer planners, as in `roisearch.planners.outside`."""


def _planner(name: str) -> str:
    """One of ours, one that an installed package offers, or `package.module:Class`."""
    ours = get_args(PlannerName)
    if name in ours or re.fullmatch(r"[\w.]+:[\w.]+", name):
        return name
    offered = sorted({point.name for point in importlib.metadata.entry_points(group=PLANNER_POINTS)})
    if name in offered:
        return name
    near = difflib.get_close_matches(name, [*ours, *offered], n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"there is {', '.join([*ours, *offered])}"
    raise ValueError(f"there is no such planner; {hint}, or a package.module:Class")


AnyPlanner = Annotated[str, AfterValidator(_planner)]

MOCK_SPEEDUP = 20.0
MOST_AIRCRAFT = 8
SPARE_M = 3.0  # so much higher than the clearance is flown over ground that is known


def _names(value: object) -> object:
    """An environment variable holds several names with commas between."""
    return [name.strip() for name in value.split(",") if name.strip()] if isinstance(value, str) else value


Names = Annotated[list[str], BeforeValidator(_names)]
Origins = Annotated[Names, AfterValidator(lambda given: [origin.lower().rstrip("/") for origin in given])]
"""As browsers write them."""
MOST_BATCH = 10_000  # reports in a request, whatever http.max_batch says


class Section(BaseModel):
    """A table of the file: unknown keys are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class LinkSettings(Section):
    connect: str = ""
    signing_key_file: str = ""
    system_id: int = Field(default=0, ge=0, le=255)
    silent_after_s: float = Field(default=3.0, gt=0.5, le=60)
    after_silence: Literal["resume", "hold", "return"] = "resume"
    connect_timeout_s: float = Field(default=120.0, gt=0)
    speedup: float | None = Field(default=None, ge=1, le=100)
    lockstep: str = ""


class FlightSettings(Section):
    altitude_m: float = Field(default=30.0, ge=5, le=500)
    speed_mps: float = Field(default=8.0, ge=1, le=25)
    acceleration_mps2: float = Field(default=2.0, ge=0.2, le=10)
    deceleration_mps2: float = Field(default=0.45, ge=0.2, le=10)
    corner_m: float = Field(default=10.0, ge=1, le=50)
    takeoff: bool = False
    min_battery_percent: float = Field(default=20.0, ge=0, le=95)
    reserve_percent: float = Field(default=15.0, ge=0, le=90)
    allow_unknown_battery: bool = False
    full_battery_s: float = Field(default=1200.0, ge=30, le=86_400)
    max_airspeed_mps: float = Field(default=15.0, ge=2, le=40)
    climb_mps: float = Field(default=2.0, ge=0.2, le=20)
    descent_mps: float = Field(default=1.0, ge=0.2, le=20)
    return_height_m: float = Field(default=60.0, ge=0, le=500)
    max_flight_s: float = Field(default=7200.0, gt=0)
    margin_m: float = Field(default=30.0, ge=0, le=5000)
    clearance_m: float = Field(default=15.0, ge=2, le=400)
    min_height_m: float = Field(default=3.0, ge=1, le=500)
    max_height_m: float = Field(default=120.0, ge=5, le=500)
    max_launch_distance_m: float = Field(default=20_000.0, gt=0)
    max_home_distance_m: float = Field(default=500.0, gt=0)
    min_satellites: int = Field(default=6, ge=0, le=40)
    max_jump_m: float = Field(default=10.0, gt=0)
    settle_s: float = Field(default=3.0, ge=0, le=600)
    max_wind_mps: float = Field(default=12.0, gt=0)
    stuck_after_s: float = Field(default=15.0, ge=2)
    max_hold_s: float = Field(default=900.0, gt=0)
    separation_m: float = Field(default=20.0, ge=5, le=1000)
    layer_m: float = Field(default=10.0, ge=5, le=100)


class GroundSettings(Section):
    file: Names = []
    flat: bool = False
    cover_file: str = ""
    mobility_file: str = ""
    position_error_m: float = Field(default=5.0, ge=0, le=100)
    max_datum_difference_m: float = Field(default=60.0, gt=0, le=1000)


class SensorSettings(Section):
    profile: Literal["point", "donut", "wide-angle", "camera"] = "point"
    horizontal_fov_deg: float = Field(default=62.0, gt=5, lt=170)
    vertical_fov_deg: float = Field(default=55.0, gt=5, lt=170)
    overlap: float = Field(default=0.2, ge=0, lt=0.9)
    cell_m: float | None = Field(default=None, gt=0.5, le=1000)
    p_tp: float = Field(default=0.9, gt=0, lt=1)
    p_tn: float = Field(default=0.9, gt=0, lt=1)
    calibration_file: str = ""
    classes: Names = []
    min_covered: float = Field(default=0.8, gt=0, le=1)
    silent_after_s: float = Field(default=10.0, gt=0)
    hover_look_s: float = Field(default=0.0, ge=0, le=3600)
    camera_pitch_deg: float = Field(default=-90.0, ge=-90, le=0)
    camera_yaw_deg: float = Field(default=0.0, ge=-180, le=180)
    camera_roll_deg: float = Field(default=0.0, ge=-180, le=180)
    camera_stabilised: bool = True
    image_width_px: int = Field(default=1920, ge=16, le=100_000)
    image_height_px: int = Field(default=1080, ge=16, le=100_000)
    target_size_m: float = Field(default=0.9, gt=0, le=100)
    half_seen_px: float = Field(default=8.0, gt=0, le=1000)
    min_p_tp: float = Field(default=0.2, gt=0, lt=1)
    max_range_m: float = Field(default=300.0, gt=1, le=20_000)
    min_grazing_deg: float = Field(default=10.0, ge=0, lt=90)
    terrain_file: str = ""
    attitude_sigma_deg: float = Field(default=1.5, ge=0, le=30)
    position_sigma_m: float = Field(default=2.0, ge=0, le=1000)
    height_sigma_m: float = Field(default=2.0, ge=0, le=1000)


class SearchSettings(Section):
    planner: AnyPlanner = "puct-regions-lite"
    deadline_s: float = Field(default=0.038, gt=0, le=5)
    iterations: int = Field(default=1, ge=0, le=1000)
    looks_ahead: int = Field(default=4000, ge=16, le=100_000)
    battery_end_s: float = Field(default=900.0, ge=0, le=86_400)
    regions_moved: float = Field(default=0.2, ge=0, le=1)
    found_at: float = Field(default=0.999, gt=0.5, lt=1)
    on_found: Literal["return", "hover", "continue"] = "return"
    reject_reliability: float = Field(default=0.99, gt=0.5, lt=1)
    stop_at_pos: float = Field(default=0.999, gt=0, lt=1)
    max_area_km2: float = Field(default=100.0, gt=0)
    max_steps: int = Field(default=40_000, gt=0)


class HttpSettings(Section):
    listen: str = "127.0.0.1:8080"
    token_file: str = ""
    report_token_file: str = ""
    view_token_file: str = ""
    allowed_hosts: Names = []
    allowed_origins: Origins = []
    reports_per_s: float = Field(default=2000.0, ge=1, allow_inf_nan=False)
    detections_per_s: float = Field(default=200.0, ge=1, allow_inf_nan=False)
    commands_per_s: float = Field(default=10.0, ge=1, allow_inf_nan=False)
    max_batch: int = Field(default=500, ge=1, le=MOST_BATCH)
    max_body_bytes: int = Field(default=1 << 20, ge=1024, le=1 << 28)
    body_timeout_s: float = Field(default=5.0, gt=0, le=300)


class PageSettings(Section):
    tiles_url: str = ""
    tiles_attribution: str = ""
    mbtiles_file: str = ""


class DoorSettings(Section):
    udp: str = ""
    unix: str = ""
    mqtt: str = ""
    mqtt_topic: str = "roisearch/reports"
    mqtt_credentials_file: str = ""
    detections_per_s: float = Field(default=200.0, ge=1, allow_inf_nan=False)


class TellingSettings(Section):
    webhook: str = ""
    webhook_token_file: str = ""
    mqtt: str = ""
    mqtt_topic: str = "roisearch/run"
    mqtt_credentials_file: str = ""
    tak: str = ""
    tak_callsign: str = "roisearch"
    tak_ca_file: str = ""
    tak_certificate_file: str = ""


class RunSettings(Section):
    folder: str = "runs"
    coordinates: Coordinates = "degrees"
    seed: int = Field(default=1, ge=0)
    next_sortie_within_s: float = Field(default=14400.0, ge=0.0)


class DemoSettings(Section):
    target: bool = True
    flavor: Literal["px4", "ardupilot"] = "px4"
    endurance_min: float = Field(default=12.0, gt=0)
    swap_battery_s: float = Field(default=30.0, gt=0)


class OwnSensorSettings(SensorSettings):
    """What the sensor of one of several aircraft has otherwise than `[sensor]`: what is given, and nothing else."""

    @field_validator("cell_m", "terrain_file", mode="before")
    @classmethod
    def _of_all(cls, value: object) -> object:
        raise ValueError("it is of the ground, which all aircraft have in common: give it in [sensor]")

    @property
    def given(self) -> dict[str, Any]:
        """What is given, by its key."""
        return {key: getattr(self, key) for key in type(self).model_fields if key in self.model_fields_set}

    @model_serializer
    def _written(self) -> dict[str, Any]:
        return self.given


class AircraftSettings(Section):
    """One of several aircraft; what it leaves out is as the other tables say."""

    name: str = Field(default="", pattern=r"^[\w.-]{0,24}$")
    connect: str = ""
    altitude_offset_m: float | None = Field(default=None, ge=0, le=200)
    speed_mps: float | None = Field(default=None, ge=1, le=25)
    system_id: int = Field(default=0, ge=0, le=255)
    sources: Names = []
    flavor: Literal["px4", "ardupilot"] | None = None
    sensor: OwnSensorSettings = OwnSensorSettings()


class Settings(Section):
    """All settings of a run; see `config/service.toml` for the meaning of each key."""

    link: LinkSettings = LinkSettings()
    flight: FlightSettings = FlightSettings()
    ground: GroundSettings = GroundSettings()
    sensor: SensorSettings = SensorSettings()
    search: SearchSettings = SearchSettings()
    http: HttpSettings = HttpSettings()
    page: PageSettings = PageSettings()
    doors: DoorSettings = DoorSettings()
    telling: TellingSettings = TellingSettings()
    run: RunSettings = RunSettings()
    demo: DemoSettings = DemoSettings()
    aircraft: list[AircraftSettings] = Field(default=[], max_length=MOST_AIRCRAFT)

    @property
    def mock(self) -> bool:
        """True when built-in mocks fly, because no link was given."""
        return not self.link.connect and not any(each.connect for each in self.aircraft)

    @property
    def ground_files(self) -> list[str]:
        """The height models; `sensor.terrain_file` is the old name of the setting."""
        return self.ground.file or ([self.sensor.terrain_file] if self.sensor.terrain_file else [])

    @property
    def real(self) -> bool:
        """True when what flies may be a real aircraft: a link, and nothing that says it is a simulator's."""
        return not self.mock and self.link.speedup in (None, 1.0)

    @property
    def speedup(self) -> float:
        """How much faster than real time the aircraft's clock runs; 1 on a link unless a simulator's is given."""
        return self.link.speedup or (MOCK_SPEEDUP if self.mock else 1.0)

"""The settings of a run: one TOML file, overridden by the environment, overridden by flags.

Every key with its unit, default and meaning stands in `config/service.toml`; a test keeps the two alike.
"""

from __future__ import annotations

import difflib
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from service.errors import BadInput, shown
from service.toml_lines import key_lines

PlannerName = Literal[
    "puct-regions-lite",
    "puct-regions",
    "puct",
    "greedy",
    "direct-policy-search",
    "coverage",
    "spiral",
    "index",
]


MOCK_SPEEDUP = 20.0


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


class FlightSettings(Section):
    altitude_m: float = Field(default=30.0, ge=5, le=500)
    speed_mps: float = Field(default=8.0, ge=1, le=25)
    deceleration_mps2: float = Field(default=1.5, gt=0.2, le=10)
    corner_m: float = Field(default=5.0, ge=1, le=50)
    takeoff: bool = False
    min_battery_percent: float = Field(default=20.0, ge=0, le=95)
    reserve_percent: float = Field(default=15.0, ge=0, le=90)
    max_airspeed_mps: float = Field(default=15.0, ge=2, le=40)
    climb_mps: float = Field(default=2.0, ge=0.2, le=20)
    descent_mps: float = Field(default=1.0, ge=0.2, le=20)
    return_height_m: float = Field(default=60.0, ge=0, le=500)
    max_flight_s: float = Field(default=7200.0, gt=0)
    margin_m: float = Field(default=30.0, ge=0, le=5000)
    min_height_m: float = Field(default=3.0, ge=1, le=500)
    max_height_m: float = Field(default=120.0, ge=5, le=500)
    max_launch_distance_m: float = Field(default=20_000.0, gt=0)
    min_satellites: int = Field(default=6, ge=0, le=40)
    max_jump_m: float = Field(default=10.0, gt=0)
    settle_s: float = Field(default=3.0, ge=0, le=600)
    max_wind_mps: float = Field(default=12.0, gt=0)
    stuck_after_s: float = Field(default=15.0, ge=2)
    max_hold_s: float = Field(default=900.0, gt=0)


class SensorSettings(Section):
    profile: Literal["point", "donut", "wide-angle", "camera"] = "point"
    horizontal_fov_deg: float = Field(default=62.0, gt=5, lt=170)
    vertical_fov_deg: float = Field(default=55.0, gt=5, lt=170)
    overlap: float = Field(default=0.2, ge=0, lt=0.9)
    cell_m: float | None = Field(default=None, gt=0.5, le=1000)
    p_tp: float = Field(default=0.9, gt=0, lt=1)
    p_tn: float = Field(default=0.9, gt=0, lt=1)
    calibration_file: str = ""
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
    planner: PlannerName = "puct-regions-lite"
    deadline_s: float = Field(default=0.038, gt=0, le=5)
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
    allowed_hosts: Names = []
    allowed_origins: Origins = []
    reports_per_s: float = Field(default=2000.0, ge=1, allow_inf_nan=False)
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


class RunSettings(Section):
    folder: str = "runs"
    seed: int = Field(default=1, ge=0)


class DemoSettings(Section):
    flavor: Literal["px4", "ardupilot"] = "px4"
    endurance_min: float = Field(default=120.0, gt=0)


class Settings(Section):
    """All settings of a run; see `config/service.toml` for the meaning of each key."""

    link: LinkSettings = LinkSettings()
    flight: FlightSettings = FlightSettings()
    sensor: SensorSettings = SensorSettings()
    search: SearchSettings = SearchSettings()
    http: HttpSettings = HttpSettings()
    page: PageSettings = PageSettings()
    doors: DoorSettings = DoorSettings()
    run: RunSettings = RunSettings()
    demo: DemoSettings = DemoSettings()

    @property
    def mock(self) -> bool:
        """True when the built-in mock flies, because no link was given."""
        return not self.link.connect

    @property
    def speedup(self) -> float:
        """How much faster than real time the aircraft's clock runs; 1 on a link unless a simulator's is given."""
        return self.link.speedup or (MOCK_SPEEDUP if self.mock else 1.0)


def _flatten(model: type[BaseModel]) -> dict[str, Any]:
    """Every known key as 'section.key' with its annotation."""
    return {
        f"{section}.{key}": field.annotation
        for section, table in model.model_fields.items()
        for key, field in table.annotation.model_fields.items()  # type: ignore[union-attr]
    }


KNOWN_KEYS: tuple[str, ...] = tuple(_flatten(Settings))


def nearest_key(key: str) -> str | None:
    """The setting that a key which is none most likely means: of the same name elsewhere, or of a similar one."""
    namesakes = [known for known in KNOWN_KEYS if known.rpartition(".")[2] == key.rpartition(".")[2]]
    if namesakes:
        return namesakes[0]
    known = KNOWN_KEYS if "." in key else (*Settings.model_fields, *KNOWN_KEYS)
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.4)
    return near[0] if near else None


def problems(values: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Everything that is wrong with settings: pairs of a dotted key and a sentence; empty when nothing is."""
    try:
        Settings.model_validate(values)
    except ValidationError as error:
        return [_problem(details) for details in error.errors()]
    return []


def _problem(details: Any) -> tuple[str, str]:
    key = ".".join(str(part) for part in details["loc"])
    if details["type"] == "extra_forbidden":
        near = nearest_key(key)
        known = KNOWN_KEYS if "." in key else tuple(Settings.model_fields)
        hint = f"did you mean '{near}'?" if near else f"known are {', '.join(known)}"
        return key, f"there is no setting '{key}'; {hint}"
    return key, f"'{key}' = {shown(details['input'])} is not possible: {details['msg']}"


def read_toml(file: Path) -> tuple[dict[str, Any], str]:
    """The values of a TOML file, and its text; raises BadInput with the line that is wrong."""
    try:
        text = file.read_text(encoding="utf-8")
        return tomllib.loads(text), text
    except OSError as error:
        raise BadInput(f"{file}: cannot be read ({error.strerror}); give an existing TOML file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        line = re.search(r"at line (\d+)", str(error))
        raise BadInput(f"{file}{f':{line[1]}' if line else ''}: is not TOML: {error}") from error


def file_problems(file: Path) -> list[str]:
    """Everything that is wrong with a settings file, as sentences with file and line; raises BadInput if no TOML."""
    values, text = read_toml(file)
    wrong = problems(values)
    lines = key_lines(text) if wrong else {}

    def line(key: str) -> int:
        while key and key not in lines:  # a wrong item of a list stands where the list does
            key = key.rpartition(".")[0]
        return lines.get(key, 0)

    found = sorted((line(key), sentence) for key, sentence in wrong)
    return [f"{file}:{number}: {sentence}" if number else f"{file}: {sentence}" for number, sentence in found]


def variable_name(key: str) -> str:
    """The environment variable that overrides 'section.key'."""
    return f"ROISEARCH_{key.replace('.', '_')}".upper()


def read_settings(
    file: Path | None = None,
    *,
    environment: Mapping[str, str] | None = None,
    flags: Mapping[str, Any] | None = None,
) -> Settings:
    """Settings from defaults, then `file`, then ROISEARCH_SECTION_KEY variables, then `flags`.

    `flags` maps 'section.key' to a value; None means 'not given'. Raises BadInput in one sentence.
    """
    values: dict[str, dict[str, Any]] = {}
    where = "settings"
    if file is not None:
        where = str(file)
        values, _ = read_toml(file)
        if wrong := file_problems(file):
            raise BadInput(wrong[0])
    variables = os.environ if environment is None else environment
    for dotted in KNOWN_KEYS:
        section, key = dotted.split(".")
        name = variable_name(dotted)
        if name in variables:
            values.setdefault(section, {})[key] = variables[name]
            where = f"environment variable {name}"
            _check(values, where)
    return changed_settings(values, flags or {}, where)


def changed_settings(values: dict[str, Any], changed: Mapping[str, Any], where: str) -> Settings:
    """Settings from `values` (tables by section, named `where`) with some 'section.key' changed; None: not.

    Raises BadInput in one sentence.
    """
    for dotted, value in changed.items():
        if value is not None:
            section, key = dotted.split(".")
            values.setdefault(section, {})[key] = value
            _check(values, f"--{key.replace('_', '-')}")
    settings = _check(values, where)
    flight = settings.flight
    if not flight.min_height_m <= flight.altitude_m <= flight.max_height_m:
        raise BadInput(
            f"{where}: 'flight.altitude_m' = {flight.altitude_m:g} is not between min_height_m = "
            f"{flight.min_height_m:g} and max_height_m = {flight.max_height_m:g}; change one of them"
        )
    if settings.link.speedup not in (None, 1.0) and settings.link.connect.startswith("serial"):
        raise BadInput(f"{settings.link.connect} is a real aircraft: it flies at a speedup of 1")
    return settings


def _check(values: dict[str, Any], where: str) -> Settings:
    if wrong := problems(values):
        raise BadInput(f"{where}: {wrong[0][1]}")
    return Settings.model_validate(values)

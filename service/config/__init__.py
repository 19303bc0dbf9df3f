"""The settings of a run: one TOML file, overridden by the environment, overridden by flags.

Every key with its unit, default and meaning stands in `config/service.toml`; a test keeps the two alike.
"""

from service.config.aircraft import ONLY, about, each_aircraft, gap_m, name_of
from service.config.keys import KNOWN_KEYS, checked, nearest_key, without_unknown
from service.config.reading import changed_settings, file_problems, read_settings, read_toml, variable_name
from service.config.tables import (
    MOCK_SPEEDUP,
    MOST_BATCH,
    SPARE_M,
    DoorSettings,
    FlightSettings,
    HttpSettings,
    PageSettings,
    PlannerName,
    SensorSettings,
    Settings,
    TellingSettings,
)

__all__ = [
    "KNOWN_KEYS",
    "MOCK_SPEEDUP",
    "MOST_BATCH",
    "ONLY",
    "SPARE_M",
    "DoorSettings",
    "FlightSettings",
    "HttpSettings",
    "PageSettings",
    "PlannerName",
    "SensorSettings",
    "Settings",
    "TellingSettings",
    "about",
    "changed_settings",
    "checked",
    "each_aircraft",
    "file_problems",
    "gap_m",
    "name_of",
    "nearest_key",
    "read_settings",
    "read_toml",
    "variable_name",
    "without_unknown",
]

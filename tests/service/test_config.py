"""Settings: where they come from, and what a wrong one is answered with."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from service.config import KNOWN_KEYS, Settings, read_settings
from service.errors import BadInput

SHIPPED = Path(__file__).parents[2] / "config" / "service.toml"


def test_the_shipped_file_names_every_key_with_its_default() -> None:
    shipped = tomllib.loads(SHIPPED.read_text(encoding="utf-8"))
    defaults = Settings().model_dump()
    for table in defaults.values():
        for key in [key for key, value in table.items() if value is None]:
            del table[key]
            assert f"\n# {key} = " in SHIPPED.read_text(encoding="utf-8")
    assert shipped == defaults


def test_flags_win_over_environment_and_environment_over_file(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text("[flight]\naltitude_m = 40\nspeed_mps = 5\n[run]\nseed = 3\n")
    environment = {"ROISEARCH_FLIGHT_ALTITUDE_M": "50", "ROISEARCH_RUN_SEED": "4"}
    settings = read_settings(file, environment=environment, flags={"run.seed": 5, "run.folder": None})
    assert (settings.flight.speed_mps, settings.flight.altitude_m, settings.run.seed) == (5.0, 50.0, 5)
    assert settings.run.folder == "runs"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[flight]\naltitud_m = 3\n", ["flight.altitud_m", "did you mean 'flight.altitude_m'"]),
        ("[fligth]\n", ["fligth", "did you mean 'flight'"]),
        ("[sensor]\np_tp = 1.5\n", ["sensor.p_tp", "1.5", "less than 1"]),
        (
            "[sensor]\nprofile = 'fisheye'\n",
            ["sensor.profile", "fisheye", "'wide-angle' or 'camera'"],
        ),
        ("[sensor\n", ["is not TOML", "line 1"]),
    ],
)
def test_a_wrong_setting_is_named_with_what_is_allowed(tmp_path: Path, text: str, words: list[str]) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    with pytest.raises(BadInput) as caught:
        read_settings(file, environment={})
    for word in ["wrong.toml", *words]:
        assert word in str(caught.value)


def test_a_missing_file_and_a_wrong_variable_are_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none\.toml: cannot be read"):
        read_settings(tmp_path / "none.toml", environment={})
    with pytest.raises(BadInput, match=r"ROISEARCH_RUN_SEED.*run\.seed"):
        read_settings(None, environment={"ROISEARCH_RUN_SEED": "many"})


def test_every_known_key_can_be_set_from_the_environment() -> None:
    assert "link.speedup" in KNOWN_KEYS
    assert read_settings(None, environment={"ROISEARCH_LINK_SPEEDUP": "50"}).speedup == 50.0


def test_only_a_simulator_may_run_faster_than_real_time() -> None:
    assert read_settings(None, environment={}).speedup == 20.0
    assert read_settings(None, environment={}, flags={"link.connect": "udpin://0.0.0.0:14540"}).speedup == 1.0
    flags = {"link.connect": "serial:///dev/ttyACM0:921600", "link.speedup": 5.0}
    with pytest.raises(BadInput, match="real aircraft"):
        read_settings(None, environment={}, flags=flags)

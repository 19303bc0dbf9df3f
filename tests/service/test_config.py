"""Settings: where they come from, and what a wrong one is answered with."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from service.cli import main as service_main
from service.commands.config import main
from service.config import KNOWN_KEYS, Settings, read_settings
from service.errors import BadInput
from service.toml_lines import key_lines

SHIPPED = Path(__file__).parents[2] / "config" / "service.toml"


def test_the_shipped_file_names_every_key_with_its_default() -> None:
    shipped = tomllib.loads(SHIPPED.read_text(encoding="utf-8"))
    defaults = Settings().model_dump()
    assert defaults.pop("aircraft") == []  # tables that the file shows in comments
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
        ("[run]\n\n[flight]\np_tp = 0.5\n", ["wrong.toml:4:", "did you mean 'sensor.p_tp'"]),
        ("altitude_m = 40\n", ["wrong.toml:1:", "did you mean 'flight.altitude_m'"]),
        ("[fligth]\n", ["fligth", "did you mean 'flight'"]),
        ("[sensor]\np_tp = 1.5\n", ["sensor.p_tp", "1.5", "less than 1"]),
        (
            "[sensor]\nprofile = 'fisheye'\n",
            ["sensor.profile", "fisheye", "'wide-angle' or 'camera'"],
        ),
        ("[sensor\n", ["is not TOML", "line 1"]),
        ("[flight]\naltitude_m = 150\n", ["flight.altitude_m", "150", "max_height_m = 120"]),
        ("[flight]\nmin_height_m = 40\n", ["flight.altitude_m", "30", "min_height_m = 40"]),
    ],
)
def test_a_wrong_setting_is_named_with_what_is_allowed(tmp_path: Path, text: str, words: list[str]) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    with pytest.raises(BadInput) as caught:
        read_settings(file, environment={})
    for word in ["wrong.toml", *words]:
        assert word in str(caught.value)


def test_a_wrong_flag_is_called_as_it_was_typed(capsys: pytest.CaptureFixture[str]) -> None:
    assert service_main(["--area", "config/area.geojson", "--cell", "-5"]) == 2
    assert "--cell: 'sensor.cell_m' = -5.0 is not possible" in capsys.readouterr().err


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


def test_the_line_of_a_key_is_found_whatever_the_spelling() -> None:
    text = (
        "# a comment\n[http]\nlisten = 'x'\nallowed_hosts = [\n  'a = 1',\n]\n"
        'flight.speed_mps = 3\n\n[run]  # more\nfolder = """\nseed = 4\n"""\nseed = 5\n'
    )
    lines = key_lines(text)
    assert lines["http.listen"] == 3
    assert lines["http.allowed_hosts"] == 4
    assert lines["http.flight.speed_mps"] == 7
    assert (lines["run"], lines["run.folder"], lines["run.seed"]) == (9, 10, 13)
    assert key_lines("inline = {a = 1}\n")["inline.a"] == 1


def test_config_check_names_every_wrong_line_and_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text("[flight]\naltitud_m = 3\n\nspeed_mps = 900\n[http]\nallowed_hosts = [\n  1,\n]\n")
    assert main(["check", str(file)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert [line.partition(": ")[0] for line in said] == [f"{file}:{number}" for number in (2, 4, 6)]
    assert "did you mean 'flight.altitude_m'" in said[0]
    assert "'flight.speed_mps' = 900" in said[1]
    assert "http.allowed_hosts" in said[2]


def test_config_check_names_all_that_a_run_would_refuse(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Addresses that are none and files that are not there; without opening any, and with what would be right."""
    monkeypatch.chdir(tmp_path)
    wrong = {
        "telling": {"webhook": "chat", "mqtt": "x://y", "tak": "tcp:/x"},
        "sensor": {"calibration_file": "none.csv"},
        "link": {"connect": "serial:///dev/ttyACM0", "signing_key_file": "none.key"},
        "http": {"listen": "everywhere", "token_file": "none.token"},
        "doors": {"udp": "14600", "mqtt": "broker"},
        "ground": {"file": "dem.tif", "cover_file": "cover.tif", "mobility_file": "mobility.tif"},
        "page": {"tiles_url": "https://tiles.example.org"},
    }
    lines = [
        line
        for table, keys in wrong.items()
        for line in (f"[{table}]", *(f'{k} = "{v}"' for k, v in keys.items()))
    ]
    Path("wrong.toml").write_text("\n".join(lines))
    assert service_main(["config", "check", "wrong.toml"]) == 2
    said = dict(line.split(": ", 1) for line in capsys.readouterr().err.splitlines())
    given = [f"wrong.toml:{number}" for number, line in enumerate(lines, 1) if not line.startswith("[")]
    assert sorted(said) == sorted(given)
    for line, words in zip(given, ["https://HOST/PATH", "mqtt://HOST", "tls://HOST:8089"], strict=False):
        assert words in said[line]


def test_config_check_takes_what_another_computer_will_have(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "right.toml"
    file.write_text(
        '[link]\nconnect = "serial:///dev/ttyACM9:921600"\n[http]\nlisten = "0.0.0.0:8080"\n[telling]\ntak = "tcp://tak:8087"\n'
    )
    assert service_main(["config", "check", str(file)]) == 0
    assert "nothing is wrong" in capsys.readouterr().out


def test_config_check_tells_where_each_setting_comes_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "good.toml"
    file.write_text("[flight]\naltitude_m = 40\nspeed_mps = 5\n")
    monkeypatch.setenv("ROISEARCH_FLIGHT_SPEED_MPS", "6")
    monkeypatch.setenv("ROISEARCH_RUN_SEAD", "6")
    assert main(["check", str(file)]) == 0
    said = capsys.readouterr()
    settings = dict(line.split(" = ") for line in said.out.splitlines()[1:])
    assert settings["  flight.altitude_m"].split() == ["40.0", f"{file}:2"]
    assert settings["  flight.speed_mps"].split() == [
        "6.0",
        *["environment", "variable"],
        "ROISEARCH_FLIGHT_SPEED_MPS",
    ]
    assert "ROISEARCH_RUN_SEAD is no setting" in said.err
    assert "did you mean ROISEARCH_RUN_SEED?" in said.err
    assert main(["show"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(KNOWN_KEYS)


def test_a_wrong_value_as_long_as_a_file_is_shown_by_its_beginning(tmp_path: Path) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text("[link]\nsystem_id = '" + "x" * 5000 + "'\n")
    with pytest.raises(BadInput, match=r"link\.system_id") as caught:
        read_settings(file, environment={})
    assert len(str(caught.value)) < 400

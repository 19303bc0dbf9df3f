"""The systemd unit: systemd itself takes it, its sandbox is closed, and it starts what there is."""

from __future__ import annotations

import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from service.cli import parser
from service.config import KNOWN_KEYS
from service.run import BEGUN_AGAIN, EXIT_CODES

UNIT = Path(__file__).parents[2] / "config" / "roisearch.service"
PROGRAM = "/opt/roisearch/bin/roisearch-service"


def lines(key: str) -> list[str]:
    """The values of a key, in order."""
    text = UNIT.read_text(encoding="utf-8")
    return [line.partition("=")[2] for line in text.splitlines() if line.startswith(f"{key}=")]


def analyze(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """What systemd-analyze says of the unit, with a program in it that is there."""
    tool = shutil.which("systemd-analyze")
    if tool is None:
        pytest.skip("NO systemd-analyze: THE UNIT HAS NOT BEEN CHECKED (apt-get install systemd)")
    unit = folder / "roisearch.service"
    unit.write_text(UNIT.read_text(encoding="utf-8").replace(PROGRAM, "/bin/true"), encoding="utf-8")
    return subprocess.run([tool, *words, str(unit)], capture_output=True, text=True, timeout=60, check=False)


def test_systemd_takes_every_line_of_the_unit(tmp_path: Path) -> None:
    said = analyze(tmp_path, "verify", "--man=no")
    about_it = [line for line in said.stderr.splitlines() if "roisearch.service" in line]
    assert (said.returncode, about_it) == (0, [])


def test_systemd_rates_the_sandbox_as_closed(tmp_path: Path) -> None:
    said = analyze(tmp_path, "security", "--offline=true", "--threshold=20", "--no-pager")
    assert said.returncode == 0, said.stdout[-300:] + said.stderr


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("NoNewPrivileges", "yes"),
        ("ProtectSystem", "strict"),
        ("ProtectHome", "yes"),
        ("PrivateTmp", "yes"),
        ("DynamicUser", "yes"),
        ("DevicePolicy", "closed"),
        ("RestrictAddressFamilies", "AF_INET AF_INET6 AF_UNIX"),
        ("CapabilityBoundingSet", ""),
        ("Restart", "on-failure"),
        ("StartLimitIntervalSec", "0"),
        ("OOMPolicy", "continue"),
    ],
)
def test_the_sandbox_has_its_walls(key: str, value: str) -> None:
    assert lines(key) == [value]


def test_what_the_planner_and_the_wire_need_is_open() -> None:
    assert "char-ttyACM rw" in lines("DeviceAllow")
    assert lines("SystemCallFilter")[0] == "@system-service"
    assert "MemoryDenyWriteExecute" not in "".join(
        line for line in UNIT.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    )
    assert "PrivateDevices=yes" not in UNIT.read_text(encoding="utf-8")


def test_the_command_in_the_unit_is_one_that_the_service_takes() -> None:
    program, *arguments = shlex.split(lines("ExecStart")[0])
    assert program == PROGRAM
    options = parser().parse_args(arguments)
    assert options.area is not None
    assert options.go_on  # a crash is gone on with, and no second search is begun
    assert not options.takeoff
    assert options.runs == "/var/lib/" + lines("StateDirectory")[0]


def test_the_token_comes_as_a_credential_and_its_variable_is_a_setting() -> None:
    variables = dict(word.split("=", 1) for line in lines("Environment") for word in line.split())
    commented = [
        line.partition("Environment=")[2]
        for line in UNIT.read_text(encoding="utf-8").splitlines()
        if line.startswith("#Environment=")
    ]
    variables |= dict(word.split("=", 1) for word in commented)
    ours = {name for name in variables if name.startswith("ROISEARCH_")}
    assert ours == {"ROISEARCH_HTTP_TOKEN_FILE", "ROISEARCH_LINK_SIGNING_KEY_FILE"}
    assert ours <= {f"ROISEARCH_{key.replace('.', '_')}".upper() for key in KNOWN_KEYS}
    assert variables["ROISEARCH_HTTP_TOKEN_FILE"] == "%d/" + lines("LoadCredential")[0].split(":")[0]


def test_only_a_crash_is_started_over() -> None:
    assert BEGUN_AGAIN not in (*EXIT_CODES.values(), 2)
    ended = {int(code) for code in lines("SuccessExitStatus")[0].split()} | {0}
    assert set(EXIT_CODES.values()) == ended
    assert lines("RestartPreventExitStatus") == ["2"]

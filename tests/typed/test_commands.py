"""Every command that a page tells is run as it is typed, or parsed where `table` says why it is not.

What serves or calls a service does so in a network namespace of its own, where the ports that the pages name are free.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from service.cli import main as service_main
from sim.__main__ import main as sim_main

from .pages import COMMANDS
from .scratch import lay_out
from .table import BESIDE, MOCKS, NOT_TO_THE_END, SERVICE, SERVING, reason

ENVIRONMENT = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
PATIENCE_S = 200
EACH = list(dict.fromkeys((file, line) for file, lines in COMMANDS.items() for line in lines))
ONCE = list({line: file for file, line in reversed(EACH)}.items())[::-1]
"""Each line with the first page that tells it."""

ALONE = "unshare --user --map-root-user --net --pid --fork --kill-child"
IN_A_NAMESPACE = """
ip link set lo up
{mock}
{serving} > said.txt 2>&1 &
service=$!
says() {{ grep -qE {until} said.txt; }}
for try in $(seq 900); do
  if says || ! kill -0 $service 2>/dev/null; then break; fi
  sleep 0.1
done
says || {{ cat said.txt >&2; exit 70; }}
{then}
"""
HEARD = """
for try in $(seq 300); do
  if curl -s http://127.0.0.1:8080/api/state | grep -qE '"accepted": ?[1-9]'; then break; fi
  sleep 0.1
done
curl -s http://127.0.0.1:8080/api/state | grep -oE '"accepted": ?[1-9]'
"""
"""Ends when the service has taken a report in."""


def alone(folder: Path, serving: str, until: str, then: str = "true") -> subprocess.CompletedProcess[str]:
    """Serve in a namespace until it says that it does; then what is typed beside it. All ends with the namespace."""
    if typed(folder, f"{ALONE} ip link set lo up").returncode:
        pytest.skip("NO NETWORK NAMESPACES: COMMANDS THAT SERVE HAVE NOT BEEN TYPED (unshare, ip)")
    mock = next((words for link, words in MOCKS.items() if f"--connect {link}" in serving), "")
    script = IN_A_NAMESPACE.format(
        mock=f"{mock} >/dev/null 2>&1 &" if mock else "", serving=serving, until=shlex.quote(until), then=then
    )
    return typed(folder, f"{ALONE} bash -euc {shlex.quote(script)}")


def typed(folder: Path, line: str) -> subprocess.CompletedProcess[str]:
    """A line in a shell, in the environment of the tests."""
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", line],
        cwd=folder,
        env=ENVIRONMENT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )


class Folders(dict[Path, Path]):
    """A folder for each page, in which its commands are typed one after the other."""

    def __init__(self, factory: pytest.TempPathFactory) -> None:
        super().__init__()
        self._factory = factory

    def __missing__(self, file: Path) -> Path:
        self[file] = lay_out(self._factory.mktemp("typed"))
        return self[file]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Folders:
    """The folders of all pages."""
    return Folders(tmp_path_factory)


TALKING = [line for line, _ in ONCE if line.startswith(BESIDE)]


@pytest.mark.parametrize(
    ("line", "file"), [each for each in ONCE if reason(each[0]) is None and each[0] not in TALKING]
)
def test_a_command_works_as_typed(line: str, file: Path, folders: Folders) -> None:
    says = next((words for start, words in SERVING.items() if line.startswith(start)), None)
    done = typed(folders[file], line) if says is None else alone(folders[file], line, says)
    assert done.returncode == 0, f"{file}: {line}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"


def test_a_service_hears_who_talks_to_it_as_typed(folders: Folders) -> None:
    detectors = [line for line in TALKING if not line.startswith("curl")]
    orders = [line for line in TALKING if line.startswith("curl")]
    then = "".join([*(f"{line} &\n{HEARD}" for line in detectors), *(f"{line}\necho\n" for line in orders)])
    done = alone(folders[Path("beside")], SERVICE, "→ SEARCHING", then)
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    heard, *answers = done.stdout.splitlines()
    assert "accepted" in heard
    assert len(answers) == len(orders) == 2
    assert all("state" in json.loads(answer) for answer in answers), answers


class Parsed(Exception):
    """The parser has taken all words."""


@pytest.fixture
def parse_only(monkeypatch: pytest.MonkeyPatch, folders: Folders) -> None:
    """Programs end when their words are parsed."""
    parse = argparse.ArgumentParser.parse_args

    def parsed(self: argparse.ArgumentParser, *words: Any) -> None:
        parse(self, *words)
        raise Parsed

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parsed)
    monkeypatch.chdir(folders[Path()])


OURS = {"roisearch-service": service_main, "roisearch-sim": sim_main}
PARSED = [each for each in ONCE if reason(each[0]) is not None and Path(each[0].split()[0]).name in OURS]


@pytest.mark.usefixtures("parse_only")
@pytest.mark.parametrize(("line", "file"), PARSED)
def test_a_command_that_is_not_run_has_words_that_its_parser_knows(line: str, file: Path) -> None:
    program, *words = shlex.split(line)
    with pytest.raises(Parsed):
        OURS[Path(program).name](words)


def test_every_line_is_good_shell() -> None:
    said = [
        subprocess.run(["bash", "-n", "-c", line], capture_output=True, text=True).stderr for _, line in EACH
    ]
    assert not any(said)


def test_no_reason_is_left_over() -> None:
    left = [start for start in NOT_TO_THE_END if not any(line.startswith(start) for _, line in EACH)]
    assert left == []


def test_there_are_commands_on_the_page_of_every_room() -> None:
    pages = [file for file in COMMANDS if file.name == "README.md" and file.parts[0] != "tests"]
    assert len(pages) >= 6
    assert all(COMMANDS[file] for file in pages)

"""The command line: a help that fits a screen and comes at once, and words that start commands."""

from __future__ import annotations

import contextlib
import importlib.metadata
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from service.cli import main, parser
from service.commands import COMMANDS
from sim.__main__ import main as simulate


def test_the_help_fits_a_screen_and_names_every_flag_and_command() -> None:
    said = parser().format_help()
    lines = said.rstrip("\n").splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    # argparse has no public list of the flags of a parser
    flags = [action.option_strings[-1] for action in parser()._actions if action.dest != "help"]
    assert [flag for flag in flags if flag not in said] == []
    assert [word for word in COMMANDS if f"\n  {word} " not in said] == []
    assert "--area config/area.geojson" in said


def test_a_process_that_a_library_ends_says_where() -> None:
    crash = (
        "import os, signal, service.cli\nservice.cli.main = lambda: os.kill(os.getpid(), signal.SIGSEGV)\n"
    )
    start = "import service.__main__\nservice.__main__.main()"
    done = subprocess.run([sys.executable, "-c", crash + start], capture_output=True, text=True)
    assert done.returncode == -11
    assert "Fatal Python error" in done.stderr


@pytest.mark.parametrize("word", ["", *COMMANDS])
def test_help_comes_before_anything_heavy_is_imported(word: str) -> None:
    heavy = ["numpy", "scipy", "numba", "matplotlib", "fastapi", "pymavlink", "skimage", "rasterio"]
    program = (
        "import sys, service.cli\n"
        f"try: service.cli.main([*{[word] if word else []}, '--help'])\n"
        "except SystemExit as end: assert not end.code\n"
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    said = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    assert said.stdout.splitlines()[-1] == "[]"
    assert "roisearch-service" in said.stdout


@pytest.mark.parametrize("program", [main, simulate])
def test_the_version_is_that_of_the_package(
    program: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    with contextlib.suppress(SystemExit):
        program(["--version"])
    assert capsys.readouterr().out == f"roisearch {importlib.metadata.version('roisearch')}\n"


def test_a_misspelt_command_is_answered_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["confg"]) == 2
    assert "did you mean 'config'?" in capsys.readouterr().err
    assert main(["fly"]) == 2
    assert ", ".join(COMMANDS) in capsys.readouterr().err


def test_neither_area_nor_run_is_one_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("udpp://1.2.3.4:5", "udpp"),
        ("udpin://0.0.0.0", "port"),
        ("serial:///dev/ttyACM0:57600", "pip install 'roisearch[serial]'"),
        ("serial:///dev/no-such-port:57600", "serial:///dev/no-such-port:57600: there is no such device; "),
        ("serial:///etc/hostname:57600", "this is no serial device"),
        ("udpout://no.such.host.invalid:14550", "the host 'no.such.host.invalid' is not known"),
        ("udpin://127.0.0.1:TAKEN", "Address already in use"),
    ],
)
def test_a_link_that_cannot_be_is_told_before_anything_is_compiled(
    url: str,
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if "pip install" in words:
        monkeypatch.setitem(sys.modules, "serial", None)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        link = url.replace("TAKEN", str(taken.getsockname()[1]))
        arguments = ["--area", "config/area.geojson", "--connect", link, "--runs", str(tmp_path / "runs")]
        assert main([*arguments, "--http", "127.0.0.1:0"]) == 2
    said = capsys.readouterr()
    assert words in said.err
    assert "compil" not in said.out
    assert not (tmp_path / "runs").exists()


def test_a_link_that_may_be_a_real_aircraft_is_warned_of_until_somebody_has_thought_of_the_ground(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:  # so that it ends before it begins
        door = ["--http", f"127.0.0.1:{taken.getsockname()[1]}"]
        link = ["--connect", "udpin://127.0.0.1:0", *door, "--runs", str(tmp_path / "runs")]
        for more, warned in (([], True), (["--flat"], False), (["--speedup", "5"], False)):
            assert main(["--area", "config/area.geojson", *link, *more]) == 2
            assert ("give --ground FILE, or --flat" in " ".join(capsys.readouterr().out.split())) == warned
    assert main(["--area", "config/area.geojson", *link, "--ground", str(tmp_path / "none.tif")]) == 2
    assert "there is no such height model; check ground.file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("run", "words", "said"),
    [
        (main, "export . --format gpxx", "argument --format: invalid choice: 'gpxx'"),
        (main, "area", "the following arguments are required"),
        (main, "config check", "the following arguments are required: FILE"),
        (main, "detector frigate --mqtt m --camera c --size 3xx3", "'3xx3' is not WIDTHxHEIGHT"),
        (simulate, "flights nowhere.geojson", "nowhere.geojson: there is no such file; check the path;"),
        (simulate, "flights --aircraft 2 nowhere.geojson", "nowhere.geojson: there is no such file;"),
        (simulate, "detector --service foo", "'foo' is no address; give http://HOST:PORT"),
        (simulate, "flights a.geojson --flavors px5", "no flavor 'px5'; there is px4, ardupilot"),
        (simulate, "flights a.geojson --planners nope", "no planner 'nope'; there is puct,"),
        (main, "detector onnx --model m --video 0 --latency -5", "'-5' is no time; give seconds, 0 or more"),
        (
            main,
            "detector onnx --model m --video 0 --rate 0",
            "'0' is not how often a second; give more than 0",
        ),
        (simulate, "trials --trials many", "argument --trials: invalid int value: 'many'"),
    ],
)
def test_wrong_words_for_a_command_are_one_sentence(
    run: Callable[[list[str]], int], words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        run(words.split())
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert line.endswith("--help tells more")

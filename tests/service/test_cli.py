"""The command line: a help that fits a screen and comes at once, and words that start commands."""

from __future__ import annotations

import subprocess
import sys

import pytest

from service.cli import main, parser
from service.commands import COMMANDS


def test_the_help_fits_a_screen_and_names_every_flag_and_command() -> None:
    said = parser().format_help()
    lines = said.rstrip("\n").splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    flags = [action.option_strings[-1] for action in parser()._actions if action.dest != "help"]
    assert [flag for flag in flags if flag not in said] == []
    assert [word for word in COMMANDS if f"\n  {word} " not in said] == []
    assert "--area config/area.geojson" in said


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


def test_a_misspelt_command_is_answered_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["confg"]) == 2
    assert "did you mean 'config'?" in capsys.readouterr().err
    assert main(["fly"]) == 2
    assert ", ".join(COMMANDS) in capsys.readouterr().err


def test_neither_area_nor_run_is_one_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert capsys.readouterr().err.count("\n") == 1

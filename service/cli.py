"""The command line of `roisearch-service`. Heavy imports wait until a run or a command really starts."""

from __future__ import annotations

import argparse
import difflib
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from service.commands import COMMANDS

NAME = "roisearch-service"
HELP = """\
usage: {name} --area FILE [options]      search an area
       {name} --resume RUN [options]     go on with a run
       {name} COMMAND ...                COMMAND --help tells more
commands:
{commands}
options:
  --area FILE       GeoJSON with the area, priors, exclusions, launch
  --prior TIF       GeoTIFF of probabilities instead of the priors
  --connect URL     the autopilot (default: the built-in mock)
  --takeoff         arm and take off by itself, also on a real link
  --config FILE     settings, see config/service.toml
  --runs DIR        where runs are kept (runs)
  --http HOST:PORT  where to listen (127.0.0.1:8080)
  --planner NAME    who decides (puct-regions-lite)
  --cell M          cell size in metres (from the sensor)
  --speedup X       how fast a mock or simulator flies; --flavor px4|ardupilot
  --seed S          seed of everything random (1)
{name} --area config/area.geojson
{name} --area a.geojson --connect udpin://0.0.0.0:14540
exit codes: 0 found, 3 searched and not found, 4 aborted, 2 bad input
"""


class _Parser(argparse.ArgumentParser):
    """A parser whose help fits a screen."""

    def format_help(self) -> str:
        words = "\n".join(f"  {word:17} {what}" for word, what in COMMANDS.items())
        return HELP.format(name=NAME, commands=words)

    def format_usage(self) -> str:
        return ""  # the one line of an error is enough


def parser() -> argparse.ArgumentParser:
    """The flags of a search; what they mean is in HELP."""
    p = _Parser(prog=NAME)
    p.add_argument("--area", metavar="FILE", type=Path)
    p.add_argument("--prior", metavar="TIF", type=Path)
    p.add_argument("--connect", metavar="URL")
    p.add_argument("--config", metavar="FILE", type=Path)
    p.add_argument("--runs", metavar="DIR")
    p.add_argument("--http", metavar="HOST:PORT")
    p.add_argument("--takeoff", action="store_true")
    p.add_argument("--planner", metavar="NAME")
    p.add_argument("--cell", metavar="M", type=float)
    p.add_argument("--flavor", choices=("px4", "ardupilot"))
    p.add_argument("--speedup", metavar="X", type=float)
    p.add_argument("--resume", metavar="RUN", type=Path)
    p.add_argument("--seed", metavar="S", type=int)
    return p


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the service or one of its commands; returns the exit code."""
    from service.errors import BadInput

    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if words and not words[0].startswith("-"):
            return _command(words[0], words[1:])
        return _search(words)
    except BadInput as error:
        print(f"{NAME}: {error}", file=sys.stderr)
        return 2


def _command(word: str, arguments: list[str]) -> int:
    """Run the command called `word`."""
    from service.errors import BadInput

    if word not in COMMANDS:
        near = difflib.get_close_matches(word, COMMANDS, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"there is {', '.join(COMMANDS)}"
        raise BadInput(f"there is no command '{word}'; {hint}")
    code: int = importlib.import_module(f"service.commands.{word}").main(arguments)
    return code


def _search(words: list[str]) -> int:
    """Fly a search, new or resumed."""
    from service.errors import BadInput

    options = parser().parse_args(words)
    if (options.area is None) == (options.resume is None):
        raise BadInput("give --area FILE, such as config/area.geojson, or --resume RUN")
    flags = {
        "link.connect": options.connect,
        "flight.takeoff": options.takeoff or None,
        "http.listen": options.http,
        "run.folder": options.runs,
        "run.seed": options.seed,
        "search.planner": options.planner,
        "sensor.cell_m": options.cell,
        "demo.flavor": options.flavor,
        "link.speedup": options.speedup,
    }
    from service.config import read_settings
    from service.run import resume, run

    if options.resume is not None:
        return resume(options.resume, flags)
    return run(options.area, options.prior, read_settings(options.config, flags=flags))

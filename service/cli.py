"""The command line of `roisearch-service`. Heavy imports wait until a run or a command really starts."""

from __future__ import annotations

import argparse
import difflib
import importlib
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from service.commands import COMMANDS

NAME = "roisearch-service"
MOST_AIRCRAFT = 8
"""As the settings have it, which are not read for a word of help."""
HELP = """\
usage: {name} --area FILE [options]      search an area
       {name} --resume RUN [options]     go on with a run
       {name} COMMAND ...                COMMAND --help; --version
commands:
{commands}
options:
  --area FILE       GeoJSON, KML, GPX, .plan, CalTopo; --prior TIF for priors
  --connect URL     autopilot, udpin://0.0.0.0:14540; again for each aircraft
  --ground FILE     heights of the ground; --flat  a real link asks for either
  --takeoff         take off by itself on a real link too; --go-on  see README
  --config FILE     settings; --runs DIR  where runs are kept; --aircraft N
  --http HOST:PORT  where to listen; --planner NAME; --cell M; --seed S
  --speedup X       how fast a mock or simulator flies; --flavor px4|ardupilot
{name} --area config/area.geojson
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
    p.add_argument("--version", action="version", version=f"roisearch {version('roisearch')}")
    p.add_argument("--area", metavar="FILE", type=Path)
    p.add_argument("--prior", metavar="TIF", type=Path)
    p.add_argument("--connect", metavar="URL", action="append", default=[])
    p.add_argument("--aircraft", metavar="N", type=int)
    p.add_argument("--config", metavar="FILE", type=Path)
    p.add_argument("--runs", metavar="DIR")
    p.add_argument("--http", metavar="HOST:PORT")
    p.add_argument("--ground", metavar="FILE", action="append")
    p.add_argument("--flat", action="store_true")
    p.add_argument("--takeoff", action="store_true")
    p.add_argument("--go-on", action="store_true")
    p.add_argument("--planner", metavar="NAME")
    p.add_argument("--cell", metavar="M", type=float)
    p.add_argument("--flavor", choices=("px4", "ardupilot"), action="append", default=[])
    p.add_argument("--speedup", metavar="X", type=float)
    p.add_argument("--resume", metavar="RUN", type=Path)
    p.add_argument("--seed", metavar="S", type=int)
    return p


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the service or one of its commands; returns the exit code."""
    from service.errors import BadInput
    from service.outlet import nobody_waits

    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if words and not words[0].startswith("-"):
            return _command(words[0], words[1:])
        with nobody_waits():
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


def aircraft_flags(connects: list[str], count: int | None, flavors: list[str]) -> dict[str, object]:
    """What --connect, --aircraft and --flavor say, each of which may be for one aircraft or for several.

    Flavours go round: with two of them and three mocks, the third has the first one's. Raises BadInput.
    """
    from service.errors import BadInput

    if count is not None and not 1 <= count <= MOST_AIRCRAFT:
        raise BadInput(f"--aircraft is a number from 1 to {MOST_AIRCRAFT}, not {count}")
    if count is not None and connects and count != len(connects):
        raise BadInput(f"--aircraft {count} with --connect given {len(connects)} times: leave --aircraft out")
    number = max(count or 1, len(connects), len(flavors))
    if number == 1:
        return {
            "link.connect": connects[0] if connects else None,
            "demo.flavor": flavors[0] if flavors else None,
        }
    if count is None and not connects:
        raise BadInput(f"--flavor is given {len(flavors)} times: say with --aircraft N how many mocks fly")
    if len(flavors) > (count or len(connects)):
        raise BadInput(f"--flavor is given {len(flavors)} times for {count or len(connects)} aircraft")
    tables: list[dict[str, str]] = [{} for _ in range(number)]
    for i, table in enumerate(tables):
        table |= {"connect": connects[i]} if connects else {}
        table |= {"flavor": flavors[i % len(flavors)]} if flavors else {}
    return {"aircraft": tables}


def _search(words: list[str]) -> int:
    """Fly a search, new or resumed."""
    from service.errors import BadInput

    options = parser().parse_args(words)
    if (options.area is None) == (options.resume is None):
        raise BadInput("give --area FILE, such as config/area.geojson, or --resume RUN")
    flags = {
        **aircraft_flags(options.connect, options.aircraft, options.flavor),
        "ground.file": options.ground,
        "ground.flat": options.flat or None,
        "flight.takeoff": options.takeoff or None,
        "http.listen": options.http,
        "run.folder": options.runs,
        "run.seed": options.seed,
        "search.planner": options.planner,
        "sensor.cell_m": options.cell,
        "link.speedup": options.speedup,
    }
    from service.config import read_settings
    from service.run import interrupted, resume, run
    from service.unpacking import given_again, unpack

    again = {**given_again(os.environ), **{key: value for key, value in flags.items() if value is not None}}
    if options.resume is not None:
        packed = options.resume.is_file()
        for name in ("prior", "config") if packed else ("prior", "config", "runs"):
            if getattr(options, name) is not None:
                raise BadInput(
                    f"--{name} does nothing with --resume: a run goes on with what is in its folder; leave it out"
                )
        if packed:
            return resume(unpack(options.resume, Path(options.runs or "runs"), again), again)
        return resume(options.resume, again)
    settings = read_settings(options.config, flags=flags)
    if options.go_on and (folder := interrupted(options.area, settings)) is not None:
        return resume(folder, again, restarted=True)
    return run(options.area, options.prior, settings, restarted=options.go_on)

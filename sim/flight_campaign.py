"""What all campaigns of whole flights have alike: their options, their seeds, and results that are not flown twice."""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pydantic import TypeAdapter

from roisearch.planners.outside import is_outside
from roisearch.registry import PLANNERS
from service.area import read_area
from service.errors import BadInput
from sim.autopilot.core import FIRMWARES

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")
D = TypeVar("D", bound="DataclassInstance")
RESULT = "result.json"
GOES_ON = "With --out, the same command goes on where it was interrupted."


def _flavors(text: str) -> str:
    for name in text.split(","):
        if name not in FIRMWARES:
            raise argparse.ArgumentTypeError(f"there is no flavor '{name}'; there is {', '.join(FIRMWARES)}")
    return text


def planners(text: str) -> str:
    """Names of planners, separated by commas, for argparse."""
    for name in text.split(","):
        if name not in PLANNERS and not is_outside(name):
            raise argparse.ArgumentTypeError(f"there is no planner '{name}'; there is {', '.join(PLANNERS)}")
    return text


def check_areas(parser: argparse.ArgumentParser, areas: Sequence[Path]) -> None:
    """End in one sentence, before the first flight, when an area file is none."""
    for area in areas:
        try:
            read_area(area)
        except BadInput as error:
            parser.error(str(error).rstrip("."))


def add_options(parser: argparse.ArgumentParser, each: str, *, speedup: float, patience_s: float) -> None:
    """Seeds, speed and patience of a campaign, and where it keeps its runs; `each` is what has so many seeds."""
    parser.add_argument("--seeds", type=int, default=20, help=f"how many seeds per {each}, from --first-seed")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--speedup", type=float, default=speedup, help="times faster than the wall clock")
    parser.add_argument(
        "--patience", type=float, default=patience_s, metavar="S", help="wall seconds a flight may take"
    )
    parser.add_argument("--out", type=Path, help="keep the run folders here (default: thrown away)")


def add_flavors(parser: argparse.ArgumentParser, *, jobs: int) -> None:
    """Which mock autopilots fly, and how many flights at a time."""
    parser.add_argument(
        "--flavors", type=_flavors, default="px4,ardupilot", help="mock autopilots, separated by commas"
    )
    parser.add_argument("--jobs", type=int, default=jobs, help="flights at a time; each keeps a core busy")


def seeds_of(options: argparse.Namespace) -> range:
    """The seeds that are asked for."""
    return range(options.first_seed, options.first_seed + options.seeds)


def kept(
    folder: Path, kind: type[T], fly: Callable[[], T], same: Callable[[T], bool] = lambda result: True
) -> T:
    """What came of a flight: a `kind` of dataclass as it is kept in its folder, else it is flown and kept there.

    What an interrupted one has left is removed first. Raises BadInput when what is kept is not the `same` flight.
    """
    file, plain = folder / RESULT, TypeAdapter(kind)
    if file.exists():
        result = plain.validate_python(json.loads(file.read_text(encoding="utf-8")))
        if not same(result):
            raise BadInput(f"{file} is of another flight than the one that is asked for; give another --out")
        return result
    shutil.rmtree(folder, ignore_errors=True)
    result = fly()
    folder.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(plain.dump_python(result, mode="json"), indent=1), encoding="utf-8")
    return result


def alike(one: D, other: D) -> bool:
    """Whether two flights that were asked for are the same: how fast, and with what patience, makes no difference."""
    slow = {"speedup": 1.0, "patience_s": 1.0}
    return replace(one, **slow) == replace(other, **slow)

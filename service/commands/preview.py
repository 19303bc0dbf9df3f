"""`roisearch-service preview`: what a search of an area will be like, before flying."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from service.errors import BadInput, Parser

if TYPE_CHECKING:
    from service.preview.preview import Preview

EXAMPLES = """\
examples:
  roisearch-service preview --area config/area.geojson
  roisearch-service preview --area a.geojson --config service.toml --battery 25 --out preview.html
"""


def parser() -> argparse.ArgumentParser:
    """The flags."""
    p = Parser(
        prog="roisearch-service preview",
        description="What a search will be like: grid, ROIs, first minutes, time to 50, 75 and 95 % POS, battery.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=EXAMPLES,
    )
    p.add_argument("--area", metavar="FILE", type=Path, required=True, help="as for the search")
    p.add_argument("--prior", metavar="TIF", type=Path, help="GeoTIFF of probabilities instead of the priors")
    p.add_argument("--config", metavar="FILE", type=Path, help="settings, see config/service.toml")
    p.add_argument(
        "--ground", metavar="FILE", action="append", help="heights of the ground, as for the search"
    )
    p.add_argument("--cell", metavar="M", type=float, help="cell size in metres (from the sensor)")
    p.add_argument("--planner", metavar="NAME", help="who decides (puct-regions-lite)")
    p.add_argument("--seed", metavar="S", type=int, help="seed of the simulated detector (1)")
    p.add_argument("--battery", metavar="MIN", type=float, help="minutes that a full battery flies")
    p.add_argument("--out", metavar="FILE", type=Path, help="also a picture (.png) or a page (.html)")
    return p


def main(arguments: list[str]) -> int:
    """Print the preview, write it if asked to; returns 0."""
    options = parser().parse_args(arguments)
    if options.out is not None and options.out.suffix not in (".png", ".html"):
        raise BadInput(f"{options.out}: a preview is written as .png or .html")
    if options.battery is not None and not 0.0 < options.battery < 1e6:
        raise BadInput(f"--battery {options.battery:g}: give the minutes that a full battery flies")
    from service.config import read_settings

    flags = {
        "ground.file": options.ground,
        "sensor.cell_m": options.cell,
        "search.planner": options.planner,
        "run.seed": options.seed,
    }
    settings = read_settings(options.config, flags=flags)
    with _progress() as told:
        told("reading the area", 0.0)
        from service.preview.preview import preview
        from service.survey import survey

        area, grid = survey(options.area, options.prior, settings)
        seen = preview(
            area,
            grid,
            settings,
            options.battery,
            told,
            lambda there: survey(options.area, options.prior, there)[1],
        )
    from service.preview.text import text

    print(text(seen))
    if options.out is not None:
        _write(options.out, seen)
    return 0


def _write(path: Path, seen: Preview) -> None:
    from service.preview.page import draw, page

    try:
        path.write_bytes(draw(seen) if path.suffix == ".png" else page(seen))
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror}); give a writable --out") from error
    print(f"written: {path}")


@contextlib.contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """Shows on standard error what is going on: a line that changes in a terminal, a line a step elsewhere."""
    from rich.console import Console

    console = Console(stderr=True)
    if console.is_terminal:
        with console.status("") as status:
            yield lambda name, part: status.update(f"{name}: {part:.0%}")
        return
    said: set[str] = set()

    def told(name: str, part: float) -> None:
        if name not in said:
            said.add(name)
            print(name, file=sys.stderr, flush=True)

    yield told

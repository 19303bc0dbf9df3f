"""`roisearch-service plan`: draw an area on the page, save it, and start its search from there."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from service.errors import BadInput, Parser

if TYPE_CHECKING:
    from service.config import Settings
    from service.http import Door

EXAMPLES = """\
examples:
  roisearch-service plan
  roisearch-service plan --out moor.geojson --connect udpin://127.0.0.1:14540 --flat

What stands in --out already is drawn on. Ctrl-C ends it; what was saved stays.
"""


def parser() -> argparse.ArgumentParser:
    """The flags."""
    p = Parser(
        prog="roisearch-service plan",
        description="Draw search area, likely places, ground not to fly over and launch on the page, and save them.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=EXAMPLES,
    )
    p.add_argument("--out", metavar="FILE", type=Path, default=Path("area.geojson"), help="(area.geojson)")
    p.add_argument("--http", metavar="HOST:PORT", help="where to listen (127.0.0.1:8080)")
    p.add_argument("--config", metavar="FILE", type=Path, help="settings, see config/service.toml")
    search = p.add_argument_group("for the search that is started from the page, as without 'plan'")
    search.add_argument("--connect", metavar="URL")
    search.add_argument("--ground", metavar="FILE", action="append")
    search.add_argument("--flat", action="store_true")
    search.add_argument("--takeoff", action="store_true")
    search.add_argument("--runs", metavar="DIR")
    search.add_argument("--speedup", metavar="X", type=float)
    return p


def main(arguments: Sequence[str]) -> int:
    """Serve the page to draw on, and then the search if one is started; returns the exit code. Raises BadInput."""
    options = parser().parse_args(list(arguments))
    from service.config import read_settings
    from service.http import open_door
    from service.http.address import bound_address

    flags = {
        "http.listen": options.http,
        "link.connect": options.connect,
        "ground.file": options.ground,
        "ground.flat": options.flat or None,
        "flight.takeoff": options.takeoff or None,
        "run.folder": options.runs,
        "link.speedup": options.speedup,
    }
    settings = read_settings(options.config, flags=flags)
    _check_file(options.out, settings)
    with contextlib.closing(open_door(settings.http, os.environ, settings.page)) as door:
        port = door.listener.getsockname()[1]
        address = bound_address(door.listener)
        print(f"draw the area of {options.out} at {door.address}", flush=True)
        started = asyncio.run(_draw(options.out, settings, door))
    if not started:
        return 0
    from service.run import run

    host = f"[{address}]" if address.version == 6 else str(address)
    flags["http.listen"] = f"{host}:{port}"  # the page that is open goes on at the same address
    return run(options.out, None, read_settings(options.config, flags=flags))


def _check_file(file: Path, settings: Settings) -> None:
    """Raises BadInput, before anybody draws, when nothing can be saved there or what is there is no area."""
    from service.survey import read_survey

    folder = file.absolute().parent
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise BadInput(f"{file}: cannot be written there; give --out in a folder that is there and yours")
    if not file.exists():
        return
    _, document = read_survey(file, settings)
    if document.format != "GeoJSON":
        raise BadInput(
            f"{file}: this is {document.format}, and what is saved here is GeoJSON, which would take its place; make a "
            f"file to draw on with roisearch-service area check {file} --out area.geojson"
        )


async def _draw(file: Path, settings: Settings, door: Door) -> bool:
    """Serve until a search is started (True) or a signal comes."""
    from service.http.plan import AreaPlan, create_plan_app

    plan = AreaPlan(file, settings)
    server = door.serving(lambda **known: create_plan_app(plan, **known))
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, setattr, server, "should_exit", True)
    serving = asyncio.create_task(server.run_until_told())
    starting = asyncio.create_task(plan.started.wait())
    await asyncio.wait([serving, starting], return_when=asyncio.FIRST_COMPLETED)
    server.should_exit = True
    starting.cancel()
    await serving
    return plan.started.is_set()

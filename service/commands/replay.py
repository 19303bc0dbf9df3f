"""`roisearch-service replay`: a run that is over, or was interrupted, on the page with a time slider."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import signal
from collections.abc import Sequence
from pathlib import Path

from service.errors import Parser


def parser() -> argparse.ArgumentParser:
    """The flags."""
    p = Parser(
        prog="roisearch-service replay",
        description="Show a run that is over or was interrupted on the page, with a time slider. Nothing is changed.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n  roisearch-service replay runs/20260501-140312-north-slope\n\nCtrl-C ends it.",
    )
    p.add_argument("run", metavar="RUN", type=Path, help="the folder of a run")
    p.add_argument("--http", metavar="HOST:PORT", help="where to listen (127.0.0.1:8080)")
    p.add_argument(
        "--config", metavar="FILE", type=Path, help="settings of the door and the page; not those of the run"
    )
    return p


def main(arguments: Sequence[str]) -> int:
    """Serve the replay until a signal comes; returns the exit code. Raises BadInput."""
    options = parser().parse_args(list(arguments))
    from service.config import read_settings
    from service.http import open_door
    from service.http.past import Replayed
    from service.view.replay import ReplayView

    settings = read_settings(options.config, flags={"http.listen": options.http})
    view = ReplayView(options.run)
    with contextlib.closing(open_door(settings.http, os.environ, settings.page)) as door:

        async def serve() -> None:
            past = Replayed(view)
            server = door.server(past, past)
            loop = asyncio.get_running_loop()
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.add_signal_handler(number, setattr, server, "should_exit", True)
            await server.run_until_told()

        print(f"{view.area.name}: {len(view.rows)} events of {options.run}", flush=True)
        print(f"listening on {door.address}", flush=True)
        asyncio.run(serve())
    return 0

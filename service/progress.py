"""What a person sees while the service runs: a live table in a terminal, plain log lines elsewhere."""

from __future__ import annotations

import asyncio
import logging
import sys
from collections.abc import Callable

from rich.console import Console
from rich.live import Live
from rich.logging import RichHandler
from rich.table import Table

from service.chances import sure
from service.mission.states import FLYING
from service.view.state import RunState

log = logging.getLogger("roisearch")
LINE_EVERY_S = 5.0


def set_up_logging(console: Console) -> None:
    """Log lines above the live table in a terminal, plain lines on standard output elsewhere."""
    handler: logging.Handler
    if console.is_terminal:
        handler = RichHandler(console=console, show_path=False, show_level=False, log_time_format="[%X]")
    else:
        handler = logging.StreamHandler(sys.stdout)
        handler.setFormatter(logging.Formatter("%(asctime)s  %(message)s", "%H:%M:%S"))
    log.handlers = [handler]
    log.setLevel(logging.INFO)
    log.propagate = False


def facts(state: RunState) -> list[tuple[str, str]]:
    """The state in words: name and value."""
    battery = state["battery_percent"]
    left = state["flight_left_s"]
    place, what_next = state["place"], state["next"]["words"].removeprefix("Next: ")
    return [
        ("state", state["state"]),
        ("probability of success so far", sure(state["pos"])),
        ("most likely place", f"{sure(place['probability'])} at {place['written']}"),
        ("steps", str(state["steps"])),
        ("in the air", f"{state['flight_time_s']:.0f} s"),
        ("flight time left", "unknown" if left is None else f"about {left / 60:.0f} min"),
        ("battery", "unknown" if battery is None else f"{battery:.0f} %"),
        ("next", state["reason"] if state["state"] in FLYING else what_next),
        *((f"aircraft {one['name']}", f"{one['state']}  {one['why']}") for one in state["aircraft"][1:]),
    ]


def line(state: RunState) -> str:
    """The state as one log line."""
    if len(state["aircraft"]) > 1:
        return _line_of_several(state)
    battery = state["battery_percent"]
    going = state["reason"] if state["state"] in FLYING else ""
    return (
        f"{state['state']:10} POS {sure(state['pos']):>6}  {state['steps']:4d} steps  "
        f"{state['flight_time_s']:5.0f} s  battery {'?' if battery is None else f'{battery:.0f}'} %  {going}"
    ).rstrip()


def _line_of_several(state: RunState) -> str:
    """The state as one log line that tells of each aircraft."""
    each = (f"{one['name']} {one['state']} {_percent(one['battery'])}" for one in state["aircraft"])
    return f"POS {sure(state['pos']):>6}  {'  '.join(each)}"


def _percent(value: float | None) -> str:
    return "?" if value is None else f"{value:.0f} %"


def _table(state: RunState) -> Table:
    table = Table.grid(padding=(0, 2))
    for name, value in facts(state):
        table.add_row(f"[dim]{name}[/dim]", value)
    return table


async def show(console: Console, state: Callable[[], RunState]) -> None:
    """Show the state until cancelled."""
    if not console.is_terminal:
        while True:
            await asyncio.sleep(LINE_EVERY_S)
            log.info("%s", line(state()))
    with Live(_table(state()), console=console, refresh_per_second=8) as live:
        try:
            while True:
                await asyncio.sleep(0.125)
                live.update(_table(state()))
        finally:
            live.update(_table(state()))  # what stands there at the end is the end

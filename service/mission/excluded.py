"""What comes of it, in flight, that ground is excluded which was not, or is not any more."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence

from service.mission.chart import here
from service.mission.effects import Note, Stop, Tell
from service.mission.phase import Wish, say, warn
from service.mission.situation import on_ground
from service.mission.standing import Look
from service.mission.states import MOVING, State


def other_ground(look: Look, known: Sequence[str], *, crosses: bool) -> Iterator[Wish]:
    """What is to be said and done now that the chart has other ground: a leg that would cross it is stopped.

    Args:
        known: the notes of the ground before.
        crosses: whether the leg that is flown crosses what is excluded now.
    """
    standing, t, chart = look.standing, look.seen.telemetry, look.chart
    for note in chart.grid.layout_notes:
        if note not in known:
            yield from say(note, look)
    if standing.state in (State.HOLDING, State.FOUND) and not on_ground(t) and chart.excluded(here(t)):
        yield from warn("it hovers over ground that is excluded now", look)
    if crosses and standing.state in MOVING and not standing.goes_home_by_itself:
        said = "the leg that was flown crosses ground that is excluded now: stopping first"
        yield Note(said, logging.WARNING)
        yield Stop()
    elif standing.autopilot_returns and not chart.leg_allowed(here(t), chart.home(t)):
        said = "the autopilot's way home may cross ground that is excluded now"
        yield Note(said, logging.WARNING)
        yield Tell(f"search {standing.state}: {said}", 4)

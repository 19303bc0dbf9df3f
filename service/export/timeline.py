"""What happened in a run, row by row and in words; decisions and waypoints are too many for it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from service.chances import sure
from service.config import Settings
from service.entries import Entry, UnknownRow
from service.export.model import TimelineEntry
from service.news.bearing import ROLE_WORDS, FieldNews
from service.places import written
from service.rows import (
    FoundRow,
    KnownRow,
    ModeRow,
    NewsRow,
    OrderRow,
    ReplacedRow,
    SortieRow,
    TransitionRow,
    VerdictRow,
    WithdrawnRow,
)


def timeline(entries: Iterable[Entry], settings: Settings) -> Iterator[TimelineEntry]:
    """What belongs into the timeline, in its order; what is of one of several aircraft begins with its name."""
    told: dict[str, FieldNews] = {}
    for entry in entries:
        whose = f"aircraft {entry.aircraft}: " if entry.aircraft else ""
        match entry.said:
            case NewsRow(news=news):
                told[news.id] = news
                yield TimelineEntry(entry.time, "news", f"told: {_called(news)}")
            case WithdrawnRow(id=name):
                taken = f": {_called(told[name])}" if name in told else f" {name}"
                yield TimelineEntry(entry.time, "news", f"taken back{taken}")
            case FoundRow(found=found):
                place = written((found.lat, found.lon), settings.run.coordinates)
                yield TimelineEntry(entry.time, "found", f"found at {place}, {sure(found.probability)} sure")
            case VerdictRow(confirmed=confirmed):
                said = f"operator: {'it is' if confirmed else 'it is not'} here"
                yield TimelineEntry(entry.time, "verdict", said)
            case _:
                for kind, said in _of_an_aircraft(entry.said):
                    yield TimelineEntry(entry.time, kind, f"{whose}{said}")


def _called(news: FieldNews) -> str:
    """A piece of news as people know it."""
    return f"{ROLE_WORDS[news.role]}, {news.words or news.prior or news.id}"


def _of_an_aircraft(said: KnownRow | UnknownRow) -> Iterator[tuple[str, str]]:
    """What has happened to an aircraft: what kind of thing, and in words."""
    match said:
        case TransitionRow(before=before, after=after, reason=reason):
            yield "state", f"{before} → {after}: {reason}"
        case OrderRow(command=command):
            yield "order", f"operator: {command}"
        case ModeRow(mode=mode, commanded=False):
            yield "mode", f"the autopilot changed to {mode}"
        case SortieRow(number=number, seconds=seconds, steps=steps, why=why):
            yield "sortie", f"flight {number} is over after {seconds / 60.0:.1f} min and {steps} cells: {why}"
        case ReplacedRow(system_id=system_id, was_system_id=was, was_autopilot=autopilot):
            by = "the next that is heard" if system_id is None else f"system {system_id}"
            yield "replaced", f"system {was} ({autopilot}) is let go for {by}"

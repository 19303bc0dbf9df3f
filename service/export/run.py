"""A run as plain values, read from its folder: from the journal, which another process may be writing.

The journal alone is enough, so a run that is under way or that was killed is read like one that has ended. Its rows
are read in one go, as they are at that moment, and the belief is replayed from them exactly as a resumed search does.
`track.geojson`, which a run leaves at its end, is not needed: every report was journalled with the aircraft's pose.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from service.config import Settings, each_aircraft
from service.entries import Entry, understanding
from service.evidence.found import Found
from service.export.model import ExportedFind, ExportedRun, Fix, PlacedDetection, TimelineEntry
from service.export.timeline import timeline
from service.mission.states import Event
from service.news.bearing import as_exclusion
from service.resume import retrace, stored_run
from service.rows import CommandRow, FoundRow, ReportRow, TransitionRow
from service.search import Search
from service.story import StoriesSoFar
from service.survey import JOURNAL
from service.view.curve import PosCurve

BREAK_S = 60.0
"""A track is broken where nothing was heard of the aircraft for so long."""


def read_run(folder: Path) -> ExportedRun:
    """Read a run from its folder, whether it is under way or over. Raises BadInput."""
    settings, area, grid, entries = stored_run(folder)
    search, curve, stories = Search(grid, settings), PosCurve(), StoriesSoFar(each_aircraft(settings))
    finds: list[ExportedFind] = []
    for entry in entries:
        with understanding(folder / JOURNAL, entry.seq, entry.said.kind):
            retrace(entry, search)
            stories.take(entry, grid.frame)
        if isinstance(entry.said, ReportRow) and entry.said.observation is not None:
            curve.add(entry.time, search.record.pos)
        elif isinstance(entry.said, FoundRow):
            finds.append(_find(entry.time, entry.said.found))
    reports = [entry for entry in entries if isinstance(entry.said, ReportRow)]
    return ExportedRun(
        name=folder.resolve().name,
        area=replace(area, exclusions=(*area.exclusions, *map(as_exclusion, search.known.excluded))),
        grid=search.grid,
        settings=settings,
        belief=search.belief,
        pod=search.record.pod(),
        labels=search.regions.labels,
        pos=search.record.pos,
        looks=search.record.looks,
        reports=len(reports),
        curve=tuple(curve.points),
        track=_track(
            reports,
            {name: [each.landed for each in flight.sorties] for name, flight in stories.flights.items()},
        ),
        hits=tuple(stories.hits),
        detections=tuple(each for entry in reports for each in _detections(entry)),
        find=replace(finds[-1], confirmed=search.confirmed is not None)
        if finds and stories.found is not None
        else None,
        timeline=tuple(timeline(entries, settings)) or (_first(entries[0]),),
        autopilot=_autopilot(entries),
        launch_amsl_m=_launch_amsl_m(entries, settings) if grid.relief is None else grid.relief.launch_amsl_m,
        state=stories.leading.state.value,
    )


def _fix(entry: Entry) -> Iterable[Fix]:
    """The pose of a report, at the time of its frame."""
    assert isinstance(entry.said, ReportRow)
    pose = entry.said.pose
    if all(math.isfinite(value) for value in (pose.lat, pose.lon, pose.height_m)):
        yield Fix(pose.time, pose.lat, pose.lon, pose.height_m, pose.heading_deg, entry.aircraft)


def _track(reports: Sequence[Entry], landed: Mapping[str, Sequence[float]]) -> tuple[tuple[Fix, ...], ...]:
    """The pieces of all aircraft, one aircraft after the other; `landed` are the landings of each by its name."""
    fixes = [fix for entry in reports for fix in _fix(entry)]
    first = next(iter(landed))  # what was written while it flew alone has no name
    own: dict[str, list[Fix]] = {}
    for fix in fixes:
        own.setdefault(fix.aircraft, []).append(fix)
    return tuple(
        piece
        for name, flown in own.items()
        for piece in _pieces(flown, sorted(landed.get(name, landed[first])))
    )


def _pieces(fixes: Iterable[Fix], landed: Sequence[float]) -> tuple[tuple[Fix, ...], ...]:
    """The track, broken at landings, and where time stands still for long or goes back, as when a run is resumed.

    Reports may come in another order than their frames were taken: a fix that is a little late is left out.
    """
    pieces: list[list[Fix]] = []
    for fix in fixes:
        since = fix.time - pieces[-1][-1].time if pieces else math.inf
        another = pieces and bisect_left(landed, fix.time) != bisect_left(landed, pieces[-1][-1].time)
        if abs(since) > BREAK_S or another:
            pieces.append([fix])
        elif since > 0.0:
            pieces[-1].append(fix)
    return tuple(tuple(piece) for piece in pieces if len(piece) > 1)


def _detections(entry: Entry) -> Iterable[PlacedDetection]:
    """What a report has seen; one that is told in pixels stands where the service placed it, if it did."""
    assert isinstance(entry.said, ReportRow)
    report, observed = entry.said.report, entry.said.observation
    seen, whole = report.get("detections", ()), 100.0 if report.get("score_unit") == "percent" else 1.0
    placed = observed.sightings if observed is not None else ()
    for number, each in enumerate(seen):
        lat, lon = each.get("lat"), each.get("lon")
        if lat is None or lon is None:
            if len(placed) != len(seen):
                continue
            lat, lon = placed[number].lat, placed[number].lon
        yield PlacedDetection(
            time=entry.said.captured,
            lat=float(lat),
            lon=float(lon),
            kind=_plain(str(each.get("class", "target"))),
            score=float(each.get("score", whole)) / whole,
            source=_plain(report.get("source", "detector")),
            counted=observed is not None and bool(observed.hits.any()),
        )


def _plain(text: object) -> str:
    """Text of a detector that every format can hold: no control characters, no halves of characters."""
    whole = str(text).encode("utf-8", "replace").decode("utf-8")
    return "".join(c if c.isprintable() else "?" for c in whole)


def _find(time: float, found: Found) -> ExportedFind:
    around = found.ellipse
    ellipse = (around["semi_major_m"], around["semi_minor_m"], around["bearing_deg"])
    return ExportedFind(time, found.lat, found.lon, found.probability, found.sigma_m, ellipse)


def _first(entry: Entry) -> TimelineEntry:
    return TimelineEntry(entry.time, "start", "the journal begins")


def _autopilot(entries: Sequence[Entry]) -> str:
    """From the reason of the first transition, such as "px4 is ready"."""
    for entry in entries:
        if isinstance(entry.said, TransitionRow) and entry.said.event == Event.LINKED:
            return entry.said.reason.partition(" ")[0]
    return ""


def _launch_amsl_m(entries: Sequence[Entry], settings: Settings) -> float | None:
    """Every waypoint is flown `flight.altitude_m` of its aircraft above the launch point, and says its height above the
    sea."""
    each = each_aircraft(settings)
    for entry in entries:
        if isinstance(entry.said, CommandRow) and entry.said.alt_amsl_m is not None:
            own = each.get(entry.aircraft, settings)
            return entry.said.alt_amsl_m - own.flight.altitude_m
    return None

"""What a run leaves behind in its folder: report.json, track.geojson and the picture of the final map."""

from __future__ import annotations

import bisect
import json
import logging
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from service.chances import sure
from service.config import Settings
from service.entries import read_last_entries
from service.evidence.found import Found
from service.geometry import LatLon
from service.mission.mission import Mission
from service.mission.states import State
from service.places import written
from service.rows import FoundRow, TrackPoint
from service.search import Search
from service.squad import Squad
from service.view.base import sortie_states

log = logging.getLogger("roisearch")
REPORT = "report.json"


def latency_summary(latencies_s: Sequence[float]) -> dict[str, float | int | None]:
    """Median and 99th percentile in milliseconds of the times from a hit's report to its waypoint on the wire."""
    if not latencies_s:
        return {"samples": 0, "median_ms": None, "p99_ms": None}
    median, p99 = np.percentile(latencies_s, [50, 99]) * 1e3
    return {"samples": len(latencies_s), "median_ms": round(float(median), 2), "p99_ms": round(float(p99), 2)}


def write_json(path: Path, value: dict[str, Any]) -> None:
    """A readable JSON file, written whole or not at all."""
    part = path.with_suffix(path.suffix + ".part")
    part.write_text(json.dumps(value, indent=2) + "\n", encoding="utf-8")
    part.replace(path)


def by_sortie(track: Sequence[TrackPoint], landed: Sequence[float]) -> list[list[TrackPoint]]:
    """The track cut at the times of landings: a part for each of them, and what came after the last."""
    parts: list[list[TrackPoint]] = [[] for _ in range(len(landed) + 1)]
    for point in track:
        parts[bisect.bisect_left(landed, point[0])].append(point)
    return parts


def track_features(
    track: Sequence[TrackPoint], landed: Sequence[float], aircraft: str = ""
) -> list[dict[str, Any]]:
    """The track of an aircraft (time, lat, lon, height above launch) as lines of RFC 7946, one for each sortie; with
    the name of the aircraft, where there are several."""
    features = []
    for number, part in enumerate(by_sortie(track, landed), 1):
        if len(part) > 1:
            line = {"type": "LineString", "coordinates": [[lon, lat, height] for _, lat, lon, height in part]}
            times = {"role": "track", "sortie": number, "times": [round(time, 2) for time, *_ in part]}
            whose = {"aircraft": aircraft} if aircraft else {}
            features.append({"type": "Feature", "geometry": line, "properties": {**times, **whose}})
    return features


def track_geojson(
    tracks: Sequence[dict[str, Any]],
    hits: Sequence[tuple[float, float]],
    report: dict[str, Any],
) -> dict[str, Any]:
    """The flights as RFC 7946: tracks as `track_features` makes them, hits and result as points."""
    features = list(tracks)
    for lat, lon in hits:
        point = {"type": "Point", "coordinates": [lon, lat]}
        features.append({"type": "Feature", "geometry": point, "properties": {"role": "hit"}})
    if report["position"]:
        place = {"type": "Point", "coordinates": [report["position"]["lon"], report["position"]["lat"]]}
        role = "found" if report["outcome"] == "found" else "probable"
        said = {"role": role, "probability": report["probability"]}
        features.append({"type": "Feature", "geometry": place, "properties": said})
    return {"type": "FeatureCollection", "features": features}


def outcome_of(state: State, *, searched: bool, found: Found | None, probable: Found | None) -> str:
    """What is known at the end, in a word.

    "found"; "probable" when it was searched to its end and there is a place where the target is rather than not;
    "not_found" when there is none; "aborted" when it was broken off, whatever is probable then.
    """
    if found is not None:
        return "found"
    if state != State.DONE or not searched:
        return "aborted"
    return "not_found" if probable is None else "probable"


def place_known(outcome: str, search: Search, found: Found | None) -> dict[str, Any]:
    """The part of report.json about where the target is.

    `position` is the place found, or the probable one; without either it is null, and `best_place` still tells where
    it is most likely, with the probability, sigma and ellipse that stand beside them.
    """
    best = found or search.best()
    place = {"lat": best.lat, "lon": best.lon}
    return {
        "position": place if outcome == "found" or search.probable() is not None else None,
        "best_place": place,
        "probability": best.probability,
        "sigma_m": best.sigma_m,
        "ellipse": best.ellipse,
        "thumbnail": best.thumbnail,
    }


def run_report(squad: Squad, area: str, settings: Settings, began: float) -> dict[str, Any]:
    """The content of report.json; `began` is the wall time (seconds since the epoch) at which the run began.

    Of several aircraft, counts are sums, the flight time is that of the one that flew longest, and `aircraft` tells
    them apart.
    """
    search, found, missions = squad.leading.search, squad.found, list(squad.missions.values())
    ended = _ended(missions)
    outcome = outcome_of(
        ended.state, searched=ended.standing.searched, found=found, probable=search.probable()
    )
    place = place_known(outcome, search, found)
    flights = [each.flight for each in missions]
    sorties = [
        each
        for name, mission in squad.missions.items()
        for each in sortie_states(mission.flight.sorties, name)
    ]
    report: dict[str, Any] = {
        "outcome": outcome,
        **place,
        "confirmed": found is not None and search.confirmed is not None,
        "outside": search.belief.outside,
        "steps": sum(each.steps for each in flights),
        "flight_time_s": round(max(each.flight_time() for each in missions), 1),
        "sorties": sorted(sorties, key=lambda each: each["landed"]),
        "pos": search.record.pos,
        "area": area,
        "coordinates": settings.run.coordinates,
        "best_place_written": written(
            (place["best_place"]["lat"], place["best_place"]["lon"]), settings.run.coordinates
        ),
        "planner": settings.search.planner,
        "seed": settings.run.seed,
        "stopped_because": ended.standing.why_stopped or ("found" if found else ""),
        "cell_m": search.grid.frame.cell_m,
        "cells": int(search.grid.searchable.sum()),
        "looks": search.record.looks,
        "hits": sum(len(each.hits) for each in flights),
        "decisions": sum(each.decisions for each in flights),
        "waypoints": sum(each.waypoints for each in flights),
        "hit_to_waypoint": latency_summary([each for flight in flights for each in flight.latencies_s]),
        "wall_time_s": round(time.time() - began, 1),
        "aircraft": [aircraft_report(name, each) for name, each in squad.missions.items()],
    }
    return report


def _ended(missions: Sequence[Mission]) -> Mission:
    """The mission whose end is that of the run: the first that has searched to the end, else the first that flew, else
    the first."""
    done = [each for each in missions if each.state == State.DONE and each.standing.searched]
    flew = [each for each in missions if each.flight.began is not None]
    return next(iter([*done, *flew, *missions]))


def aircraft_report(name: str, mission: Mission) -> dict[str, Any]:
    """What report.json tells of one aircraft; its track is in track.geojson, by its name where there are several."""
    flight, standing = mission.flight, mission.standing
    probable = mission.search.probable()
    return {
        "name": name,
        "outcome": outcome_of(
            mission.state, searched=standing.searched, found=standing.found, probable=probable
        ),
        "state": mission.state,
        "stopped_because": standing.why_stopped or ("found" if standing.found else ""),
        "flight_time_s": round(mission.flight_time(), 1),
        "steps": flight.steps,
        "hits": len(flight.hits),
        "decisions": flight.decisions,
        "waypoints": flight.waypoints,
        "sorties": sortie_states(flight.sorties, name),
    }


def found_after_s(mission: Mission) -> float:
    """How long after the first look the last place was found, or the last word came if none was, where that counts:
    0 if the target stands still."""
    known = mission.search.known
    if known.time is None or known.since is None:
        return 0.0
    last = next(iter(read_last_entries(mission.journal.path, FoundRow, 1)), None)
    return (known.time if last is None else last.time) - known.since


def simulated(target: LatLon | None, squad: Squad, settings: Settings) -> dict[str, Any]:
    """What only a simulation can tell: where the target really was (None: nowhere), and how far off the report is."""
    error, found = None, squad.found
    frame = squad.leading.search.grid.frame
    if found and target is not None:
        metres = frame.to_metres(np.array([target, (found.lat, found.lon)]))
        error = float(np.hypot(*(metres[1] - metres[0])))
    return {
        "flavor": settings.demo.flavor,
        "speedup": settings.speedup,
        "target": None if target is None else {"lat": target[0], "lon": target[1]},
        "error_m": error,
        "error_cells": None if error is None else error / frame.cell_m,
    }


def in_words(report: dict[str, Any]) -> str:
    """How the run of a report.json has ended."""
    place, why = report["best_place"], report["stopped_because"]
    at = written((place["lat"], place["lon"]), report.get("coordinates", "degrees"))
    where = f"{at}, {sure(report['probability'])} sure"
    if report["ellipse"]:
        where += f", 95 % within {report['ellipse']['semi_major_m']:.0f} m"
    match report["outcome"]:
        case "found":
            if report.get("confirmed"):
                return (
                    f"FOUND at {at}, confirmed by an operator; the map gives it {sure(report['probability'])}"
                )
            return f"FOUND at {where}"
        case "probable":
            return f"NOT FOUND, but PROBABLE at {where}: {why}"
        case "not_found":
            best, outside = 100 * report["probability"], 100 * report["outside"]
            return f"NOT FOUND: {why}; best place {best:.1f} %, outside the area {outside:.1f} %"
    return f"ABORTED: {why}" + (f"; PROBABLE at {where}" if report["position"] else "")


def write_results(folder: Path, squad: Squad, report: dict[str, Any], picture: bytes) -> None:
    """Write the run's folder and say how it ended."""
    write_json(folder / REPORT, report)
    tracks = [
        feature
        for name, each in squad.missions.items()
        for feature in track_features(
            each.flight.track,
            [sortie.landed for sortie in each.flight.sorties],
            name if squad.several else "",
        )
    ]
    track = track_geojson(
        tracks, [hit for each in squad.missions.values() for hit in each.flight.hits], report
    )
    (folder / "track.geojson").write_text(json.dumps(track), encoding="utf-8")
    (folder / "map.png").write_bytes(picture)
    log.info("%s", in_words(report))
    simulated = report.get("simulated")
    if simulated and simulated["error_m"] is not None:
        error, cells = simulated["error_m"], simulated["error_cells"]
        log.info("the simulated target was %.1f m away (%.2f cells)", error, cells)
    log.info("report, track and map are in %s", folder)

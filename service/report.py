"""What a run leaves behind in its folder: report.json, track.geojson and the picture of the final map."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from service.config import Settings
from service.mission.flight import LatLon
from service.mission.mission import Mission
from service.mission.states import State

log = logging.getLogger("roisearch")


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


def track_geojson(
    track: Sequence[tuple[float, float, float, float]],
    hits: Sequence[tuple[float, float]],
    report: dict[str, Any],
) -> dict[str, Any]:
    """The flight as RFC 7946: the track (time, lat, lon, height above launch) as a line, hits and result as points."""
    features = []
    if len(track) > 1:
        line = {"type": "LineString", "coordinates": [[lon, lat, height] for _, lat, lon, height in track]}
        times = {"role": "track", "times": [round(time, 2) for time, *_ in track]}
        features.append({"type": "Feature", "geometry": line, "properties": times})
    for lat, lon in hits:
        point = {"type": "Point", "coordinates": [lon, lat]}
        features.append({"type": "Feature", "geometry": point, "properties": {"role": "hit"}})
    if report["position"]:
        place = {"type": "Point", "coordinates": [report["position"]["lon"], report["position"]["lat"]]}
        said = {"role": "found", "probability": report["probability"]}
        features.append({"type": "Feature", "geometry": place, "properties": said})
    return {"type": "FeatureCollection", "features": features}


def run_report(mission: Mission, area: str, settings: Settings, began: float) -> dict[str, Any]:
    """The content of report.json; `began` is the wall time (seconds since the epoch) at which the run began."""
    search, found, flight = mission.search, mission.found, mission.flight
    outcome = "found" if found else "not_found" if mission.state == State.DONE else "aborted"
    if mission.state == State.DONE and not found and not mission.searched:
        outcome = "aborted"
    place = search.place
    flown = mission.flight_time()
    report: dict[str, Any] = {
        "outcome": outcome,
        "position": {"lat": found.lat, "lon": found.lon} if found else None,
        "probability": found.probability if found else place.probability,
        "sigma_m": found.sigma_m if found else None,
        "ellipse": found.ellipse if found else None,
        "thumbnail": found.thumbnail if found else None,
        "outside": search.belief.outside,
        "steps": flight.steps,
        "flight_time_s": round(flown, 1),
        "pos": search.record.pos,
        "area": area,
        "planner": settings.search.planner,
        "seed": settings.run.seed,
        "stopped_because": mission.why_stopped or ("found" if found else ""),
        "cell_m": search.grid.frame.cell_m,
        "cells": int(search.grid.searchable.sum()),
        "looks": search.record.looks,
        "hits": len(flight.hits),
        "decisions": flight.decisions,
        "waypoints": flight.waypoints,
        "hit_to_waypoint": latency_summary(flight.latencies_s),
        "wall_time_s": round(time.time() - began, 1),
    }
    return report


def simulated(target: LatLon, mission: Mission, settings: Settings) -> dict[str, Any]:
    """What only a simulation can tell: where the target really was, and how far off the report is."""
    error = None
    frame = mission.frame
    if mission.found:
        metres = frame.to_metres(np.array([target, (mission.found.lat, mission.found.lon)]))
        error = float(np.hypot(*(metres[1] - metres[0])))
    return {
        "flavor": settings.demo.flavor,
        "speedup": settings.speedup,
        "target": {"lat": target[0], "lon": target[1]},
        "error_m": error,
        "error_cells": None if error is None else error / frame.cell_m,
    }


def write_results(folder: Path, mission: Mission, report: dict[str, Any], picture: bytes) -> None:
    """Write the run's folder and say how it ended."""
    write_json(folder / "report.json", report)
    track = track_geojson(mission.flight.track, mission.flight.hits, report)
    (folder / "track.geojson").write_text(json.dumps(track), encoding="utf-8")
    (folder / "map.png").write_bytes(picture)
    if report["outcome"] == "found":
        position = report["position"]
        log.info(
            "FOUND at %.6f, %.6f with probability %.4f",
            position["lat"],
            position["lon"],
            report["probability"],
        )
    elif report["outcome"] == "not_found":
        log.info(
            "NOT FOUND: %s; best place %.1f %%, outside the area %.1f %%",
            report["stopped_because"],
            100 * report["probability"],
            100 * report["outside"],
        )
    else:
        log.info("ABORTED: %s", report["stopped_because"])
    simulated = report.get("simulated")
    if simulated and simulated["error_m"] is not None:
        error, cells = simulated["error_m"], simulated["error_cells"]
        log.info("the simulated target was %.1f m away (%.2f cells)", error, cells)
    log.info("report, track and map are in %s", folder)

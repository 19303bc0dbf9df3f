"""What a run leaves behind in its folder: report.json, track.geojson and the picture of the final map."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np


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

"""Helpers of the integration tests: the real service as a process, on real sockets."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sim.soak.process import Process

REPOSITORY = Path(__file__).parents[2]

# A field of 200 x 150 m at 47° north with a last known position: small enough that a search takes half a minute.
FIELD: dict[str, Any] = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"name": "field"},
            "geometry": {
                "type": "Polygon",
                "coordinates": [
                    [[8.3, 47.05], [8.3026, 47.05], [8.3026, 47.05135], [8.3, 47.05135], [8.3, 47.05]]
                ],
            },
        },
        {
            "type": "Feature",
            "properties": {"role": "prior", "sigma_m": 30, "weight": 1},
            "geometry": {"type": "Point", "coordinates": [8.3017, 47.0508]},
        },
        {
            "type": "Feature",
            "properties": {"role": "launch"},
            "geometry": {"type": "Point", "coordinates": [8.3001, 47.0501]},
        },
    ],
}


def write_area(folder: Path, area: dict[str, Any] = FIELD) -> Path:
    """The area as a file."""
    path = folder / "area.geojson"
    path.write_text(json.dumps(area), encoding="utf-8")
    return path


@contextmanager
def running(*words: str) -> Iterator[Process]:
    """A process that is gone at the end of the block, whatever happens."""
    process = Process(words)
    try:
        yield process
    finally:
        process.stop()


def service_words(area: Path, runs: Path, *more: str) -> list[str]:
    """The service on a free port, fast."""
    words = ["service", "--area", str(area), "--runs", str(runs), "--http", "127.0.0.1:0"]
    return [*words, *(() if "--speedup" in more else ("--speedup", "40")), *more]


def only_report(runs: Path) -> dict[str, Any]:
    """The report.json of the one run in the folder."""
    (path,) = runs.glob("*/report.json")
    report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return report

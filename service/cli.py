"""The command line of `roisearch-service`. Heavy imports wait until a run really starts."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

EPILOG = """\
examples:
  roisearch-service --area config/area.geojson                      the built-in mock autopilot and detector
  roisearch-service --area a.geojson --connect udpin://0.0.0.0:14540   beside PX4
  roisearch-service --area a.geojson --connect tcpout://127.0.0.1:5760 --takeoff   ArduPilot SITL

exit codes: 0 found, 3 searched and not found, 4 aborted, 2 bad input
"""


def parser() -> argparse.ArgumentParser:
    """The flags."""
    p = argparse.ArgumentParser(
        prog="roisearch-service",
        description="Search an area with a drone: fly where the target most likely is, until it is found.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=EPILOG,
    )
    p.add_argument(
        "--area", metavar="FILE", type=Path, help="GeoJSON with the area, priors, exclusions, launch"
    )
    p.add_argument("--prior", metavar="TIF", type=Path, help="GeoTIFF of probabilities instead of the priors")
    p.add_argument("--connect", metavar="URL", help="the autopilot (default: the built-in mock)")
    p.add_argument("--config", metavar="FILE", type=Path, help="settings, see config/service.toml")
    p.add_argument("--runs", metavar="DIR", help="where runs are kept (default: runs)")
    p.add_argument("--http", metavar="HOST:PORT", help="where to listen (default: 127.0.0.1:8080)")
    p.add_argument("--takeoff", action="store_true", help="arm and take off by itself, also on a real link")
    p.add_argument("--planner", metavar="NAME", help="default: puct-regions-lite")
    p.add_argument("--cell", metavar="M", type=float, help="cell size in metres (default: from the sensor)")
    p.add_argument(
        "--flavor", choices=("px4", "ardupilot"), help="which autopilot the mock is (default: px4)"
    )
    p.add_argument(
        "--speedup",
        metavar="X",
        type=float,
        help="how much faster than real time the mock or simulator flies",
    )
    p.add_argument("--resume", metavar="RUN", type=Path, help="go on with the search of a run's folder")
    p.add_argument("--schema", action="store_true", help="print the JSON Schema of a detector report")
    p.add_argument("--seed", metavar="S", type=int, help="seed of everything random (default: 1)")
    return p


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the service; returns the exit code."""
    options = parser().parse_args(arguments)
    if options.schema:
        from service.reports import schema_text

        print(schema_text(), end="")
        return 0
    if (options.area is None) == (options.resume is None):
        print(
            "roisearch-service: give --area FILE, such as config/area.geojson, or --resume RUN",
            file=sys.stderr,
        )
        return 2
    from service.errors import BadInput

    flags = {
        "link.connect": options.connect,
        "flight.takeoff": options.takeoff or None,
        "http.listen": options.http,
        "run.folder": options.runs,
        "run.seed": options.seed,
        "search.planner": options.planner,
        "sensor.cell_m": options.cell,
        "demo.flavor": options.flavor,
        "link.speedup": options.speedup,
    }
    try:
        from service.config import read_settings
        from service.run import resume, run

        if options.resume is not None:
            return resume(options.resume, flags)
        return run(options.area, options.prior, read_settings(options.config, flags=flags))
    except BadInput as error:
        print(f"roisearch-service: {error}", file=sys.stderr)
        return 2

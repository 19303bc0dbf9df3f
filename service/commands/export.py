"""`roisearch-service export`: a run as files that search teams use, while it is under way or after it."""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path

from service.errors import BadInput, Parser

EXAMPLES = """\
examples:
  roisearch-service export runs/20260501-140312-north-slope --format html
  roisearch-service export runs/20260501-140312-north-slope --format plan --out rest.plan

formats:
"""


def parser() -> argparse.ArgumentParser:
    """The words and flags."""
    from service.export.formats import FORMATS

    formats = "\n".join(f"  {name:8} {format_.about}" for name, format_ in FORMATS.items())
    p = Parser(
        prog="roisearch-service export",
        description="A run as a file, whether it is under way (it is not disturbed) or over.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=EXAMPLES + formats,
    )
    p.add_argument("run", metavar="RUN", type=Path, help="the run's folder")
    p.add_argument("--format", choices=FORMATS, default="html", help="default: html", metavar="F")
    p.add_argument("--out", metavar="FILE", help="default: the run's name, here; - for standard output")
    p.add_argument(
        "--pod-below", metavar="P", type=float, default=0.5, help="a gap has less POD (default: 0.5)"
    )
    p.add_argument(
        "--poa-above",
        metavar="X",
        type=float,
        default=0.5,
        help="and holds X times the probability of an average cell or more (default: 0.5)",
    )
    p.add_argument("--minutes", metavar="M", type=float, help="longest mission of a plan (default: as set)")
    return p


def main(arguments: list[str]) -> int:
    """Write the file and say where it is; returns 0."""
    options = parser().parse_args(arguments)
    from service.export.formats import FORMATS
    from service.export.run import read_run
    from service.export.wishes import Wishes

    wishes = Wishes(options.pod_below, options.poa_above, options.minutes)
    chosen = FORMATS[options.format]
    logging.basicConfig(format="%(message)s", level=logging.INFO, stream=sys.stderr)
    run = read_run(options.run)
    data = chosen.write(run, wishes)
    if options.out == "-":
        sys.stdout.buffer.write(data)
        return 0
    path = Path(options.out or f"{run.name}{chosen.suffix}")
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(data)
        part.replace(path)
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror}); give a writable --out") from error
    print(f"{path}: {run.area.name}, {run.summary}")
    return 0

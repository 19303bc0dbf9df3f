"""`roisearch-service pack`: a run as one file, to go on with it on another computer."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from service.errors import Parser


def parser() -> argparse.ArgumentParser:
    """The flags."""
    p = Parser(
        prog="roisearch-service pack",
        description="Put a run, under way or over, into one file: journal, area, prior and settings without secrets.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n"
        "  roisearch-service pack runs/20260501-140312-north-slope\n"
        "  roisearch-service --resume 20260501-140312-north-slope.zip     on the other computer",
    )
    p.add_argument("run", metavar="RUN", type=Path, help="the folder of a run")
    p.add_argument("--out", metavar="FILE", type=Path, help="the file to write (RUN.zip, here)")
    return p


def main(arguments: Sequence[str]) -> int:
    """Write the file; returns the exit code. Raises BadInput."""
    options = parser().parse_args(list(arguments))
    from service.config import variable_name
    from service.packing import pack
    from service.resume import stored_settings
    from service.survey import JOURNAL
    from service.unpacking import not_taken_over

    out = options.out or Path(f"{options.run.resolve().name}.zip")
    rows = pack(options.run, out)
    print(f"{out}: {rows} rows, the area and the settings without secrets")
    if keys := not_taken_over(stored_settings(options.run / JOURNAL, {})):
        print(
            f"to be given again there: {', '.join(keys)}, by variables such as {variable_name(keys[0])}=..."
        )
    return 0

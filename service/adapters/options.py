"""The flags that all adapters have."""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path

from service.adapters.door import Door
from service.errors import BadInput, Parser


def parser(kind: str, words: str | None) -> argparse.ArgumentParser:
    """A parser with the flags of the door; `words` describe the kind."""
    made = Parser(
        prog=f"roisearch-service detector {kind}",
        description=words,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument(
        "--service",
        metavar="URL",
        default="http://127.0.0.1:8080",
        help="where the service listens (%(default)s)",
    )
    made.add_argument(
        "--token-file", metavar="FILE", help="file with its report token (default: $ROISEARCH_TOKEN)"
    )
    made.add_argument("--source", metavar="NAME", default=kind, help="how the camera is called (%(default)s)")
    made.add_argument(
        "--patience",
        metavar="S",
        type=seconds,
        default=30.0,
        help="give up on a silent service (%(default)s)",
    )
    return made


def share(text: str) -> float:
    """A number from 0 to 1, for argparse."""
    value = float(text)
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not between 0 and 1")
    return value


def seconds(text: str) -> float:
    """Seconds, none of them negative, for argparse."""
    value = float(text)
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is no time; give seconds, 0 or more")
    return value


def hertz(text: str) -> float:
    """How often a second, for argparse."""
    value = float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is not how often a second; give more than 0")
    return value


def size(text: str) -> tuple[int, int]:
    """WIDTHxHEIGHT in pixels, for argparse."""
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"'{text}' is not WIDTHxHEIGHT, such as 1280x720")
    return int(width), int(height)


def door(options: argparse.Namespace, threshold: float | None = None) -> Door:
    """The door that the flags name. Raises BadInput when the token cannot be read or the address is none."""
    if not options.service.startswith(("http://", "https://")):
        raise BadInput(f"--service '{options.service}' is no address; give http://HOST:PORT")
    return Door(
        options.service,
        source=options.source,
        token=_token(options.token_file),
        threshold=threshold,
        patience_s=options.patience,
    )


def _token(file: str | None) -> str:
    """The bearer token: never an argument, which every user of the machine could read."""
    if file is None:
        return os.environ.get("ROISEARCH_TOKEN", "").strip()
    try:
        return Path(file).read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{file}: the token cannot be read ({error}); give a readable file") from error

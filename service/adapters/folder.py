"""An ONNX detector over the pictures that a camera writes into a folder, as MAVLink cameras do (CAMERA_IMAGE_CAPTURED).

A picture is looked at once, when it is whole. When it was taken, its EXIF says: GPSDateStamp and GPSTimeStamp (UTC),
else DateTimeOriginal with OffsetTimeOriginal; without them it is when the file was written (--latency before).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from service.adapters import options as flags
from service.adapters.frames import Frame
from service.adapters.model import Model
from service.adapters.onnx import add_model, read_model
from service.adapters.serve import report_all
from service.errors import BadInput

SUFFIXES = {".jpg", ".jpeg", ".png", ".tif", ".tiff"}
LOOK_S = 0.2
"""Between two looks into the folder."""
WHOLE_S = 0.4
"""A file that has not changed for so long is whole."""
# tags of Exif 3.0: 4.6.5 and 4.6.7
_EXIF, _GPS = 0x8769, 0x8825
_ORIGINAL, _OFFSET, _SUBSECOND = 0x9003, 0x9011, 0x9291
_GPS_TIME, _GPS_DATE = 7, 29


def main(arguments: list[str]) -> int:
    """Watch the folder until stopped; returns the exit code."""
    parser = flags.parser("folder", __doc__)
    add_model(parser)
    parser.add_argument("--folder", metavar="DIR", type=Path, required=True, help="where pictures appear")
    parser.add_argument(
        "--latency", metavar="S", type=flags.seconds, default=0.0, help="from lens to file (%(default)s)"
    )
    parser.add_argument(
        "--idle", metavar="S", type=float, help="end when nothing has come for so long (never)"
    )
    parser.add_argument("--all", action="store_true", help="also those that are there already")
    options = parser.parse_args(arguments)
    model = read_model(options)
    if not options.folder.is_dir():
        raise BadInput(f"{options.folder}: there is no such folder")
    seen = set() if options.all else set(_pictures(options.folder))
    files = arriving(options.folder, seen, options.idle)
    frames = (_frame(file, model, options.latency) for file in files)
    return report_all(flags.door(options, options.threshold), frames)


def _pictures(folder: Path) -> list[Path]:
    return sorted(each for each in folder.rglob("*") if each.suffix.lower() in SUFFIXES and each.is_file())


def arriving(
    folder: Path, seen: set[Path], idle_s: float | None = None, sleep: Callable[[float], None] = time.sleep
) -> Iterator[Path]:
    """Each picture that is not in `seen` once, when it is whole, until nothing new has come for `idle_s`."""
    waiting: dict[Path, tuple[int, float]] = {}
    last = time.monotonic()
    while idle_s is None or time.monotonic() - last < idle_s:
        for file in _pictures(folder):
            if file in seen:
                continue
            size, since = waiting.get(file, (-1, 0.0))
            now = file.stat().st_size
            if now != size:
                waiting[file] = (now, time.monotonic())
                last = time.monotonic()
            elif now and time.monotonic() - since >= WHOLE_S:
                seen.add(file)
                waiting.pop(file)
                yield file
        sleep(LOOK_S)


def _frame(file: Path, model: Model, latency_s: float) -> Frame:
    """A picture, looked at. One that cannot be read is told as unusable: it clears no ground."""
    import cv2

    picture: Any = cv2.imread(str(file), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    at = taken_at(file)
    at = file.stat().st_mtime - latency_s if at is None else at
    name = file.name[:128]
    if picture is None:
        return Frame(at, name=name, usable=False)
    return Frame(at, model.look(picture), name=name)


def taken_at(file: Path) -> float | None:
    """When a picture was taken by its EXIF, in seconds since the epoch; None where it does not say it for sure."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(file) as image:
            exif = image.getexif()
            gps, more = exif.get_ifd(_GPS), exif.get_ifd(_EXIF)
    except (OSError, UnidentifiedImageError, SyntaxError, ValueError):
        return None
    return _by_gps(gps) or _by_clock(more)


def _by_gps(gps: dict[int, Any]) -> float | None:
    try:
        day = datetime.strptime(str(gps[_GPS_DATE]).strip("\0 "), "%Y:%m:%d").replace(tzinfo=UTC)
        hours, minutes, seconds = (float(part) for part in gps[_GPS_TIME])
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return None
    return (day + timedelta(hours=hours, minutes=minutes, seconds=seconds)).timestamp()


def _by_clock(exif: dict[int, Any]) -> float | None:
    """The camera's clock counts only with its offset: without one nobody knows of which zone it is."""
    try:
        text = f"{str(exif[_ORIGINAL]).strip(chr(0))}{str(exif[_OFFSET]).strip(chr(0))}"
        moment = datetime.strptime(text, "%Y:%m:%d %H:%M:%S%z").timestamp()
        return moment + float(f"0.{str(exif.get(_SUBSECOND, '0')).strip(chr(0) + ' ') or '0'}")
    except (KeyError, ValueError):
        return None

"""Any ONNX detector over a video: RTSP, HTTP (MJPEG), a file, or a camera device; weights are your own.

The service places boxes by its camera model: it needs sensor.profile = "camera" (see config/camera.toml).
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from service.adapters import options as flags
from service.adapters.decode import LAYOUTS
from service.adapters.door import Door
from service.adapters.frames import Frame
from service.adapters.model import Model, Wishes, need_extra
from service.adapters.serve import report_all
from service.adapters.video import Taken, watch
from service.errors import BadInput


def main(arguments: list[str]) -> int:
    """Watch until the video is over; returns the exit code."""
    parser = flags.parser("onnx", __doc__)
    add_model(parser)
    parser.add_argument(
        "--video", metavar="URL|FILE|N", required=True, help="what to watch; N is /dev/videoN"
    )
    parser.add_argument(
        "--latency", metavar="S", type=flags.seconds, default=0.0, help="from the lens to here (%(default)s)"
    )
    parser.add_argument(
        "--rate", metavar="HZ", type=flags.hertz, default=5.0, help="frames a second at most (%(default)s)"
    )
    parser.add_argument("--frames", metavar="N", type=int, help="end after so many")
    parser.add_argument(
        "--clock", choices=("unix", "service"), default="unix",
        help="service: ask it for the time, as this computer's clock is another, or time is simulated",
    )  # fmt: skip
    options = parser.parse_args(arguments)
    model = read_model(options)
    door = flags.door(options, options.threshold)
    taken = paced(watch(options.video, options.latency), options.rate)
    return report_all(door, itertools.islice(_frames(model, taken, door, options.clock), options.frames))


def add_model(parser: argparse.ArgumentParser) -> None:
    """The flags of a model."""
    parser.add_argument("--model", metavar="FILE", type=Path, required=True, help="the detector's .onnx file")
    parser.add_argument("--classes", metavar="FILE", type=Path, help="names of its classes, one a line")
    parser.add_argument(
        "--threshold", type=flags.share, default=0.4, help="report scores from here on (%(default)s)"
    )
    parser.add_argument(
        "--overlap", type=flags.share, default=0.5, help="boxes that share more are one (%(default)s)"
    )
    parser.add_argument("--layout", choices=LAYOUTS, help="of the model's outputs (by their shapes)")


def read_model(options: argparse.Namespace) -> Model:
    """The model that the flags name. Raises BadInput when there is none, or the extra is missing."""
    need_extra()
    if not options.model.is_file():
        raise BadInput(f"{options.model}: there is no such model; give the .onnx file of a detector")
    names = None
    if options.classes is not None:
        try:
            names = options.classes.read_text(encoding="utf-8").split("\n")
        except (OSError, UnicodeDecodeError) as error:
            raise BadInput(f"{options.classes}: the names cannot be read ({error})") from error
    wishes = Wishes(options.threshold, options.overlap, options.layout)
    return Model(options.model, [name.strip() for name in names] if names else None, wishes)


def paced(frames: Iterable[Taken], rate_hz: float) -> Iterator[Taken]:
    """At most so many frames a second, each as new as can be."""
    due = time.monotonic()
    for frame in frames:
        if time.monotonic() >= due:
            due = time.monotonic() + 1.0 / rate_hz
            yield frame


def _frames(model: Model, taken: Iterable[Taken], door: Door, clock: str) -> Iterator[Frame]:
    for each in taken:
        seen = model.look(each.picture)
        yield Frame(door.at(each.at) if clock == "service" else each.at, seen, clock)

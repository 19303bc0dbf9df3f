"""An Ultralytics model (YOLO, RT-DETR, ...) over a video: pip install ultralytics; its licence is AGPL-3.0.

A program of yours that has Results already takes `frame_of` and `service.adapters.door.Door`.
"""

from __future__ import annotations

import importlib.util
import itertools
from collections.abc import Iterator
from typing import Any

from service.adapters import options as flags
from service.adapters.frames import Frame, Seen
from service.adapters.onnx import paced
from service.adapters.serve import report_all
from service.adapters.video import watch
from service.errors import BadInput


def main(arguments: list[str]) -> int:
    """Watch until the video is over; returns the exit code."""
    parser = flags.parser("ultralytics", __doc__)
    parser.add_argument("--model", metavar="FILE", required=True, help="weights, such as best.pt")
    parser.add_argument(
        "--video", metavar="URL|FILE|N", required=True, help="what to watch; N is /dev/videoN"
    )
    parser.add_argument(
        "--threshold", type=flags.share, default=0.4, help="report scores from here on (%(default)s)"
    )
    parser.add_argument(
        "--latency", metavar="S", type=flags.seconds, default=0.0, help="from the lens to here (%(default)s)"
    )
    parser.add_argument(
        "--rate", metavar="HZ", type=flags.hertz, default=5.0, help="frames a second at most (%(default)s)"
    )
    parser.add_argument("--frames", metavar="N", type=int, help="end after so many")
    options = parser.parse_args(arguments)
    if importlib.util.find_spec("ultralytics") is None:
        raise BadInput("this needs ultralytics, which is not installed: pip install ultralytics")
    from ultralytics import YOLO

    model = YOLO(options.model)

    def frames() -> Iterator[Frame]:
        for taken in paced(watch(options.video, options.latency), options.rate):
            (result,) = model(taken.picture, conf=options.threshold, verbose=False)
            yield frame_of(result, taken.at)

    return report_all(flags.door(options, options.threshold), itertools.islice(frames(), options.frames))


def frame_of(result: Any, captured_at: float) -> Frame:
    """A frame from `ultralytics.engine.results.Results`, by its `boxes` (`xyxyn`, `conf`, `cls`) and `names`.

    `captured_at` is when the frame was taken, in seconds since the epoch: a Results does not know it.
    """
    if result.boxes is None:
        raise BadInput("these Results have no boxes; use a model that detects")
    rows = zip(
        result.boxes.xyxyn.tolist(), result.boxes.conf.tolist(), result.boxes.cls.tolist(), strict=True
    )
    seen = (
        Seen(str(result.names[int(kind)]), score, (box[0], box[1], box[2], box[3]))
        for box, score, kind in rows
        if box[0] < box[2] and box[1] < box[3]
    )
    return Frame(captured_at, tuple(seen))

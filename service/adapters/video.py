"""Frames of a video as they come, by OpenCV: RTSP, HTTP (MJPEG), a file, or a camera device by its number."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.errors import BadInput

AGAIN_S = 1.0
"""Between two calls of a stream that has ended."""
_WAIT_S = 0.5
_FPS = 25.0  # of a file that does not tell


@dataclass(frozen=True)
class Taken:
    """A picture, [rows, cols, 3] with blue first, and when it was taken, in seconds since the epoch."""

    picture: NDArray[np.uint8]
    at: float


def watch(source: str, latency_s: float = 0.0, lost_s: float = 10.0) -> Iterator[Taken]:
    """The newest frame each time one is asked for: what comes while the last is looked at is left out, never saved up.

    A file is played as though it were live. A stream that ends is called again for `lost_s` seconds.

    Raises:
        BadInput: there is no such video.
    """
    if Path(source).is_file():
        yield from _played(source)
    else:
        yield from _live(source, latency_s, lost_s)


def _opened(source: str) -> Any:
    import cv2

    capture = cv2.VideoCapture(int(source) if source.isdecimal() else source)
    if not capture.isOpened():
        raise BadInput(
            f"the video {source!r} cannot be opened; give rtsp://..., http://..., a file, or a camera device's number"
        )
    return capture


def _played(source: str) -> Iterator[Taken]:
    """A file, by the clock: a frame whose time has gone by while the last was looked at is left out."""
    import cv2

    capture = _opened(source)
    began, period, number = time.monotonic(), 1.0 / (capture.get(cv2.CAP_PROP_FPS) or _FPS), 0
    while capture.grab():
        late = time.monotonic() - began - number * period
        number += 1
        if late >= period:
            continue
        time.sleep(max(0.0, -late))
        good, picture = capture.retrieve()
        if good:
            yield Taken(picture, time.time())
    capture.release()


class _Newest:
    """Reads a stream in a thread of its own, so that it never falls behind, and keeps the newest frame."""

    def __init__(self, capture: Any, latency_s: float) -> None:
        self._capture, self._latency_s = capture, latency_s
        self._frame: Taken | None = None
        self._changed, self._over = threading.Condition(), False
        self._thread = threading.Thread(target=self._read, name="video", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while not self._over:
            good, picture = self._capture.read()
            with self._changed:
                self._frame = Taken(picture, time.time() - self._latency_s) if good else self._frame
                self._over = self._over or not good
                self._changed.notify()
        self._capture.release()

    def next(self) -> Taken | None:
        """The newest frame that has not been taken yet; None when the stream is over."""
        with self._changed:
            while self._frame is None and not self._over:
                self._changed.wait(_WAIT_S)
            frame, self._frame = self._frame, None
            return frame

    def stop(self) -> None:
        """Read no more."""
        self._over = True


def _live(source: str, latency_s: float, lost_s: float) -> Iterator[Taken]:
    newest = _Newest(_opened(source), latency_s)
    heard = time.monotonic()
    try:
        while True:
            frame = newest.next()
            if frame is not None:
                heard = time.monotonic()
                yield frame
                continue
            if time.monotonic() - heard > lost_s:
                return
            print(f"the video {source!r} has ended: calling it again")
            time.sleep(AGAIN_S)
            try:
                newest = _Newest(_opened(source), latency_s)
            except BadInput:
                continue
    finally:
        newest.stop()

"""Video as cameras send it: H.264 over RTSP by GStreamer's server, and MJPEG over HTTP."""

from __future__ import annotations

import contextlib
import functools
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

Scene = Callable[[], NDArray[np.uint8]]
"""What the camera sees now, [rows, cols, 3], blue first."""
FPS = 25
SERVER = Path(__file__).with_name("gstreamer.py")
PYTHON = "/usr/bin/python3"
"""The system's, for which GStreamer's bindings are."""
GOOD = "gstreamer1.0-plugins-base gstreamer1.0-plugins-good gstreamer1.0-plugins-ugly"
PACKAGES = f"python3-gi gir1.2-gst-rtsp-server-1.0 {GOOD}"


@functools.cache
def _there() -> bool:
    """Whether there is an RTSP server, with all that it needs."""
    return (
        Path(PYTHON).exists() and subprocess.run([PYTHON, str(SERVER)], capture_output=True).returncode == 0
    )


def _draw(scene: Scene, lens: IO[bytes], stop: threading.Event) -> None:
    """What the camera sees, again and again, into the server."""
    with contextlib.suppress(BrokenPipeError):
        while not stop.wait(1.0 / FPS):
            lens.write(scene().tobytes())
            lens.flush()


@contextmanager
def rtsp(scene: Scene) -> Iterator[str]:
    """The scene as an RTSP stream; yields its URL."""
    if not _there():
        pytest.skip(f"NO RTSP SERVER: NO STREAM HAS BEEN WATCHED (apt-get install {PACKAGES})")
    height, width = scene().shape[:2]
    words = [PYTHON, str(SERVER), str(width), str(height), str(FPS)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as server:
        assert server.stdin is not None
        assert server.stdout is not None
        stop = threading.Event()
        thread = threading.Thread(target=_draw, args=(scene, server.stdin, stop), daemon=True)
        thread.start()
        try:
            url = server.stdout.readline().decode().strip()
            assert url.startswith("rtsp://"), "the RTSP server did not start"
            yield url
        finally:
            stop.set()
            thread.join(5.0)
            assert server.poll() is None, "the RTSP server has ended by itself"
            server.terminate()


@contextmanager
def mjpeg(scene: Scene) -> Iterator[str]:
    """The scene as JPEG pictures that follow each other over HTTP; yields its URL."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("content-type", "multipart/x-mixed-replace; boundary=frame")
            self.end_headers()
            with contextlib.suppress(OSError):
                while True:
                    data = cv2.imencode(".jpg", scene())[1].tobytes()
                    head = f"--frame\r\ncontent-type: image/jpeg\r\ncontent-length: {len(data)}\r\n\r\n"
                    self.wfile.write(head.encode() + data + b"\r\n")
                    time.sleep(1.0 / FPS)

        def log_message(self, *_words: Any) -> None:
            """Nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/camera.mjpg"
        server.shutdown()

"""GStreamer's RTSP server, by the system's Python: raw pictures on standard input, H.264 over RTSP as cameras send it.

    /usr/bin/python3 gstreamer.py WIDTH HEIGHT FPS    prints the stream's URL
    /usr/bin/python3 gstreamer.py                     fails when a part of GStreamer is missing

It is a program of its own because GStreamer's bindings are Debian's, not a package of the environment of the tests.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer  # noqa: E402  (the versions first)

LAUNCH = (
    "( appsrc name=lens is-live=true do-timestamp=true format=time"
    " caps=video/x-raw,format=BGR,width={0},height={1},framerate={2}/1"
    " ! videoconvert ! video/x-raw,format=I420"
    " ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=5"
    " ! rtph264pay name=pay0 pt=96 config-interval=1 )"
)


class Lens:
    """Hands each picture to the stream that is played, if one is."""

    def __init__(self, size: int, over: Callable[[], None]) -> None:
        self._size, self._over, self._source = size, over, None

    def configure(self, _factory: GstRtspServer.RTSPMediaFactory, media: GstRtspServer.RTSPMedia) -> None:
        """A client has called: its stream begins."""
        self._source = media.get_element().get_child_by_name("lens")

    def look(self) -> None:
        """Picture after picture, until whoever draws them is gone."""
        while len(picture := sys.stdin.buffer.read(self._size)) == self._size:
            if self._source is not None:
                self._source.emit("push-buffer", Gst.Buffer.new_wrapped(picture))
        self._over()


def main() -> None:
    """Serve until standard input closes."""
    Gst.init(None)
    if not sys.argv[1:]:
        Gst.parse_launch(LAUNCH.format(64, 64, 25))
        return
    width, height, fps = (int(word) for word in sys.argv[1:])
    loop = GLib.MainLoop()
    lens = Lens(width * height * 3, loop.quit)
    factory = GstRtspServer.RTSPMediaFactory(shared=True, launch=LAUNCH.format(width, height, fps))
    factory.connect("media-configure", lens.configure)
    server = GstRtspServer.RTSPServer(address="127.0.0.1", service="0")
    server.get_mount_points().add_factory("/camera", factory)
    server.attach(None)
    print(f"rtsp://127.0.0.1:{server.get_bound_port()}/camera", flush=True)
    threading.Thread(target=lens.look, daemon=True).start()
    loop.run()


main()

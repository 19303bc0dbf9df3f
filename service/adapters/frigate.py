"""Frigate: what its MQTT topics `frigate/events`, `frigate/stats` and `frigate/available` tell of one camera.

Frigate publishes tracked objects only, never that a frame was empty, and silence clears no ground. So an empty frame is
reported every --every seconds as long as Frigate is online, its statistics, no older than --stats-age, say that frames
of the camera are looked at, and no object is being tracked. Set mqtt.stats_interval to 15 there, and detect.fps to 5.

The shapes are those of Frigate's documentation (Integrations, MQTT; and of its /api/stats), 0.13 to 0.16.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from service.adapters import options as flags
from service.adapters.frames import Frame, Seen, in_shares
from service.adapters.mqtt import add_broker, messages, read_broker
from service.adapters.serve import report_all

FRESH_S = 1.0
"""A box of another object that is older than that is not where the aircraft sees it now."""


def main(arguments: list[str]) -> int:
    """Listen to the broker until stopped; returns the exit code."""
    parser = flags.parser("frigate", __doc__)
    add_broker(parser, required=True)
    parser.add_argument("--camera", metavar="NAME", required=True, help="its name in Frigate")
    parser.add_argument(
        "--size",
        metavar="WxH",
        type=flags.size,
        required=True,
        help="detect.width and detect.height in Frigate",
    )
    parser.add_argument("--topic", metavar="PREFIX", default="frigate", help="mqtt.topic_prefix in Frigate")
    parser.add_argument(
        "--every", metavar="S", type=float, default=0.5, help="an empty frame so often (%(default)s)"
    )
    parser.add_argument("--stats-age", metavar="S", type=float, default=90.0, help="(%(default)s)")
    parser.add_argument(
        "--latency", metavar="S", type=flags.seconds, default=0.5, help="of empty frames (%(default)s)"
    )
    options = parser.parse_args(arguments)
    broker = read_broker(options.mqtt, options.mqtt_credentials)
    return report_all(flags.door(options), _frames(broker, options))


def _frames(broker: Any, options: argparse.Namespace) -> Iterator[Frame]:
    watched = Watched(options.camera, options.size, options.stats_age)
    topics = [f"{options.topic}/{name}" for name in ("events", "stats", "available")]
    due = time.monotonic()
    for message in messages(broker, topics, options.every):
        now = time.monotonic()
        if message is not None:
            topic, payload = message
            frame = watched.hear(topic.rpartition("/")[2], payload, now)
            if frame is not None:
                yield frame
        if now >= due and watched.looks_in_vain(now):
            due = now + options.every
            yield Frame(time.time() - options.latency)


@dataclass
class Watched:
    """What is known of one camera of Frigate. Times are of a clock that never steps."""

    camera: str
    size: tuple[int, int]
    stats_age_s: float
    online: bool = True
    _looked: float | None = None
    _tracked: dict[str, tuple[float, Seen | None]] = field(default_factory=dict)

    def hear(self, topic: str, payload: bytes, now: float) -> Frame | None:
        """Take a message in; a frame comes of it where an object is told of."""
        if topic == "available":
            self.online = payload == b"online"
            self._tracked.clear()  # nobody tells the end of what it tracked
            return None
        try:
            said = json.loads(payload)
            if topic == "stats":
                self._hear_stats(said["cameras"][self.camera], now)
                return None
            return self._hear_event(said["type"], said["after"])
        except (ValueError, KeyError, TypeError):
            return None  # of another camera, or of another version

    def looks_in_vain(self, now: float) -> bool:
        """Whether frames are looked at now, and nothing is seen in them."""
        recent = self._looked is not None and now - self._looked <= self.stats_age_s
        return self.online and recent and not self._tracked

    def _hear_stats(self, camera: dict[str, Any], now: float) -> None:
        looks = camera["process_fps"] > 0 and camera.get("detection_enabled", True)
        self._looked = now if looks else None

    def _hear_event(self, kind: str, after: dict[str, Any]) -> Frame | None:
        if after["camera"] != self.camera or after["false_positive"]:
            return None
        if kind == "end":
            self._tracked.pop(after["id"], None)
            return None
        at = float(after["frame_time"])
        box = in_shares(after["box"], *self.size)
        seen = None if box is None else Seen(str(after["label"]), float(after["score"]), box)
        self._tracked[after["id"]] = (at, seen)
        together = (each for told, each in self._tracked.values() if abs(told - at) <= FRESH_S)
        return Frame(at, tuple(each for each in together if each is not None))

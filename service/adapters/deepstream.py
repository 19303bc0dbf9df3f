"""NVIDIA DeepStream: messages of Gst-nvmsgconv, from an MQTT broker (--mqtt, --topic) or on standard input.

Use the minimal schema (payload-type=1, msg2p-newapi=1): a message for each frame, also for an empty one. The full
schema (payload-type=0) has a message for each object and none for an empty frame, and so clears no ground.
`@timestamp` is when the message was made: --latency tells how long after the frame was taken that is. A frame with
nothing but boxes that the tracker expects (confidence below 0) is unusable: it was not looked at.

The shapes are those that NVIDIA's nvmsgconv library writes (dsmeta_payload.cpp of DeepStream 6 and 7).
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from service.adapters import options as flags
from service.adapters.frames import Frame, Seen, in_shares
from service.adapters.mqtt import add_broker, messages, read_broker
from service.adapters.serve import report_all
from service.errors import BadInput

TOGETHER_S = 0.05
"""Messages of the full schema whose times are so near to each other are of one frame."""
_NO_KINDS = {"id", "speed", "direction", "orientation", "bbox", "location", "coordinate", "pose", "embedding"}
_MOST_TEXT = 1 << 20


def main(arguments: list[str]) -> int:
    """Listen until stopped, or the end of the input; returns the exit code."""
    parser = flags.parser("deepstream", __doc__)
    add_broker(parser, required=False)
    parser.add_argument("--topic", default="deepstream", help="of the broker (%(default)s)")
    parser.add_argument(
        "--size", metavar="WxH", type=flags.size, required=True, help="of the images the boxes are in"
    )
    parser.add_argument("--sensor", metavar="ID", help="of which camera (all: one pipeline watches one)")
    parser.add_argument(
        "--latency", metavar="S", type=flags.seconds, default=0.2, help="from lens to message (%(default)s)"
    )
    options = parser.parse_args(arguments)
    if options.mqtt is not None:
        heard = messages(read_broker(options.mqtt, options.mqtt_credentials), [options.topic], TOGETHER_S)
        values: Iterable[Any] = (None if each is None else _value(each[1]) for each in heard)
    else:
        values = json_values(iter(lambda: sys.stdin.readline(), ""))
    told = (each if each is None else _told(each, options) for each in values)
    frames = together(each for each in told if each is None or options.sensor in (None, each.sensor))
    return report_all(flags.door(options), frames)


@dataclass(frozen=True)
class Told:
    """What one message tells. `whole`: it tells all of its frame; `seen` holds None for what is only expected."""

    at: float
    sensor: str
    seen: tuple[Seen | None, ...]
    whole: bool

    @property
    def frame(self) -> Frame:
        """As a frame: whatever was really seen in it, else whether it was looked at."""
        seen = tuple(each for each in self.seen if each is not None)
        return Frame(self.at, seen, usable=bool(seen) or not self.seen)


def json_values(lines: Iterable[str]) -> Iterator[Any]:
    """Each JSON value of a text in which they follow each other, on one line or on several.

    Raises:
        BadInput: a value does not end within a megabyte, or none ever does.
    """
    text, decoder, any_ = "", json.JSONDecoder(), False
    for line in lines:
        text = (text + line.replace("\0", "")).lstrip()
        while text:
            try:
                value, end = decoder.raw_decode(text)
            except json.JSONDecodeError:
                if len(text) > _MOST_TEXT:
                    raise BadInput("the input is no JSON of DeepStream: a message does not end") from None
                break
            any_ = True
            yield value
            text = text[end:].lstrip()
    if text and not any_:
        raise BadInput(f"the input is no JSON of DeepStream: {text[:60].rstrip()!r}; pipe its messages in")


def _value(payload: bytes) -> Any:
    try:
        return json.loads(payload.rstrip(b"\0 \r\n"))
    except ValueError:
        return {}


def _told(value: Any, options: argparse.Namespace) -> Told:
    return told(value, options.size, options.latency)


def told(value: Any, size: tuple[int, int], latency_s: float = 0.0) -> Told:
    """What a message of either schema tells; `size` is width and height of the images.

    Raises:
        BadInput: it is of neither.
    """
    try:
        at = datetime.fromisoformat(value["@timestamp"]).timestamp() - latency_s
        if "objects" in value:
            seen = [_minimal(text, size) for text in value["objects"]]
            return Told(at, str(value.get("sensorId", "")), tuple(seen), True)
        sensor = value.get("sensor") or {}
        return Told(at, str(sensor.get("id", "")), (_full(value["object"], size),), False)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise BadInput(
            f"this is no message of DeepStream's schemas ({error}): {json.dumps(value)[:120]}; "
            "set payload-type=1 and msg2p-newapi=1 in its [message-converter]"
        ) from error


def _minimal(text: str, size: tuple[int, int]) -> Seen | None:
    """`id|left|top|right|bottom|class`, then `|#|...|confidence` where a second network has looked at it."""
    parts = text.split("|")
    last = parts[-1]
    sure = float(last) if "#" in parts and re.fullmatch(r"-?\d*\.?\d+(e-?\d+)?", last) else 1.0
    return _seen(parts[5], sure, [float(part) for part in parts[1:5]], size)


def _full(thing: dict[str, Any], size: tuple[int, int]) -> Seen | None:
    """An object, whose class is the name of what holds its confidence."""
    kind = next(
        (name for name, value in thing.items() if name not in _NO_KINDS and isinstance(value, dict)), "object"
    )
    box = [float(thing["bbox"][name]) for name in ("topleftx", "toplefty", "bottomrightx", "bottomrighty")]
    sure = thing.get(kind, {}).get("confidence", thing.get("confidence", 1.0))
    return _seen(kind, float(sure), box, size)


def _seen(kind: str, sure: float, box: list[float], size: tuple[int, int]) -> Seen | None:
    placed = in_shares(box, *size)
    if sure < 0.0 or placed is None:
        return None
    return Seen(kind, min(sure, 1.0), placed)


def together(heard: Iterable[Told | None]) -> Iterator[Frame]:
    """A frame for each message that tells all of one, and one for those that tell a part each; None is a pause."""
    open_: Told | None = None
    for each in heard:
        if open_ is not None and (each is None or each.whole or abs(each.at - open_.at) > TOGETHER_S):
            yield open_.frame
            open_ = None
        if each is None:
            continue
        if each.whole:
            yield each.frame
        else:
            seen = each.seen if open_ is None else (*open_.seen, *each.seen)
            open_ = Told(each.at if open_ is None else open_.at, each.sensor, seen, False)
    if open_ is not None:
        yield open_.frame

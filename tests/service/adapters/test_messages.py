"""Frigate, DeepStream, Ultralytics: what they publish, through real sockets and a real broker, as reports."""

from __future__ import annotations

import io
import json
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import paho.mqtt.publish
import pytest

from service.adapters.deepstream import json_values, together, told
from service.adapters.door import Door
from service.adapters.frames import Frame, in_shares
from service.adapters.frigate import Watched
from service.adapters.serve import GONE, report_all
from service.commands.detector import main
from service.errors import BadInput
from tests.ports import free_port
from tests.service.doors.test_mqtt import mosquitto, needs_mosquitto

from .stage import Taking, taking

SIZE = (1280, 720)
BOX = [424, 500, 536, 712]
SHARE = [424 / 1280, 500 / 720, 536 / 1280, 712 / 720]


def event(kind: str = "update", **changed: Any) -> bytes:
    """A message of `frigate/events`."""
    after = {
        "id": "1607123955.475377-mxklsc",
        "camera": "drone",
        "frame_time": 1607123961.837752,
        "label": "person",
        "sub_label": None,
        "top_score": 0.958984375,
        "false_positive": False,
        "start_time": 1607123955.475377,
        "end_time": None,
        "score": 0.7890625,
        "box": BOX,
        "area": 23744,
        "region": [264, 450, 667, 853],
        "has_snapshot": True,
    }
    return json.dumps({"type": kind, "before": after, "after": {**after, **changed}}).encode()


def stats(fps: float = 5.0) -> bytes:
    """A message of `frigate/stats`."""
    camera = {"camera_fps": 5.0, "process_fps": fps, "skipped_fps": 0.0, "detection_fps": 1.5, "pid": 34}
    return json.dumps({"cameras": {"drone": camera}, "service": {"uptime": 12}}).encode()


def minimal(*objects: str, at: str = "2026-05-01T14:03:12.500Z") -> dict[str, Any]:
    """A message of DeepStream's minimal schema."""
    return {"version": "4.0", "id": "418", "@timestamp": at, "sensorId": "CAM_0", "objects": list(objects)}


def full(at: str, left: int, confidence: float = 0.8) -> dict[str, Any]:
    """A message of DeepStream's full schema."""
    box = {"topleftx": left, "toplefty": 100, "bottomrightx": left + 64, "bottomrighty": 200}
    thing = {
        "id": "7",
        "speed": 0.0,
        "person": {"confidence": confidence},
        "bbox": box,
        "location": {},
        "coordinate": {},
    }
    return {
        "messageid": "a",
        "mdsversion": "1.0",
        "@timestamp": at,
        "sensor": {"id": "CAM_0"},
        "object": thing,
    }


def publish_until(
    port: int, said: list[tuple[str, bytes]], taker: Taking, enough: Callable[[Any], bool]
) -> None:
    """Publish, again while the adapter may not have subscribed yet, until there are reports enough."""
    done = threading.Event()

    def go_on() -> None:
        while not done.wait(0.2):
            paho.mqtt.publish.multiple(
                [(topic, payload, 1, False) for topic, payload in said], "127.0.0.1", port
            )

    threading.Thread(target=go_on, daemon=True).start()
    try:
        taker.wait_for(enough)
    finally:
        done.set()


@needs_mosquitto
def test_frigates_events_are_hits_and_its_idle_frames_looks_in_vain(tmp_path: Path) -> None:
    port = free_port()
    with mosquitto(tmp_path, port, "allow_anonymous true"), taking() as taker:
        flags = [
            "--mqtt",
            f"mqtt://127.0.0.1:{port}",
            "--camera",
            "drone",
            "--size",
            "1280x720",
            "--every",
            "0.1",
        ]
        adapter = ["frigate", "--service", taker.url, *flags]
        threading.Thread(target=main, args=(adapter,), daemon=True).start()
        publish_until(port, [("frigate/stats", stats())], taker, lambda reports: len(reports) > 2)
        assert not any(each["detections"] for each in taker.reports)
        publish_until(
            port, [("frigate/events", event("new"))], taker, lambda reports: bool(reports[-1]["detections"])
        )
    (seen,) = taker.reports[-1]["detections"]
    assert (seen["class"], seen["score"]) == ("person", 0.7890625)
    np.testing.assert_allclose(seen["box"], SHARE)
    assert taker.reports[-1]["captured_at"] == 1607123961.837752


def test_frigate_clears_no_ground_while_it_tracks_is_silent_or_does_not_look() -> None:
    watched = Watched("drone", SIZE, stats_age_s=90.0)
    assert not watched.looks_in_vain(0.0)
    watched.hear("stats", stats(), 10.0)
    assert watched.looks_in_vain(99.0)
    assert not watched.looks_in_vain(101.0)
    watched.hear("events", event("new"), 20.0)
    assert not watched.looks_in_vain(21.0)
    watched.hear("events", event("end"), 22.0)
    assert watched.looks_in_vain(23.0)
    watched.hear("available", b"offline", 24.0)
    assert not watched.looks_in_vain(25.0)
    watched.hear("available", b"online", 26.0)
    watched.hear("stats", stats(fps=0.0), 27.0)
    assert not watched.looks_in_vain(28.0)


def test_frigates_false_positives_and_other_cameras_are_not_reported() -> None:
    watched = Watched("drone", SIZE, stats_age_s=90.0)
    for payload in (event(false_positive=True), event(camera="door"), b"{", b"[]", event(box=None)):
        assert watched.hear("events", payload, 0.0) is None
    first = watched.hear("events", event(), 0.0)
    both = watched.hear("events", event(id="b", frame_time=1607123962.5), 0.0)
    later = watched.hear("events", event(id="b", frame_time=1607123964.0), 0.0)
    assert [len(each.seen) for each in (first, both, later) if each is not None] == [1, 2, 1]


def test_deepstreams_minimal_schema_tells_whole_frames_and_empty_ones() -> None:
    heard = told(minimal("957|424|500|536|712|Person|#|blue|0.8", "3|0|0|64|72|Person"), SIZE, 0.5)
    (frame,) = together([heard])
    assert [each.score for each in frame.seen if each is not None] == [0.8, 1.0]
    np.testing.assert_allclose(frame.seen[0].box, SHARE)
    assert frame.captured_at == 1777644192.0
    (empty,) = together([told(minimal(), SIZE)])
    assert empty.usable
    assert not empty.seen
    (expected,) = together([told(minimal("957|424|500|536|712|Person|#|blue|-0.1"), SIZE)])
    assert not expected.usable, "the tracker alone expects it: nobody has looked"


def test_deepstreams_full_schema_is_put_together_to_frames() -> None:
    times = ["2026-05-01T14:03:12.500Z", "2026-05-01T14:03:12.503Z", "2026-05-01T14:03:12.600Z"]
    heard = [told(full(at, 100 * number), SIZE) for number, at in enumerate(times)]
    assert [len(frame.seen) for frame in together(heard)] == [2, 1]
    assert [len(frame.seen) for frame in together([heard[0], None, heard[1]])] == [1, 1]
    with pytest.raises(BadInput, match="no message of DeepStream"):
        told({"@timestamp": "yesterday", "objects": []}, SIZE)


def test_deepstreams_messages_come_as_lines_or_pretty_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    text = json.dumps(minimal()) + "\n" + json.dumps(minimal("3|0|0|64|72|Person"), indent=2) + "\0"
    assert len(list(json_values(io.StringIO(text)))) == 2
    assert list(json_values(io.StringIO(" \n"))) == []
    with pytest.raises(BadInput, match="no JSON of DeepStream: 'hello'; pipe its messages in"):
        list(json_values(io.StringIO("hello\n")))
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    with taking() as taker:
        assert main(["deepstream", "--service", taker.url, "--size", "1280x720"]) == 0
    assert [len(each["detections"]) for each in taker.reports] == [0, 1]


@needs_mosquitto
def test_deepstreams_messages_come_from_a_broker(tmp_path: Path) -> None:
    port = free_port()
    with mosquitto(tmp_path, port, "allow_anonymous true"), taking() as taker:
        flags = ["--mqtt", f"mqtt://127.0.0.1:{port}", "--topic", "ds", "--size", "1280x720"]
        threading.Thread(
            target=main, args=(["deepstream", "--service", taker.url, *flags],), daemon=True
        ).start()
        said = json.dumps(minimal("3|0|0|64|72|Person")).encode() + b"\0"
        publish_until(port, [("ds", said)], taker, lambda reports: len(reports) > 0)
    assert taker.reports[0]["detections"][0]["box"] == [0.0, 0.0, 0.05, 0.1]


def test_ultralytics_results_become_a_frame(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its Results are played by values of the same names and shapes: the package brings its own torch, 2 GB of it."""
    from service.adapters.ultralytics import frame_of

    boxes = SimpleNamespace(
        xyxyn=np.array([[0.1, 0.2, 0.3, 0.4], [0.5, 0.5, 0.5, 0.6]]),
        conf=np.array([0.9, 0.8]),
        cls=np.array([0.0, 1.0]),
    )
    frame = frame_of(SimpleNamespace(boxes=boxes, names={0: "person", 1: "dog"}), 12.5)
    assert frame.captured_at == 12.5
    assert [(each.kind, each.score, each.box) for each in frame.seen] == [
        ("person", 0.9, (0.1, 0.2, 0.3, 0.4))
    ]
    monkeypatch.setitem(sys.modules, "ultralytics", None)
    with pytest.raises((BadInput, ValueError), match="ultralytics"):
        main(["ultralytics", "--model", str(tmp_path / "best.pt"), "--video", "0"])


def test_a_report_is_sent_again_as_it_was_until_there_is_an_answer() -> None:
    told: list[str] = []
    with taking() as taker:
        taker.fail, taker.refuse = [500, 429, 503], "the aircraft was too low"
        with Door(taker.url, source="cam", token="secret", tell=told.append) as door:
            assert door.send(Frame(1.0))["status"] == "refused"
            door.send(Frame(2.0))
    assert taker.tokens == ["Bearer secret"] * 5
    assert [each["captured_at"] for each in taker.reports] == [1.0, 2.0]
    assert told == ["refused: the aircraft was too low"], "a reason is told once"


def test_a_service_that_is_gone_or_shut_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    gone = Door(f"http://127.0.0.1:{free_port()}", source="cam", patience_s=0.3)
    assert report_all(gone, [Frame(time.time())]) == GONE
    assert "is gone" in capsys.readouterr().err
    with taking() as taker:
        taker.fail = [401]
        with Door(taker.url, source="cam") as door, pytest.raises(BadInput, match="--token-file"):
            door.send(Frame(1.0))


def test_a_box_is_clipped_to_its_image() -> None:
    assert in_shares((-10, 0, 50, 50), 100, 50) == (0.0, 0.0, 0.5, 1.0)
    assert in_shares((120, 0, 150, 50), 100, 50) is None

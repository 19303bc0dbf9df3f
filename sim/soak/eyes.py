"""The detector of the soak, which remembers what was acknowledged, and the eye on the service's process and belief."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from sim.detector import Detector, of_aircraft
from sim.soak.audit import Told

_LOOK_S = 0.2
_GROWTH_MB, _GROWTH_PART = 40.0, 0.25
_MOST_TASKS = 60
_BAD = (
    (b"{", "application/json"),
    (b'{"id": "x", "captured_at": NaN}', "application/json"),
    (b"[" * 2000, "application/json"),
    (b"\xff\xfe", "text/plain"),
)


def misplaced(way: str, seen: dict[str, Any]) -> dict[str, float]:
    """Where a detector that lies in some way says that it saw something."""
    places = {
        "swapped": (seen["lon"], seen["lat"]),
        "nowhere": (0.0, 0.0),
        "far": (seen["lat"] + 0.009, seen["lon"]),
    }
    lat, lon = places.get(way, (seen["lat"], seen["lon"]))
    return {"lat": lat, "lon": lon}


def distort(way: str, frame: dict[str, Any], state: dict[str, Any], stood: float) -> None:
    """Make of a frame what a detector that lies in some way says: the target in every cell, or an hour ago (`stood`,
    whatever the time is), or from another place."""
    if way == "everywhere":
        cells = [each for each in state["footprint"]["cells"] if each["counts"]]
        frame["detections"] = [
            {"class": "target", "score": 0.9, "lat": each["lat"], "lon": each["lon"]} for each in cells
        ]
    elif way == "still":
        frame["captured_at"] = stood
    elif way == "pose":
        pose = state["pose"]
        frame["pose"] = {"lat": pose["lat"] + 0.01, "lon": pose["lon"], "height_m": 15.0, "heading_deg": 0.0}


class Eyes:
    """Two threads beside one service; `violations` are sentences.

    Attributes:
        silent, repeats, rude: switches of the detector: it says nothing, says everything twice, or sends what is no
            report in between.
        lies: how it places what it sees: "swapped" (latitude for longitude), "nowhere" (0/0), "far" (a kilometre off);
            or how else it is wrong: see `distort`.
        clock_off_s: how far the computer's clock has been stepped since the service began. `own_clock`: the detector
            goes by that, and otherwise by the service's: a flight faster than the wall clock knows no other.
        aircraft: whose camera it is; empty: of the only one.
        true_hits: the ids of reports in which it saw the target, wherever it said it was.
    """

    def __init__(
        self, url: str, pid: int, detector: Detector, rate_hz: float, *, own_clock: bool = False
    ) -> None:
        self.silent = self.repeats = self.rude = False
        self.lies = self.aircraft = ""
        self.clock_off_s, self._own_clock = 0.0, own_clock
        self._stood = 0.0  # when its clock stopped
        self.true_hits: set[str] = set()
        self.acknowledged: set[str] = set()
        self.told: list[Told] = []
        self.violations: list[str] = []
        self.memory_mb: list[float] = []
        self.tasks: list[int] = []
        self.beliefs = 0
        self._url, self._pid, self._detector, self._period_s = url, pid, detector, 1.0 / rate_hz
        self._open = True
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._report, self._look)]

    def __enter__(self) -> Eyes:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._open = False
        for thread in self._threads:
            thread.join()

    def _report(self) -> None:
        with httpx.Client(base_url=self._url, timeout=20.0) as door:
            last = None
            while self._open:
                began = time.monotonic()
                try:
                    if not self.silent:
                        last = self._frame(door, last)
                    if self.rude:
                        self._rudeness(door)
                except (httpx.HTTPError, ValueError):
                    time.sleep(0.1)  # it is being killed, or stands still
                time.sleep(max(0.0, self._period_s - (time.monotonic() - began)))

    def _frame(self, door: httpx.Client, last: object) -> object:
        state = door.get("/api/state").raise_for_status().json()
        state = of_aircraft(state, self.aircraft)
        pose = state["pose"]
        if pose is None or pose["time"] == last:
            return last
        frame = self._detector.frame(state)
        if self.aircraft:
            frame["aircraft"] = self.aircraft
        target = self._detector.target_at(pose["time"])
        if any((seen["lat"], seen["lon"]) == target for seen in frame["detections"]):
            self.true_hits.add(frame["id"])
        if self._own_clock:
            del frame["clock"]
            frame["captured_at"] += self.clock_off_s
        for seen in frame["detections"]:
            seen.update(misplaced(self.lies, seen))
        self._stood = frame["captured_at"] if self.lies != "still" else self._stood
        distort(self.lies, frame, state, self._stood)
        for _ in range(2 if self.repeats else 1):
            for receipt in door.post("/api/reports", json=frame).raise_for_status().json():
                if receipt["status"] == "accepted":
                    if receipt["id"] in self.acknowledged:
                        self.violations.append(f"report {receipt['id']} was accepted twice")
                    self.acknowledged.add(receipt["id"])
        return pose["time"]

    def _rudeness(self, door: httpx.Client) -> None:
        for body, kind in _BAD:
            answer = door.post("/api/reports", content=body, headers={"content-type": kind})
            if not 400 <= answer.status_code < 500:
                self.violations.append(f"{body[:20]!r} was answered by {answer.status_code}")

    def _look(self) -> None:
        with httpx.Client(base_url=self._url, timeout=20.0) as door:
            while self._open:
                try:
                    self._take(door)
                except (httpx.HTTPError, ValueError, OSError):
                    time.sleep(0.1)
                time.sleep(_LOOK_S)

    def _take(self, door: httpx.Client) -> None:
        seen = door.get("/api/map").raise_for_status().json()
        values = np.array([value for row in seen["probability"] for value in row if value is not None])
        total = float(values.sum()) + seen["outside"]
        self.beliefs += 1
        if not math.isclose(total, 1.0, abs_tol=1e-9) or not (values >= 0).all():
            self.violations.append(f"a belief that sums to {total!r}")
        self.told.append((seen["reports"], seen["digest"]))
        for line in door.get("/metrics").raise_for_status().text.splitlines():
            if line.startswith("roisearch_tasks "):
                self.tasks.append(int(float(line.split()[1])))
        status = Path(f"/proc/{self._pid}/status").read_text(encoding="ascii")
        if resident := status.partition("VmRSS:")[2].split():  # a process that is ending has none
            self.memory_mb.append(int(resident[0]) / 1024.0)


def grown(eyes: Eyes) -> list[str]:
    """Whether memory or tasks have grown from the middle of a process's life to its end."""
    found = []
    third = len(eyes.memory_mb) // 3
    if third >= 10:
        middle, end = (
            float(np.median(part)) for part in (eyes.memory_mb[third:-third], eyes.memory_mb[-third:])
        )
        if end - middle > max(_GROWTH_MB, _GROWTH_PART * middle):
            found.append(f"memory has grown from {middle:.0f} to {end:.0f} MB")
    if eyes.memory_mb and not max(eyes.tasks, default=0):
        found.append("the number of tasks is not told")
    if max(eyes.tasks, default=0) > _MOST_TASKS * (2 if eyes.aircraft else 1):
        found.append(f"{max(eyes.tasks)} tasks at a time")
    if third >= 10 and eyes.tasks and min(eyes.tasks[-third:]) > max(eyes.tasks[third:-third]):
        found.append(f"tasks have grown from {max(eyes.tasks[third:-third])} to {min(eyes.tasks[-third:])}")
    return found

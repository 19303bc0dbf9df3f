"""The detector of the soak, which remembers what was acknowledged, and the eye on the service's process and belief."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path

import httpx
import numpy as np

from sim.detector import Detector
from sim.soak.audit import Told

_LOOK_S = 0.2
_BAD = (
    (b"{", "application/json"),
    (b'{"id": "x", "captured_at": NaN}', "application/json"),
    (b"[" * 2000, "application/json"),
    (b"\xff\xfe", "text/plain"),
)


class Eyes:
    """Two threads beside one service; `violations` are sentences.

    `silent`, `repeats` and `rude` are switches of the detector: it says nothing, says everything twice, or sends what
    is no report in between.
    """

    def __init__(self, url: str, pid: int, detector: Detector, rate_hz: float) -> None:
        self.silent = self.repeats = self.rude = False
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
        pose = state["pose"]
        if pose is None or pose["time"] == last:
            return last
        frame = self._detector.frame(state)
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

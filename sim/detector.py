"""`roisearch-sim detector`: a simulated detector beside a running service, real or simulated flight.

It knows where the target is and nothing else. It follows the aircraft through the service's public door
(GET /api/state), draws what a camera with the given true-positive and true-negative probabilities would say about
each cell of the footprint, and reports it (POST /api/reports). Frames of one pass over a cell agree with each other, as
those of a real camera do: one draw decides the pass, and a miss turns into a hit only where a better view makes it one.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import httpx
import numpy as np

Point = tuple[float, float]


def contains(corners: Sequence[Sequence[float]], point: Point) -> bool:
    """True when the convex quadrilateral `corners` ((lat, lon) in order) contains the point."""
    sides = []
    for (lat, lon), (lat2, lon2) in zip(corners, [*corners[1:], corners[0]], strict=True):
        sides.append((lat2 - lat) * (point[1] - lon) - (lon2 - lon) * (point[0] - lat))
    return all(side >= 0 for side in sides) or all(side <= 0 for side in sides)


class Detector:
    """Draws once per cell and pass. `target` is (lat, lon), or None when there is nothing to find."""

    def __init__(
        self, target: Point | None, p_tp: float, p_tn: float, seed: int, again_s: float = math.inf
    ) -> None:
        """`again_s`: a cell that stays in view for so many seconds gets another draw (see sensor.hover_look_s)."""
        self.target, self.p_tp, self.p_tn = target, p_tp, p_tn
        self._rng = np.random.default_rng(seed)
        self._again_s = again_s
        self._draws: dict[tuple[int, int], tuple[float, float]] = {}  # the draw, and when it was made
        self._hits: set[tuple[int, int]] = set()
        self._prefix = uuid.uuid4().hex[:12]
        self._count = 0

    def frame(self, state: dict[str, Any]) -> dict[str, Any]:
        """The report of one frame, from the service's state. A frame between cells reports nothing seen."""
        footprint = state["footprint"]
        cells = {(cell["row"], cell["col"]): cell for cell in footprint["cells"]}
        for gone in self._draws.keys() - cells.keys():
            del self._draws[gone]
            self._hits.discard(gone)
        detections, now = [], state["pose"]["time"]
        for key, cell in cells.items():
            if not cell["counts"]:
                continue
            there = self.target is not None and contains(cell["corners"], self.target)
            draw, made = self._draws.get(key, (0.0, -math.inf))
            if key not in self._draws or now >= made + self._again_s:
                draw, made = self._draws[key] = float(self._rng.random()), now
                self._hits.discard(key)
            if draw < self._chance(cell, footprint, there):
                self._hits.add(key)
            if key in self._hits:
                lat, lon = self.target if there and self.target else (cell["lat"], cell["lon"])
                detections.append({"class": "target", "score": 0.9, "lat": lat, "lon": lon})
        self._count += 1
        return {
            "id": f"{self._prefix}-{self._count}",
            "source": "simulated",
            "captured_at": state["pose"]["time"],
            "detections": detections,
        }

    def _chance(self, cell: dict[str, Any], footprint: dict[str, Any], there: bool) -> float:
        """P(report) for a cell: as good as the detector is, as well as the camera shows this cell."""
        if there:
            return self.p_tp * float(cell["p_tp"]) / float(footprint["p_tp"])
        return (1.0 - self.p_tn) * (1.0 - float(cell["p_tn"])) / (1.0 - float(footprint["p_tn"]))


def follow(client: httpx.Client, detector: Detector, rate_hz: float, patience_s: float) -> int:
    """Report frames until the run is over (0) or the service has been silent for `patience_s` (4).

    A report without an answer may have arrived or not, so it is sent again as it was: its id counts once.
    """
    heard, last_pose = time.monotonic(), None
    unanswered: dict[str, Any] | None = None
    period = 1.0 / rate_hz
    while True:
        began = time.monotonic()
        try:
            state = client.get("/api/state").raise_for_status().json()
            heard = began
            if state["state"] in ("DONE", "ABORTED"):
                return 0
            period = 1.0 / (rate_hz * state["speedup"])
            pose = state["pose"]
            if unanswered is None and pose is not None and pose["time"] != last_pose:
                last_pose = pose["time"]
                unanswered = detector.frame(state)
            if unanswered is not None:
                client.post("/api/reports", json=unanswered).raise_for_status()
                unanswered = None
        except httpx.HTTPError as error:
            if began - heard > patience_s:
                print(f"roisearch-sim detector: the service is gone ({error})", file=sys.stderr)
                return 4
            time.sleep(0.2)
        time.sleep(max(0.0, period - (time.monotonic() - began)))


def _point(text: str) -> Point:
    try:
        lat, lon = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not LAT,LON, such as 47.0512,8.3093") from None
    if not (-90 <= lat <= 90 and -180 <= lon <= 180):
        raise argparse.ArgumentTypeError(
            f"'{text}' is not on the globe; latitude comes first, then longitude"
        )
    return lat, lon


def _probability(text: str) -> float:
    value = float(text)
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a probability above 0")
    return value


def _token(file: str | None) -> str:
    """The bearer token: never an argument, which every user of the machine could read."""
    if file is None:
        return os.environ.get("ROISEARCH_TOKEN", "").strip()
    return Path(file).read_text(encoding="ascii").strip()


def main(arguments: list[str]) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="roisearch-sim detector",
        description="A simulated detector: follows the aircraft through the service's door and reports frames.",
    )
    parser.add_argument("--service", metavar="URL", required=True, help="where the service listens")
    parser.add_argument(
        "--target", metavar="LAT,LON", type=_point, help="where the target is (default: nowhere)"
    )
    parser.add_argument(
        "--p-tp", type=_probability, default=0.9, help="P(report | target there) (default 0.9)"
    )
    parser.add_argument(
        "--p-tn", type=_probability, default=0.9, help="P(no report | not there) (default 0.9)"
    )
    parser.add_argument(
        "--again", type=float, default=math.inf, metavar="S", help="look anew after so long (default: never)"
    )
    parser.add_argument("--rate", type=float, default=2.0, metavar="HZ", help="frames a second (default 2)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--token-file", metavar="FILE", help="file with a token of the service (default: $ROISEARCH_TOKEN)"
    )
    parser.add_argument(
        "--patience", type=float, default=10.0, metavar="S", help="give up on a silent service"
    )
    options = parser.parse_args(arguments)
    try:
        token = _token(options.token_file)
    except (OSError, UnicodeDecodeError) as error:
        print(f"roisearch-sim detector: the token cannot be read ({error})", file=sys.stderr)
        return 2
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    detector = Detector(options.target, options.p_tp, options.p_tn, options.seed, options.again)
    with httpx.Client(base_url=options.service, headers=headers, timeout=5.0) as client:
        try:
            return follow(client, detector, options.rate, options.patience)
        except KeyboardInterrupt:
            return 0

"""`roisearch-sim detector`: a simulated detector beside a running service, real or simulated flight.

It knows where the target is and nothing else. It follows the aircraft through the service's public door
(GET /api/state), draws what a camera with the given true-positive and true-negative probabilities would say about
each cell of the footprint, and reports it (POST /api/reports). Frames of one pass over a cell agree with each other, as
those of a real camera do: one draw decides the pass, and a miss turns into a hit only where a better view makes it one.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import threading
import time
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from service.errors import BadInput, Parser
from service.lockstep import Lockstep
from sim.sight import Point, Sight
from sim.target import Tour

_AGAIN_S = 0.001
LATE_S = 1.0
"""So late a frame may be before a simulator in lockstep waits for it: well within what counts as silence."""


def contains(corners: Sequence[Sequence[float]], point: Point) -> bool:
    """True when the convex quadrilateral `corners` ((lat, lon) in order) contains the point."""
    sides = []
    for (lat, lon), (lat2, lon2) in zip(corners, [*corners[1:], corners[0]], strict=True):
        sides.append((lat2 - lat) * (point[1] - lon) - (lon2 - lon) * (point[0] - lat))
    return all(side >= 0 for side in sides) or all(side <= 0 for side in sides)


class Detector:
    """Draws once per cell and pass. `target` is (lat, lon), or where it is so many seconds after the first look, or
    None when there is nothing to find."""

    def __init__(
        self,
        target: Point | Callable[[float], Point] | None,
        p_tp: float,
        p_tn: float,
        seed: int,
        again_s: float = math.inf,
        sight: Sight | None = None,
    ) -> None:
        """`again_s`: a cell that stays in view for so many seconds gets another draw (see sensor.hover_look_s).
        `sight`: what stands between the aircraft and the target, if anything does."""
        self._target, self.p_tp, self.p_tn = target, p_tp, p_tn
        self._first_look: float | None = None
        self._rng = np.random.default_rng(seed)
        self._again_s, self._sight = again_s, sight
        self._draws: dict[tuple[int, int], tuple[float, float]] = {}  # the draw, and when it was made
        self._hits: set[tuple[int, int]] = set()
        self._prefix = uuid.uuid4().hex[:12]
        self._count = 0

    def target_at(self, now: float) -> Point | None:
        """Where the target is."""
        if not callable(self._target):
            return self._target
        return self._target(0.0 if self._first_look is None else now - self._first_look)

    def frame(self, state: dict[str, Any]) -> dict[str, Any]:
        """The report of one frame, from the service's state. A frame between cells reports nothing seen."""
        footprint = state["footprint"]
        cells = {(cell["row"], cell["col"]): cell for cell in footprint["cells"]}
        for gone in self._draws.keys() - cells.keys():
            del self._draws[gone]
            self._hits.discard(gone)
        detections, now = [], state["pose"]["time"]
        if self._first_look is None and any(cell["counts"] for cell in cells.values()):
            self._first_look = now
        target = self._in_sight(state["pose"])
        for key, cell in cells.items():
            if not cell["counts"]:
                continue
            there = target is not None and contains(cell["corners"], target)
            draw, made = self._draws.get(key, (0.0, -math.inf))
            if key not in self._draws or now >= made + self._again_s:
                draw, made = self._draws[key] = float(self._rng.random()), now
                self._hits.discard(key)
            if draw < self._chance(cell, footprint, there):
                self._hits.add(key)
            if key in self._hits:
                lat, lon = target if there and target else (cell["lat"], cell["lon"])
                detections.append({"class": "target", "score": 0.9, "lat": lat, "lon": lon})
        self._count += 1
        return {
            "id": f"{self._prefix}-{self._count}",
            "source": "simulated",
            "captured_at": state["pose"]["time"],
            "clock": "service",
            "detections": detections,
        }

    def _in_sight(self, pose: dict[str, Any]) -> Point | None:
        """Where the target is, if no ground stands before it."""
        target = self.target_at(pose["time"])
        hidden = target is not None and self._sight is not None and not self._sight.reaches(pose, target)
        return None if hidden else target

    def _chance(self, cell: dict[str, Any], footprint: dict[str, Any], there: bool) -> float:
        """P(report) for a cell: as good as the detector is, as well as the camera shows this cell."""
        if there:
            return self.p_tp * float(cell["p_tp"]) / float(footprint["p_tp"])
        return (1.0 - self.p_tn) * (1.0 - float(cell["p_tn"])) / (1.0 - float(footprint["p_tn"]))


def of_aircraft(state: dict[str, Any], name: str) -> dict[str, Any]:
    """The state with pose and footprint of the aircraft of that name, nowhere while there is none; empty: of the only
    one."""
    if not name:
        return state
    own = next(
        (each for each in state["aircraft"] if each["name"] == name), {"pose": None, "footprint": None}
    )
    return {**state, "pose": own["pose"], "footprint": own["footprint"]}


def follow(
    client: httpx.Client,
    detector: Detector,
    rate_hz: float,
    patience_s: float,
    aircraft: str = "",
    lockstep: Lockstep | None = None,
) -> int:
    """Report frames until the run is over (0) or the service has been silent for `patience_s` (4).

    `aircraft`: whose camera it is, where several fly. `lockstep`: the time of a simulator, which waits for frames that
    are due.

    A report without an answer may have arrived or not, so it is sent again as it was: its id counts once.
    """
    if lockstep is not None:
        lockstep.content_for(0.0)
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
            state = of_aircraft(state, aircraft)
            pose = state["pose"]
            if unanswered is None and pose is not None and pose["time"] != last_pose:
                last_pose = pose["time"]
                whose = {"aircraft": aircraft, "source": f"simulated-{aircraft}"} if aircraft else {}
                unanswered = {**detector.frame(state), **whose}
            if unanswered is not None:
                client.post("/api/reports", json=unanswered).raise_for_status()
                unanswered = None
        except httpx.HTTPError as error:
            if began - heard > patience_s:
                print(f"roisearch-sim detector: the service is gone ({error})", file=sys.stderr)
                return 4
            time.sleep(0.2)
        left = max(0.0, period - (time.monotonic() - began))
        if lockstep is None:
            time.sleep(left)
        else:
            _wait(left / (period * rate_hz), lockstep)


def _wait(seconds: float, lockstep: Lockstep) -> None:
    """Wait so long in the simulator's time, which waits for us only when the next frame is late."""
    lockstep.content_for(seconds + LATE_S)
    due = lockstep.ticks() + seconds
    while lockstep.ticks() < due:
        time.sleep(_AGAIN_S)


def end_with_standard_input() -> None:
    """End this process when whoever started it is gone, killed or not: then our standard input closes."""

    def wait() -> None:
        while os.read(0, 1 << 12):
            pass
        os._exit(0)

    threading.Thread(target=wait, name="attached", daemon=True).start()


def _address(text: str) -> str:
    if not text.startswith(("http://", "https://")):
        raise argparse.ArgumentTypeError(f"'{text}' is no address; give http://HOST:PORT")
    return text


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


def _tour(text: str) -> Tour:
    """The walk of a file, whose places are latitude and longitude."""
    try:
        rows = np.array(json.loads(Path(text).read_text(encoding="utf-8")), dtype=np.float64)
    except (OSError, ValueError, TypeError) as error:
        raise argparse.ArgumentTypeError(f"{text} cannot be read as a walk ({error})") from None
    if rows.ndim != 2 or rows.shape[1] != 3 or not np.isfinite(rows).all() or (np.diff(rows[:, 0]) < 0).any():
        raise argparse.ArgumentTypeError(f"{text} is no list of [seconds, lat, lon], the earliest first")
    return Tour(rows[:, 0], rows[:, 1:])


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


def _sight(file: Path | None, home: Point | None) -> Sight | None:
    """Over the height model, when there is one; ValueError says what is missing or wrong."""
    if file is None:
        return None
    if home is None:
        raise ValueError("--ground needs --home LAT,LON: the place that the aircraft's heights count from")
    return Sight.over(file, home)


def main(arguments: list[str]) -> int:
    """The command line."""
    parser = Parser(
        prog="roisearch-sim detector",
        description="A simulated detector: follows the aircraft through the service's door and reports frames.",
    )
    parser.add_argument(
        "--service", metavar="URL", type=_address, required=True, help="where the service listens"
    )
    parser.add_argument(
        "--target", metavar="LAT,LON", type=_point, help="where the target is (default: nowhere)"
    )
    parser.add_argument(
        "--walk", metavar="FILE", type=_tour,
        help="where it walks instead: JSON, a list of [seconds since the first look, LAT, LON]",
    )  # fmt: skip
    parser.add_argument(
        "--p-tp", type=_probability, default=0.9, help="P(report | target there) (default 0.9)"
    )
    parser.add_argument(
        "--p-tn", type=_probability, default=0.9, help="P(no report | not there) (default 0.9)"
    )
    parser.add_argument(
        "--again", type=float, default=math.inf, metavar="S", help="look anew after so long (default: never)"
    )
    parser.add_argument(
        "--ground",
        metavar="FILE",
        type=Path,
        help="a height model: what it hides from the aircraft is not seen",
    )
    parser.add_argument(
        "--home", metavar="LAT,LON", type=_point, help="where heights count from, with --ground"
    )
    parser.add_argument("--aircraft", metavar="NAME", default="", help="whose camera, where several fly")
    parser.add_argument("--rate", type=float, default=2.0, metavar="HZ", help="frames a second (default 2)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--token-file", metavar="FILE", help="file with a token of the service (default: $ROISEARCH_TOKEN)"
    )
    parser.add_argument(
        "--patience", type=float, default=10.0, metavar="S", help="give up on a silent service"
    )
    parser.add_argument(
        "--lockstep", metavar="FILE", type=Path, help="where the mock autopilot keeps its time"
    )
    parser.add_argument("--attached", action="store_true", help="end when standard input closes")
    options = parser.parse_args(arguments)
    if options.attached:
        end_with_standard_input()
    try:
        token = _token(options.token_file)
    except (OSError, UnicodeDecodeError) as error:
        print(f"roisearch-sim detector: the token cannot be read ({error})", file=sys.stderr)
        return 2
    try:
        sight = _sight(options.ground, options.home)
        lockstep = Lockstep(options.lockstep) if options.lockstep else None
    except (ValueError, BadInput) as error:
        print(f"roisearch-sim detector: {error}", file=sys.stderr)
        return 2
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    target = options.target if options.walk is None else options.walk.at
    detector = Detector(target, options.p_tp, options.p_tn, options.seed, options.again, sight)
    with httpx.Client(base_url=options.service, headers=headers, timeout=5.0) as client:
        try:
            return follow(client, detector, options.rate, options.patience, options.aircraft, lockstep)
        except KeyboardInterrupt:
            return 0

"""Searches that outlive batteries, processes and aircraft, flown by real processes with a mock autopilot.

Each search is of a square with a launch point beside it, flown by a `roisearch-service` with one battery after
another. With trouble the service is killed on the ground as soon as the first sortie has landed, and killed in the air
in the second; after the third another aircraft (system id, flavour) takes the place of the first, by an operator's
order and without a restart. The target is told to the detector after the third sortie: it is drawn from the belief as
it is then, which is how a target is distributed that three sorties have not found. So every search needs four sorties
at least.

`sorties_campaign` flies many of them and judges by what their journals tell.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from sim.autopilot.control import Control
from sim.autopilot.process import AutopilotProcess
from sim.soak.process import Process
from sim.target import draw_target

ORIGIN = (47.05, 8.3)
SETTINGS = """
[link]
lockstep = "{lockstep}"
[run]
next_sortie_within_s = 360000
[flight]
max_flight_s = 36000
full_battery_s = {full_s}
[sensor]
cell_m = 25
p_tn = 0.99
[search]
stop_at_pos = 0.999999
"""
OTHER = {"px4": "ardupilot", "ardupilot": "px4"}
HIDDEN = 3
"""Sorties after which there is a target."""
KILLED_ALOFT_AFTER = 12
"""Steps of the second sortie after which the service is killed in the air."""
OTHER_SYSTEM = 7
"""The system id of the second aircraft."""
FLYING = ("SEARCHING", "CONFIRMING")
ENDING_S = 60.0  # wall time that a service takes to end whose door is shut
LAUNCHES = 3
"""So often a launch is ordered until it is given up."""
LOST = 1e-9
WITHIN_CELLS = 1.5
TROUBLES = ("killed on the ground", "killed in the air", "another aircraft")
"""What is done to a search with trouble, in this order."""


@dataclass(frozen=True)
class Search:
    """One search to fly: the square's side in metres, the battery's minutes, and whether there is trouble."""

    flavor: str
    seed: int
    side_m: float
    battery_min: float
    trouble: bool
    speedup: float
    patience_s: float


@dataclass
class Outcome:
    """How a search ended: exit code, report, what went wrong, if anything did, and the POS after each sortie."""

    search: Search
    code: int = -1
    report: dict[str, Any] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)
    pos: list[float] = field(default_factory=list)
    troubles: list[str] = field(default_factory=list)
    error_cells: float = math.inf
    wall_s: float = 0.0

    @property
    def sorties(self) -> list[dict[str, Any]]:
        """The flights from take-off to landing."""
        return list(self.report.get("sorties", []))

    @property
    def good(self) -> bool:
        """It was found where the target is, after four sorties or more, all trouble came, and nothing was lost."""
        there = self.code == 0 and self.error_cells <= WITHIN_CELLS
        troubles = TROUBLES if self.search.trouble else ()
        return there and not self.wrong and len(self.sorties) > HIDDEN and tuple(self.troubles) == troubles


class LongSearch:
    """A search under way: the service that flies it now, its door and its detector."""

    def __init__(self, search: Search, folder: Path, stack: ExitStack) -> None:
        self.search, self.folder, self.flown = search, folder, Outcome(search)
        self._stack = stack
        folder.mkdir(parents=True, exist_ok=True)
        self.area, self.settings = folder / "area.geojson", folder / "settings.toml"
        self.area.write_text(json.dumps(area_of(search.side_m)), encoding="utf-8")
        self.lockstep = folder / "time"
        said = SETTINGS.format(lockstep=self.lockstep, full_s=60.0 * search.battery_min)
        self.settings.write_text(said, encoding="utf-8")
        self.target: tuple[float, float] | None = None
        self._service: Process | None = None
        self._detector: Process | None = None
        self._door: httpx.Client | None = None
        self.aircraft(search.flavor, 1)

    # ---- what takes part

    def aircraft(self, flavor: str, system_id: int) -> None:
        """An aircraft stands at the launch point."""
        options = [f"--home={ORIGIN[0]:.7f},{ORIGIN[1]:.7f},400", "--sysid", str(system_id)]
        options += ["--seed", str(self.search.seed), "--endurance", f"{self.search.battery_min:g}"]
        options += ["--swap-battery", "20", "--control", "127.0.0.1:0", "--lockstep", str(self.lockstep)]
        mock = self._stack.enter_context(
            AutopilotProcess(flavor, speedup=self.search.speedup, options=options)
        )
        self.url = mock.url.replace("udpin", "udpout")
        assert mock.control is not None
        self._mock = self._stack.enter_context(Control(mock.control))

    def another_aircraft(self) -> None:
        """Another one, of the other flavour, stands there instead, and an operator says so; the search goes on as it
        is."""
        before = self.pos()
        self._mock.replace(OTHER[self.search.flavor], OTHER_SYSTEM)
        self.order("replace", system_id=OTHER_SYSTEM)
        assert self._service is not None
        self._service.wait_for(f"another aircraft, system {OTHER_SYSTEM} ", self.search.patience_s)
        self.troubles("another aircraft")
        self.never_less(before, "with another aircraft")

    def start(self, *more: str) -> None:
        """Start the service, for the aircraft that is there, and a detector."""
        words = ["service", *more, "--connect", self.url, "--takeoff", "--http", "127.0.0.1:0"]
        words += ["--speedup", f"{self.search.speedup:g}"]
        self._service = self._stack.enter_context(gone_at_the_end(words))
        address = self._service.wait_for(r"listening on (http://\S+)", self.search.patience_s)[1]
        self._door = self._stack.enter_context(httpx.Client(base_url=address, timeout=60.0))
        self.look()

    def look(self) -> None:
        """Start a detector, in the place of the one before."""
        if self._detector is not None:
            self._detector.stop()
        assert self._door is not None
        words = ["sim", "detector", "--attached", "--service", str(self._door.base_url), "--p-tn", "0.99"]
        words += ["--seed", str(self.search.seed), "--lockstep", str(self.lockstep)]
        if self.target is not None:
            words.append(f"--target={self.target[0]:.7f},{self.target[1]:.7f}")
        self._detector = self._stack.enter_context(gone_at_the_end(words))

    def begin(self) -> None:
        """The search's first process."""
        self.start("--area", str(self.area), "--runs", str(self.folder / "runs"), "--config", str(self.settings),
                   "--seed", str(self.search.seed))  # fmt: skip

    def kill(self, where: str) -> None:
        """Kill the service, and start it again where it was; what is known must be the same."""
        before = self.pos()
        assert self._service is not None
        self._mock.speedup(1.0)  # a start takes wall seconds, of which a battery would not last many
        self._service.process.kill()
        self._service.process.wait()
        self.start("--resume", str(self.run))
        self._mock.speedup(self.search.speedup)
        self.troubles(where)
        self.never_less(before, where)

    # ---- what is seen of it

    @property
    def run(self) -> Path:
        """The run's folder."""
        (run,) = (path.parent for path in (self.folder / "runs").glob("*/journal.sqlite"))
        return run

    def state(self) -> dict[str, Any]:
        """What the service says of itself."""
        assert self._door is not None
        told: dict[str, Any] = self._door.get("/api/state").raise_for_status().json()
        return told

    def pos(self) -> float:
        """The probability of success so far."""
        return float(self.state()["pos"])

    def order(self, command: str, **more: Any) -> None:
        """An operator's order. ValueError when it is refused."""
        assert self._door is not None
        answer = self._door.post("/api/commands", json={"command": command, **more}).raise_for_status().json()
        if "refused" in answer:
            raise ValueError(f"{command} is refused: {answer['refused']}")

    def launch(self) -> None:
        """Take off and search. What comes to nothing on the ground is ordered again, as a person would; ValueError when
        it does time after time."""
        for _ in range(LAUNCHES):
            self.order("launch")
            self.waits(lambda told: told["state"] in ("TAKEOFF", *FLYING))
            self.waits(lambda told: told["state"] != "TAKEOFF")
            if self.ended() or (came := self.state())["state"] in FLYING:
                return
            if came["state"] != "YIELDED":
                break
        raise ValueError(f"the launch came to nothing: {came['state']}, {came['why']}")

    def ended(self) -> bool:
        """The service has ended."""
        assert self._service is not None
        return self._service.process.poll() is not None

    def ends(self) -> bool:
        """The service ends within a while, if it has not yet."""
        deadline = time.monotonic() + ENDING_S
        while not self.ended() and time.monotonic() < deadline:
            time.sleep(0.2)
        return self.ended()

    def waits(self, until: Callable[[dict[str, Any]], bool]) -> bool:
        """Wait for something to be told; False when the search ended before. AssertionError when nothing comes."""
        deadline = time.monotonic() + self.search.patience_s
        while not self.ended():
            try:
                if until(self.state()):
                    return True
            except httpx.TransportError:
                time.sleep(0.2)  # it is ending
                continue
            except httpx.HTTPStatusError as error:
                if error.response.status_code != httpx.codes.SERVICE_UNAVAILABLE:
                    raise
                time.sleep(0.2)  # it is ending, or behind
                continue
            said = "" if self._service is None else self._service.said[-2000:]
            assert time.monotonic() < deadline, f"nothing for {self.search.patience_s:g} s:\n{said}"
            time.sleep(0.1)
        return False

    def lands(self, sortie: int) -> bool:
        """Wait until so many sorties are over; False when the search ended before."""
        return self.waits(lambda told: told["state"] == "GROUNDED" and len(told["sorties"]) >= sortie)

    def never_less(self, before: float, when: str) -> None:
        """POS is what it was, or more."""
        after = self.pos()
        if after < before - LOST:
            self.flown.wrong.append(f"POS {before:.6f} became {after:.6f} {when}")

    def troubles(self, what: str) -> None:
        """Write down what was done to it."""
        self.flown.troubles.append(what)

    def hide(self) -> None:
        """Put a target where the belief has it, and tell the detector."""
        from service.config import read_settings
        from service.survey import survey

        assert self._door is not None
        told = self._door.get("/api/map").raise_for_status().json()["probability"]
        belief = np.array([[cell or 0.0 for cell in row] for row in told])
        where = draw_target(belief / belief.sum(), np.random.default_rng(self.search.seed))
        _, grid = survey(self.area, None, read_settings(self.settings, environment={}))
        self.cell = where
        lat, lon = grid.frame.to_latlon(np.array([where]) - 0.5)[0]
        self.target = float(lat), float(lon)
        self._cells = grid.frame
        self.look()

    def end(self) -> Outcome:
        """Wait for the end and judge it."""
        assert self._service is not None
        flown = self.flown
        flown.code = self._service.exit_code(self.search.patience_s)
        (report,) = (self.folder / "runs").glob("*/report.json")
        flown.report = json.loads(report.read_text(encoding="utf-8"))
        flown.pos = [each["pos"] for each in flown.sorties]
        numbers = [each["number"] for each in flown.sorties]
        if numbers != list(range(1, len(numbers) + 1)):
            flown.wrong.append(f"the sorties are numbered {numbers}")
        place = flown.report.get("position")
        if place and self.target is not None:
            at = self._cells.to_metres([(place["lat"], place["lon"]), self.target])
            flown.error_cells = float(np.hypot(*(at[0] - at[1]))) / self._cells.cell_m
        return flown


def fly(search: Search, folder: Path, told: Callable[[str], None] = lambda said: None) -> Outcome:
    """Fly one search to its end; `told` hears how far it has come."""
    began = time.monotonic()
    with ExitStack() as stack:
        flight = LongSearch(search, folder, stack)
        try:
            flight.begin()
            try:
                after_sorties(flight, told)
            except httpx.TransportError:  # found on the ground, by a report that came after the landing
                if not flight.ends():
                    raise
            flight.end()
        except (AssertionError, httpx.HTTPError, ValueError) as error:
            flight.flown.wrong.append(str(error))
        flight.flown.wall_s = time.monotonic() - began
        return flight.flown


def after_sorties(flight: LongSearch, told: Callable[[str], None]) -> None:
    """Send it up again after each landing, until the search has ended."""
    sortie = 1
    while flight.lands(sortie):
        told(f"sortie {sortie} landed, POS {flight.pos():.1%}")
        between(flight, sortie)
        sortie += 1


def between(flight: LongSearch, sortie: int) -> None:
    """What happens after a sortie, until the next one flies."""
    trouble = flight.search.trouble
    if trouble and sortie == 1:
        flight.kill("killed on the ground")
        flight.lands(sortie)
    if sortie == HIDDEN:
        if trouble:
            flight.another_aircraft()
        flight.hide()
    flight.waits(lambda told: (told["battery_percent"] or 0.0) >= 95.0)
    steps = flight.state()["steps"]
    flight.launch()
    if trouble and sortie == 1:
        far = steps + KILLED_ALOFT_AFTER
        flight.waits(lambda told: told["steps"] >= far or told["state"] == "GROUNDED")
        if flight.state()["state"] == "GROUNDED":
            raise ValueError(
                f"the second sortie was over before {KILLED_ALOFT_AFTER} steps: give a longer battery"
            )
        flight.kill("killed in the air")
        flight.waits(lambda told: told["state"] in FLYING)


def area_of(side_m: float) -> dict[str, Any]:
    """A square of so many metres, even in prior but for a hill, with the launch point in its south-west corner."""
    lat, lon = ORIGIN
    down = side_m / 111_194.93
    right = down / math.cos(math.radians(lat))
    ring = [(lon, lat), (lon + right, lat), (lon + right, lat + down), (lon, lat + down), (lon, lat)]

    def feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
        geometry = {"type": kind, "coordinates": coordinates}
        return {"type": "Feature", "properties": properties, "geometry": geometry}

    hill = [lon + 0.6 * right, lat + 0.6 * down]
    return {
        "type": "FeatureCollection",
        "features": [
            feature("Polygon", [ring], name="square"),
            feature("Polygon", [ring], role="prior", weight=2),
            feature("Point", hill, role="prior", sigma_m=0.15 * side_m, weight=1),
            feature("Point", [lon, lat], role="launch"),
        ],
    }


@contextmanager
def gone_at_the_end(words: Sequence[str], environment: Mapping[str, str] | None = None) -> Iterator[Process]:
    """A process that is gone at the end of the block, whatever happens. `environment` adds to our own."""
    process = Process(words, environment)
    try:
        yield process
    finally:
        process.stop()

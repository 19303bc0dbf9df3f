"""The embedded default: a mock autopilot and a simulated detector, each a process of its own.

This is the one place where the service knows the simulated world.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.area import Grid
from service.config import SensorSettings, Settings, each_aircraft
from service.errors import BadInput
from service.geometry import LatLon
from service.lockstep import Lockstep

GROUND_AMSL_M = 120.0
WALKS_S = 6 * 3600.0
"""How long a target walks in this world."""


@dataclass
class DemoWorld:
    """The processes that stand in for the world, and where the target is.

    `target`: where it sets out from; `way`, float [n, 3]: where it walks, if it does, as rows of seconds since the
    first look, latitude and longitude.
    """

    target: LatLon | None
    settings: Settings
    lockstep: Lockstep | None = None
    """The time of this world, which the first mock keeps."""
    urls: list[str] = field(default_factory=list)
    """Of the mock autopilots, in the order of the aircraft."""
    processes: list[asyncio.subprocess.Process] = field(default_factory=list)
    """The autopilots, and then the detectors, both in that order."""
    way: NDArray[np.float64] | None = None
    _file: Path | None = None
    _gone: list[asyncio.subprocess.Process] = field(default_factory=list)

    def target_at(self, seconds: float) -> LatLon | None:
        """Where the target is so long after the first look."""
        if self.way is None:
            return self.target
        lat, lon = (float(np.interp(seconds, self.way[:, 0], self.way[:, axis])) for axis in (1, 2))
        return lat, lon

    @classmethod
    async def start(cls, grid: Grid, settings: Settings, lockstep: Lockstep | None = None) -> DemoWorld:
        """Draw a target from the prior, if there is to be one, and start the mock autopilots at the launch point.

        Raises BadInput when one does not start.
        """
        world = cls(draw(grid, settings.run.seed) if settings.demo.target else None, settings, lockstep)
        if world.target is not None and grid.walk is not None:
            world.way = draw_way(grid, world.target, settings.run.seed)
        for number, alone in enumerate(each_aircraft(settings).values()):
            await world._start_autopilot(grid, alone, number)
        return world

    async def _start_autopilot(self, grid: Grid, settings: Settings, number: int) -> None:
        """Start the mock of one aircraft, with a system id and a seed of its own."""
        lat, lon = grid.launch
        amsl = GROUND_AMSL_M if grid.relief is None else grid.relief.launch_amsl_m
        demo = settings.demo
        words = ["autopilot", "--attached", "--flavor", demo.flavor, "--listen", "udpin://127.0.0.1:0"]
        words += [f"--home={lat:.7f},{lon:.7f},{amsl:.1f}", "--speedup", f"{settings.speedup:g}"]
        words += ["--seed", str(settings.run.seed + number), "--endurance", f"{demo.endurance_min:g}"]
        words += ["--lockstep", str(self.lockstep.file)] if self.lockstep else []
        words += ["--swap-battery", f"{demo.swap_battery_s:g}", "--sysid", str(number + 1)]
        for file in settings.ground_files[:1]:
            words += ["--ground", file]
        process = await self.spawn(words)
        assert process.stdout is not None
        while line := (await process.stdout.readline()).decode():
            if line.startswith("listening on "):
                self.urls.append(line.split()[-1].replace("udpin://", "udpout://"))
                return
        await self.stop()
        raise BadInput("the built-in mock autopilot did not start; run 'roisearch-sim autopilot --help'")

    async def start_detectors(self, service_url: str, aircraft: Sequence[str], token: str = "") -> None:
        """Start the detector of each aircraft, with a token if the door wants one; they end by themselves when the run
        is over."""
        own = each_aircraft(self.settings).values()
        for number, (name, alone) in enumerate(zip(aircraft, own, strict=True)):
            whose = ["--aircraft", name] if len(aircraft) > 1 else []
            seed = ["--seed", str(self.settings.run.seed + number)]
            await self._start_detector(service_url, alone.sensor, [*whose, *seed], token)

    async def _start_detector(
        self, service_url: str, sensor: SensorSettings, more: Sequence[str], token: str
    ) -> None:
        place = [f"--target={self.target[0]:.7f},{self.target[1]:.7f}"] if self.target else []
        chances = ["--p-tp", f"{sensor.p_tp}", "--p-tn", f"{sensor.p_tn}"]
        if self.way is not None:
            if self._file is None:
                with tempfile.NamedTemporaryFile("w", suffix=".json", delete=False) as file:
                    json.dump(self.way.tolist(), file)
                self._file = Path(file.name)
            place = ["--walk", str(self._file)]
        again = ["--again", f"{sensor.hover_look_s}"] if sensor.hover_look_s else []
        pace = ["--lockstep", str(self.lockstep.file)] if self.lockstep else []
        words = ["detector", "--attached", "--service", service_url, *place, *chances, *more, *again, *pace]
        await self.spawn(words, token)

    async def spawn(self, words: Sequence[str], token: str = "") -> asyncio.subprocess.Process:
        """Start one `roisearch-sim` command; it ends when our end of its standard input closes.

        It gets no token of ours but the one given, and that in its environment: arguments are for all to see.
        """
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ROISEARCH_")}
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "sim",
            *words,
            env={**environment, "ROISEARCH_TOKEN": token},
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE if words[0] == "autopilot" else None,
            pass_fds=self.lockstep.to_pass if self.lockstep else (),
            start_new_session=True,  # Ctrl-C is for the service, which flies home first
        )
        self.processes.append(process)
        return process

    async def ended(self) -> tuple[str, int]:
        """Wait until one more of the processes ends by itself; returns which, and of which aircraft, counted from 0."""
        waits = {asyncio.create_task(each.wait()): each for each in self.processes if each not in self._gone}
        try:
            done, _ = await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for wait in waits:
                wait.cancel()
        gone = next(each for each in self.processes if any(waits[wait] is each for wait in done))
        self._gone.append(gone)
        number, count = self.processes.index(gone), len(self.urls)
        return "the mock autopilot" if number < count else "the simulated detector", number % count

    async def stop(self) -> None:
        """End what is still running."""
        if self._file is not None:
            self._file.unlink(missing_ok=True)
        for process in self.processes:
            if process.returncode is None:
                with contextlib.suppress(ProcessLookupError):
                    process.terminate()
        for process in self.processes:
            await process.wait()


def draw(grid: Grid, seed: int) -> LatLon:
    """A target drawn from the prior over the cells that the aircraft can get to: this world has something to find."""
    from sim.target import draw_target

    reachable = np.where(grid.flyable, grid.prior, 0.0)
    where = draw_target(reachable / reachable.sum(), np.random.default_rng(seed))
    lat, lon = grid.frame.to_latlon(np.array([where]) - 0.5)[0]
    return float(lat), float(lon)


def draw_way(grid: Grid, start: LatLon, seed: int) -> NDArray[np.float64]:
    """A walk of a target from `start` over what is searched and can be flown over, by the grid's walk, float [n, 3]."""
    from sim.target import draw_tour

    assert grid.walk is not None
    row, col = grid.frame.to_metres([start])[0][::-1] / grid.frame.cell_m
    rng = np.random.default_rng((seed, 1))
    tour = draw_tour((row, col), grid.walk, grid.searchable & grid.flyable, WALKS_S, rng)
    return np.column_stack([tour.seconds, grid.frame.to_latlon(tour.places - 0.5)])

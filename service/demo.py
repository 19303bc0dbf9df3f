"""The embedded default: a mock autopilot and a simulated detector, each a process of its own.

This is the one place where the service knows the simulated world.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from service.area import Grid
from service.config import Settings
from service.errors import BadInput

LatLon = tuple[float, float]
GROUND_AMSL_M = 120.0


@dataclass
class World:
    """The processes that stand in for the world, and where the target is."""

    target: LatLon
    url: str
    settings: Settings
    processes: list[asyncio.subprocess.Process] = field(default_factory=list)

    @classmethod
    async def start(cls, grid: Grid, settings: Settings) -> World:
        """Draw a target from the prior and start the mock autopilot at the launch point."""
        world = cls(draw(grid, settings.run.seed), "", settings)
        lat, lon = grid.launch
        demo = settings.demo
        words = ["autopilot", "--attached", "--flavor", demo.flavor, "--listen", "udpin://127.0.0.1:0"]
        words += [f"--home={lat:.7f},{lon:.7f},{GROUND_AMSL_M:.0f}", "--speedup", f"{settings.speedup:g}"]
        words += ["--seed", str(settings.run.seed), "--endurance", f"{demo.endurance_min:g}"]
        process = await world.spawn(words)
        assert process.stdout is not None
        while line := (await process.stdout.readline()).decode():
            if line.startswith("listening on "):
                world.url = line.split()[-1].replace("udpin://", "udpout://")
                return world
        await world.stop()
        raise BadInput("the built-in mock autopilot did not start; run 'roisearch-sim autopilot --help'")

    async def start_detector(self, service_url: str, token: str = "") -> None:
        """Start the detector, with a token if the door wants one; it ends by itself when the run is over."""
        sensor = self.settings.sensor
        place = [f"--target={self.target[0]:.7f},{self.target[1]:.7f}"]
        chances = ["--p-tp", f"{sensor.p_tp}", "--p-tn", f"{sensor.p_tn}"]
        seed = ["--seed", str(self.settings.run.seed)]
        seed += ["--again", f"{sensor.hover_look_s}"] if sensor.hover_look_s else []
        await self.spawn(["detector", "--service", service_url, *place, *chances, *seed], token)

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
            start_new_session=True,  # Ctrl-C is for the service, which flies home first
        )
        self.processes.append(process)
        return process

    async def ended(self) -> str:
        """Wait until one of the processes ends by itself; returns which."""
        waits = [asyncio.create_task(process.wait()) for process in self.processes]
        try:
            done, _ = await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
            return "the mock autopilot" if waits[0] in done else "the simulated detector"
        finally:
            for wait in waits:
                wait.cancel()

    async def stop(self) -> None:
        """End what is still running."""
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

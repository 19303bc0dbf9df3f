"""The other aircraft of a soak's flight: mocks beside the one that the faults befall, each with a detector of its own.

They start a few metres from the launch point. What is judged of them is that no two aircraft ever come too near, and
that all are on the ground in the end.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from sim.autopilot.process import AutopilotProcess
from sim.separation import Separation, Watching, side_by_side
from sim.soak import ground
from sim.soak.process import Process

STARTS_M = 6.0
FLAVORS = ("ardupilot", "px4")


class Wing:
    """The aircraft 2 to `number` of a flight, and the judge of all.

    Args:
        stack: what ends them.
        control: the control socket of the first.
        lockstep: where the first keeps its time.
        over: the mocks' words for the ground below.
    """

    def __init__(
        self,
        number: int,
        stack: ExitStack,
        *,
        speedup: float,
        seed: int,
        control: str,
        lockstep: Path,
        over: list[str],
    ) -> None:
        self._stack, self._seed, self._lockstep = stack, seed, lockstep
        self.judge = Separation()
        self.names = [str(each) for each in range(2, number + 1)]
        self._detectors: list[Process] = []
        controls, self.words = {"1": control}, list[str]()
        for name, place in zip(self.names, side_by_side(ground.launch(), number, STARTS_M)[1:], strict=True):
            home = f"--home={place[0]:.7f},{place[1]:.7f},{ground.GROUND_AMSL_M:g}"
            options = [home, "--ready-after", "3", "--control", "127.0.0.1:0", "--sysid", name]
            options += [
                "--seed",
                str(seed + int(name)),
                "--endurance",
                f"{ground.ENDURANCE_S / 60.0:g}",
                "--lockstep",
                str(lockstep),
                *over,
            ]
            flavor = FLAVORS[(seed + int(name)) % len(FLAVORS)]
            mock = stack.enter_context(AutopilotProcess(flavor, speedup=speedup, options=options))
            controls[name] = str(mock.control)
            self.words += ["--connect", mock.url.replace("udpin", "udpout")]
        self._watching = stack.enter_context(Watching(controls, self.judge))
        stack.callback(self.look_away)

    def look(self, url: str) -> None:
        """Let a detector of each report to a service."""
        self.look_away()
        for name in self.names:
            words = ["sim", "detector", "--attached", "--service", url, "--aircraft", name, "--p-tn", "0.97"]
            words += ["--seed", str(self._seed + int(name)), "--lockstep", str(self._lockstep)]
            self._detectors.append(Process(words))

    def look_away(self) -> None:
        """The service that they reported to is gone."""
        while self._detectors:
            self._detectors.pop().stop()

    def aloft(self) -> list[str]:
        """Which of them are armed now."""
        last = self._watching.last
        return [name for name in self.names if name in last and last[name]["armed"]]

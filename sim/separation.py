"""The judge of several aircraft in one sky: by where they truly are, whatever they tell.

Two that both fly, with less height between them than the layers leave, must be as far apart on the ground as the
settings say. It knows nothing of how the service sees to that.

The mocks are asked one after the other, and on a busy machine with a clock that runs fast an aircraft flies ten metres
between two answers. So of two the first is asked again after the second: where it was meanwhile lies between its two
answers, and only what is too near from both of them is a violation.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping, Sequence
from itertools import combinations
from types import TracebackType
from typing import Any

from sim.autopilot.control import Control

_METRES_PER_DEGREE = 111_194.93
GAP_M = 6.5
"""Of a layer of 10 m; what flies about its height may leave a little less than it is allowed to plan with."""
STANDS_S, STILL_MPS = 8.0, 1.0
NEARER_M = 1.0
"""Who is given back too near to another one may come so much nearer before they are apart: what hovers sways."""
EVERY_S = 0.01  # wall time


class Separation:
    """Compares true places at one moment; each time that two come too near is one violation, however long it lasts.

    Args:
        separation_m: the least distance on the ground, unless
        gap_m: one is so much higher.
    """

    def __init__(self, separation_m: float = 20.0, gap_m: float = GAP_M) -> None:
        self._separation_m, self._gap_m = separation_m, gap_m
        self._near: dict[tuple[str, str], int] = {}  # the violation under way of each pair
        self.violations: list[str] = []
        self.nearest_m = math.inf
        """The nearest that two of no more than `gap_m` between their heights came."""
        self.taken: frozenset[str] = frozenset()
        """Who may be flown by somebody else just now, a pilot or a failsafe: it goes where it goes, and whoever comes
        too near to it has to stand still within STANDS_S."""
        self._since: dict[tuple[str, str], float] = {}
        # as near as others had brought a pair, in metres: it comes no nearer
        self._given_back: dict[tuple[str, str], float] = {}
        self.together = 0
        """Moments at which two were in the air, which is when there was something to judge."""

    def see(
        self, moment: Mapping[str, Mapping[str, Any]], again: Mapping[str, Mapping[str, Any]] | None = None
    ) -> None:
        """Take in where all of them are: the control socket's state of each, by name, in the order in which they were
        asked, and of those who were asked again after that; by default all were asked at once."""
        again = again or moment
        flying = {
            name: state
            for name, state in moment.items()
            if "ON_GROUND" not in (state["landed"], again[name]["landed"])
        }
        self.together += len(flying) > 1
        for first, second in combinations(flying, 2):
            self._pair(first, second, (flying[first], again[first]), flying[second])
        for pair in [pair for pair in {*self._near, *self._since} if not set(pair) <= flying.keys()]:
            self._over(pair)

    def _pair(
        self,
        first: str,
        second: str,
        around: tuple[Mapping[str, Any], Mapping[str, Any]],
        b: Mapping[str, Any],
    ) -> None:
        a = max(around, key=lambda each: _apart_m(each, b))
        gap, metres = max(abs(each["up"] - b["up"]) for each in around), _apart_m(a, b)
        if gap >= self._gap_m or metres >= 2.0 * self._separation_m:
            self._over((first, second))
            self._given_back.pop((first, second), None)
            return
        self.nearest_m = min(self.nearest_m, metres)
        if metres >= self._separation_m:
            self._since.pop((first, second), None)
            self._given_back.pop((first, second), None)
            return
        if self.taken & {first, second}:
            if self._stands((first, second), around[1], b):
                self._given_back[first, second] = metres
                return
        elif metres > self._given_back.get((first, second), math.inf) - NEARER_M:
            return
        said = (
            f"aircraft {first} and {second} were {metres:.1f} m apart, {a['up']:.1f} and {b['up']:.1f} m high"
        )
        said += f" ({a['mode']} and {b['mode']}), at {a['time']:.0f} s"
        if (first, second) not in self._near:
            self._near[first, second] = len(self.violations)
            self.violations.append(said)

    def _over(self, pair: tuple[str, str]) -> None:
        """An encounter is: the next one is another, with a grace of its own."""
        self._near.pop(pair, None)
        self._since.pop(pair, None)

    def _stands(self, pair: tuple[str, str], a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
        """Of two, one of whom may be flown by somebody else, the other stands, or came too near only just now."""
        since = self._since.setdefault(pair, a["time"])
        others = [state for name, state in zip(pair, (a, b), strict=True) if name not in self.taken]
        return a["time"] - since < STANDS_S or all(state["speed"] < STILL_MPS for state in others)


class Watching:
    """Asks mocks for the truth all the time; use as a context manager. `controls`: the control sockets, by name."""

    def __init__(self, controls: Mapping[str, str], judge: Separation) -> None:
        self._controls = {name: Control(url) for name, url in controls.items()}
        self.judge, self.last = judge, dict[str, Mapping[str, Any]]()
        self._open = True
        self._thread = threading.Thread(target=self._watch, name="separation", daemon=True)

    def __enter__(self) -> Watching:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open = False
        self._thread.join()
        for control in self._controls.values():
            control.close()

    def _watch(self) -> None:
        while self._open:
            asked: dict[str, Mapping[str, Any]] = {
                name: control.state() for name, control in self._controls.items()
            }
            if self.last:
                self.judge.see(self.last, asked)
            self.last = asked
            time.sleep(EVERY_S)


def _apart_m(a: Mapping[str, Any], b: Mapping[str, Any]) -> float:
    narrow = math.cos(math.radians((a["latitude"] + b["latitude"]) / 2.0))
    return _METRES_PER_DEGREE * math.hypot(
        a["latitude"] - b["latitude"], (a["longitude"] - b["longitude"]) * narrow
    )


def side_by_side(home: tuple[float, float], number: int, metres: float) -> Sequence[tuple[float, float]]:
    """Places to start from, so many metres east of one another."""
    narrow = _METRES_PER_DEGREE * math.cos(math.radians(home[0]))
    return [(home[0], home[1] + index * metres / narrow) for index in range(number)]

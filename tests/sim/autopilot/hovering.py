"""A mock that hovers, with its ground station, for the tests of its faults."""

from __future__ import annotations

from typing import Any

import pytest

from sim.autopilot.faults import Fault
from sim.autopilot.settings import Settings
from tests.conformance.dialogue import Dialogue
from tests.conformance.wire import Lockstep
from tests.fixtures_autopilot import flavor

__all__ = ["Flight", "flavor", "flight"]

RETURN = {"px4": "AUTO_RTL", "ardupilot": "RTL"}
LAND = {"px4": "AUTO_LAND", "ardupilot": "LAND"}


class Flight(Dialogue):
    """A mock that hovers at 20 m, or stands ready on the ground, with its ground station."""

    def __init__(self, flavor: str, *, hovers: bool = True, settings: Settings | None = None) -> None:
        self.lockstep = Lockstep(settings or Settings(flavor=flavor, seed=3))
        self.autopilot = self.lockstep.autopilot
        super().__init__(self.lockstep, flavor)
        if not hovers:
            self.on_ground()
            self.begin()
            return
        self.in_air()
        self.begin()
        self.origin_home()

    def fault(self, kind: str, **options: Any) -> None:
        """Let a fault come now; what was on the wire before is gone."""
        self.lockstep.drain()
        self.autopilot.faults.add(Fault.of({"kind": kind, **options}))

    def heard(self, seconds: float) -> list[Any]:
        """Everything on the wire for some time, from whomever."""
        until, found = self.now + seconds, []
        while self.now < until:
            message = self.wire.read()
            if message is not None:
                found.append(message)
        return found

    def count(self, kind: str, seconds: float = 4.0) -> int:
        """How many messages of a kind come in some time."""
        return sum(message.get_type() == kind for message in self.heard(seconds))

    @property
    def status(self) -> Any:
        """The latest SYS_STATUS."""
        return self.latest["SYS_STATUS"]

    def said(self, words: str) -> bool:
        """Has it said something with these words?"""
        return any(words in text for text in self.texts)


@pytest.fixture
def flight(flavor: str) -> Flight:
    """A flight of each flavour."""
    return Flight(flavor)

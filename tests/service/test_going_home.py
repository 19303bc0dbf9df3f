"""The way home: ours around the exclusions, then the autopilot's own."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any, cast

from service.mission.mission import Mission
from service.mission.states import Event, State


class Homebound:
    """As much of a mission as flying home asks of."""

    def __init__(self) -> None:
        self.did: list[str] = []
        self.state = State.RETURNING
        self.helm = SimpleNamespace(
            route=lambda home: [(1.0, 1.0), home],
            home=lambda: (0.0, 0.0),
            rest=lambda: self.did.append("rest"),
        )
        self.holds = SimpleNamespace(direct=False)
        self.vehicle: Any = SimpleNamespace(
            telemetry=SimpleNamespace(guided=True, armed=False), return_to_launch=lambda: None
        )

    async def _fly_to(self, point: tuple[float, float]) -> bool:
        self.did.append(f"fly to {point}")
        return True

    async def _command(self, action: object, name: str) -> None:
        self.did.append(name)

    async def happen(self, event: Event, reason: str) -> None:
        self.state = State.DONE


def test_no_waypoint_of_ours_is_watched_while_the_autopilot_lands() -> None:
    """Landed in the guided mode, the aircraft comes no nearer to it, and that is no fault."""
    homebound = Homebound()
    asyncio.run(Mission._go_home(cast(Mission, homebound)))
    assert homebound.did == ["fly to (1.0, 1.0)", "rest", "return to launch"]

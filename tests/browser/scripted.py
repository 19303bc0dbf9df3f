"""A search that a test tells what to be: the real page at the real door, with no flight behind it, so that any state,
detection or find can be looked at as long as it takes."""

from __future__ import annotations

import asyncio
import copy
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np
from playwright.sync_api import Locator

from service.clock import Clock
from service.config import Settings
from service.evidence.cover import sensors_over
from service.evidence.reports import KEPT_AT, OrderReceipt
from service.geometry import LatLon
from service.http import Door, Server, open_door
from service.http.plan import AreaPlan, create_plan_app
from service.mission.states import State
from service.reasons import Option
from service.search import Search
from service.survey import survey
from service.view.feed import Moment
from service.view.live import RunView
from service.view.next import STATE_WORDS, choices, next_state
from service.view.state import RunState
from tests.service.http.door import FakeRun, settings
from tests.service.mission.flown import ON_GROUND, reached

from .stage import Watch

DEMO = Path(__file__).parents[2] / "config" / "area.geojson"
PICTURE = "0" * 64 + ".jpg"
JPEG = bytes.fromhex(
    "ffd8ffe000104a46494600010100000100010000ffdb004300"
    + "08" * 64
    + "ffc0000b080001000101011100ffc4001f0000010501010101"
    "010100000000000000000102030405060708090a0bffda0008010100003f0037ffd9"
)
"""One grey pixel."""
PHONE_FIX, RUIN = (56.609142, -4.739255), (56.609643, -4.744307)


def orders(state: State) -> list[str]:
    """What may be ordered in a state, of an aircraft in the air but for GROUNDED."""
    talk = reached(state)
    if state == State.GROUNDED:
        talk.shows(**ON_GROUND)
    return talk.core.orders(talk.seen)


class Scripted(FakeRun):
    """The demo area, just taken off; `state_now` and `places` may be changed at any time."""

    def __init__(self, coordinates: str = "degrees") -> None:
        super().__init__()
        given = Settings.model_validate({"run": {"coordinates": coordinates}})
        area, grid = survey(DEMO, None, given)
        self.search = Search(grid, given)
        self.view = RunView(area, self.search, sensors_over(grid, given), given, Clock(1.0))
        self.judged: list[tuple[str, LatLon | None]] = []
        self.redrawn: dict[str, Any] = {}
        self.ordered: list[tuple[str, str | None]] = []
        self.systems: list[int | None] = []
        self.tracks: list[list[LatLon]] = [[(56.6072, -4.7422), (56.6076, -4.7421), (56.6081, -4.7421)]]
        self.now = copy.deepcopy(self.view.state())
        here = {"lat": 56.6081, "lon": -4.7421, "height_m": 40.0, "heading_deg": 70.0}
        still = {"time": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0, "written": self.written((56.6081, -4.7421))}
        self.tell(
            pose={**here, **still}, height_above_ground_m=36.0, wind={"speed_mps": 5.2, "from_deg": 250.0},
            battery_percent=81.0, flight_left_s=1260.0, pos=0.21, regions=self.view.region_masses(),
            link={"up": True, "silent_s": 0.2, "received": 0.99, "round_trip_s": 0.1},
            detector={"silent_s": 0.4, "silent": False},
            ahead=[(56.6081, -4.7421), (56.6088, -4.743), RUIN], mode="AUTO_LOITER",
        )  # fmt: skip
        self.be(State.SEARCHING)

    def tell(self, **values: Any) -> None:
        """Change what the page is told."""
        self.now = cast(RunState, {**self.now, **values})

    def be(self, state: State, why: str = "") -> None:
        """Be in a state."""
        names, regions = self.view.ground.names, self.now["regions"]
        weighed = [
            Option("region 1", 1, 9, 0.1, 0.2, 396.0, True, ""),
            Option("region 2", 2, 4, 0.1, 0.3, 120.0, False, ""),
        ]
        self.tell(
            state=state, words=STATE_WORDS[state], why=why, orders=orders(state),
            next=next_state(state, weighed, names, regions), choices=choices(weighed, names, regions),
        )  # fmt: skip

    def suspect(
        self, place: LatLon, probability: float = 0.67, *, picture: bool = True, hits: int = 3
    ) -> dict[str, Any]:
        """A suspect as it is told."""
        picture_at = KEPT_AT + PICTURE if picture else None
        known = {"lat": place[0], "lon": place[1], "probability": probability, "thumbnail": picture_at}
        return {**known, "hits": hits, "score": 0.83, "written": self.written(place)}

    def find(self, place: LatLon, *, confirmed: bool = False) -> None:
        """Something counts as found."""
        ellipse = {"semi_major_m": 9.0, "semi_minor_m": 6.0, "bearing_deg": 20.0}
        where = {"lat": place[0], "lon": place[1], "written": self.written(place), "probability": 0.9997}
        more = {"sigma_m": 4.0, "ellipse": ellipse, "thumbnail": KEPT_AT + PICTURE, "confirmed": confirmed}
        self.tell(found={**where, **more})

    # ---- as the door asks

    async def state(self) -> dict[str, Any]:
        return cast(dict[str, Any], self.now)

    async def moment(self) -> Moment:
        belief = self.search.belief
        pod = np.where(np.arange(belief.weights.size).reshape(belief.weights.shape) % 3 == 0, 0.8, 0.0)
        hits, curve = [PHONE_FIX], [(0.0, 0.0), (60.0, 0.21)]
        return Moment(self.now, belief.weights, belief.total, pod, self.tracks, hits, curve)

    async def regions(self) -> dict[str, Any]:
        return {**self.view.ground.described_regions(), **self.redrawn}

    def scene(self) -> dict[str, Any]:
        return self.view.ground.describe()

    def searchable(self) -> Any:
        return self.search.grid.searchable

    def written(self, place: tuple[float, float]) -> str:
        return self.view.ground.written(place)

    async def kept_picture(self, name: str) -> bytes | None:
        return JPEG if name == PICTURE else None

    async def order(
        self,
        command: str,
        place: LatLon | None = None,
        aircraft: str | None = None,
        system_id: int | None = None,
    ) -> OrderReceipt:
        self.judged.append((command, place))
        self.ordered.append((command, aircraft))
        self.systems.append(system_id)
        return OrderReceipt(state=self.now["state"])


class Opened:
    """A page at its address, served beside the test."""

    def __init__(self, environment: dict[str, str], serve: Callable[[Door], Server]) -> None:
        self._door = open_door(settings(), environment)
        self.url = self._door.url
        self._server = serve(self._door)
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._server.run_until_told()), daemon=True
        )
        self._thread.start()

    def end(self) -> None:
        """The service ends, as after a finished run."""
        self._server.should_exit = True
        self._thread.join(20.0)
        self._door.close()


class Served(Opened):
    """A scripted search at its address; it can be ended."""

    def __init__(self, run: Scripted, environment: dict[str, str]) -> None:
        self.run = run
        super().__init__(environment, lambda door: door.server(run))


class Board(Opened):
    """An area that is being drawn; `file` is where it is saved."""

    def __init__(self, file: Path, coordinates: str = "degrees") -> None:
        self.file = file
        plan = AreaPlan(file, Settings.model_validate({"run": {"coordinates": coordinates}}))
        super().__init__({}, lambda door: door.serving(lambda **known: create_plan_app(plan, **known)))


@contextmanager
def served(run: Scripted | None = None, environment: dict[str, str] | None = None) -> Iterator[Served]:
    """A scripted search at a real door, until the block ends."""
    search = Served(run or Scripted(), environment or {})
    try:
        yield search
    finally:
        search.end()


@contextmanager
def board(file: Path, coordinates: str = "degrees") -> Iterator[Board]:
    """The page to draw on, until the block ends."""
    opened = Board(file, coordinates)
    try:
        yield opened
    finally:
        opened.end()


def card(watch: Watch, place: tuple[float, float]) -> Locator:
    """The card of what was seen at a place."""
    return watch.page.locator("#suspects li").filter(has_text=f"{place[0]:.6f}, {place[1]:.6f}")

"""Several aircraft of one run: whose order, whose report, and when it is over for all."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely

from roisearch import SearchState
from service.clock import Clock
from service.config import Settings
from service.errors import BadInput
from service.evidence.counts import Counts
from service.evidence.reports import OrderReceipt, Receipt, Report
from service.journal import Journal
from service.mavlink.events import Home
from service.mavlink.telemetry import Telemetry
from service.mission.chart import Chart
from service.mission.effects import Answer
from service.mission.mission import Mission
from service.mission.news import Order
from service.mission.standing import Terms
from service.mission.states import FINAL, Event, State
from service.news.bearing import FieldNews
from service.search import Search
from service.squad import Squad
from tests.service.mission.flown import CELL_M, FOUND, GRID, ON_GROUND, Talk, place, reached

SETTINGS = Settings.model_validate(
    {"sensor": {"cell_m": CELL_M}, "aircraft": [{"name": "north", "sources": ["cam0"]}, {"name": "south"}]}
)


class StandIn:
    """A mission that does nothing but remember what it was told."""

    def __init__(self, name: str, search: Search, state: State = State.SEARCHING) -> None:
        self.name, self.search, self.state = name, search, state
        self.orders: list[str] = []
        self.wanted_system: int | None = None
        self.reports: list[Report] = []
        self.refusal = ""
        self.means_something = True
        self.judgements: list[bool] = []
        self.core = SimpleNamespace(overtaken=0)
        self.meanwhile = lambda: None
        self.may_move = True
        self.found: object | None = None
        self.flight = SimpleNamespace(hits=[])
        self.intake = SimpleNamespace(submit_all=self.take, refuse=self.refuse, counts=Counts())
        self.called = f"aircraft '{name}': "

    async def order(
        self, command: str, place: tuple[float, float] | None = None, system_id: int | None = None
    ) -> OrderReceipt:
        self.orders.append(command)
        self.wanted_system = system_id
        self.meanwhile()
        return OrderReceipt(state=self.state, refused=self.refusal or None)

    def concerned(self, command: str) -> bool:
        return self.means_something

    async def judged(self, *, confirmed: bool, moves: bool = True) -> OrderReceipt:
        self.judgements.append(confirmed)
        self.may_move = moves
        return OrderReceipt(state=self.state)

    async def take(self, reports: Sequence[Report]) -> list[Receipt]:
        self.reports += reports
        return [Receipt(id=each.id, status="accepted") for each in reports]

    def refuse(self, report: Report, reason: str) -> Receipt:
        return Receipt(id=report.id, status="refused", reason=reason)


def squad(*missions: StandIn, settings: Settings = SETTINGS) -> Squad:
    """These, as the missions of a run."""
    every: Any = missions
    return Squad(every, settings)


def two(*states: State) -> tuple[StandIn, StandIn, Squad]:
    """Two missions, searching unless their states are given, and their squad."""
    search = Search(GRID, SETTINGS)
    first, second = states or (State.SEARCHING, State.SEARCHING)
    north, south = StandIn("north", search, first), StandIn("south", search, second)
    return north, south, squad(north, south)


@pytest.mark.parametrize("command", ["hold", "return", "abort", "finish"])
def test_an_order_that_names_none_is_for_all(command: str) -> None:
    north, south, both = two()
    assert asyncio.run(both.order(command)).refused is None
    assert north.orders == south.orders == [command]


def test_an_order_that_names_one_is_for_that_alone() -> None:
    north, south, both = two()
    asyncio.run(both.order("hold", aircraft="south"))
    assert (north.orders, south.orders) == ([], ["hold"])
    with pytest.raises(BadInput, match="there is no aircraft 'west'; there is north, south"):
        asyncio.run(both.order("hold", aircraft="west"))


def test_one_that_has_ended_gets_no_more_orders_and_who_refuses_is_named() -> None:
    north, south, both = two(State.DONE, State.READY)
    south.refusal = "there is nothing to return in READY"
    receipt = asyncio.run(both.order("return"))
    assert north.orders == []
    assert receipt.refused == "south: there is nothing to return in READY"


@pytest.mark.parametrize("command", ["resume", "return", "launch"])
def test_an_aircraft_is_taken_back_from_its_pilot_by_its_name_only(command: str) -> None:
    north, south, both = two(State.HOLDING, State.YIELDED)
    refused = asyncio.run(both.order(command)).refused
    assert refused == "south: its pilot has it, and only an order that names it takes it back"
    assert (north.orders, south.orders) == ([command], [])
    asyncio.run(both.order(command, aircraft="south"))
    assert south.orders == [command]


def in_the_air_and_on_the_ground() -> tuple[Talk, Talk, Squad]:
    """The squad of a mission that searches and of one between two sorties, with their real cores."""

    class WithACore(StandIn):
        def __init__(self, name: str, talk: Talk) -> None:
            super().__init__(name, Search(GRID, SETTINGS), talk.state)
            self.talk = talk

        def concerned(self, command: str) -> bool:
            return self.talk.core.concerned(command, self.talk.seen)

        async def order(self, command: str, *_: Any, **__: Any) -> OrderReceipt:
            did = self.talk.on(Order(command, 7))
            refused = next((each.refused for each in did if isinstance(each, Answer)), "")
            return OrderReceipt(state=self.talk.state, refused=refused or None)

    flies, stands = reached(State.SEARCHING), reached(State.GROUNDED)
    stands.shows(**ON_GROUND)
    return flies, stands, squad(WithACore("north", flies), WithACore("south", stands))


@pytest.mark.parametrize(("command", "state"), [("hold", State.HOLDING), ("return", State.RETURNING)])
def test_who_an_order_for_all_means_nothing_to_does_not_refuse_it(command: str, state: State) -> None:
    flies, stands, both = in_the_air_and_on_the_ground()
    assert asyncio.run(both.order(command)).refused is None
    assert (flies.state, stands.state) == (state, State.GROUNDED)


def test_an_order_that_one_refuses_or_that_means_nothing_to_any_is_refused() -> None:
    flies, _, both = in_the_air_and_on_the_ground()
    assert "there is nothing to resume in GROUNDED" in str(
        asyncio.run(both.order("resume", aircraft="south")).refused
    )
    assert "--takeoff" in str(asyncio.run(both.order("launch")).refused)  # south's alone
    flies.happens(Event.RETURN)
    flies.happens(Event.DOWN)
    assert "there is nothing to hold" in str(asyncio.run(both.order("hold")).refused)


def test_of_several_only_the_one_that_is_named_is_replaced() -> None:
    north, south, both = two(State.GROUNDED, State.GROUNDED)
    assert "name the aircraft" in str(asyncio.run(both.order("replace")).refused)
    assert north.orders == south.orders == []
    assert asyncio.run(both.order("replace", aircraft="south", system_id=7)).refused is None
    assert (north.orders, south.orders, south.wanted_system) == ([], ["replace"], 7)


def test_a_word_on_a_place_is_believed_once_and_told_to_all() -> None:
    north, south, both = two()
    south.found = FOUND
    asyncio.run(both.order("reject"))
    assert (south.orders, south.judgements) == (["reject"], [])
    assert (north.orders, north.judgements) == ([], [False])
    assert north.may_move


def test_a_word_on_a_place_moves_nobody_who_was_stopped_while_it_waited_for_the_disk() -> None:
    north, south, both = two()
    north.meanwhile = lambda: setattr(south.core, "overtaken", 1)  # a hold, or its pilot
    asyncio.run(both.order("confirm", place=(47.0, 8.3)))
    assert (south.judgements, south.may_move) == ([True], False)


def report(number: int, **more: Any) -> Report:
    """A frame that shows nothing."""
    return Report(id=f"r{number}", captured_at=1000.0, **more)


def test_a_report_goes_to_the_aircraft_that_it_names_or_that_its_source_is_paired_with() -> None:
    north, south, both = two()
    sent = [report(1, aircraft="south"), report(2, source="cam0"), report(3, source="cam0", aircraft="south")]
    receipts = asyncio.run(both.submit_all(sent))
    assert [each.id for each in receipts] == ["r1", "r2", "r3"]
    assert [each.id for each in north.reports] == ["r2"]
    assert [each.id for each in south.reports] == ["r1", "r3"]


def test_a_report_of_nobody_knows_whom_is_refused_with_what_would_be_right() -> None:
    north, south, both = two()
    unnamed, unknown = asyncio.run(both.submit_all([report(1), report(2, aircraft="west")]))
    assert unnamed.status == unknown.status == "refused"
    assert unnamed.reason == (
        'it does not say of which aircraft it is: add "aircraft", one of "north", "south", or put the source '
        "'detector' into the sources of an aircraft in the settings"
    )
    assert unknown.reason == 'there is no aircraft \'west\'; there is "north", "south"'
    assert north.reports == south.reports == []


def test_of_the_only_aircraft_is_every_report() -> None:
    settings = Settings.model_validate({"sensor": {"cell_m": CELL_M}})
    only = StandIn("", Search(GRID, settings))
    receipts = asyncio.run(squad(only, settings=settings).submit_all([report(1), report(2, aircraft="1")]))
    assert [each.status for each in receipts] == ["accepted", "accepted"]


def test_one_that_is_not_heard_yet_leads_nobody_who_flies() -> None:
    """It was switched off, and the page said for the whole run that the aircraft is waited for."""
    search = Search(GRID, SETTINGS)
    late, flies = StandIn("1", search, State.WAITING), StandIn("2", search, State.SEARCHING)
    both = squad(late, flies)
    assert both.leading is flies
    flies.state = State.WAITING
    assert both.leading is late


def test_the_first_that_has_not_ended_leads_and_the_run_ends_with_the_last() -> None:
    north, south, both = two(State.DONE, State.SEARCHING)
    assert both.leading is south  # type: ignore[comparison-overlap]
    assert not both.ended
    south.state = State.ABORTED
    assert both.leading is north  # type: ignore[comparison-overlap]
    assert both.ended


@pytest.mark.parametrize(
    ("state", "given"), [(State.SEARCHING, False), (State.HOLDING, True), (State.YIELDED, True)]
)
def test_one_that_does_not_search_has_given_its_share_back(state: State, given: bool, tmp_path: Path) -> None:
    search = Search(GRID, SETTINGS, aircraft="north")
    search.beside("south", SETTINGS)
    asyncio.run(search.decide(SearchState(GRID.start), [], now=1000.0))
    talk = reached(state)
    vehicle: Any = SimpleNamespace(telemetry=talk.seen.telemetry, autopilot=None, events_waiting=False)
    intake: Any = SimpleNamespace(last_at=0.0, counts=Counts())
    with contextlib.closing(Journal(tmp_path / "journal.sqlite")) as journal:
        mission = Mission(
            talk.core,
            clock=Clock(),
            search=search,
            vehicle=vehicle,
            journal=journal,
            make_intake=lambda *_: intake,
        )
        mission.map_changed()
    assert (len(search.common.others.committed("north").when) == 0) == given


class Silent(StandIn):
    """A mission that goes on for as long as it is let, with an aircraft that is not heard any more."""

    def __init__(
        self,
        name: str,
        search: Search,
        state: State,
        *,
        between: bool = False,
        heard: bool = True,
        aloft: bool = False,
    ) -> None:
        super().__init__(name, search, state)
        self.clock = Clock(200.0)
        told = Telemetry(heartbeat_time=self.clock.now()) if heard else Telemetry()
        self.vehicle = SimpleNamespace(telemetry=told)
        settings = SETTINGS.model_copy(
            update={"flight": SETTINGS.flight.model_copy(update={"full_battery_s": 1200.0})}
        )
        self.core = SimpleNamespace(
            terms=Terms(), between_sorties=between, settings=settings, may_be_aloft=aloft
        )
        self.gone = asyncio.Event()

    async def run(self) -> None:
        if self.state not in FINAL:
            await self.gone.wait()

    async def leave(self, reason: str) -> None:
        self.end(State.ABORTED)

    def end(self, state: State) -> None:
        self.state = state
        self.gone.set()


@pytest.mark.parametrize(
    ("state", "how", "after_s"),
    [
        (State.SEARCHING, {}, 30.0),
        (State.WAITING, {"heard": False}, 120.0),  # it may be starting still
        (State.WAITING, {"heard": False, "aloft": True}, None),  # an earlier process left it in the air
        (State.GROUNDED, {"between": True}, None),
        (State.WAITING, {"between": True}, None),  # an earlier process left it between two sorties
    ],
)
def test_one_that_is_silent_when_all_others_have_ended_is_left_but_on_the_ground_it_may_be_switched_off(
    state: State, how: dict[str, bool], after_s: float | None
) -> None:
    search = Search(GRID, SETTINGS)
    north, south = Silent("north", search, State.DONE), Silent("south", search, state, **how)
    looks = [0]

    async def run() -> None:
        ticking = north.clock.sleep

        async def sleep(seconds: float) -> None:  # of who looks at them
            looks[0] += 1
            if looks[0] == 300:
                south.end(State.DONE)
            await ticking(seconds)

        north.clock.sleep = sleep  # type: ignore[method-assign]
        await squad(north, south).run()

    asyncio.run(run())
    assert (south.state == State.ABORTED) == (after_s is not None)
    if after_s is not None:  # a second and more between two looks
        assert looks[0] <= after_s + 2.0


class WithAHome(StandIn):
    """One that hears news, and has a home beside the launch point."""

    def __init__(self, name: str, home: Home, state: State = State.SEARCHING) -> None:
        super().__init__(name, Search(GRID, SETTINGS), state)
        self.core = SimpleNamespace(chart=Chart(GRID))
        self.vehicle = SimpleNamespace(telemetry=Telemetry(home=home))
        self.heard: list[str] = []

    async def hear(self, said: FieldNews) -> None:
        self.heard.append(said.role)

    def map_changed(self) -> None:
        """Nothing follows."""


@pytest.mark.parametrize(
    ("state", "away_m", "words"),
    [
        (State.SEARCHING, 0.0, "lies in it"),
        (State.SEARCHING, 3.0, "lies 3 m from it, less than 5 m"),
        (State.SEARCHING, 8.0, ""),
        (State.DONE, 0.0, ""),
    ],
)
def test_an_exclusion_over_or_beside_the_home_of_any_aircraft_is_refused_and_other_news_there_are_not(
    state: State, away_m: float, words: str
) -> None:
    homes = [place(250.0, 60.0), place(60.0, 60.0)]
    missions: Any = [
        WithAHome("north", Home(*homes[0], 400.0)),
        WithAHome("south", Home(*homes[1], 400.0), state),
    ]
    squad = Squad(missions, SETTINGS)
    corners = [(60.0 + away_m, 50.0), (90.0, 50.0), (90.0, 70.0), (60.0 + away_m, 70.0)]
    if not away_m:
        corners[0], corners[3] = (50.0, 50.0), (50.0, 70.0)
    around = shapely.MultiPolygon([shapely.Polygon([place(*each)[::-1] for each in corners])])
    nothing = np.zeros((0, 2), dtype=np.int64)
    for role in ("searched", "exclude"):
        news = FieldNews(role, role, "", homes[1], nothing, np.zeros(0), around)
        if role == "exclude" and words:
            with pytest.raises(
                BadInput, match=rf"the home of aircraft south, .*, {words}; move one of the two"
            ):
                asyncio.run(squad.hear(news))
        else:
            asyncio.run(squad.hear(news))
    assert missions[0].heard == ["searched"] if words else ["searched", "exclude"]

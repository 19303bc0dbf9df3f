"""The page of a search that several aircraft fly: a panel, a colour and orders for each, and one to hold them all."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, expect

from service.evidence.reports import OrderReceipt
from service.mission.states import State
from service.view.next import STATE_WORDS
from tests.integration.flight import running
from tests.service.export.recorded import record_two
from tests.service.http.door import REPORT, both_tokens
from tests.service.test_squad import in_the_air_and_on_the_ground

from .hands import PHONE
from .scripted import PHONE_FIX, RUIN, Scripted, Served, orders, served
from .stage import Watch

pytestmark = pytest.mark.timeout(300)
NOTHING = "M0 0"
"""A line without a place, as Leaflet draws it."""
THREE_PLACES = re.compile(r"^M[^ML]+L[^ML]+L[^ML]+$")
PLACES = [(56.6081, -4.7421), (56.6090, -4.7400), (56.6099, -4.7436)]


def craft(search: Scripted, number: int, state: State, **changes: Any) -> dict[str, Any]:
    """One of three aircraft as it is told."""
    lat, lon = PLACES[number - 1]
    usual = {
        "name": str(number), "colour": number - 1, "state": state, "words": STATE_WORDS[state], "why": "",
        "orders": orders(state),
        "lat": lat, "lon": lon, "height": 20.0 + 10.0 * number, "heading_deg": 90.0 * number, "battery": 90.0 - number,
        "link": {"up": True, "silent_s": 0.2, "received": 0.99, "round_trip_s": 0.1},
        "mode": "AUTO_LOITER", "next": search.now["next"],
        "ahead": [(lat, lon), PHONE_FIX if number < 3 else RUIN], "steps": 3, "flight_time_s": 60.0,
        "pose": None, "footprint": search.now["footprint"],
    }  # fmt: skip
    return {**usual, **changes}


def fly_three(search: Scripted, **third: Any) -> None:
    """Two that search and one that holds, each of which has flown a corner."""
    three = [
        craft(search, 1, State.SEARCHING),
        craft(search, 2, State.SEARCHING, battery=19.0),
        craft(search, 3, third.pop("state", State.HOLDING), **third),
    ]
    search.tell(aircraft=three)
    search.tracks = [[(lat - 0.0006, lon), (lat - 0.0003, lon + 0.0006), (lat, lon)] for lat, lon in PLACES]


@pytest.fixture
def search() -> Iterator[Served]:
    """A search that three aircraft fly."""
    with served() as scripted:
        fly_three(scripted.run)
        yield scripted


@pytest.fixture
def watch(chromium: Browser, search: Served) -> Iterator[Watch]:
    """Its page."""
    page = Watch(chromium, search.url)
    page.shows("SEARCHING")
    yield page
    page.close()


def flown(watch: Watch, number: int) -> Locator:
    """The line of what an aircraft has flown."""
    return watch.page.locator(f"#map path.own-{number - 1}:not([stroke-dasharray])")


def panel(watch: Watch, name: str) -> Locator:
    """An aircraft's panel."""
    return watch.page.locator("#fleet > li").filter(
        has=watch.page.get_by_role("heading", name=re.compile(f"^Aircraft {name} "))
    )


def test_each_aircraft_has_a_panel_with_its_state_battery_and_height(watch: Watch, search: Served) -> None:
    expect(watch.page.locator("#fleet > li")).to_have_count(3)
    expect(panel(watch, "1")).to_contain_text("Battery89 %Height30 mLinkgood")
    expect(panel(watch, "2").locator(".bad")).to_have_text("19 %")
    expect(panel(watch, "3").locator(".chip")).to_have_text(STATE_WORDS[State.HOLDING])
    fly_three(
        search.run,
        link={"up": False, "silent_s": 9.0, "received": None, "round_trip_s": 0.1},
        battery=None,
        height=None,
    )
    expect(panel(watch, "3")).to_contain_text("BatteryunknownHeightunknownLinklost")
    fly_three(search.run, why="the pilot or the autopilot selected LOITER")
    expect(panel(watch, "3")).to_contain_text("the pilot or the autopilot selected LOITER")
    fly_three(search.run, state=State.ABORTED, why="home is 20 m higher than that of 1")
    expect(panel(watch, "3")).to_contain_text("This aircraft flies no more")
    expect(panel(watch, "3")).to_contain_text("home is 20 m higher than that of 1")
    colours = watch.page.locator("#fleet .swatch").evaluate_all(
        "(all) => all.map((each) => getComputedStyle(each).backgroundColor)"
    )
    assert len(set(colours)) == 3


def test_each_has_orders_of_its_own_which_name_it(watch: Watch, search: Served) -> None:
    page = watch.page
    expect(panel(watch, "1").get_by_role("button", name="Resume")).to_be_disabled()
    page.get_by_role("button", name="Hold aircraft 2").click()
    expect(page.locator("#toast")).to_have_text("Aircraft 2: It holds still")
    page.get_by_role("button", name="Resume aircraft 3").click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("Aircraft 3: Resume the search?")
    dialog.get_by_role("button", name="Resume").click()
    page.get_by_role("button", name="Return aircraft 1").click()
    page.get_by_role("dialog").get_by_role("button", name="Return").click()
    expect(page.locator("#toast")).to_have_text("Aircraft 1: It flies home")
    assert search.run.ordered == [("hold", "2"), ("resume", "3"), ("return", "1")]


def test_one_order_that_is_always_there_holds_them_all(watch: Watch, search: Served) -> None:
    hold = watch.order("Hold all")
    done = [craft(search.run, number, State.HOLDING) for number in (1, 2, 3)]
    search.run.tell(aircraft=done)
    expect(panel(watch, "1").get_by_role("button", name="Hold")).to_be_disabled()
    expect(hold).to_be_enabled()
    expect(watch.order("Resume")).to_be_hidden()  # each has its own
    hold.click()
    expect(watch.page.locator("#toast")).to_have_text("It holds still")
    assert search.run.ordered == [("hold", None)]


class ByASquad(Scripted):
    """One whose orders are carried out by the cores of an aircraft that searches and of one on the ground."""

    def __init__(self) -> None:
        super().__init__()
        self.flies, self.stands, self.squad = in_the_air_and_on_the_ground()
        self.show()

    def show(self) -> None:
        """Both as they are now."""
        both = enumerate((self.flies, self.stands), 1)
        self.tell(aircraft=[craft(self, number, talk.state) for number, talk in both])

    async def order(self, command: str, *_: Any, **__: Any) -> OrderReceipt:
        receipt = await self.squad.order(command)
        self.show()
        return receipt


def test_to_hold_them_all_is_not_told_as_refused_because_one_stands_on_the_ground(chromium: Browser) -> None:
    with served(ByASquad()) as search:
        watch = Watch(chromium, search.url)
        expect(panel(watch, "2").locator(".chip")).to_have_text(STATE_WORDS[State.GROUNDED])
        watch.order("Hold all").click()
        expect(watch.page.locator("#toast")).to_have_text("It holds still")
        expect(panel(watch, "1").locator(".chip")).to_have_text(STATE_WORDS[State.HOLDING])
        expect(panel(watch, "2").locator(".chip")).to_have_text(STATE_WORDS[State.GROUNDED])
        watch.close()


@pytest.mark.parametrize(
    ("button", "title", "warns", "ordered"),
    [
        ("Launch aircraft 3", "Aircraft 3: Take off?", "Nobody may be near it", ("launch", "3")),
        ("Finish", "Finish the search?", "no further flight follows", ("finish", None)),
    ],
)
def test_a_launch_and_the_finish_are_asked_first(
    watch: Watch, search: Served, button: str, title: str, warns: str, ordered: tuple[str, str | None]
) -> None:
    search.run.tell(
        aircraft=[craft(search.run, 1, State.SEARCHING), craft(search.run, 3, State.GROUNDED, name="3")]
    )
    expect(panel(watch, "3").locator(".chip")).to_have_text(STATE_WORDS[State.GROUNDED])
    pressed = watch.page.get_by_role("button", name=button, exact=True)
    for answer, result in (("Cancel", []), (ordered[0].title(), [ordered])):
        pressed.click()
        dialog = watch.page.get_by_role("dialog")
        expect(dialog.get_by_role("heading")).to_have_text(title)
        expect(dialog).to_contain_text(warns)
        dialog.get_by_role("button", name=answer).click()
        expect(dialog).to_have_count(0)
        if result:
            expect(watch.page.locator("#toast")).not_to_be_empty()
        assert search.run.ordered == result


def test_each_is_on_the_map_in_its_colour_with_its_name_its_track_and_its_plan(
    watch: Watch, search: Served, pictures: Path | None
) -> None:
    page = watch.page
    expect(page.locator("#map .flyer")).to_have_count(3)
    expect(page.locator("#map .flyer-name")).to_have_text(["1", "2", "3"])
    expect(page.locator("#map .craft:not(.flyer)")).to_have_count(0)
    expect(page.locator("#map path.own-line.own-2")).to_have_count(2)
    marks = page.locator("#map .flyer path").evaluate_all(
        "(all) => all.map((each) => getComputedStyle(each).fill)"
    )
    swatches = page.locator("#fleet .swatch").evaluate_all(
        "(all) => all.map((each) => getComputedStyle(each).backgroundColor)"
    )
    assert marks == swatches
    before = flown(watch, 2).get_attribute("d") or ""
    assert before.count("L") == 2
    search.run.tracks[1].append((PLACES[1][0] + 0.0004, PLACES[1][1]))
    expect(flown(watch, 2)).to_have_attribute("d", re.compile(f"{before}L"))
    assert [(flown(watch, number).get_attribute("d") or "").count("L") for number in (1, 3)] == [2, 2]
    assert not watch.violations()
    if pictures is not None:
        page.screenshot(path=pictures / "fleet.png")


def test_a_page_that_is_loaded_again_shows_all_that_each_has_flown(watch: Watch, search: Served) -> None:
    for number in (1, 2, 3):
        expect(flown(watch, number)).to_have_attribute("d", THREE_PLACES)
    watch.page.reload()
    watch.shows("SEARCHING")
    for number in (1, 2, 3):
        expect(flown(watch, number)).to_have_attribute("d", THREE_PLACES)


def test_a_replay_shows_the_track_of_each_at_its_end_and_as_far_as_it_was_before(
    chromium: Browser, tmp_path: Path
) -> None:
    folder = record_two(tmp_path)
    with running("service", "replay", str(folder), "--http", "127.0.0.1:0") as service:
        watch = Watch(chromium, service.wait_for(r"listening on (http://\S+)").group(1))
        watch.shows("SEARCHING")
        slider = watch.page.get_by_role("slider", name="Time")
        ends = [flown(watch, number).get_attribute("d") or "" for number in (1, 2)]
        assert all("L" in end for end in ends)
        slider.fill("7")  # the first has looked at its cells, the second has not begun
        expect(flown(watch, 2)).to_have_attribute("d", NOTHING)
        expect(flown(watch, 1)).to_have_attribute("d", ends[0])
        slider.fill("1")
        expect(flown(watch, 1)).to_have_attribute("d", NOTHING)
        slider.fill("12")
        for number in (1, 2):
            expect(flown(watch, number)).to_have_attribute("d", ends[number - 1])
        watch.close()


def test_a_search_with_one_aircraft_has_no_panels_and_the_old_orders(watch: Watch, search: Served) -> None:
    search.run.tell(aircraft=[craft(search.run, 1, State.SEARCHING)])
    expect(watch.page.locator("#fleet-card")).to_be_hidden()
    expect(watch.order("Hold")).to_have_text("Hold")
    expect(watch.order("Resume")).to_be_visible()
    expect(watch.page.locator("#map .flyer")).to_have_count(0)
    expect(watch.page.locator("#map .craft")).to_have_count(1)


def test_who_only_looks_on_sees_the_panels_without_orders(chromium: Browser) -> None:
    with served(environment=both_tokens()) as search:
        fly_three(search.run)
        watch = Watch(chromium, search.url)
        watch.page.get_by_label("Token").fill(REPORT)
        watch.page.keyboard.press("Enter")
        watch.shows("SEARCHING")
        expect(watch.page.locator("#fleet > li")).to_have_count(3)
        expect(watch.page.locator("#fleet .buttons").first).to_be_hidden()
        watch.context.close()


@pytest.mark.parametrize(("theme", "options"), [("day", {}), ("sun", PHONE), ("night", PHONE)])
def test_axe_finds_nothing_with_several_aircraft(
    chromium: Browser, search: Served, theme: str, options: dict[str, Any]
) -> None:
    """In states of all kinds at once, and with a find."""
    watch = Watch(chromium, search.url, **options)
    watch.shows("SEARCHING")
    watch.page.locator("#theme").select_option(theme)
    search.run.tell(suspects=[search.run.suspect(RUIN)])
    search.run.find(PHONE_FIX)
    for states in (list(State)[i : i + 3] for i in range(0, len(State), 3)):
        search.run.tell(aircraft=[craft(search.run, i, state) for i, state in enumerate(states, 1)])
        expect(watch.page.locator("#fleet .chip").first).to_have_text(STATE_WORDS[states[0]])
        assert watch.violations() == [], states
        assert watch.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), states
    watch.close()

"""The page in every state that a search can be in, told by a script: words, cards, the find, who only looks on."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, expect

from service.mission.states import State
from tests.service.http.door import COMMAND, REPORT, both_tokens

from .hands import PHONE, Keyboard
from .scripted import PHONE_FIX, RUIN, Scripted, Served, card, served
from .stage import Watch

pytestmark = pytest.mark.timeout(300)


@pytest.fixture
def watch(chromium: Browser, search: Served) -> Iterator[Watch]:
    """Its page."""
    page = Watch(chromium, search.url)
    page.shows("SEARCHING")
    yield page
    page.close()


@pytest.fixture
def keys(chromium: Browser, search: Served) -> Iterator[Keyboard]:
    """A keyboard alone at it."""
    hand = Keyboard(chromium, search.url)
    hand.watch.shows("SEARCHING")
    yield hand
    hand.close()


def test_likely_places_that_are_drawn_again_take_the_place_of_the_old_ones(
    watch: Watch, search: Served
) -> None:
    """One is spent, the others keep their names, and what is new is said."""
    page, run = watch.page, search.run
    marks = page.locator("#map .roi.likely")
    before = marks.count()
    expect(marks.filter(has_text="shieling ruin")).to_have_count(1)
    told = run.view.ground.described_regions()
    number = told["names"].index("shieling ruin") + 1
    left = [each for each in told["regions"]["features"] if each["properties"]["number"] != number]
    run.redrawn = {"regions": {"type": "FeatureCollection", "features": left}, "drawn": 1}
    run.tell(drawn={"number": 1, "words": f"region {number} (shieling ruin) is spent"})
    expect(marks).to_have_count(before - 1)
    expect(marks.filter(has_text="shieling ruin")).to_have_count(0)
    expect(page.locator("#facts")).to_contain_text(f"likely placesregion {number} (shieling ruin) is spent")


def test_the_strip_says_it_in_words_and_what_happens_next(watch: Watch, search: Served) -> None:
    page = watch.page
    expect(page.locator("#next")).to_have_text(re.compile(r"^Next: shieling ruin, 400 m, \d+ %$"))
    strip = page.locator("#strip")
    for said in ("Battery81 %21 min left", "Linkgood", "Detectorreporting", "Height36 m", "Wind5 m/sfrom W"):
        expect(strip).to_contain_text(said)
    page.get_by_text("Why?").click()
    expect(page.locator("#options tr.chosen")).to_contain_text("shieling ruin")
    expect(page.locator("#options")).to_contain_text("last phone fix")
    search.run.tell(battery_percent=19.0, flight_left_s=90.0, wind=None, height_above_ground_m=None)
    expect(strip.locator(".bad")).to_have_text(["19 %", "2 min left"])
    expect(strip).to_contain_text("Heightunknown")
    expect(strip).to_contain_text("Windunknown")
    search.run.tell(link={"up": True, "silent_s": 0.2, "received": 0.99, "round_trip_s": 5.2})
    expect(strip).to_contain_text("Linkslowanswers after 5 s")
    expect(page.locator("#facts")).to_contain_text("up, answers after 5 s")
    expect(page.locator("#facts")).not_to_contain_text("voltage")
    search.run.tell(battery={"voltage_v": 15.24, "current_a": None, "consumed_mah": 1204.0})
    expect(page.locator("#facts")).to_contain_text("voltage, current15.2 V, 1204 mAh used")
    search.run.tell(battery_doubt="the battery's level is not told any longer: reckoned to be 18 %")
    expect(page.locator("#facts")).to_contain_text("reckoned to be 18 %")


def test_what_cannot_be_seen_from_the_air_is_named_with_the_likeliest_first(
    watch: Watch, search: Served
) -> None:
    facts = watch.page.locator("#facts")
    expect(facts).not_to_contain_text("ground team")
    places = [(56.60 + 0.001 * number, -4.74) for number in range(5)]
    search.run.tell(
        unseen=[
            {"lat": lat, "lon": lon, "probability": 0.01 * number, "written": search.run.written((lat, lon))}
            for number, (lat, lon) in enumerate(places)
        ]
    )
    told = facts.locator("dt", has_text="needs a ground team").locator("xpath=following-sibling::dd[1]")
    expect(told).to_contain_text(re.compile(r"^56\.604000, -4\.740000 \(4 %\); 56\.603000.*; and 2 more$"))
    expect(told).to_have_class("bad")


@pytest.mark.parametrize("state", list(State))
def test_every_state_has_its_words_and_none_of_the_tools(state: State, watch: Watch, search: Served) -> None:
    search.run.tell(suspects=[search.run.suspect(RUIN)])
    if state in (State.FOUND, State.RETURNING):
        search.run.find(PHONE_FIX)
    search.run.be(state)
    watch.shows(state)
    expect(card(watch, RUIN).get_by_role("button", name="Confirm")).to_be_enabled()
    expect(card(watch, RUIN).get_by_role("button", name="Reject")).to_be_enabled()
    page = watch.page
    for button in page.locator("#orders button").all():
        meant = button.get_attribute("data-command") in search.run.now["orders"]
        expect(button).to_be_enabled() if meant else expect(button).to_be_disabled()
    page.locator("details").evaluate_all("(all) => all.forEach((each) => (each.open = true))")
    watch.says_it_in_words()
    assert state not in page.locator("body").inner_text()


def test_a_detection_is_a_card_that_names_its_place(watch: Watch, search: Served) -> None:
    search.run.tell(
        suspects=[search.run.suspect(PHONE_FIX), search.run.suspect(RUIN, 0.3, picture=False, hits=1)]
    )
    first, second = card(watch, PHONE_FIX), card(watch, RUIN)
    expect(first).to_contain_text("67 % sure, score 0.83, seen 3 times")
    expect(second).to_contain_text("30 % sure, score 0.83, seen once")
    expect(first.get_by_role("img")).to_have_js_property("naturalWidth", 1)
    first.get_by_role("button", name="Enlarge").click()
    watch.page.get_by_role("dialog").get_by_role("button", name="Close").click()
    elsewhere = {**search.run.suspect(RUIN, 0.3), "thumbnail": "https://camera.example/1.jpg"}
    search.run.tell(suspects=[search.run.suspect(PHONE_FIX), elsewhere])
    link = second.get_by_role("link", name="Picture")  # of somebody else: asked for on a click alone
    expect(link).to_have_attribute("href", "https://camera.example/1.jpg")
    second.get_by_role("button", name="Reject 56.609643, -4.744307").click()
    dialog = watch.page.get_by_role("dialog")
    expect(dialog).to_contain_text("Reject 56.609643, -4.744307?")
    dialog.get_by_role("button", name="Reject").click()
    expect(watch.page.locator("#toast")).to_have_text("Rejected: 56.609643, -4.744307")
    assert search.run.judged == [("reject", RUIN)]


def test_cards_never_move_under_a_finger(watch: Watch, search: Served) -> None:
    page = watch.page
    first, second = search.run.suspect(PHONE_FIX, 0.6), search.run.suspect(RUIN, 0.5)
    search.run.tell(suspects=[first, second])
    reject = card(watch, RUIN).get_by_role("button", name="Reject")
    reject.hover()
    before = reject.bounding_box()
    moved = {**second, "lat": RUIN[0] + 1e-4, "written": "56.609743, -4.744307", "probability": 0.9}
    search.run.tell(
        suspects=[moved]
    )  # it is the likeliest now, a little elsewhere, and the other one is gone
    expect(page.locator("#suspects li.gone")).to_contain_text("no longer likely")
    now = page.get_by_role("button", name="Reject 56.609743, -4.744307")
    assert now.bounding_box() == before
    page.wait_for_timeout(6000)
    assert now.bounding_box() == before, "the pointer is still on the list"
    page.locator("#map").hover()
    expect(page.locator("#suspects li")).to_have_count(1, timeout=15_000)


def test_a_find_is_a_headline_that_can_be_handed_on(chromium: Browser, search: Served) -> None:
    watch = Watch(chromium, search.url, permissions=["clipboard-read", "clipboard-write"])
    page, found = watch.page, watch.page.locator("#found")
    watch.shows("SEARCHING")
    search.run.tell(suspects=[search.run.suspect(PHONE_FIX), search.run.suspect(RUIN, 0.2)])
    expect(card(watch, PHONE_FIX)).to_be_visible()
    search.run.find(PHONE_FIX)
    expect(card(watch, PHONE_FIX)).to_contain_text("this is the find")
    for state in (State.FOUND, State.RETURNING):
        search.run.be(state)
        watch.shows(state)
        expect(found).to_contain_text("56.609142, -4.739255")
        expect(found).to_contain_text("over 99.9 % sure")
        expect(page.locator("#suspects li:not(.gone)")).to_have_count(1)  # the find is not a suspect as well
    found.get_by_role("button", name="Copy").click()
    expect(page.locator("#toast")).to_contain_text("copied")
    assert page.evaluate("navigator.clipboard.readText()") == "Found at 56.609142, -4.739255"
    expect(found.get_by_role("link", name="Navigate")).to_have_attribute("href", "geo:56.609142,-4.739255")
    with page.expect_download() as saved:
        found.get_by_role("button", name="Export").click()
    point = ElementTree.fromstring(Path(saved.value.path()).read_text(encoding="utf-8"))[0]
    assert point.attrib == {"lat": "56.6091420", "lon": "-4.7392550"}
    found.get_by_role("button", name="Confirm 56.609142, -4.739255").click()
    page.get_by_role("dialog").get_by_role("button", name="Confirm").click()
    expect(page.locator("#toast")).to_contain_text("Confirmed")
    assert search.run.judged == [("confirm", PHONE_FIX)]
    search.run.find(PHONE_FIX, confirmed=True)
    expect(found).to_contain_text("confirmed by a person")
    watch.close()


def test_the_end_of_the_service_after_a_finished_run_is_no_error(chromium: Browser) -> None:
    with served() as search:
        search.run.find(PHONE_FIX)
        search.run.be(State.DONE)
        watch = Watch(chromium, search.url)
        watch.shows("DONE")
        search.end()
        expect(watch.page.locator("#ended")).to_contain_text("The search is over and the service has ended")
        expect(watch.page.locator("#lost")).to_be_hidden()
        expect(watch.page.locator("#chip")).to_have_text("Finished")
        watch.context.close()


def test_without_a_service_nothing_can_be_judged_and_what_is_shown_says_how_old_it_is(
    chromium: Browser,
) -> None:
    with served() as search:
        search.run.tell(suspects=[search.run.suspect(RUIN)])
        search.run.find(PHONE_FIX)
        watch = Watch(chromium, search.url, **PHONE)
        watch.shows("SEARCHING")
        judging = watch.page.get_by_role("button", name=re.compile("^(Confirm|Reject) "))
        expect(judging).to_have_count(4)
        search.end()
        expect(watch.page.locator("#lost")).to_be_visible()
        expect(watch.page.locator("#next")).to_have_text(re.compile(r"^Last heard of at \d+:\d\d"))
        assert [each.is_enabled() for each in judging.all()] == [False] * 4
        watch.context.close()


def test_a_token_that_only_looks_on_opens_the_page_without_orders(chromium: Browser) -> None:
    with served(
        environment={**both_tokens(), "ROISEARCH_HTTP_VIEW_TOKEN": "view-token-0123456789"}
    ) as search:
        search.run.tell(suspects=[search.run.suspect(RUIN)])
        search.run.find(PHONE_FIX)
        for token, orders in (("view-token-0123456789", False), (REPORT, False), (COMMAND, True)):
            watch = Watch(chromium, search.url)
            expect(watch.chip).to_have_text("a token is needed")
            watch.page.get_by_label("Token").fill("a-wrong-token-0123456789")
            watch.page.keyboard.press("Enter")
            expect(watch.chip).to_have_text("wrong token")
            expect(watch.page.locator("#refused")).to_contain_text("none of this service's tokens")
            watch.page.get_by_label("Token").fill(token)
            watch.page.keyboard.press("Enter")
            watch.shows("SEARCHING")
            expect(watch.page.locator("#orders")).to_be_visible(visible=orders)
            expect(watch.page.get_by_role("button", name="Confirm")).to_have_count(2 if orders else 0)
            expect(watch.page.locator("#read-only")).to_be_visible(visible=not orders)
            expect(card(watch, RUIN).get_by_role("img")).to_be_visible()
            assert watch.violations() == []
            watch.context.close()


def test_no_number_on_the_page_says_more_than_is_known(watch: Watch, search: Served) -> None:
    said = watch.page.evaluate(
        """async () => {
          const { percent, certainty, heatTicks } = await import("/page/cells.js");
          return [[0, 1e-9, 0.00096, 0.096, 0.0996, 0.42, 0.996].map(percent), [0.994, 0.9994, 0.9997].map(certainty),
            heatTicks({ top: 5e-6, decades: 3 })];
        }"""
    )
    parts = ["0 %", "under 0.001 %", "0.1 %", "10 %", "10 %", "42 %", "over 99 %"]
    assert said == [
        parts,
        ["99 %", "99.9 %", "over 99.9 %"],
        ["0.0000005 %", "0.000005 %", "0.00005 %", "0.0005 %"],
    ]
    search.run.tell(pos=0.9997)
    expect(watch.page.locator("#pos")).to_have_text("over 99.9 %")


def coordinates_of(watch: Watch) -> Locator:
    return watch.page.locator("#cursor")


def test_the_cursor_tells_the_teams_own_coordinates(chromium: Browser) -> None:
    with served(Scripted("mgrs")) as search:
        watch = Watch(chromium, search.url)
        watch.shows("SEARCHING")
        watch.page.locator("#map").hover(position={"x": 300, "y": 300})
        expect(coordinates_of(watch)).to_have_text(re.compile(r"^30V [A-Z]{2} \d{5} \d{5}$"))
        watch.close()


OFF_MIDDLE = """() => {
  const map = document.getElementById("map").getBoundingClientRect();
  const craft = document.querySelector(".craft").getBoundingClientRect();
  const middle = ({ x, y, width, height }) => [x + width / 2, y + height / 2];
  const [a, b] = [middle(map), middle(craft)];
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}"""
"""How many pixels the aircraft is from the middle of the map."""


def test_the_map_fits_follows_and_measures(watch: Watch, search: Served) -> None:
    page = watch.page
    assert page.evaluate(f"({OFF_MIDDLE})()") > 50
    follow = page.get_by_role("button", name="Follow")
    follow.click()
    page.wait_for_function(f"() => ({OFF_MIDDLE})() < 5")
    expect(follow).to_have_attribute("aria-pressed", "true")
    page.get_by_role("button", name="Fit").click()
    expect(follow).to_have_attribute("aria-pressed", "false")
    page.wait_for_function(f"() => ({OFF_MIDDLE})() > 50")
    page.get_by_role("button", name="Measure").click()
    page.locator("#map").click(position={"x": 300, "y": 300})
    page.locator("#map").click(position={"x": 500, "y": 300})
    expect(coordinates_of(watch)).to_contain_text(re.compile(r"measured: \d+ m"))
    expect(page.locator(".measured").last).to_contain_text(" m")
    page.get_by_role("button", name="Measure").click()
    expect(page.locator(".measured")).to_have_count(0)


def test_the_map_is_measured_and_places_are_told_by_keys_alone(keys: Keyboard, search: Served) -> None:
    page, press = keys.page, keys.page.keyboard.press
    crosshair, told = page.locator("#crosshair"), coordinates_of(keys.watch)
    expect(crosshair).to_be_hidden()
    keys.reach(page.locator("#map"))
    expect(crosshair).to_be_visible()
    expect(told).to_have_text(re.compile(r"^56\.\d{6}, -4\.\d{6}$"))
    before = told.inner_text()
    press("Shift+ArrowRight")
    expect(told).not_to_have_text(before)
    keys.press(page.get_by_role("button", name="Measure"))
    expect(page.locator("#map")).to_be_focused()
    press("Enter")
    press("Shift+ArrowDown")
    press("Enter")
    expect(told).to_have_text(re.compile(r"^measured: [1-9]\d* m$"))
    press("Escape")
    expect(page.get_by_role("button", name="Measure")).to_be_focused()
    expect(page.locator(".measured")).to_have_count(0)


def test_the_place_under_the_cross_hair_is_told_again_when_the_map_gets_another_size(keys: Keyboard) -> None:
    page, told = keys.page, coordinates_of(keys.watch)
    keys.reach(page.locator("#map"))
    expect(told).to_have_text(re.compile(r"^56\.\d{6}, -4\.\d{6}$"))
    before = told.inner_text()
    page.locator("header").evaluate("(header) => (header.style.paddingBottom = '9rem')")
    expect(told).not_to_have_text(before)


def test_news_get_their_place_by_keys_alone(keys: Keyboard, search: Served) -> None:
    page, press = keys.page, keys.page.keyboard.press
    keys.press(page.get_by_text("Tell news"))
    keys.press(page.get_by_role("button", name="Take it from the map"))
    expect(page.locator("#map")).to_be_focused()
    expect(page.locator("#toast")).to_contain_text("Enter takes the place under the cross-hair")
    press("ArrowUp")
    press("Enter")
    expect(page.locator("#news-metres")).to_be_focused()
    taken = [page.locator(f"#news-{which}").input_value() for which in ("lat", "lon")]
    expect(coordinates_of(keys.watch)).to_have_text(", ".join(taken))


def test_a_way_is_drawn_for_news_by_keys_alone(keys: Keyboard, search: Served) -> None:
    page, press = keys.page, keys.page.keyboard.press
    keys.press(page.get_by_text("Tell news"))
    keys.reach(page.get_by_label("Shape"))
    press("End")
    expect(page.get_by_label("Shape")).to_have_value("way")
    keys.press(page.get_by_role("button", name="Tell", exact=True))
    expect(page.locator("#toast")).to_contain_text("A way needs two corners, and there are 0")
    keys.press(page.get_by_role("button", name="Take it from the map"))
    press("Enter")
    for _ in range(2):
        press("ArrowRight")
        press("Enter")
    press("Escape")
    expect(page.get_by_label("Words")).to_be_focused()
    expect(page.get_by_text("3 corners so far")).to_be_visible()
    keys.press(page.get_by_role("button", name="Take the last corner back"))
    with page.expect_request("**/api/news") as told:
        keys.press(page.get_by_role("button", name="Tell", exact=True))
    feature = told.value.post_data_json
    (west, south), (east, north) = feature["geometry"]["coordinates"]
    assert (feature["geometry"]["type"], south == north, west < east) == ("LineString", True, True)
    assert feature["properties"]["sigma_m"] == 50.0


def test_the_map_has_two_views_names_from_the_file_and_north(watch: Watch) -> None:
    page = watch.page
    assert watch.painted("Heat layer") > 0
    page.get_by_text("Searched POD").click()
    assert watch.painted("probability of detection") > 0
    assert page.locator("canvas.cells").count() == 1
    expect(page.locator("#ticks-pod")).to_contain_text("POD 0 %")
    expect(page.locator(".roi.likely")).to_have_count(4)
    expect(page.locator(".roi.exclude")).to_have_text("mast")
    expect(page.get_by_role("img", name="North is up")).to_be_visible()


def test_after_a_find_the_rest_of_the_ground_can_still_be_told_apart(watch: Watch, search: Served) -> None:
    before = watch.painted("Heat layer")
    run = search.run.search
    row, col = run.place.cell
    for _ in range(3):
        run.belief.observe([(row, col)], [True], 0.99, 0.99)
    assert run.belief.probability().max() > 0.999
    expect(watch.page.locator("#ticks-belief")).to_contain_text("100 % a cell")
    assert watch.painted("Heat layer") == before
    expect(watch.page.locator("#ticks-belief")).to_contain_text("≤ 0.0")


LISTEN = """() => {
  window.heard = [];
  window.Notification = class {
    static permission = "granted";
    constructor(title, { body }) { window.heard.push(`${title}: ${body}`); }
  };
  const start = OscillatorNode.prototype.start;
  OscillatorNode.prototype.start = function (...when) { window.heard.push("tone"); return start.apply(this, when); };
}"""


def test_a_detection_and_a_find_are_heard_and_notified_once_switched_on(watch: Watch, search: Served) -> None:
    page = watch.page
    page.evaluate(LISTEN)
    search.run.tell(suspects=[search.run.suspect(RUIN)])
    expect(card(watch, RUIN)).to_be_visible()
    assert page.evaluate("window.heard") == [], "the switch is off"
    page.get_by_label("Sound and notification").check()
    search.run.tell(suspects=[search.run.suspect(RUIN), search.run.suspect(PHONE_FIX)])
    page.wait_for_function("() => window.heard.length >= 3")
    told = "Detection: 56.609142, -4.739255, Rannoch Moor"
    assert sorted(page.evaluate("window.heard")) == sorted(["tone", "tone", told])
    search.run.find(PHONE_FIX)
    page.wait_for_function("() => window.heard.length >= 7")
    assert "Found: 56.609142, -4.739255, Rannoch Moor" in page.evaluate("window.heard")
    page.reload()
    expect(page.get_by_label("Sound and notification")).to_be_checked()


def test_another_aircraft_is_ordered_between_two_sorties_and_the_page_says_who_flew(
    watch: Watch, search: Served
) -> None:
    replace = watch.order("Replace")
    expect(replace).to_be_disabled()
    search.run.be(State.GROUNDED)
    replace.click()
    dialog = watch.page.get_by_role("dialog")
    expect(dialog).to_contain_text("Switch the old one off before")
    dialog.get_by_role("button", name="Replace").click()
    expect(watch.page.locator("#toast")).to_have_text("Waiting for another aircraft")
    assert search.run.ordered == [("replace", None)]
    replace.click()
    dialog.get_by_label("System id of the other one").fill("300")
    dialog.get_by_role("button", name="Replace").click()
    expect(dialog).to_be_visible()  # no aircraft has such a number
    dialog.get_by_label("System id of the other one").fill("7")
    dialog.get_by_role("button", name="Replace").click()
    expect(watch.page.locator("#toast")).to_have_text("Waiting for another aircraft, of system 7")
    assert search.run.systems == [None, 7]
    flown = {"landed": 0.0, "flight_time_s": 600.0, "steps": 90, "why": "battery"}
    first = {**flown, "number": 1, "pos": 0.2, "system_id": 1, "autopilot": "px4"}
    facts = watch.page.locator("#facts")
    search.run.tell(sorties=[first])
    expect(facts).to_contain_text("20 % searched")
    expect(facts).not_to_contain_text("by system")
    search.run.tell(
        sorties=[first, {**flown, "number": 2, "pos": 0.4, "system_id": 7, "autopilot": "ardupilot"}]
    )
    expect(facts).to_contain_text("40 % searched, by system 7 (ardupilot)")

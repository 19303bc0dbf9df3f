"""What is in sight: every button, detection and find in any state, theme and width, and nothing over another."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from service.mission.states import State

from .hands import PHONE
from .scripted import PHONE_FIX, RUIN, Served, card
from .stage import Watch

pytestmark = pytest.mark.timeout(300)
TABLET: dict[str, Any] = {"viewport": {"width": 820, "height": 1180}, "has_touch": True, "is_mobile": True}
SMALL: dict[str, Any] = {"viewport": {"width": 320, "height": 568}, "has_touch": True, "is_mobile": True}
OFF_SCREEN = """() => [...document.querySelectorAll(":is(#orders, #tools, #found, .ground) :is(button, a)")]
  .filter((button) => button.checkVisibility())
  .filter((button) => {
    const { left, right } = button.getBoundingClientRect();
    return left < 0 || right > innerWidth;
  }).map((button) => button.textContent)"""
"""The buttons that reach over the edge, which a page's own width does not tell of what is fixed on it."""

COVERED = """([name, by]) => {
  const mark = document.querySelector(name).getBoundingClientRect();
  const over = document.querySelector(by).getBoundingClientRect();
  return mark.left < over.right && mark.right > over.left && mark.top < over.bottom && mark.bottom > over.top;
}"""
"""Whether one thing lies, in part, where another one is."""


WIDTHS: dict[str, dict[str, Any]] = {"desktop": {}, "tablet": TABLET, "phone": PHONE, "small": SMALL}


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("theme", ["day", "sun", "night"])
def test_axe_finds_nothing_in_any_theme_at_any_width(
    chromium: Browser, search: Served, theme: str, width: str
) -> None:
    watch = Watch(chromium, search.url, **WIDTHS[width])
    watch.shows("SEARCHING")
    watch.page.locator("#theme").select_option(theme)
    watch.page.locator("details").evaluate_all("(all) => all.forEach((each) => (each.open = true))")
    search.run.tell(suspects=[search.run.suspect(RUIN), search.run.suspect(PHONE_FIX, picture=False)])
    for state in State:
        if state in (State.FOUND, State.DONE):
            search.run.find(PHONE_FIX)
        else:
            search.run.tell(found=None)
        search.run.be(state, why="because")
        watch.shows(state)
        assert watch.violations() == [], state
        assert watch.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), state
        assert watch.page.evaluate(OFF_SCREEN) == [], state
    watch.close()


@pytest.mark.parametrize("width", ["desktop", "phone"])
def test_the_headline_of_a_find_hides_it_not(chromium: Browser, search: Served, width: str) -> None:
    watch = Watch(chromium, search.url, **WIDTHS[width])
    watch.shows("SEARCHING")
    box = watch.page.locator("#map").bounding_box()
    assert box is not None
    frame = search.run.view.ground.grid.frame
    place = tuple(float(each) for each in frame.to_latlon([(0, frame.cols // 2)])[0])
    search.run.find((place[0], place[1]))
    expect(watch.page.locator(".find")).to_be_visible()
    expect(watch.page.locator("#found")).to_be_visible()
    assert not watch.page.evaluate(COVERED, [".find", "#found"])
    watch.close()


def test_on_a_phone_the_map_says_that_a_detection_waits_and_leads_to_its_card(
    chromium: Browser, search: Served
) -> None:
    watch = Watch(chromium, search.url, **PHONE)
    watch.shows("SEARCHING")
    waits = watch.page.locator("#to-look-at")
    expect(waits).to_be_hidden()
    search.run.tell(suspects=[search.run.suspect(RUIN), search.run.suspect(PHONE_FIX, 0.2)])
    expect(waits).to_have_text("2 detections to look at")
    expect(watch.page.get_by_role("heading", name="2 detections to look at")).to_have_count(1)
    waits.tap()
    confirm = card(watch, RUIN).get_by_role("button", name="Confirm")
    expect(confirm).to_be_in_viewport(ratio=1)
    assert not watch.page.evaluate(COVERED, ["#suspects .go", "#orders"])
    assert not watch.page.evaluate(COVERED, ["#suspects .go", "header"])
    search.run.tell(suspects=[])
    expect(waits).to_be_hidden()
    watch.close()


def test_a_toast_covers_no_order(chromium: Browser, search: Served) -> None:
    watch = Watch(chromium, search.url, **PHONE)
    page = watch.page
    watch.shows("SEARCHING")
    watch.order("Hold").click()
    expect(page.locator("#toast")).not_to_be_empty()
    assert not page.evaluate(COVERED, ["#toast", "#orders"])
    watch.close()

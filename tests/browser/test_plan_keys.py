"""Drawing without a mouse: what each key does, what is read out, and how it looks in any colours at any width."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, expect

from .hands import Fingers, Keyboard, drawing
from .scripted import Board, board

pytestmark = pytest.mark.timeout(300)
GROUND = "Ground to search"
CORNERS = ((-4, -4), (8, 0), (0, 8), (-8, 0))


@pytest.fixture
def paper(tmp_path: Path) -> Iterator[Board]:
    """An empty map to draw on."""
    with board(tmp_path / "area.geojson") as opened:
        yield opened


@pytest.fixture
def keys(chromium: Browser, paper: Board) -> Iterator[Keyboard]:
    """A keyboard at it, over a moor."""
    hand = Keyboard(chromium, paper.url)
    go_there(hand)
    yield hand
    hand.close()


def go_there(hand: Keyboard) -> None:
    """Let the map be over the moor."""
    hand.write(hand.page.get_by_label("Latitude"), "56.6085")
    hand.write(hand.page.get_by_label("Longitude"), "-4.742")
    hand.press(hand.page.get_by_role("button", name="Go there"))
    hand.page.wait_for_timeout(400)  # the map flies there


def said(hand: Keyboard) -> Locator:
    """What is read out."""
    region = hand.page.locator("#aimed")
    expect(region).to_have_attribute("role", "status")
    return region


def saved(hand: Keyboard, paper: Board) -> list[dict[str, Any]]:
    """What was drawn, as it is in the file."""
    hand.press(hand.page.get_by_role("button", name="Save"))
    expect(hand.page.locator("#told")).to_contain_text("Saved in")
    features: list[dict[str, Any]] = json.loads(paper.file.read_text(encoding="utf-8"))["features"]
    hand.page.locator("#told").evaluate("(told) => (told.textContent = '')")
    return features


def handles(hand: Keyboard, name: str) -> Locator:
    """What can be moved on the map."""
    return hand.page.locator("#map").get_by_role("button", name=name)


def test_each_key_does_what_the_help_says_and_all_of_it_is_read_out(keys: Keyboard) -> None:
    page, press = keys.page, keys.page.keyboard.press
    keys.press(page.get_by_text("Drawing without a mouse"))
    told = page.locator("#keys dt kbd").all_inner_texts()
    assert told == ["←", "→", "↑", "↓", "+", "-", "Enter", "Backspace", "Escape"]
    keys.press(drawing(keys.watch, GROUND))
    expect(page.locator("#map")).to_be_focused()
    expect(page.locator("#crosshair")).to_be_visible()
    expect(said(keys)).to_have_text(
        re.compile("^Ground to search: arrow keys move the map .* Enter sets a corner")
    )
    press("Backspace")
    expect(said(keys)).to_have_text("There is no corner to take back.")
    press("Enter")
    expect(said(keys)).to_have_text("Corner 1 set.")
    press("Enter")
    expect(said(keys)).to_have_text(re.compile("There is a corner here already"))
    press("Shift+ArrowRight")
    expect(said(keys)).to_have_text(re.compile(r"^56\.60\d{4}, -4\.73\d{4}, \d+ m from the last corner$"))
    expect(page.locator("#cursor")).to_have_text(re.compile(r"^56\.60\d{4}, -4\.73\d{4}$"))
    press("Enter")
    expect(said(keys)).to_have_text(re.compile(r"^Corner 2 set, \d+ m from the last corner\.$"))
    press("Backspace")
    expect(said(keys)).to_have_text("Taken back; 1 corner left.")
    press("Backspace")
    expect(said(keys)).to_have_text("Taken back; 0 corners left.")
    press("Enter")
    expect(said(keys)).to_have_text("Corner 1 set.")
    press("Escape")
    expect(said(keys)).to_have_text("Given up; nothing is drawn.")
    expect(drawing(keys.watch, GROUND)).to_be_focused()
    expect(page.locator("#crosshair")).to_be_hidden()
    expect(page.locator("#drawn li")).to_have_count(0)


def test_a_border_that_would_cross_itself_is_refused_in_words_and_closes_on_its_first_corner(
    keys: Keyboard, paper: Board
) -> None:
    page, press = keys.page, keys.page.keyboard.press
    keys.press(drawing(keys.watch, GROUND))
    for way in ((0, 0), (10, 0), (0, 10)):
        keys.go(way)
        press("Enter")
    keys.go((-5, -15))
    press("Enter")
    expect(said(keys)).to_have_text("No corner is set: the border would cross itself.")
    keys.go((-5, 5))
    expect(said(keys)).to_have_text(re.compile("^On the first corner"))
    press("Enter")
    expect(said(keys)).to_have_text("Ground to search: drawn.")
    expect(drawing(keys.watch, GROUND)).to_be_focused()
    expect(page.locator("#drawn li")).to_have_count(1)
    (ground,) = saved(keys, paper)
    assert len(ground["geometry"]["coordinates"][0]) == 4  # three corners, and the first again


def test_a_line_is_drawn_by_keys_and_may_cross_itself(keys: Keyboard, paper: Board) -> None:
    page, press = keys.page, keys.page.keyboard.press
    keys.draw(GROUND, *CORNERS)
    keys.press(drawing(keys.watch, "Likely line"))
    press("Enter")
    press("Enter")
    expect(said(keys)).to_have_text("There is a corner here already. A line needs two corners.")
    for way in ((3, 0), (0, 3), (-1, -5)):
        keys.go(way)
        press("Enter")
    press("Backspace")
    expect(said(keys)).to_have_text("Taken back; 3 corners left.")
    press("Enter")
    expect(page.get_by_role("button", name="End")).to_be_visible()
    press("Enter")
    expect(said(keys)).to_have_text("Likely line: drawn.")
    expect(drawing(keys.watch, "Likely line")).to_be_focused()
    _, line = saved(keys, paper)
    assert line["geometry"]["type"] == "LineString"
    assert len(line["geometry"]["coordinates"]) == 4
    assert line["properties"] == {"role": "prior", "name": "", "weight": 1, "width_m": 60}


def test_places_are_read_out_as_the_team_writes_them(chromium: Browser, tmp_path: Path) -> None:
    with board(tmp_path / "area.geojson", "mgrs") as paper:
        hand = Keyboard(chromium, paper.url)
        go_there(hand)
        hand.press(drawing(hand.watch, "Launch"))
        hand.page.keyboard.press("Shift+ArrowRight")
        expect(said(hand)).to_have_text(re.compile(r"^30V UH \d{5} \d{5}$"))
        hand.page.keyboard.press("Enter")
        expect(said(hand)).to_have_text("Launch: drawn.")
        hand.reach(handles(hand, "Launch; arrow keys move it"))
        hand.page.keyboard.press("Shift+ArrowRight")
        expect(said(hand)).to_have_text(re.compile(r"^Moved to 30V UH \d{5} \d{5}$"))
        hand.close()


def test_pins_and_corners_are_moved_by_arrow_keys(keys: Keyboard, paper: Board) -> None:
    keys.draw(GROUND, *CORNERS)
    keys.draw("Launch", (2, -2))
    before = saved(keys, paper)
    keys.reach(handles(keys, "Launch; arrow keys move it"))
    keys.page.keyboard.press("Shift+ArrowRight")
    expect(said(keys)).to_have_text(re.compile("^Moved to 56"))
    expect(
        keys.page.get_by_role("button", name="Start the search")
    ).to_be_disabled()  # not as it is saved any more
    keys.reach(handles(keys, "corner; arrow keys move it").first)
    keys.page.keyboard.press("Shift+ArrowUp")
    after = saved(keys, paper)
    assert after[1]["geometry"]["coordinates"][0] > before[1]["geometry"]["coordinates"][0] + 1e-4
    ring, moved = (each[0]["geometry"]["coordinates"][0] for each in (before, after))
    assert moved[0][1] > ring[0][1] + 1e-4
    assert moved[1:4] == ring[1:4]


def test_corners_are_added_and_removed_by_keys(keys: Keyboard, paper: Board) -> None:
    keys.draw(GROUND, *CORNERS)
    keys.reach(handles(keys, "middle of a side").first)
    keys.page.keyboard.press("Enter")
    expect(handles(keys, "corner; arrow keys move it")).to_have_count(5)
    for left in (4, 3, 3):
        keys.reach(handles(keys, "corner; arrow keys move it").last)
        keys.page.keyboard.press("Delete")
        expect(handles(keys, "corner; arrow keys move it")).to_have_count(left)
    expect(said(keys)).to_have_text("Ground needs three corners, a line two.")
    (ground,) = saved(keys, paper)
    assert len(ground["geometry"]["coordinates"][0]) == 4


def test_the_way_past_the_map_is_short(keys: Keyboard) -> None:
    keys.draw(GROUND, *CORNERS)
    keys.reach(keys.page.get_by_role("link", name="Skip the map"))
    keys.page.keyboard.press("Enter")
    keys.page.keyboard.press("Tab")
    expect(drawing(keys.watch, GROUND)).to_be_focused()


def test_the_place_under_the_cross_hair_is_told_as_the_team_writes_places(
    chromium: Browser, tmp_path: Path
) -> None:
    with board(tmp_path / "area.geojson", "mgrs") as opened:
        hand = Keyboard(chromium, opened.url)
        go_there(hand)
        hand.press(drawing(hand.watch, GROUND))
        hand.page.keyboard.press("ArrowUp")
        expect(hand.page.locator("#cursor")).to_have_text(re.compile(r"^30V [A-Z]{2} \d{5} \d{5}$"))
        hand.close()


@pytest.mark.parametrize("theme", ["day", "sun", "night"])
@pytest.mark.parametrize("way", [Keyboard, Fingers], ids=["desktop", "phone"])
def test_axe_finds_nothing_while_it_is_drawn(
    way: type[Keyboard], theme: str, chromium: Browser, paper: Board
) -> None:
    hand = way(chromium, paper.url)
    page, watch = hand.page, hand.watch
    page.get_by_label("Colours").select_option(theme)
    assert watch.violations() == []
    go_there(hand)
    hand.draw(GROUND, *CORNERS)
    hand.draw("Launch", (2, -2))
    hand.draw("Likely place", (1, -1))
    assert watch.violations() == []
    hand.press(drawing(watch, "Never fly here"))
    page.locator("details").evaluate_all("(all) => all.forEach((each) => (each.open = true))")
    hand.press(page.get_by_role("button", name="Set here"))
    assert watch.violations() == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    saved(hand, paper)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.reload()
    expect(page.locator("html")).to_have_attribute("data-theme", theme)
    hand.close()

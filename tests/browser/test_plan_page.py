"""Drawing a search with no file at all: area, exclusion, likely place and launch are drawn, moved and saved."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from service.area import LinePrior, RingPrior, read_area
from tests.integration.flight import running

from .scripted import Board, board
from .stage import Watch

pytestmark = pytest.mark.timeout(300)


def roles(file: Path) -> list[str]:
    """The roles of what was saved."""
    saved: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return [each["properties"]["role"] for each in saved["features"]]


def draw(watch: Watch, what: str, *points: tuple[int, int]) -> None:
    """Draw something by clicks on the map."""
    watch.page.locator("#draw").get_by_role("button", name=what, exact=True).click()
    for x, y in points:
        watch.page.locator("#map").click(position={"x": x, "y": y})
        watch.page.wait_for_timeout(300)  # two clicks at once are a double click


@pytest.fixture
def paper(tmp_path: Path) -> Iterator[Board]:
    """An empty map to draw on."""
    with board(tmp_path / "drawn.geojson") as opened:
        yield opened


def test_a_search_is_drawn_moved_and_saved(chromium: Browser, paper: Board) -> None:
    file, watch = paper.file, Watch(chromium, paper.url)
    page = watch.page
    page.get_by_role("button", name="Save").click()
    expect(page.locator("#told")).not_to_have_text("")  # nothing was drawn: one sentence, and no file
    assert not file.exists()
    watch.complaints.clear()  # Chromium says that it was refused
    page.get_by_label("Latitude").fill("56.6085")
    page.get_by_label("Longitude").fill("-4.742")
    page.get_by_role("button", name="Go there").click()
    page.wait_for_timeout(800)
    page.get_by_label("Name").first.fill("Drawn moor")
    draw(watch, "Ground to search", (400, 250), (520, 250), (520, 340), (400, 340), (400, 250))
    expect(page.locator("#drawn li")).to_have_count(1)
    draw(watch, "Likely place", (480, 290))
    draw(watch, "Launch", (420, 330))
    draw(watch, "Launch", (410, 325))  # there is one launch: the second takes the place of the first
    draw(watch, "Never fly here", (450, 265), (510, 265), (510, 278), (450, 265))
    crossing = ((410, 300), (470, 320), (470, 300), (430, 330), (430, 330))  # as a trail may
    draw(watch, "Likely line", *crossing)
    draw(watch, "Last seen", (430, 280))
    expect(page.locator("#drawn li")).to_have_count(6)
    page.get_by_label("Within about, metres").fill("40")
    page.get_by_label("Width, metres").fill("30")
    terrain = page.get_by_label("Terrain", exact=True)
    page.get_by_label("Who is lost", exact=True).select_option("autistic")
    assert terrain.locator("option").all_inner_texts()[0] == "urban"
    page.get_by_label("Who is lost", exact=True).select_option(
        "hiker"
    )  # there are no figures of hikers in towns
    terrain.select_option("dry flat")
    page.wait_for_timeout(300)
    assert watch.violations() == []
    page.get_by_role("button", name="Save").click()
    expect(page.locator("#told")).to_contain_text("Saved in")
    assert sorted(roles(file)) == ["exclude", "ipp", "launch", "prior", "prior", "search"]
    before = read_area(file)
    kinds = {type(prior): prior for prior in before.priors}
    line, rings = kinds[LinePrior], kinds[RingPrior]
    assert isinstance(line, LinePrior)
    assert isinstance(rings, RingPrior)
    assert (line.width_m, len(line.line.geoms[0].coords)) == (30.0, 4)
    assert rings.about == "hiker, dry flat"
    assert before.name == "Drawn moor"
    assert before.launch is not None
    pin = page.locator(".pin", has=page.locator("[data-kind=launch]")).bounding_box()
    assert pin is not None
    page.mouse.move(pin["x"] + 15, pin["y"] + 15)
    page.mouse.down()
    page.mouse.move(pin["x"] + 75, pin["y"] - 15, steps=8)
    page.mouse.up()
    expect(
        page.get_by_role("button", name="Start the search")
    ).to_be_disabled()  # not as it is saved any more
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("button", name="Start the search")).to_be_enabled()
    after = read_area(file)
    assert after.launch is not None
    assert after.launch[1] > before.launch[1]
    page.reload()
    expect(page.locator("#drawn li")).to_have_count(6)  # what was saved is drawn on
    page.get_by_role("button", name="Save").click()
    expect(page.locator("#told")).to_contain_text("Saved in")
    assert read_area(file).priors == after.priors
    watch.close()


def test_what_cannot_be_drawn_stays_in_the_file(chromium: Browser, tmp_path: Path) -> None:
    file = tmp_path / "area.geojson"
    square = [[-4.7465, 56.6065], [-4.738, 56.6065], [-4.738, 56.61], [-4.7465, 56.61], [-4.7465, 56.6065]]
    wood = {"type": "Polygon", "coordinates": [[*square[:3], square[0]]]}
    lost = {"role": "ipp", "subject": "Child (4-6)", "terrain": "Dry, flat"}
    features = [
        {"type": "Feature", "properties": {"role": "search", "outside": 0.1},
         "geometry": {"type": "Polygon", "coordinates": [square]}},
        {"type": "Feature", "properties": {"role": "cover", "kind": "scrub"}, "geometry": wood},
        {"type": "Feature", "properties": lost, "geometry": {"type": "Point", "coordinates": [-4.74, 56.608]}},
    ]  # fmt: skip
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    with running("service", "plan", "--out", str(file), "--http", "127.0.0.1:0") as service:
        url = service.wait_for(r"at (http://\S+)", 60.0).group(1)
        watch = Watch(chromium, url)
        expect(watch.page.locator("#drawn li")).to_have_count(2)
        watch.page.get_by_role("button", name="Save").click()
        expect(watch.page.locator("#told")).to_contain_text("Saved in")
        watch.close()
    area = read_area(file)
    assert area.outside == pytest.approx(0.1)
    assert [each.kind for each in area.covers] == ["scrub"]
    (prior,) = area.priors
    assert isinstance(prior, RingPrior)
    assert prior.about == "child 4-6, dry flat"  # as it is spelt in the file

"""The live page in a real browser, beside a search that really flies against the mock autopilot.

One search for all: the tests are in the order in which it can be looked at.
"""

from __future__ import annotations

import base64
import json
import re
import time
import uuid
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, WebSocket, expect

from service.area.frame import GridFrame

from .scripted import JPEG
from .stage import PATIENCE_MS, Stage, Watch, searching

pytestmark = pytest.mark.timeout(300)


def craft(page: Page) -> str:
    """Where the page shows the aircraft."""
    transform: str = page.locator(".craft").evaluate("(element) => element.style.transform")
    return transform


def test_the_page_shows_a_search_that_is_running(watch: Watch, stage: Stage) -> None:
    page = watch.page
    searching(watch)
    expect(page.locator("#area")).to_have_text("Rannoch Moor")
    expect(page.locator(".roi.likely span")).to_have_count(4)
    expect(page.locator(".roi.likely span").first).to_contain_text("%")
    expect(page.locator("#goals")).to_contain_text("to 50 %", timeout=PATIENCE_MS)
    expect(page.locator("#chip")).to_have_text(re.compile("^(Searching|Looking again)$"))
    page.wait_for_function("() => / m, |here, /.test(document.getElementById('next').textContent)")
    page.get_by_text("Why?").click()
    expect(page.locator("#options tbody tr.chosen")).to_be_visible()
    assert page.locator("#options tbody tr").count() >= 2
    expect(page.locator("#strip")).to_contain_text("above ground")
    expect(page.locator("#facts")).to_contain_text("% received")
    assert (
        watch.painted("Heat layer") >= 50
    )  # of 315 cells: a false alarm leaves most three decades below the peak
    before = craft(page)
    page.wait_for_function(
        "(before) => document.querySelector('.craft').style.transform !== before", arg=before
    )
    page.wait_for_function("() => parseFloat(document.getElementById('pos').textContent) > 0")
    page.get_by_text("Searched POD").click()
    assert watch.painted("probability of detection") > 0
    assert abs(float(page.locator("#pos").inner_text().split()[0]) - 100 * stage.state()["pos"]) < 5.0
    expect(page.locator(".leaflet-control-scale-line")).to_contain_text("m")


def test_nothing_is_asked_of_anybody_but_the_service(watch: Watch, stage: Stage) -> None:
    searching(watch)
    watch.page.wait_for_function(
        "() => document.querySelectorAll('.leaflet-tile-loaded').length > 0"
    )  # MBTiles
    assert {url.split("/")[2] for url in watch.asked if not url.startswith("blob:")} == {
        f"127.0.0.1:{stage.port}"
    }


def test_moments_come_over_one_websocket_and_are_small(watch: Watch) -> None:
    page = watch.page
    searching(watch)
    opened: list[WebSocket] = []
    frames: list[str | bytes] = []

    def note(socket: WebSocket) -> None:
        opened.append(socket)
        socket.on("framereceived", lambda frame: frames.append(frame))

    page.on("websocket", note)
    page.reload()
    searching(watch)
    asked = len(watch.asked)
    while len(frames) < 12:
        page.wait_for_timeout(50)
    assert len(opened) == 1
    assert [url for url in watch.asked[asked:] if "/tiles/" not in url and not url.startswith("blob:")] == []
    told = [json.loads(frame) for frame in frames]
    assert told[0]["type"] == "scene"
    assert {each["type"] for each in told[1:]} <= {"moment", "regions"}
    moments = [each for each in told if each["type"] == "moment"][1:]  # the first has everything
    assert len(moments) > 5
    cells = 15 * 21
    assert all(len(moment["belief"].get("codes", "")) < cells for moment in moments)


def test_reload_keeps_the_view(watch: Watch) -> None:
    page = watch.page
    searching(watch)
    page.get_by_text("Searched POD").click()
    page.get_by_role("button", name="Zoom in").click()
    page.locator("#map").focus()
    page.keyboard.press("ArrowLeft")
    page.wait_for_timeout(600)
    kept = "Object.entries(localStorage).find(([key]) => key.startsWith('view of'))[1]"
    before = json.loads(page.evaluate(kept))
    page.reload()
    searching(watch)
    expect(page.locator("#view-pod")).to_be_checked()
    expect(page.locator("#view-belief")).not_to_be_checked()
    page.get_by_label("track flown").uncheck()  # writes the view down again
    after = json.loads(page.evaluate(kept))
    assert before["zoom"] == after["zoom"]
    assert before["centre"] == pytest.approx(
        after["centre"], abs=4e-5
    )  # a few pixels: the header has grown since
    assert page.locator("canvas.cells").count() == 1


def at_rest(stage: Stage) -> bool:
    """Wait until the aircraft stands still; what it really does, not what it says."""
    deadline = time.monotonic() + PATIENCE_MS / 1000
    still = 0
    while still < 10:  # in a corner of its way it stands for a moment too
        still = still + 1 if stage.control.state()["speed"] <= 0.3 else 0
        assert time.monotonic() < deadline, stage.control.state()
        time.sleep(0.05)
    return True


def test_hold_stops_the_aircraft_and_resume_asks_first(watch: Watch, stage: Stage) -> None:
    page = watch.page
    searching(watch)
    watch.order("Hold").click()
    watch.shows("HOLDING")
    expect(page.locator("#toast")).to_have_text("It holds still")
    assert at_rest(stage)
    stands = stage.control.state()
    expect(watch.order("Hold")).to_be_disabled()
    watch.order("Resume").click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("Resume the search?")
    dialog.get_by_role("button", name="Cancel").click()
    expect(dialog).to_be_hidden()
    assert stage.state()["state"] == "HOLDING"
    now = stage.control.state()
    assert abs(now["north"] - stands["north"]) + abs(now["east"] - stands["east"]) < 2.0
    watch.order("Resume").click()
    dialog.get_by_role("button", name="Resume").click()
    searching(watch)
    deadline = time.monotonic() + PATIENCE_MS / 1000
    while stage.control.state()["speed"] < 1.0:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_rejected_detection_lowers_the_map_there(watch: Watch, stage: Stage) -> None:
    page = watch.page
    searching(watch)
    stage.door.post("/api/commands", json={"command": "hold"})  # nobody else is to change the map there
    watch.shows("HOLDING")
    assert at_rest(stage)
    for each in stage.state()["suspects"]:  # a false alarm nearby would take this one into its own square
        stage.door.post("/api/commands", json={"command": "reject", "lat": each["lat"], "lon": each["lon"]})
    grid = stage.door.get("/api/map").json()
    frame = GridFrame.from_dict(grid["frame"])
    left = np.array(grid["probability"], dtype=float)  # null is nan
    pose = stage.state()["pose"]
    row, col = frame.to_cells([(pose["lat"], pose["lon"])])[0].tolist()
    rows, cols = np.indices(left.shape)
    left[abs(rows - row) + abs(cols - col) != 1] = (
        np.nan
    )  # not what is being watched, and near enough for a pose
    row, col = (int(i) for i in np.unravel_index(np.nanargmax(left), left.shape))
    lat, lon = frame.to_latlon([(row, col)])[0].tolist()
    seen = {"lat": lat, "lon": lon, "score": 0.9, "image": base64.b64encode(JPEG).decode()}
    pose = {"lat": lat, "lon": lon, "height_m": 30.0, "heading_deg": 0.0}
    report = {"id": f"test-{uuid.uuid4()}", "source": "test", "pose": pose}
    report["captured_at"] = stage.state()["time"] - 1.0
    receipt = stage.door.post("/api/reports", json={**report, "detections": [seen]}).json()[0]
    assert receipt["hits"] == 1, receipt
    expect(page.locator("#suspects-card")).to_be_visible()
    item = page.locator("#suspects li").filter(has=page.get_by_role("img"))
    expect(item).to_contain_text("sure, score 0.90")
    expect(item.get_by_role("img")).to_have_js_property("naturalWidth", 1)
    (kept,) = (stage.run / "pictures").iterdir()
    assert kept.read_bytes() == JPEG
    assert stage.door.get(f"/api/pictures/{kept.name}").headers["content-type"] == "image/jpeg"
    assert watch.violations() == []
    before, shown = probability(stage, row, col), watch.cell(row, col)
    item.get_by_role("button", name="Reject").click()
    page.get_by_role("dialog").get_by_role("button", name="Reject").click()
    expect(page.locator("#toast")).to_contain_text("Rejected: ")
    page.locator("#map").hover()
    expect(item).to_have_count(0)
    assert probability(stage, row, col) < before / 10
    assert watch.cell(row, col) < shown, "the map on the page is paler there"


def test_news_are_told_on_the_page_and_taken_back_with_one_click(watch: Watch, stage: Stage) -> None:
    page = watch.page
    searching(watch)
    stage.door.post("/api/commands", json={"command": "hold"})
    watch.shows("HOLDING")
    assert at_rest(stage)
    page.get_by_text("Tell news").click()
    assert watch.violations() == []
    page.locator("#map").click(position={"x": 400, "y": 300})
    expect(page.get_by_label("Latitude")).not_to_have_value("")
    page.get_by_label("Still counts at, metres").fill("60")
    page.get_by_label("Likelier if the target is there, times").fill("30")
    page.get_by_label("Words").fill("red <b>hat</b>")
    page.get_by_role("button", name="Tell", exact=True).click()
    item = page.locator("#news li")
    expect(item).to_contain_text("red <b>hat</b>")
    (news,) = stage.state()["news"]
    assert (news["role"], news["words"]) == ("clue", "red <b>hat</b>")
    drawn = page.locator("#map path.told.clue")
    expect(drawn).to_have_count(1)
    layer = page.get_by_label("news from the field", exact=True)
    layer.set_checked(False)
    expect(drawn).to_have_count(0)
    layer.set_checked(True)
    expect(drawn).to_have_count(1)
    assert watch.violations() == []
    page.get_by_role("button", name="Take back").click()
    expect(item).to_have_count(0)
    expect(drawn).to_have_count(0)
    assert stage.state()["news"] == []
    page.locator("#news-role").select_option("exclude")
    expect(page.get_by_label("Likelier if the target is there, times")).to_be_hidden()
    expect(page.get_by_label("Not within, metres")).to_be_visible()
    page.locator("#news-role").select_option("searched")
    page.get_by_label("Shape").select_option("in an outline")
    expect(page.get_by_label("Latitude")).to_be_hidden()
    for x, y in ((380, 280), (460, 280), (460, 350), (700, 350)):
        page.locator("#map").click(position={"x": x, "y": y})
    expect(page.get_by_text("4 corners so far")).to_be_visible()
    page.get_by_role("button", name="Take the last corner back").click()
    expect(page.get_by_text("3 corners so far")).to_be_visible()
    assert watch.violations() == []
    page.get_by_label("Words").fill("team 2")
    page.get_by_role("button", name="Tell", exact=True).click()
    expect(item).to_contain_text("searched by others")
    expect(page.get_by_text("no corners so far")).to_be_visible()
    (news,) = stage.state()["news"]
    assert (news["geometry"]["type"], len(news["geometry"]["coordinates"][0][0])) == ("MultiPolygon", 4)
    page.get_by_role("button", name="Take back:").click()
    expect(item).to_have_count(0)
    page.locator("#news-role").select_option("refute")
    expect(page.get_by_label("Shape")).to_be_hidden()
    expect(page.get_by_label("Latitude")).to_be_hidden()
    page.get_by_label("Words").fill("another phone")
    page.get_by_role("button", name="Tell", exact=True).click()
    expect(item).to_contain_text("not assumed any more")
    (news,) = stage.state()["news"]
    assert (news["role"], news["geometry"]) == ("refute", None)
    page.get_by_role("button", name="Take back").click()
    expect(item).to_have_count(0)


def probability(stage: Stage, row: int, col: int) -> float:
    """The probability of a cell, as the service tells it."""
    cell: float = stage.door.get("/api/map").json()["probability"][row][col]
    return cell


def focused(page: Page) -> str:
    """What has the keyboard."""
    text: str = page.evaluate("document.activeElement.textContent.trim() || document.activeElement.id")
    return text


def test_a_keyboard_is_enough(watch: Watch, stage: Stage) -> None:
    page = watch.page
    searching(watch)
    page.keyboard.press("Tab")
    assert focused(page) == "Hold"  # the first stop: the way to stop must be short
    page.keyboard.press("Enter")
    watch.shows("HOLDING")
    for _ in range(10):
        page.keyboard.press("Tab")
        if focused(page) == "Resume":
            break
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog")).to_be_visible()
    assert focused(page) == "Cancel"
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_be_hidden()
    assert focused(page) == "Resume"
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog")).to_be_visible()
    assert focused(page) == "Cancel"  # a key that comes sooner goes to the page behind
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    searching(watch)
    reached = set()
    for _ in range(35):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id"))
    assert {"map", "view-belief", "fit", "layer-regions", "layer-tiles"} <= reached


LATE = """() => window.addEventListener("close", (event) => {
  if (!event.isTrusted) return;
  event.stopImmediatePropagation();
  setTimeout(() => event.target.dispatchEvent(new Event("close")), 1000);
}, true)"""


def test_a_question_that_ends_late_does_not_answer_the_next_one(watch: Watch, stage: Stage) -> None:
    searching(watch)
    watch.order("Hold").click()
    watch.shows("HOLDING")
    watch.page.evaluate(LATE)  # as on a busy host
    dialog = watch.page.get_by_role("dialog")
    watch.order("Return").click()
    dialog.get_by_role("button", name="Cancel").click()
    watch.order("Resume").click()
    dialog.get_by_role("button", name="Resume").click()
    searching(watch)


def test_no_serious_finding_of_axe(watch: Watch, stage: Stage) -> None:
    searching(watch)
    assert watch.violations() == []
    watch.order("Return").click()
    expect(watch.page.get_by_role("dialog")).to_be_visible()
    assert watch.violations() == []
    watch.page.keyboard.press("Escape")
    watch.page.goto(stage.url + "/docs")
    expect(watch.page.get_by_text("POST /api/reports")).to_be_visible()
    assert watch.violations() == []


def test_a_phone_shows_everything_that_matters(chromium: Browser, stage: Stage) -> None:
    phone = Watch(
        chromium, stage.url, viewport={"width": 390, "height": 844}, device_scale_factor=2, has_touch=True
    )
    page = phone.page
    searching(phone)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for name in ("Hold", "Resume", "Return"):
        box = phone.order(name).bounding_box()
        assert box is not None
        assert box["height"] >= 44
        assert box["y"] + box["height"] < 844
    box = page.locator("#map").bounding_box()
    assert box is not None
    assert box["height"] > 300
    assert box["y"] + box["height"] < 844
    page.mouse.wheel(0, 3000)
    expect(phone.order("Hold")).to_be_in_viewport()  # wherever one has scrolled to
    assert phone.violations() == []
    phone.order("Hold").tap()
    phone.shows("HOLDING")
    phone.order("Resume").tap()
    page.get_by_role("dialog").get_by_role("button", name="Resume").tap()
    searching(phone)
    phone.close()


def test_programs_get_the_same_over_a_socket(stage: Stage) -> None:
    door, deadline = stage.door, time.monotonic() + PATIENCE_MS / 1000
    while len(door.get("/api/decisions").json()) < 5:
        assert time.monotonic() < deadline, stage.service.said
        time.sleep(0.2)
    shapes = door.get("/api/map", params={"format": "geojson"}).json()
    roles = [each["properties"]["role"] for each in shapes["features"]]
    assert roles.count("cell") == 315
    assert {"search", "exclude", "launch", "region", "cell", "track"} <= set(roles)
    mass = sum(
        each["properties"].get("probability", 0)
        for each in shapes["features"]
        if each["properties"]["role"] == "cell"
    )
    assert mass + shapes["outside"] == pytest.approx(1.0)
    decisions: list[dict[str, Any]] = door.get("/api/decisions", params={"count": 5}).json()
    assert len(decisions) == 5
    assert any(option["chosen"] for option in decisions[0]["options"])
    told = door.get("/metrics").text
    for name in (
        "roisearch_step_seconds_bucket",
        "roisearch_hit_to_waypoint_seconds_bucket",
        "roisearch_reports_accepted",
        "roisearch_belief_entropy_bits",
        "roisearch_link_quality",
    ):
        assert name in told
    assert door.get("/readyz").text == "ready\n"
    assert door.get("/api/map.png").content.startswith(b"\x89PNG")


def test_the_readmes_pictures(watch: Watch, chromium: Browser, stage: Stage, pictures: Path | None) -> None:
    """Made when ROISEARCH_PICTURES names a folder; the sizes are looked at always."""
    page = watch.page
    searching(watch)
    if pictures is not None:
        page.wait_for_function(
            "() => parseFloat(document.getElementById('pos').textContent) > 38", timeout=240_000
        )
    wide = page.screenshot()
    phone = Watch(chromium, stage.url, viewport={"width": 390, "height": 844}, device_scale_factor=2)
    searching(phone)
    phone.page.wait_for_function("() => document.getElementById('goals').textContent.includes('50')")
    narrow = phone.page.screenshot()
    phone.close()
    for name, picture in (("page.png", wide), ("page-phone.png", narrow)):
        assert picture.startswith(b"\x89PNG")
        assert len(picture) > 20_000  # something is on it
        if pictures is not None:
            (pictures / name).write_bytes(picture)


def test_a_restart_of_the_service_is_survived(chromium: Browser, stage: Stage) -> None:
    watch = Watch(chromium, stage.url)
    page = watch.page
    searching(watch)
    page.get_by_label("detector hits").uncheck()
    page.evaluate("window.same = true")
    stage.service.process.kill()
    expect(page.locator("#lost")).to_contain_text("No connection")
    expect(watch.order("Hold")).to_be_disabled()
    pos = page.locator("#pos").inner_text()
    watch.complaints.clear()
    stage.start_again()
    watch.shows("SEARCHING", "CONFIRMING")
    expect(page.locator("#lost")).to_be_hidden()
    assert page.evaluate("window.same"), "the page was not loaded again"
    assert float(page.locator("#pos").inner_text().split()[0]) >= float(pos.split()[0]) - 0.2
    expect(page.get_by_label("detector hits")).not_to_be_checked()
    expect(watch.order("Hold")).to_be_enabled()
    refused = "ERR_CONNECTION_REFUSED"  # what Chromium itself says while nobody listens
    assert [said for said in watch.complaints if refused not in said] == []
    watch.context.close()

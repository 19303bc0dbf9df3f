"""A whole search, from an empty map to the place that is handed over: by keyboard alone, and by fingers on a phone.

The flight is a real one against the mock autopilot; only the two detections are told by the test.
"""

from __future__ import annotations

import base64
import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, Locator, expect

from service.area.frame import GridFrame
from sim.autopilot.process import AutopilotProcess
from tests.integration.flight import Process, only_report, running
from tests.ports import free_port

from .hands import Fingers, Keyboard
from .scripted import JPEG
from .stage import LAUNCH, PATIENCE_MS

pytestmark = pytest.mark.timeout(300)
SPEEDUP = 12.0
SETTINGS = """
[link]
silent_after_s = 30  # of the vehicle's time; a busy host may pause for longer than it usually has
[sensor]
p_tp = 0.9
p_tn = 0.999  # one hit stands out
silent_after_s = 600  # nobody looks but the test
"""
SHARING = """window.shared = [];
navigator.share = async (what) => void window.shared.push(what.text);"""
"""A browser without a window has nobody to share with."""


class Drawn:
    """`roisearch-service plan` beside an aircraft on the ground."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.file, self.runs = folder / "drawn.geojson", folder / "runs"
        settings = folder / "settings.toml"
        settings.write_text(SETTINGS, encoding="utf-8")
        mock = AutopilotProcess("px4", speedup=SPEEDUP, options=(LAUNCH, "--ready-after", "3"))
        port = stack.enter_context(mock).port
        self.url = f"http://127.0.0.1:{free_port()}"
        self.service: Process = stack.enter_context(
            running(
                "service", "plan", "--out", str(self.file), "--runs", str(self.runs), "--takeoff", "--flat",
                "--http", self.url.removeprefix("http://"), "--connect", f"udpout://127.0.0.1:{port}",
                "--speedup", str(SPEEDUP), "--config", str(settings),
            )
        )  # fmt: skip
        self.service.wait_for(r"draw the area of .* at http://\S+", 60.0)
        self.door = stack.enter_context(httpx.Client(base_url=self.url, timeout=30.0))
        self.seen = 0

    def sees(self, rows: int) -> tuple[float, float]:
        """The detector sees something so many rows south of the aircraft; returns the place."""
        state = self.door.get("/api/state").json()
        frame = GridFrame.from_dict(self.door.get("/api/map").json()["frame"])
        (row, col) = frame.to_cells([(state["pose"]["lat"], state["pose"]["lon"])])[0].tolist()
        lat, lon = (float(each) for each in frame.to_latlon([(row + rows, col)])[0])
        self.seen += 1
        seen = {"lat": lat, "lon": lon, "score": 0.9, "image": base64.b64encode(JPEG).decode()}
        report: dict[str, Any] = {
            "id": f"seen-{self.seen}", "source": "test", "captured_at": state["time"] - 1.0, "detections": [seen],
            "pose": {"lat": lat, "lon": lon, "height_m": 30.0, "heading_deg": 0.0},
        }  # fmt: skip
        (receipt,) = self.door.post("/api/reports", json=report).json()
        assert receipt["hits"] == 1, receipt
        return lat, lon

    def ended(self) -> int:
        """Wait until the service has ended; its exit code."""
        return self.service.process.wait(PATIENCE_MS / 1000)


@pytest.fixture
def drawn(tmp_path: Path) -> Iterator[Drawn]:
    """Nothing drawn yet, and an aircraft that waits."""
    with ExitStack() as stack:
        yield Drawn(tmp_path, stack)


def judge(hand: Keyboard, card: Locator, verdict: str) -> None:
    """Confirm or reject what a card shows, and answer the question."""
    hand.press(card.get_by_role("button", name=verdict))
    hand.press(hand.page.get_by_role("dialog").get_by_role("button", name=verdict))


def cards(hand: Keyboard) -> Locator:
    """What needs a person's eyes."""
    return hand.page.locator("#suspects li:not(.gone)")


def draw_a_search(hand: Keyboard, drawn: Drawn) -> None:
    """Ground, a place not to fly to, a likely place and the launch, moved once, saved and started."""
    page = hand.page
    hand.write(page.get_by_label("Latitude"), "56.6069")
    hand.write(page.get_by_label("Longitude"), "-4.7422")
    hand.press(page.get_by_role("button", name="Go there"))
    hand.write(page.get_by_label("Name").first, "Drawn moor")
    hand.draw("Launch", (0, 0))
    hand.draw("Ground to search", (-5, -5), (10, 0), (0, 10), (-10, 0))
    hand.draw("Never fly here", (1, -9), (2, 0), (0, 1))
    hand.draw("Likely place", (3, 2))
    expect(page.locator("#drawn li")).to_have_count(4)
    hand.write(page.get_by_label("Within about, metres"), "250")
    hand.press(page.get_by_role("button", name="Save"))
    expect(page.locator("#told")).to_contain_text("Saved in")
    assert hand.watch.violations() == []
    saved = json.loads(drawn.file.read_text(encoding="utf-8"))
    roles = [each["properties"]["role"] for each in saved["features"]]
    assert sorted(roles) == ["exclude", "launch", "prior", "search"]
    hand.press(page.get_by_role("button", name="Start the search"))
    expect(page.locator("#area")).to_have_text("Drawn moor", timeout=180_000)


def hand_over(hand: Keyboard, place: str) -> None:
    """Copy, share, navigate to, export."""
    page, found = hand.page, hand.page.locator("#found")
    expect(found).to_contain_text(place)
    hand.press(found.get_by_role("button", name="Copy"))
    expect(page.locator("#toast")).to_contain_text("copied")
    assert page.evaluate("navigator.clipboard.readText()") == f"Found at {place}"
    hand.press(found.get_by_role("button", name="Share"))
    page.wait_for_function("() => window.shared.length")
    assert page.evaluate("window.shared") == [f"Found at {place}"]
    navigate = found.get_by_role("link", name="Navigate")
    expect(navigate).to_have_attribute("href", "geo:" + place.replace(" ", ""))
    hand.reach(navigate)
    with page.expect_download() as saved:
        hand.press(found.get_by_role("button", name="Export"))
    (point,) = ElementTree.fromstring(Path(saved.value.path()).read_text(encoding="utf-8"))
    assert f"{float(point.attrib['lat']):.6f}, {float(point.attrib['lon']):.6f}" == place


@pytest.mark.parametrize("way", [Keyboard, Fingers], ids=["keyboard", "phone"])
def test_a_whole_story(way: type[Keyboard], chromium: Browser, drawn: Drawn) -> None:
    hand = way(chromium, drawn.url, permissions=["clipboard-read", "clipboard-write"])
    page, watch = hand.page, hand.watch
    watch.context.add_init_script(SHARING)  # for the page that comes when the search starts
    draw_a_search(hand, drawn)
    watch.shows("SEARCHING")
    watch.says_it_in_words()
    hand.press(watch.order("Hold"))  # a look at the picture may take its time
    watch.shows("HOLDING")
    drawn.sees(-1)
    expect(cards(hand).get_by_role("img")).to_be_visible(timeout=PATIENCE_MS)
    hand.press(cards(hand).get_by_role("button", name="Enlarge"))
    hand.press(page.get_by_role("dialog").get_by_role("button", name="Close"))
    judge(hand, cards(hand), "Reject")
    expect(page.locator("#toast")).to_contain_text("Rejected: ")
    expect(cards(hand)).to_have_count(0, timeout=PATIENCE_MS)
    lat, lon = drawn.sees(1)
    expect(cards(hand)).to_have_count(1, timeout=PATIENCE_MS)
    assert watch.violations() == []
    watch.says_it_in_words()
    judge(hand, cards(hand), "Confirm")
    watch.shows("FOUND", "RETURNING", "DONE")
    expect(page.locator("#why")).not_to_be_empty()
    watch.says_it_in_words()
    hand_over(hand, f"{lat:.6f}, {lon:.6f}")
    assert drawn.ended() == 0
    ended = "The search is over and the service has ended"
    expect(page.locator("#ended")).to_contain_text(ended, timeout=PATIENCE_MS)
    report = only_report(drawn.runs)
    assert report["outcome"] == "found"
    assert (report["position"]["lat"], report["position"]["lon"]) == pytest.approx((lat, lon), abs=1e-5)
    unheard = re.compile("ERR_CONNECTION_REFUSED|ERR_CONNECTION_RESET|ERR_EMPTY_RESPONSE")
    assert [said for said in watch.complaints if not unheard.search(said)] == []  # while nobody listens
    watch.context.close()

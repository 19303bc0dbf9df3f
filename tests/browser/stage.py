"""What the browser tests look at: a search that flies against a mock autopilot, and a page in a real Chromium."""

from __future__ import annotations

import re
import sqlite3
import struct
import time
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import httpx
from playwright.sync_api import Browser, Locator, Page, Response, expect

from sim.autopilot.control import Control
from sim.autopilot.process import AutopilotProcess
from tests.integration.flight import REPOSITORY, Process, running
from tests.ports import free_port

PATIENCE_MS = 60_000
AREA = REPOSITORY / "config" / "area.geojson"
LAUNCH = "--home=56.606917,-4.742277,300"
SETTINGS = """
[link]
silent_after_s = 30  # of the vehicle's time; a busy host may pause for longer than it usually has
[flight]
stuck_after_s = 300
[sensor]
p_tn = 0.995
silent_after_s = 300
[page]
mbtiles_file = "{tiles}"
"""
AXE = Path(__file__).parent / "vendor" / "axe-core" / "axe.min.js"
AXE_RUN = """async () => {
  const { violations } = await axe.run(document, { resultTypes: ["violations"] });
  return violations.map(({ id, impact, nodes }) => [impact, id, nodes.map((node) => node.html.slice(0, 160))]);
}"""


TOOL_WORDS = re.compile(
    r"\b(ROI|mass|visits|footprint|index rule|posterior|rollout|best rate|(search|sensor|flight)\.[a-z_]+)\b",
    re.IGNORECASE,
)
"""What only somebody who has read the code would understand."""


class Stage:
    """A search under way, its page's address, and the truth about its aircraft."""

    def __init__(self, folder: Path, stack: ExitStack, speedup: float) -> None:
        self.folder, self._stack, self._speedup = folder, stack, speedup
        options = (LAUNCH, "--ready-after", "3", "--control", "127.0.0.1:0", "--endurance", "120")
        self._autopilot = stack.enter_context(AutopilotProcess("px4", speedup=speedup, options=options))
        assert self._autopilot.control is not None
        self.control = stack.enter_context(Control(self._autopilot.control))
        self.port = free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.settings = folder / "settings.toml"
        tiles = folder / "ground.mbtiles"
        write_tiles(tiles)
        self.settings.write_text(SETTINGS.format(tiles=tiles), encoding="utf-8")
        link = f"udpout://127.0.0.1:{self._autopilot.port}"
        self.service = self._start(
            "--area", str(AREA), "--runs", str(folder / "runs"), "--connect", link, "--takeoff",
            "--config", str(self.settings), "--cell", "25",
        )  # fmt: skip
        where = ["--p-tn", "0.995", "--patience", "120"]
        stack.enter_context(running("sim", "detector", "--service", self.url, *where))
        self.door = stack.enter_context(httpx.Client(base_url=self.url, timeout=30.0))

    def _start(self, *words: str) -> Process:
        where = ("--http", f"127.0.0.1:{self.port}", "--speedup", str(self._speedup))
        service = self._stack.enter_context(running("service", *words, *where))
        service.wait_for(r"listening on http://\S+", 300.0)  # the planner may have to be compiled
        return service

    @property
    def run(self) -> Path:
        """The run's folder."""
        (folder,) = (self.folder / "runs").iterdir()
        return folder

    def start_again(self) -> None:
        """Go on with the killed search, at the same address."""
        self.service = self._start("--resume", str(self.run))

    def go_on(self) -> None:
        """Let the search be on, whatever an earlier test has left behind."""
        deadline = time.monotonic() + PATIENCE_MS / 1000
        while self.state()["state"] not in ("SEARCHING", "CONFIRMING"):
            assert time.monotonic() < deadline, self.service.said
            if self.state()["state"] in ("HOLDING", "YIELDED"):
                self.door.post("/api/commands", json={"command": "resume"})
            time.sleep(0.1)

    def state(self) -> dict[str, Any]:
        """What the service says."""
        state: dict[str, Any] = self.door.get("/api/state").json()
        return state


@contextmanager
def flying(folder: Path, speedup: float) -> Iterator[Stage]:
    """A search that has just been started."""
    with ExitStack() as stack:
        yield Stage(folder, stack, speedup)


class Watch:
    """A page, and everything that it complained about."""

    def __init__(self, browser: Browser, url: str, **options: Any) -> None:
        self.context = browser.new_context(**{"viewport": {"width": 1360, "height": 850}, **options})
        self.page: Page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE_MS)
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda said: said.type == "error" and self.complaints.append(said.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("response", self._note)
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(url)

    def _note(self, answer: Response) -> None:
        if answer.status >= 500:
            self.complaints.append(f"{answer.status} for {answer.url}")

    @property
    def chip(self) -> Locator:
        """The state."""
        return self.page.locator("#chip")

    def shows(self, *states: str) -> None:
        """Wait until the page shows one of these states."""
        self.page.wait_for_function(
            "(states) => states.includes(document.getElementById('chip').dataset.state)",
            arg=list(states),
            timeout=PATIENCE_MS,
        )

    def order(self, name: str) -> Locator:
        """A button of the header."""
        return self.page.locator("#orders").get_by_role("button", name=name)

    def violations(self) -> list[Any]:
        """What axe finds, be it serious or not."""
        self.page.evaluate(AXE.read_text(encoding="utf-8"))
        found: list[Any] = self.page.evaluate(AXE_RUN)
        return found

    def says_it_in_words(self) -> None:
        """Nothing on the page is a tool's word."""
        body = self.page.locator("body").inner_text()
        assert not TOOL_WORDS.search(body), body

    def painted(self, layer: str) -> int:
        """How many pixels of a layer of cells are not clear."""
        script = """(label) => {
          const canvas = [...document.querySelectorAll("canvas.cells")].find((each) => each.ariaLabel.includes(label));
          const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
          return data.filter((value, i) => i % 4 === 3 && value > 0).length;
        }"""
        count: int = self.page.evaluate(script, layer)
        return count

    def cell(self, row: int, col: int) -> int:
        """How dark a cell of the heat layer is on a white ground, 0 to 765."""
        script = """([row, col]) => {
          const canvas = [...document.querySelectorAll("canvas.cells")].find((each) => each.ariaLabel.includes("Heat"));
          const [r, g, b, alpha] = canvas.getContext("2d").getImageData(col, row, 1, 1).data;
          return Math.round(((765 - r - g - b) * alpha) / 255);
        }"""
        dark: int = self.page.evaluate(script, [row, col])
        return dark

    def close(self) -> None:
        """Close the page; it must have had nothing to complain about."""
        self.context.close()
        assert not self.complaints, self.complaints


def searching(watch: Watch) -> None:
    """Wait until the search is on."""
    watch.shows("SEARCHING", "CONFIRMING")
    expect(watch.page.locator("#pos")).not_to_have_text("–")


def write_tiles(path: Path) -> None:
    """An MBTiles file with one tile of the whole world, green."""
    database = sqlite3.connect(path)
    with database:
        database.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
        database.execute(
            "CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB)"
        )
        database.execute("INSERT INTO metadata VALUES ('format', 'png')")
        database.execute("INSERT INTO tiles VALUES (0, 0, 0, ?)", (png(226, 236, 214),))
    database.close()


def png(*colour: int) -> bytes:
    """An image of one colour, 256 pixels square."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", 256, 256, 8, 2, 0, 0, 0)
    rows = (b"\x00" + bytes(colour) * 256) * 256
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + chunk(b"IDAT", zlib.compress(rows))
        + chunk(b"IEND", b"")
    )

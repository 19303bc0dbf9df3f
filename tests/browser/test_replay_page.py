"""A run that is over on the same page: the slider, and nothing that could change anything."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from service.area import build_grid, read_area
from service.config import Settings
from service.evidence.observe import Observation
from service.evidence.verdict import verdict_on
from service.journal import Journal
from service.rows import VerdictRow
from tests.integration.flight import running, write_area

from .stage import Watch

TOKEN = "replay-token-0123456789"
START, STEPS = 1_771_236_000.0, 40


def write_run(folder: Path) -> Path:
    """A run of 40 looks, one every two seconds, one of them a hit that was rejected; it was interrupted then."""
    area = write_area(folder)
    grid = build_grid(read_area(area), 20.0)
    settings = Settings.model_validate({"sensor": {"cell_m": 20.0}, "flight": {"altitude_m": 15.0}})
    journal = Journal(folder / "journal.sqlite")
    journal.set_meta("grid", grid.frame.to_dict())
    journal.set_meta("settings", settings.model_dump())
    last = None

    def note(time: float, kind: str, body: dict[str, Any]) -> None:
        nonlocal last
        last = journal.write(START + time, kind, body)

    note(0.0, "transition", {"from": "READY", "event": "airborne", "to": "SEARCHING", "reason": "in the air"})
    best = np.argsort(-grid.prior, axis=None)
    for step in range(STEPS):
        cell = np.array(np.unravel_index(best[step // 2], grid.frame.shape)).reshape(1, 2)
        lat, lon = grid.frame.to_latlon(cell)[0]
        options = [{"action": "region 1", "region": 1, "visits": 9, "value": 0.5, "mass": 0.4, "distance_m": 60.0,
                    "chosen": True, "words": f"ROI 1: 40 % of the mass, {step} m"}]  # fmt: skip
        decision = {"action": "region 1", "path": cell.tolist(), "reason": f"step {step}", "options": options}
        note(2.0 * step, "decision", decision)
        look = Observation(cell, np.array([step == 30]), np.array([0.9]), np.array([0.9]), np.array([True]))
        body = {"report": {"id": f"r{step}"}, "pose": [lat, lon, 15.0, 0.0], "observation": look.to_dict()}
        note(2.0 * step + 1.0, "report", body)
    hit = np.unravel_index(best[15], grid.frame.shape)
    cell = (int(hit[0]), int(hit[1]))
    rejected = verdict_on(cell, grid.frame.shape, 0.99, confirmed=False)
    note(2.0 * STEPS, "verdict", VerdictRow(False, cell, rejected).body())
    assert last is not None
    last.result(10)
    journal.close()
    return folder


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a replay that wants a token."""
    folder = write_run(tmp_path_factory.mktemp("run"))
    os.environ["ROISEARCH_HTTP_TOKEN"] = TOKEN
    try:
        with running("service", "replay", str(folder), "--http", "127.0.0.1:0") as service:
            yield service.wait_for(r"listening on (http://\S+)").group(1)
    finally:
        del os.environ["ROISEARCH_HTTP_TOKEN"]


def test_a_replay_has_every_time_and_takes_no_orders(replay: str) -> None:
    headers = {"authorization": f"Bearer {TOKEN}"}
    with httpx.Client(base_url=replay, headers=headers, timeout=60.0) as door:
        assert door.get("/api/replay").json() == {"from": START, "to": START + 80.0}
        pos = [door.get("/api/state", params={"at": START + at}).json()["pos"] for at in (0, 20, 40, 79, 20)]
        assert 0.0 == pos[0] < pos[1] < pos[2] < pos[3]
        assert pos[4] == pos[1]
        first = door.get("/api/state", params={"at": START + 20.5}).json()
        assert (first["state"], first["reason"], first["reports"]["accepted"]) == ("SEARCHING", "step 10", 10)
        decisions = door.get("/api/decisions", params={"at": START + 20.5, "count": 2}).json()
        assert [each["reason"] for each in decisions] == ["step 10", "step 9"]
        digests = {
            door.get("/api/map", params={"at": at}).json()["digest"] for at in (START + 80, START + 1e6)
        }
        assert len(digests) == 1
        suspects = [
            len(door.get("/api/state", params={"at": START + at}).json()["suspects"])
            for at in (50, 62, 80, 62)
        ]
        assert suspects == [0, 1, 0, 1]  # a hit after a minute, which the operator rejected at the end
        assert door.get("/api/map.png", params={"at": START + 30}).content.startswith(b"\x89PNG")
        assert door.post("/api/commands", json={"command": "hold"}).status_code == 409
        assert door.post("/api/reports", json={"id": "a", "captured_at": 1.0}).status_code == 409
        assert door.get("/readyz").status_code == 503


def test_the_page_asks_for_the_token_and_then_shows_the_run_with_a_slider(
    chromium: Browser, replay: str
) -> None:
    watch = Watch(chromium, replay)
    page = watch.page
    expect(page.locator("#chip")).to_have_text("a token is needed")
    page.get_by_label("Token").fill("wrong-token-0123456789")
    page.keyboard.press("Enter")
    expect(page.locator("#refused")).to_contain_text("none of this service's tokens")
    page.get_by_label("Token").fill(TOKEN)
    page.keyboard.press("Enter")
    watch.shows("SEARCHING")
    expect(page.locator("#chip")).to_have_text("Searching (replay)")
    assert TOKEN not in "".join(watch.asked)
    expect(page.locator("#orders")).to_be_hidden()
    end = page.locator("#pos").inner_text()
    slider = page.get_by_role("slider", name="Time")
    slider.fill("20")
    expect(page.locator("#clock")).to_have_text("20 s of 80 s")
    expect(page.locator("#next")).to_contain_text("60 m")
    assert float(page.locator("#pos").inner_text().split()[0]) < float(end.split()[0])
    assert page.locator(".leaflet-flight-pane path").count() > 0
    slider.focus()
    page.keyboard.press("ArrowRight")
    expect(page.locator("#clock")).to_have_text("21 s of 80 s")
    page.get_by_role("button", name="Play").click()
    expect(page.locator("#clock")).to_have_text("80 s of 80 s", timeout=30_000)
    expect(page.locator("#pos")).to_have_text(end)
    assert watch.violations() == []
    refusals = ("401", "no valid credentials")  # what Chromium itself says of one
    watch.complaints[:] = [said for said in watch.complaints if not any(each in said for each in refusals)]
    watch.close()


def test_what_is_no_run_is_one_clear_line(tmp_path: Path) -> None:
    with running("service", "replay", str(tmp_path), "--http", "127.0.0.1:0") as service:
        assert service.exit_code() == 2
    assert "there is no journal here" in service.said
    assert json.dumps(service.said).count("\\n") == 1

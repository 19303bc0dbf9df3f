"""The door of a search that is being drawn: what is saved is a search, and nothing starts before."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.area import read_area
from service.cli import main
from service.config import Settings
from service.errors import BadInput
from service.http import Access
from service.http.plan import AreaPlan, DrawnFeatures, create_plan_app
from tests.service.area.files import box, collection, feature, polygon

from .door import TOKENS, bearer

EXPORTS = Path(__file__).parents[1] / "area" / "exports"

FIELD = collection(feature(polygon(box(0, 0, 300, 200)), name="field"))


def ask(
    plan: AreaPlan, method: str, path: str, body: Any = None, access: Access | None = None, **headers: str
) -> httpx.Response:
    """One request."""

    async def once() -> httpx.Response:
        transport = httpx.ASGITransport(app=create_plan_app(plan, access=access))
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8080") as client:
            return await client.request(method, path, json=body, headers=headers)

    return asyncio.run(once())


def test_a_search_is_saved_and_then_started(tmp_path: Path) -> None:
    plan = AreaPlan(tmp_path / "area.geojson", Settings())
    assert ask(plan, "POST", "/api/plan/start", {}).status_code == 409
    assert not plan.started.is_set()
    assert ask(plan, "GET", "/api/plan").json()["drawn"] is None
    told = ask(plan, "POST", "/api/plan", FIELD).json()
    assert told["km2"] == pytest.approx(0.06, rel=0.01)
    assert read_area(plan.file).polygon.area > 0.0
    assert ask(plan, "GET", "/api/plan").json()["drawn"]["features"][0]["properties"]["name"] == "field"
    assert ask(plan, "POST", "/api/plan/start", {}).json() == {"starting": True}
    assert plan.started.is_set()
    assert list(tmp_path.iterdir()) == [plan.file]


def test_what_is_no_search_leaves_the_file_alone_and_is_one_sentence_without_our_paths(
    tmp_path: Path,
) -> None:
    plan = AreaPlan(tmp_path / "area.geojson", Settings())
    plan.file.write_text(json.dumps(FIELD), encoding="utf-8")
    nothing = ask(plan, "POST", "/api/plan", {"type": "FeatureCollection", "features": []})
    assert nothing.status_code == 422
    assert nothing.json()["detail"].startswith("area.geojson: ")
    assert ".plan-" not in nothing.json()["detail"]
    assert json.loads(plan.file.read_text(encoding="utf-8")) == FIELD
    with pytest.raises(BadInput, match="writable --out"):
        AreaPlan(tmp_path / "no" / "a.geojson", Settings()).save(
            DrawnFeatures.model_validate({**FIELD, "name": ""})
        )


def test_drawing_wants_the_command_token(tmp_path: Path) -> None:
    plan = AreaPlan(tmp_path / "area.geojson", Settings())
    assert ask(plan, "GET", "/api/plan", access=TOKENS).status_code == 401
    report = ask(plan, "POST", "/api/plan", FIELD, access=TOKENS, **bearer("report-token-0123456789"))
    assert report.status_code == 403
    assert not plan.file.exists()


def test_what_cannot_be_saved_or_drawn_on_is_refused_before_anybody_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["plan", "--http", "127.0.0.1:0", "--out"]
    assert main([*words, str(tmp_path / "nowhere" / "area.geojson")]) == 2
    assert "cannot be written there; give --out in a folder that is there" in capsys.readouterr().err
    (tmp_path / "notes.txt").write_text("hello")
    assert main([*words, str(tmp_path / "notes.txt")]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert "notes.txt" in said
    teams = tmp_path / "team.kml"
    teams.write_bytes(before := (EXPORTS / "google-earth.kml").read_bytes())
    assert main([*words, str(teams)]) == 2
    assert (
        "this is KML, and what is saved here is GeoJSON, which would take its place; make a file"
        in capsys.readouterr().err
    )
    assert teams.read_bytes() == before

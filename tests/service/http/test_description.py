"""What the description of the API promises: every status stands there; a complaint is made once."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import httpx
import pytest

from .door import COMMAND, FRAME, HOLD, REPORT, TOKENS, FakeRun, ask, bearer, in_memory, settings

Asked = tuple[str, str, dict[str, Any]]
JSON = {"content-type": "application/json"}
REFUSED: list[Asked] = [
    ("POST", "/api/reports", {"content": b"x", "headers": {"content-type": "text/plain"}}),
    ("POST", "/api/reports", {"content": b"x", "headers": {**JSON, "content-length": "many"}}),
    ("POST", "/api/reports", {"json": [FRAME] * 600}),
    ("POST", "/api/reports", {"json": {}}),
    ("POST", "/api/reports", {"json": FRAME, "headers": {"host": "evil.example"}}),
    ("POST", "/api/commands", {"json": HOLD, "headers": {"origin": "http://evil.example"}}),
    ("POST", "/api/commands", {"content": b"x" * 2000, "headers": JSON}),
    ("GET", "/api/state?at=1", {}),
    ("GET", "/api/map?at=1", {}),
    ("GET", "/api/map?format=xml", {}),
    ("GET", "/api/map.png?at=1", {}),
    ("GET", "/api/decisions?count=0", {}),
    ("GET", "/api/replay", {}),
]


def test_every_status_that_is_answered_is_described() -> None:
    async def once() -> list[tuple[str, httpx.Response]]:
        http = settings(max_body_bytes=1024, commands_per_s=1)
        answers: list[tuple[str, httpx.Response]] = []
        for given in ({}, {"access": TOKENS}):
            for method, path, more in REFUSED * 4:  # often enough for 429
                async with in_memory(FakeRun(), http=http, **given) as client:
                    asked = {
                        **more,
                        "headers": {**bearer(COMMAND if not given else REPORT), **more.get("headers", {})},
                    }
                    for _ in range(4):
                        answers.append((f"{method} {path}", await client.request(method, path, **asked)))
        return answers

    api = ask("GET", "/openapi.json").json()
    seen: set[int] = set()
    for name, answer in asyncio.run(once()):
        method, _, path = name.partition(" ")
        described = api["paths"][path.partition("?")[0]][method.lower()]["responses"]
        assert str(answer.status_code) in described, name
        seen.add(answer.status_code)
    assert seen >= {400, 403, 404, 413, 415, 421, 422, 429}


@pytest.mark.parametrize(
    ("body", "places"),
    [
        ({"id": 3}, [["body", "id"], ["body", "captured_at"]]),
        ([{"id": "a"}], [["body", 0, "captured_at"]]),
        ([FRAME, {"captured_at": 1.0}], [["body", 1, "id"]]),
    ],
)
def test_what_is_wrong_with_a_report_is_said_once(body: object, places: list[list[object]]) -> None:
    answer = ask("POST", "/api/reports", json=body)
    assert answer.status_code == 422
    assert [each["loc"] for each in answer.json()["detail"]] == places
    assert "Report" not in json.dumps([each["loc"] for each in answer.json()["detail"]])

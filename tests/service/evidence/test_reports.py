"""The schema of a detector report: what it takes, and that its exported form says the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from pydantic import ValidationError

from service.cli import main
from service.evidence.reports import EXAMPLES, OrderRequest, Report
from tests.service.http.door import FakeRun, ask

SHIPPED = Path(__file__).parents[3] / "config" / "report.schema.json"
LEAST = {"id": "a", "captured_at": 1.0}
SEEN = {"lat": 47.0, "lon": 8.0}
BOX = {"box": [1, 2, 3, 4]}
POSE = {"lat": 47.0, "lon": 8.0, "height_m": 30.0, "heading_deg": 0.0}
SIZE = {"width": 640, "height": 480}

GOOD: list[dict[str, Any]] = [
    *EXAMPLES.values(),
    {**LEAST, "pose": None, "gimbal": None, "intrinsics": None, "footprint": None, "threshold": None},
    {**LEAST, "detections": [{**SEEN, "box": None}, {**BOX, "lat": None, "lon": None}]},
    {**LEAST, "pose": {**POSE, "roll_deg": -170}, "gimbal": {"pitch_deg": -90}},
    {**LEAST, "intrinsics": {**SIZE, "fx": 800, "fy": 801, "cx": 320, "cy": 240}},
]
BAD: list[dict[str, Any]] = [
    {"id": "a"},
    {**LEAST, "id": ""},
    {**LEAST, "version": 2},
    {**LEAST, "colour": 1},
    {**LEAST, "clock": "gps"},
    {**LEAST, "threshold": 1.5},
    {**LEAST, "footprint": [[47, 8], [47, 9]]},
    {**LEAST, "pose": {"lat": 47.0, "lon": 8.0}},
    {**LEAST, "gimbal": {"yaw_deg": 3}},
    {**LEAST, "gimbal": {"pitch_deg": -90, "relative_to": "moon"}},
    {**LEAST, "intrinsics": SIZE},
    {**LEAST, "intrinsics": {**SIZE, "fx": 800}},
    {**LEAST, "intrinsics": {**SIZE, "fx": 800, "fy": 800, "horizontal_fov_deg": 60}},
    {**LEAST, "intrinsics": {**SIZE, "horizontal_fov_deg": 1e-300}},
    {**LEAST, "intrinsics": {**SIZE, "horizontal_fov_deg": 179.9999}},
    {**LEAST, "intrinsics": {**SIZE, "fx": 1e-9, "fy": 800}},
    {**LEAST, "intrinsics": {**SIZE, "fx": 800, "fy": 1e-9}},
    {**LEAST, "detections": [{}]},
    {**LEAST, "detections": [{"lat": 47.0}]},
    {**LEAST, "detections": [{**SEEN, **BOX}]},
    {**LEAST, "detections": [{"lat": 91, "lon": 8.0}]},
    {**LEAST, "detections": [{"box": [1, 2, 3]}]},
    {**LEAST, "detections": [{**SEEN, "accuracy_m": 0}]},
    {**LEAST, "detections": [{**SEEN, "accuracy_m": 1e-200}]},  # whose square is 0
    {**LEAST, "pose": {**POSE, "height_m": 1e300}},
    {**LEAST, "captured_at": 1e300, "clock": "boot"},
    {**LEAST, "detections": [{**SEEN, "thumbnail": "javascript:alert(1)"}]},
]


@pytest.mark.parametrize(
    ("given", "captured_s", "share"),
    [
        ({"captured_at": 1700000000.5}, 1700000000.5, 0.5),
        ({"captured_at": 1700000000500, "clock": "unix_ms"}, 1700000000.5, 0.5),
        ({"captured_at": 12500, "clock": "boot_ms"}, 12.5, 0.5),
        ({"captured_at": 12.5, "clock": "boot"}, 12.5, 0.5),
        ({"captured_at": "2023-11-14T22:13:20.5Z", "clock": "iso"}, 1700000000.5, 0.5),
        ({"captured_at": "2023-11-14T23:13:20.5+01:00", "clock": "iso"}, 1700000000.5, 0.5),
        ({"score_unit": "percent", "detections": [{**SEEN, "score": 50}]}, 1.0, 0.5),
        ({"score_unit": "percent", "threshold": 50}, 1.0, 0.5),
    ],
)
def test_units_are_taken_where_they_are_declared(
    given: dict[str, Any], captured_s: float, share: float
) -> None:
    report = Report.model_validate({**LEAST, "detections": [{**SEEN, "score": 0.5}], **given})
    assert report.captured_s == captured_s
    assert report.share(report.detections[0].score) == share or report.threshold_share == share


@pytest.mark.parametrize(
    ("given", "hint"),
    [
        ({"captured_at": 1700000000500}, 'for milliseconds say "clock": "unix_ms"'),
        ({"captured_at": "2023-11-14T22:13:20Z"}, 'for an ISO 8601 time say "clock": "iso"'),
        ({"captured_at": "2023-11-14T22:13:20", "clock": "iso"}, "has no offset; end it with Z for UTC"),
        ({"captured_at": "yesterday", "clock": "iso"}, "is no ISO 8601 time"),
        ({"detections": [{**SEEN, "score": 87}]}, 'for per cent say "score_unit": "percent"'),
        ({"threshold": 40}, 'for per cent say "score_unit": "percent"'),
    ],
)
def test_units_that_are_not_declared_are_refused_with_the_hint(given: dict[str, Any], hint: str) -> None:
    with pytest.raises(ValidationError) as refused:
        Report.model_validate({**LEAST, **given})
    assert hint in str(refused.value)


@pytest.fixture(scope="module")
def shipped() -> jsonschema.Draft202012Validator:
    schema = json.loads(SHIPPED.read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("report", GOOD, ids=str)
def test_the_model_and_the_shipped_schema_take_the_same(
    report: dict[str, Any], shipped: jsonschema.Draft202012Validator
) -> None:
    assert list(shipped.iter_errors(report)) == []
    Report.model_validate_json(json.dumps(report))


@pytest.mark.parametrize("report", BAD, ids=str)
def test_the_model_and_the_shipped_schema_refuse_the_same(
    report: dict[str, Any], shipped: jsonschema.Draft202012Validator
) -> None:
    assert not shipped.is_valid(report)
    with pytest.raises(ValidationError):
        Report.model_validate_json(json.dumps(report))


def test_the_service_prints_the_schema_that_ships(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    printed = capsys.readouterr().out
    assert printed == SHIPPED.read_text(encoding="utf-8"), (
        "roisearch-service schema > config/report.schema.json"
    )


@pytest.mark.parametrize(
    ("seen", "words"),
    [
        ({**SEEN, **BOX}, "either lat and lon or a pixel box"),
        ({"lon": 8.0}, "either lat and lon or a pixel box"),
        ({"box": [5, 2, 3, 4]}, "x0 < x1"),
        ({**BOX, "accuracy_m": 3}, "accuracy_m belongs to lat and lon"),
    ],
)
def test_a_detection_that_is_nowhere_or_twice_is_refused_in_words(seen: dict[str, Any], words: str) -> None:
    answer = ask("POST", "/api/reports", json={**LEAST, "detections": [seen]})
    assert answer.status_code == 422
    assert words in answer.text


def test_every_example_passes_the_door_and_stands_in_its_documentation() -> None:
    run = FakeRun()
    for example in EXAMPLES.values():
        assert ask("POST", "/api/reports", json=example, run=run).status_code == 200
    assert ask("POST", "/api/reports", json=list(EXAMPLES.values()), run=run).status_code == 200
    assert len(run.reports) == 2 * len(EXAMPLES)
    body = ask("GET", "/openapi.json").json()["paths"]["/api/reports"]["post"]["requestBody"]
    shown = body["content"]["application/json"]["examples"]
    assert [shown[name]["value"] for name in EXAMPLES] == list(EXAMPLES.values())


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ({"command": "launch", "system_id": 7}, "'launch' has no system_id; only replace does"),
        ({"command": "replace", "system_id": 0}, "greater than or equal to 1"),
        ({"command": "replace", "system_id": 256}, "less than or equal to 255"),
        (
            {"command": "replace", "lat": 47.0, "lon": 8.0},
            "'replace' has no place; only confirm and reject do",
        ),
    ],
)
def test_an_order_that_makes_no_sense_is_refused_in_words(order: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        OrderRequest.model_validate(order)
    answer = ask("POST", "/api/commands", json=order)
    assert answer.status_code == 422
    assert words in answer.text


@pytest.mark.parametrize("system_id", [None, 7])
def test_which_aircraft_replaces_the_one_that_landed_passes_the_door(system_id: int | None) -> None:
    run = FakeRun()
    order = {"command": "replace"} | ({} if system_id is None else {"system_id": system_id})
    assert ask("POST", "/api/commands", json=order, run=run).status_code == 200
    assert run.orders == ["replace"]
    assert run.wanted_system == [system_id]

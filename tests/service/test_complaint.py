"""What a sender is told of a field that there is not, and of what cannot be."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence

import pytest
from pydantic import ValidationError

from service.complaint import complaint
from service.doors.lines import answer
from service.evidence.reports import Receipt, Report, field_names

FOUND = {"id": "a", "captured_at": 1.0}
PLACE = {"class": "person", "score": 0.5, "lat": 47.0, "lon": 8.0}


def said(report: object) -> list[str]:
    with pytest.raises(ValidationError) as caught:
        Report.model_validate_json(json.dumps(report))
    return [complaint(each, field_names()) for each in caught.value.errors()]


@pytest.mark.parametrize(
    ("other", "ours"),
    [
        ("confidence", "score"),
        ("label", "class"),
        ("bbox", "box"),
        ("Latitude", "lat"),
        ("acuracy_m", "accuracy_m"),
    ],
)
def test_a_field_of_another_name_is_told_by_ours(other: str, ours: str) -> None:
    assert f"there is no field of that name; did you mean '{ours}'?" in said(
        {**FOUND, "detections": [{**PLACE, other: 1}]}
    )


def test_a_field_like_no_other_has_no_hint() -> None:
    assert said({**FOUND, "weather": "fine"}) == ["there is no field of that name"]


def test_what_cannot_be_is_told_in_our_words_alone() -> None:
    (told,) = said({**FOUND, "captured_at": "yesterday"})
    assert told.startswith("captured_at is text; for an ISO 8601 time say")


def test_a_receipt_tells_all_that_is_wrong() -> None:
    async def nobody(reports: Sequence[Report]) -> list[Receipt]:
        raise AssertionError(reports)

    line = json.dumps({**FOUND, "capturedAt": 1.0, "detections": [{**PLACE, "conf": 1}]})
    receipt = json.loads(asyncio.run(answer(line.encode(), nobody)))
    assert receipt["status"] == "refused"
    assert receipt["reason"] == (
        "detections.0.conf: there is no field of that name; did you mean 'score'?; "
        "capturedAt: there is no field of that name; did you mean 'captured_at'?"
    )

"""Pictures of reports: what is taken, what is refused with one sentence, and how they are kept."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from service.evidence import images
from service.evidence.images import FOLDER, Images
from service.evidence.reports import KEPT_AT, MOST_IMAGE_BYTES, Report

JPEG = b"\xff\xd8\xff\xe0" + b"\x00" * 60 + b"\xff\xd9"
URL = "https://camera.example/1.jpg"


def coded(data: bytes) -> str:
    return base64.b64encode(data).decode()


def report(**more: Any) -> Report:
    """A report with one detection, which has `seen` beside its place."""
    seen = {"lat": 47.0, "lon": 11.0, **more.pop("seen", {})}
    return Report.model_validate({"id": "a", "captured_at": 1.0, "detections": [seen], **more})


def test_a_picture_becomes_a_file_and_the_report_has_its_address(tmp_path: Path) -> None:
    kept = Images(tmp_path)
    told = kept.keep(report(seen={"image": coded(JPEG)}))
    address = told.picture_of(told.detections[0])
    assert address is not None
    assert address.startswith(KEPT_AT)
    assert kept.read(address.removeprefix(KEPT_AT)) == JPEG
    assert Report.model_validate_json(told.model_dump_json(by_alias=True, exclude_unset=True)) == told
    assert kept.keep(report(image=coded(JPEG))).image == address  # the same picture is one file
    assert [file.name for file in (tmp_path / FOLDER).iterdir()] == [address.removeprefix(KEPT_AT)]


def test_a_detections_own_picture_comes_before_the_frames() -> None:
    frame = "https://camera.example/frame.jpg"
    told = report(seen={"thumbnail": URL}, image=frame)
    assert told.picture_of(told.detections[0]) == URL
    told = report(image=frame)
    assert told.picture_of(told.detections[0]) == frame
    told = report(seen={"image": coded(JPEG)})  # not kept by anybody: there is no address to tell
    assert told.picture_of(told.detections[0]) is None


@pytest.mark.parametrize(
    ("image", "why"),
    [
        (coded(JPEG[:-2] + b"\x00" * MOST_IMAGE_BYTES + JPEG[-2:]), "image is larger than 64 kB"),
        (coded(b"\x89PNG" + b"\x00" * 60), "image is no whole JPEG"),
        (coded(JPEG[:-2]), "image is no whole JPEG"),
        ("<svg onload=alert(1)>", "image is neither an http(s) URL nor base64"),
        ("javascript:alert(1)", "image is neither an http(s) URL nor base64"),
    ],
)
def test_what_is_no_small_jpeg_is_refused_with_one_sentence(image: str, why: str) -> None:
    for where in ({"image": image}, {"seen": {"image": image}}):
        with pytest.raises(ValidationError) as caught:
            report(**where)
        (error,) = caught.value.errors()
        assert why in error["msg"]


def test_the_largest_picture_is_taken() -> None:
    report(image=coded(JPEG[:-2] + b"\x00" * (MOST_IMAGE_BYTES - len(JPEG)) + JPEG[-2:]))


def test_no_name_leads_out_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "journal.sqlite").write_bytes(b"secret")
    (tmp_path / FOLDER).mkdir()
    for name in ("../journal.sqlite", "..%2fjournal.sqlite", "", "a.jpg", "0" * 64):
        assert Images(tmp_path).read(name) is None


def test_a_full_folder_or_disk_costs_the_picture_and_not_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(images, "MOST_FILES", 1)
    kept = Images(tmp_path)
    assert kept.keep(report(image=coded(JPEG))).image is not None
    assert kept.keep(report(image=coded(JPEG[:-3] + b"\x01" + JPEG[-2:]))).image is None
    blocked = Images(tmp_path / "no-such-folder")
    assert blocked.keep(report(image=coded(JPEG))).image is None

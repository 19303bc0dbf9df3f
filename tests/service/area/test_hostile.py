"""Files that are built to do harm, or are beyond all use, are refused in one sentence before they do any."""

from __future__ import annotations

import contextlib
import io
import json
import tracemalloc
import zipfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.area import parse_area, read_area
from service.area.geojson import MOST_BYTES, MOST_POSITIONS
from service.errors import BadInput
from tests.service.area.test_reading import refusal

EXPORTS = Path(__file__).parent / "exports"
BOMB = (
    '<?xml version="1.0"?><!DOCTYPE kml [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + n)} "{f"&{chr(97 + n)};" * 10}">' for n in range(12))
    + "]><kml><Placemark><name>&m;</name></Placemark></kml>"
).encode()


def kmz(**files: bytes) -> bytes:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name.replace("_", "."), data)
    return whole.getvalue()


def said(data: bytes) -> str:
    return refusal(lambda: parse_area(data, source="field"))


def test_entities_are_refused_before_a_reader_sees_them() -> None:
    assert "document type (<!DOCTYPE)" in said(BOMB)
    assert "document type" in said(kmz(doc_kml=BOMB))
    gpx = b'<!DOCTYPE gpx SYSTEM "http://example.org/x.dtd"><gpx version="1.1"></gpx>'
    assert "document type" in said(gpx)


def test_an_archive_that_grows_is_read_only_so_far() -> None:
    bomb = kmz(doc_kml=b"<kml>" + b" " * (8 * MOST_BYTES))
    assert len(bomb) < MOST_BYTES / 50
    tracemalloc.start()
    try:
        assert "unpacks to more than 32 MB" in said(bomb)
        assert tracemalloc.get_traced_memory()[1] < 4 * MOST_BYTES
    finally:
        tracemalloc.stop()


def test_archives_without_a_map_are_refused() -> None:
    assert "no .kml file" in said(kmz(a_txt=b"hello"))
    assert "damaged" in said(kmz(doc_kml=b"<kml/>")[:60])
    assert "XML of <svg>" in said(kmz(doc_kml=b"<svg/>"))
    assert "holds 2 maps" in said(kmz(a_gpx=b"", b_gpx=b""))
    assert "holds a Shapefile" in said(kmz(a_shp=b"", a_dbf=b""))


def test_xml_of_another_kind_or_none_is_refused() -> None:
    assert "XML of <svg>" in said(b"<svg xmlns='http://www.w3.org/2000/svg'/>")
    assert "not XML at line 1" in said(b"<kml><Placemark></kml>")
    assert "nested more than 100 deep" in said(b"<kml>" + b"<Folder>" * 200 + b"</Folder>" * 200 + b"</kml>")
    assert "more than 600000 elements" in said(b"<kml>" + b"<a/>" * 600_001 + b"</kml>")


def test_more_positions_than_an_outline_needs_are_refused() -> None:
    ring = [[8.3 + n * 1e-9, 47.0] for n in range(MOST_POSITIONS + 1)]
    data = json.dumps({"type": "Polygon", "coordinates": [ring]}).encode()
    assert f"more than {MOST_POSITIONS} positions" in said(data)


def test_more_things_than_a_map_needs_are_refused() -> None:
    features = [{"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [8, 47]}}]
    data = json.dumps({"type": "FeatureCollection", "features": features * 20_001}).encode()
    assert "more than 20000 things" in said(data)


def test_a_file_without_end_is_refused() -> None:
    assert "more than 32 MB" in refusal(lambda: read_area("/dev/zero"))


@pytest.mark.parametrize(
    "name", ["google-earth.kml", "garmin.gpx", "survey.plan", "caltopo.json", "google-earth.kmz"]
)
@given(st.integers(0, 10_000), st.binary(min_size=1, max_size=6))
def test_a_damaged_export_is_read_or_refused_but_never_crashes(name: str, at: int, dirt: bytes) -> None:
    data = (EXPORTS / name).read_bytes()
    at %= len(data)
    with contextlib.suppress(BadInput):
        parse_area(data[:at] + dirt + data[at + len(dirt) :], source="field")

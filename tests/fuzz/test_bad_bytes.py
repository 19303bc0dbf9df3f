"""Bad bytes, everywhere that bytes come in: nothing raises, and no belief stops being a probability."""

from __future__ import annotations

import copy
import json
import time
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.integration.flight import FIELD

from .targets import fuzz_area, fuzz_door, fuzz_mavlink, fuzz_settings, open_door

SHIPPED = Path(__file__).parents[2] / "config" / "service.toml"
PATIENT = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])

HARD_NUMBERS = st.sampled_from(
    [0, -0.0, 5e-324, 1e-300, 1e300, -1e300, 2**63, -(2**70), 10**400, 180, -180.0000001, 90, 89.9999999]
) | st.floats(allow_nan=True, allow_infinity=True)
HARD_TEXTS = st.text(max_size=8) | st.sampled_from(
    ["\ud800", "\x00", "a" * 4000, "Polygon", "search", "1e999"]
)
ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | HARD_NUMBERS | HARD_TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(HARD_TEXTS, inner, max_size=4),
    max_leaves=12,
)


def places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths of everything inside a JSON value."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [at, *(path for key, item in inside for path in places(item, (*at, key)))]


@st.composite
def altered(draw: st.DrawFn, base: Any, other: st.SearchStrategy[Any] = ANY_JSON) -> Any:
    """A JSON value with a few places replaced, removed or added to."""
    value = copy.deepcopy(base)
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(places(value)))
        if not path:
            continue
        holder = value
        for key in path[:-1]:
            holder = holder[key]
        what = draw(st.sampled_from(["replace", "replace", "remove", "repeat"]))
        if what == "replace":
            holder[path[-1]] = draw(other)
        elif what == "remove":
            del holder[path[-1]]
        elif isinstance(holder, list):
            holder.insert(path[-1], copy.deepcopy(holder[path[-1]]))
        else:
            holder[draw(HARD_TEXTS)] = draw(other)
    return value


def as_bytes(value: Any) -> bytes:
    """JSON as lenient writers write it: NaN, Infinity and halves of characters included."""
    return json.dumps(value).encode()


# ---- MAVLink


@PATIENT
@given(data=st.binary(max_size=600))
def test_any_mavlink_bytes_are_survived(data: bytes) -> None:
    fuzz_mavlink(data)


@st.composite
def telemetry(draw: st.DrawFn) -> bytes:
    """Good frames of a vehicle with hard contents, in the form that the target cuts up."""
    out = bytes([draw(st.integers(0, 7))])
    for _ in range(draw(st.integers(1, 12))):
        number = draw(st.integers(0, 2**15 - 1))
        payload = draw(st.binary(min_size=1, max_size=60) | st.sampled_from([b"\xff" * 60, b"\x7f" * 60]))
        piece = (number << 1 | 1).to_bytes(2, "little") + payload
        out += bytes([len(piece)]) + piece
    return out


@PATIENT
@given(data=telemetry())
def test_any_content_of_good_frames_is_survived(data: bytes) -> None:
    fuzz_mavlink(data)


# ---- area files


@PATIENT
@given(data=st.binary(max_size=300) | ANY_JSON.map(as_bytes))
@example(data=b"[" * 100_000)
@example(data=b'{"type": "Polygon", "coordinates": ' + b"1" * 5000 + b"}")
@example(data=b'{"type": "\\ud800"}')
def test_any_bytes_as_an_area_file_are_answered_in_a_sentence(data: bytes) -> None:
    fuzz_area(data)


@PATIENT
@given(value=altered(FIELD))
def test_an_area_file_with_anything_in_it_altered_is_a_grid_or_a_sentence(value: Any) -> None:
    fuzz_area(as_bytes(value))


NUDGES = st.floats(-0.003, 0.003) | st.sampled_from([0.0, 1e-12, -1e-9, 1e-6])


@PATIENT
@given(nudges=st.lists(NUDGES, min_size=10, max_size=10), weight=HARD_NUMBERS, sigma=HARD_NUMBERS)
def test_a_polygon_of_any_shape_and_a_prior_of_any_width_are_a_grid_or_a_sentence(
    nudges: list[float], weight: float, sigma: float
) -> None:
    area = copy.deepcopy(FIELD)
    ring = area["features"][0]["geometry"]["coordinates"][0]
    for point, east, north in zip(ring, nudges[::2], nudges[1::2], strict=True):
        point[0], point[1] = point[0] + east, point[1] + north
    ring[-1] = ring[0]
    area["features"][1]["properties"] |= {"weight": weight, "sigma_m": sigma}
    fuzz_area(as_bytes(area))


# ---- settings


@PATIENT
@given(data=st.binary(max_size=200))
def test_any_bytes_as_a_settings_file_are_answered_in_a_sentence(data: bytes) -> None:
    fuzz_settings(data)


LINES = [line for line in SHIPPED.read_text(encoding="utf-8").splitlines() if line and line[0] not in " #"]
TOML_VALUES = st.one_of(
    HARD_NUMBERS.map(str),
    st.sampled_from(
        ["nan", "-inf", "true", "[]", "{}", "'''", "1979-05-27T07:32:00Z", '"\\u0000"', "[[1], 'a']"]
    ),
    st.text(max_size=12).map(lambda text: json.dumps(text)),
    st.sampled_from(
        ["udpin://", "serial:///dev/x:99", "tcp:h:0", "[::1]:x", "a:²", ":99999999999999999999"]
    ).map(json.dumps),
)


@PATIENT
@given(changes=st.lists(st.tuples(st.integers(0, len(LINES) - 1), TOML_VALUES), min_size=1, max_size=3))
def test_a_settings_file_with_any_value_altered_is_settings_or_a_sentence(
    changes: list[tuple[int, str]],
) -> None:
    lines = list(LINES)
    for at, value in changes:
        key, equals, _ = lines[at].partition("=")
        lines[at] = f"{key}= {value}" if equals else f"[{value}]"
    fuzz_settings("\n".join(lines).encode("utf-8", "surrogatepass"))


# ---- detector reports


def report() -> dict[str, Any]:
    """A report that is taken in: over the field, with one detection in it."""
    frame = open_door().search.grid.frame
    (lat, lon), (lat2, lon2) = frame.to_latlon([[2, 2], [2.3, 2.4]]).tolist()
    return {
        "id": "x",
        "source": "fuzz",
        "captured_at": time.time(),
        "usable": True,
        "pose": {"lat": lat, "lon": lon, "height_m": 30.0, "heading_deg": 0.0},
        "detections": [{"class": "person", "score": 0.5, "lat": lat2, "lon": lon2}],
    }


def test_the_report_that_is_altered_below_is_taken_in() -> None:
    answer = fuzz_door(as_bytes(report()))
    assert answer.json()[0] == {"id": "x", "status": "accepted", "reason": "", "looks": 1, "hits": 1}


@PATIENT
@given(data=st.binary(max_size=200) | ANY_JSON.map(as_bytes))
@example(data=b"[" * 100_000)
@example(data=b'{"id": ' + b"9" * 5000 + b"}")
@example(data=b'{"id": "\\ud800", "captured_at": NaN, "\\ud800": 1}')
@example(data=b"\xff\xfe{\x00}\x00")
def test_any_bytes_as_a_report_are_answered(data: bytes) -> None:
    fuzz_door(data)


@PATIENT
@given(data=st.data())
def test_a_report_with_anything_in_it_altered_is_answered(data: st.DataObject) -> None:
    number = data.draw(st.integers(0, 2**60))
    fuzz_door(as_bytes(data.draw(altered({**report(), "id": f"{number}"}))))


@PATIENT
@given(
    cells=st.lists(
        st.tuples(st.integers(-2, 30), st.integers(-2, 30), st.booleans()), min_size=1, max_size=60
    ),
    salt=st.integers(0, 2**60),
)
def test_any_series_of_good_reports_leaves_a_probability(
    cells: list[tuple[int, int, bool]], salt: int
) -> None:
    frame = open_door().search.grid.frame
    batch = []
    for number, (row, col, hit) in enumerate(cells):
        lat, lon = frame.to_latlon([[row, col]])[0].tolist()
        pose = {"lat": lat, "lon": lon, "height_m": 30.0, "heading_deg": 90.0}
        detections = [{"lat": lat, "lon": lon}] if hit else []
        batch.append(
            {"id": f"{salt}-{number}", "captured_at": time.time(), "pose": pose, "detections": detections}
        )
    assert fuzz_door(as_bytes(batch)).status_code in (200, 429)


@PATIENT
@given(
    headers=st.dictionaries(
        st.sampled_from(
            ["host", "origin", "content-type", "authorization", "sec-fetch-site", "content-length"]
        ),
        st.text(st.characters(min_codepoint=32, max_codepoint=255, exclude_characters="\x7f"), max_size=40),
        max_size=5,
    )
)
def test_any_headers_are_answered(headers: dict[str, str]) -> None:
    raw = {name: value.encode("latin-1") for name, value in headers.items()}
    answer = open_door().post("/api/commands", b'{"command": "hold"}', raw)  # type: ignore[arg-type]
    assert answer.status_code < 500

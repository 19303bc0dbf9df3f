"""Reading area files: what is accepted, and the one sentence for everything that is not."""

import contextlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.area import BadArea, PointPrior, PolygonPrior, parse_area, read_area
from service.errors import BadInput
from tests.service.area.files import at, box, collection, feature, parse, point, polygon, ring, square

BOX = box(-200, -200, 200, 200)
BOWTIE = [[11.0, 47.0], [11.002, 47.002], [11.002, 47.0], [11.0, 47.002], [11.0, 47.0]]
NAN, INF = float("nan"), float("inf")


def refusal(call: Callable[[], object]) -> str:
    """The message with which a call refuses its input: checked to be one sentence on one line."""
    with pytest.raises(BadInput) as caught:
        call()
    message = str(caught.value)
    assert message.endswith((".", "?"))
    assert not message.endswith("..")
    assert "\n" not in message
    return message


# --- files ---------------------------------------------------------------------------------------


def test_missing_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "nowhere.geojson"
    assert refusal(lambda: read_area(path)) == f"{path}: there is no such file; check the path."


def test_folder_instead_of_file_is_refused(tmp_path: Path) -> None:
    assert "this is a folder; give the area file" in refusal(lambda: read_area(tmp_path))


def test_unreadable_file_says_why(tmp_path: Path) -> None:
    path = tmp_path / "loop.geojson"
    path.symlink_to(path)
    message = refusal(lambda: read_area(path))
    assert "cannot be read" in message
    assert "permissions" in message


def test_path_that_is_no_path_is_refused() -> None:
    assert "cannot be read" in refusal(lambda: read_area("area\0.geojson"))


def test_not_json_names_line_and_column(tmp_path: Path) -> None:
    path = tmp_path / "field.geojson"
    path.write_text('{"type": "Polygon",\n "coordinates": [[[11.0, 47.0] [11.1, 47.0]]]}')
    message = refusal(lambda: read_area(path))
    assert message.startswith(f"{path}: not JSON at line 2, column 32")
    assert "correct it there" in message


@pytest.mark.parametrize("data", [b"", b" \n", b"\xef\xbb\xbf"])
def test_empty_file_is_refused(data: bytes) -> None:
    assert "field.geojson: the file is empty" in refusal(lambda: parse_area(data, source="field.geojson"))


def test_utf8_byte_order_mark_is_accepted() -> None:
    area = parse_area(b"\xef\xbb\xbf" + json.dumps(square()).encode(), source="field.geojson")
    assert not area.ground.is_empty


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32"])
def test_a_byte_order_mark_says_the_encoding(encoding: str) -> None:
    data = json.dumps({**collection(square()), "name": "Höhe"}, ensure_ascii=False).encode(encoding)
    assert parse_area(data, source="field.geojson").name == "Höhe"


def test_text_that_is_no_utf8_is_read_with_a_note() -> None:
    data = json.dumps({**collection(square()), "name": "Höhe"}, ensure_ascii=False).encode("latin-1")
    area = parse_area(data, source="field.geojson")
    assert area.name == "Höhe"
    assert any("Windows-1252" in note for note in area.notes)


@pytest.mark.parametrize("data", [b"[" * 100_000, b'{"a": 1' + b"0" * 5000 + b"}"])
def test_json_beyond_the_parser_is_refused(data: bytes) -> None:
    assert "not usable JSON" in refusal(lambda: parse_area(data, source="field.geojson"))


@given(st.binary(max_size=200))
def test_any_bytes_are_refused_or_accepted_but_never_crash(data: bytes) -> None:
    with pytest.raises(BadInput):
        parse_area(data, source="field.geojson")


SCALARS = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(["Point", "prior", "launch"])
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=9,
)


@given(
    st.sampled_from(
        ["type", "geometry", "coordinates", "properties", "role", "weight", "sigma_m", "outside"]
    ),
    st.sampled_from([0, 1, 2]),
    VALUES,
)
def test_any_value_in_any_member_is_refused_or_accepted_but_never_crashes(
    member: str, index: int, value: Any
) -> None:
    features = [
        square(),
        feature(point(at(0, 0)), role="prior", weight=1, sigma_m=10),
        feature(polygon(box(0, 0, 50, 50)), role="exclude"),
    ]
    target = features[index]
    holder = target if member in target else target["geometry" if member == "coordinates" else "properties"]
    holder[member] = value
    with contextlib.suppress(BadInput):
        parse(collection(*features))


# --- what is accepted ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "value",
    [
        polygon(BOX),
        {"type": "MultiPolygon", "coordinates": [[BOX]]},
        feature(polygon(BOX)),
        {"type": "Feature", "properties": None, "geometry": polygon(BOX)},
        collection(feature(polygon(BOX))),
        collection(square()),
    ],
)
def test_bare_geometry_feature_and_collection_give_the_same_area(value: Any) -> None:
    area = parse(value)
    assert area.polygon.equals(parse(square()).polygon)
    assert (area.priors, area.exclusions, area.launch, area.outside) == ((), (), None, 0.0)


def test_full_file_is_read_with_all_its_roles() -> None:
    area = parse(
        collection(
            feature(polygon(BOX, box(-20, -20, 20, 20)), role="search", outside=0.25),
            feature(point(at(50, 50)), role="prior", sigma_m=30, weight=2),
            feature(polygon(box(-100, -100, -50, -50)), role="prior"),
            feature(polygon(box(100, 100, 150, 150)), role="exclude"),
            feature(polygon(box(100, -100, 150, -50)), role="exclude", searchable=True),
            feature(point([*at(0, -200), 850.0]), role="launch"),
            name="Field",
            description="A story.",
        )
    )
    assert (area.name, area.description, area.outside) == ("Field", "A story.", 0.25)
    near, even = area.priors
    assert isinstance(near, PointPrior)
    assert isinstance(even, PolygonPrior)
    assert (near.sigma_m, near.weight, even.weight) == (30.0, 2.0, 1.0)
    assert near.position == tuple(at(50, 50)[::-1])
    assert [item.searchable for item in area.exclusions] == [False, True]
    assert area.launch == tuple(at(0, -200)[::-1])
    assert area.ground.area == pytest.approx(area.polygon.area - area.exclusions[0].polygon.area)


@pytest.mark.parametrize("name", ["urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:EPSG::4326", "EPSG:4326"])
def test_crs_member_that_says_wgs84_is_accepted(name: str) -> None:
    crs = {"type": "name", "properties": {"name": name}}
    assert not parse(collection(square(), crs=crs)).ground.is_empty


def test_outside_is_read_from_the_collection_too() -> None:
    assert parse(collection(square(), outside=0.3)).outside == 0.3


def test_overlapping_search_polygons_are_joined() -> None:
    west, east = feature(polygon(box(-200, 0, 50, 99))), feature(polygon(box(-50, 0, 200, 99)))
    joined, whole = parse(collection(west, east)), parse(polygon(box(-200, 0, 200, 99)))
    assert joined.polygon.area == pytest.approx(whole.polygon.area, rel=1e-4)


# --- what is refused -----------------------------------------------------------------------------

SEARCH = "field.geojson: the geometry: "
FIRST = "field.geojson: features[0]: "
SECOND = "field.geojson: features[1]: "


def with_prior(**properties: Any) -> Any:
    return collection(square(), feature(point(at(0, 0)), role="prior", **properties))


REFUSED: dict[str, tuple[Any, tuple[str, ...]]] = {
    "a list": ([1, 2], ("field.geojson: not GeoJSON: the top level must be an object",)),
    "no type": ({"features": []}, ("field.geojson: not GeoJSON: 'type' is null", "FeatureCollection")),
    "topojson": ({"type": "Topology"}, ("not GeoJSON", '"Topology"')),
    "features no list": ({"type": "FeatureCollection", "features": {}}, ("needs a list of 'features'",)),
    "not a feature": (collection(polygon(BOX)), (FIRST, "not a GeoJSON Feature")),
    "no geometry": (collection(feature(None, role="search")), (FIRST, "geometry is null", "draw a Polygon")),
    "nothing with a geometry": (collection(feature(None)), ("field.geojson: the search area is empty",)),
    "properties a list": (
        collection({"type": "Feature", "geometry": polygon(BOX), "properties": []}),
        (FIRST, "'properties' must be an object or null"),
    ),
    "other crs": (
        collection(square(), crs={"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}),
        ("field.geojson: 'crs' is \"urn:ogc:def:crs:EPSG::25832\"", "WGS84 (EPSG:4326)"),
    ),
    "linked crs": (collection(square(), crs={"type": "link"}), ("'crs' is", "WGS84")),
    "projected coordinates": (
        polygon([[679000.0, 5250000.0], [679500, 5250000], [679500, 5250300], [679000.0, 5250000.0]]),
        (SEARCH, "[679000.0, 5250000.0] looks like projected coordinates", "WGS84 (EPSG:4326)"),
    ),
    "swapped": (
        polygon([[p[1], p[0]] for p in box(-200, -200, 200, 200, (47.0, 151.0))]),
        (SEARCH, "latitude 150.997 is out of range -90..90", "look swapped, write", "[longitude, latitude]"),
    ),
    "latitude out of range": (polygon([[150, 95], [150, 96], [151, 96], [150, 95]]), ("latitude 95 is out",)),
    "longitude out of range": (
        polygon([[179.9, 10], [180.1, 10], [180.1, 11], [179.9, 10]]),
        (SEARCH, "longitude 180.1 is out of range -180..180", "antimeridian"),
    ),
    "crossing the antimeridian": (
        polygon([[179.999, 10], [-179.999, 10], [-179.999, 10.001], [179.999, 10.001], [179.999, 10]]),
        (SEARCH, "the outer ring crosses the antimeridian after [179.999, 10.0]", "one side of it at a time"),
    ),
    "parts on both sides of the antimeridian": (
        {
            "type": "MultiPolygon",
            "coordinates": [
                [[[179.99, 10], [180, 10], [180, 10.01], [179.99, 10]]],
                [[[-180, 10], [-179.99, 10], [-180, 10.01], [-180, 10]]],
            ],
        },
        ("field.geojson: the area lies on both sides of the antimeridian", "one side of it at a time"),
    ),
    "near a pole": (
        polygon([[10, 85.9], [10.01, 85.9], [10.01, 85.901], [10, 85.9]]),
        ("field.geojson: the area reaches latitude 85.901; stay within 85 degrees", "poles"),
    ),
    "crossing itself": (
        polygon(BOWTIE),
        (SEARCH, "the ring crosses or touches itself at [11.001, 47.001]; move the corners"),
    ),
    "hole outside": (
        polygon(BOX, box(300, 300, 400, 400)),
        (SEARCH, "not valid (hole lies outside shell) at [11.00", "draw it again"),
    ),
    "two corners": (
        polygon([BOX[0], BOX[1], BOX[0]]),
        (SEARCH, "the outer ring has 3 positions; give at least 4"),
    ),
    "no coordinates": (polygon(), ("the search area is empty", "(the geometry: left out, it is empty)")),
    "no positions": (
        collection(feature(polygon([]), role="search")),
        (FIRST, "the polygon is empty: the outer ring has no positions"),
    ),
    "no parts": (
        collection(feature({"type": "MultiPolygon", "coordinates": []}, role="search")),
        (FIRST, "the polygon is empty"),
    ),
    "a line back and forth": (
        polygon([[11, 47], [11.1, 47.1], [11.2, 47.2], [11, 47]]),
        (SEARCH, "the polygon is empty: it encloses no ground"),
    ),
    "no features": (collection(), ("field.geojson: the search area is empty", "role 'search'", "draw one")),
    "only a prior": (
        collection(feature(polygon(BOX), role="prior")),
        ("field.geojson: the search area is empty: no Polygon has the role 'search'",),
    ),
    "coordinates of the wrong depth": (
        {"type": "Polygon", "coordinates": BOX},
        (SEARCH, "is not a position; write [longitude, latitude]"),
    ),
    "text as position": (
        polygon([["11", "47"]]),
        (SEARCH, '["11", "47"] is not a position; write two numbers'),
    ),
    "NaN position": (
        polygon([[NAN, 47.0], *BOX[1:]]),
        (SEARCH, "[NaN, 47.0] holds NaN or Infinity", "finite"),
    ),
    "infinite position": (polygon([[11.0, -INF], *BOX[1:]]), (SEARCH, "holds NaN or Infinity")),
    "zero weight": (
        with_prior(sigma_m=9, weight=0),
        (SECOND, "weight is 0; give a finite number greater than 0"),
    ),
    "negative weight": (
        with_prior(sigma_m=9, weight=-1.5),
        (SECOND, "weight is -1.5; give", "greater than 0"),
    ),
    "NaN weight": (with_prior(sigma_m=9, weight=NAN), (SECOND, "weight is NaN; give a finite number")),
    "infinite weight": (
        with_prior(sigma_m=9, weight=INF),
        (SECOND, "weight is Infinity; give a finite number"),
    ),
    "huge weight": (with_prior(sigma_m=9, weight=10**400), (SECOND, "weight is 1000", "finite number")),
    "text as weight": (
        with_prior(sigma_m=9, weight="much"),
        (SECOND, 'weight is "much"; give a finite number'),
    ),
    "true as weight": (with_prior(sigma_m=9, weight=True), (SECOND, "weight is true; give a finite number")),
    "no sigma": (with_prior(weight=1), (SECOND, "a point prior needs sigma_m", "metres")),
    "zero sigma": (with_prior(sigma_m=0), (SECOND, "sigma_m is 0; give a finite number greater than 0")),
    "negative sigma": (with_prior(sigma_m=-3), (SECOND, "sigma_m is -3; give")),
    "NaN sigma": (with_prior(sigma_m=NAN), (SECOND, "sigma_m is NaN")),
    "unknown role": (
        collection(square(), feature(point(at(0, 0)), role="goal")),
        (SECOND, 'unknown role "goal"; use search, prior, ipp, exclude, cover, transit or launch'),
    ),
    "role no text": (collection(feature(polygon(BOX), role=["search"])), (FIRST, 'unknown role ["search"]')),
    "line as exclude": (
        collection(square(), feature({"type": "LineString", "coordinates": BOX}, role="exclude")),
        (SECOND, "the role 'exclude' cannot be a LineString; draw it as a Polygon or MultiPolygon"),
    ),
    "point as search": (
        collection(feature(point(at(0, 0)), role="search")),
        (FIRST, "the role 'search' cannot be a Point; draw it as a Polygon"),
    ),
    "polygon as launch": (
        collection(square(), feature(polygon(BOX), role="launch")),
        (SECOND, "the role 'launch' cannot be a Polygon; draw it as a Point"),
    ),
    "two launch points": (
        collection(square(), *[feature(point(at(0, 0)), role="launch")] * 2),
        ("field.geojson: features[2]: this is a second launch point; keep one",),
    ),
    "launch far away": (
        collection(square(), feature(point(at(5200, 0)), role="launch", name="hut")),
        ('features[1] ("hut"): the launch point is 5 km from the area, more than 2 km; move it to the edge',),
    ),
    "launch swapped": (
        collection(square(), feature(point(at(0, 0)[::-1]), role="launch")),
        (SECOND, "the launch point is", "longitude and latitude are swapped, either here or in the area"),
    ),
    "prior swapped": (
        collection(square(), feature(point(at(0, 0)[::-1]), role="prior", sigma_m=50)),
        (SECOND, "lies entirely outside", "longitude and latitude are swapped, either here or in the area"),
    ),
    "outside one": (
        collection(feature(polygon(BOX), outside=1)),
        (FIRST, "outside is 1; give the probability"),
    ),
    "outside negative": (
        collection(square(), outside=-0.1),
        ("field.geojson: outside is -0.1;", "less than 1"),
    ),
    "outside NaN": (collection(square(), outside=NAN), ("outside is NaN",)),
    "outside twice": (
        collection(feature(polygon(BOX), outside=0.2), outside=0.1),
        (FIRST, "outside is 0.2 here and 0.1 before; give it once"),
    ),
    "outside on a prior": (
        with_prior(sigma_m=9, outside=0.1),
        (SECOND, "'outside' belongs to the search area"),
    ),
    "searchable no bool": (
        collection(square(), feature(polygon(box(0, 0, 9, 9)), role="exclude", searchable="perhaps")),
        (SECOND, 'searchable is "perhaps"; write true or false'),
    ),
    "polygon prior outside": (
        collection(square(), feature(polygon(box(300, 300, 400, 400)), role="prior", name="wood")),
        ('features[1] ("wood"): the prior lies entirely outside the area', "move it or remove it"),
    ),
    "point prior outside": (
        collection(square(), feature(point(at(500, 0)), role="prior", sigma_m=50)),
        (
            SECOND,
            "the prior lies entirely outside the area that is searched",
            "move it, widen it or remove it",
        ),
    ),
    "prior in an exclusion": (
        collection(
            square(),
            feature(polygon(box(0, 0, 100, 100)), role="exclude"),
            feature(polygon(box(10, 10, 90, 90)), role="prior"),
        ),
        ("features[2]: the prior lies entirely outside the area that is searched",),
    ),
    "exclusion over everything": (
        collection(square(), feature(polygon(box(-999, -999, 999, 999)), role="exclude")),
        ("field.geojson: the exclusions cover the whole search area; make them smaller",),
    ),
    "over the limit": (
        square(6000),
        ("field.geojson: the area covers 144 km², over the limit of 100 km²; draw a smaller area or",),
    ),
    "reaching too far": (
        polygon(ring([(-50_000, 0), (50_000, 0), (50_000, 200), (-50_000, 200)])),
        ("field.geojson: the area reaches 50.0 km from its centre, more than 40 km", "several searches"),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_area_is_refused_with_one_sentence_that_says_where_and_what_to_do(name: str) -> None:
    value, words = REFUSED[name]
    message = refusal(lambda: parse(value))
    assert message.startswith("field.geojson: ")
    for word in words:
        assert word in message


def test_feature_is_named_by_its_id_when_it_has_no_name() -> None:
    bad = {**feature(point(at(0, 0)), role="goal"), "id": 17}
    assert "features[1] (17): unknown role" in refusal(lambda: parse(collection(square(), bad)))


def test_line_breaks_in_a_name_stay_out_of_the_message() -> None:
    bad = feature(point(at(0, 0)), role="goal", name="one\ntwo\x1b[31m")
    assert r"one\ntwo\u001b" in refusal(lambda: parse(collection(square(), bad)))


def test_area_limit_and_launch_limit_can_be_set() -> None:
    far = collection(square(6000), feature(point(at(9000, 0)), role="launch"))
    assert parse(far, max_area_km2=150, max_launch_m=3500).launch is not None
    assert "over the limit of 0.1 km²" in refusal(lambda: parse(square(), max_area_km2=0.1))


def test_holes_do_not_count_for_the_area_limit() -> None:
    ring_shaped = polygon(box(-6000, -6000, 6000, 6000), box(-5000, -5000, 5000, 5000))
    assert not parse(ring_shaped, max_area_km2=45).ground.is_empty


def test_a_name_gives_no_orders_to_the_terminal_it_is_shown_in() -> None:
    area = parse({**collection(feature(polygon(BOX))), "name": "north\n\x1b[2Jslope "})
    assert area.name == "north  [2Jslope"


def test_half_of_a_character_is_refused_before_the_flight_not_when_the_report_is_written() -> None:
    data = json.dumps({**collection(feature(polygon(BOX))), "name": "\ud800"}).encode()
    assert "half of a character" in refusal(lambda: parse_area(data, source="a.geojson"))
    whole = json.dumps({**collection(feature(polygon(BOX))), "name": "\U0001f6a9"}).encode()
    assert parse_area(whole, source="a.geojson").name == "\U0001f6a9"


def faults_of(*features: Any) -> list[str]:
    with pytest.raises(BadArea) as caught:
        parse(collection(*features))
    return list(caught.value.faults)


def test_all_that_is_wrong_with_a_feature_is_told_at_once() -> None:
    bad = feature(point(["east", 47]), role="prior", sigma_m="wide", wieght=-2, outside=0.1)
    assert faults_of(square(), bad) == [
        "features[1]: it has no property \"wieght\" that is known; did you mean 'weight'?",
        "features[1]: 'outside' belongs to the search area; move it to the feature with the role 'search'.",
        "features[1]: weight is -2; give a finite number greater than 0.",
        'features[1]: sigma_m is "wide"; give a finite number greater than 0.',
        'features[1]: ["east", 47] is not a position; write two numbers, [longitude, latitude].',
    ]


def test_a_misspelt_property_is_not_missed_as_well() -> None:
    said = refusal(lambda: parse(collection(square(), feature(point(at(0, 0)), role="prior", sigma=50))))
    assert said.endswith("it has no property \"sigma\" that is known; did you mean 'sigma_m'?")


def test_what_lies_too_far_away_is_told_beside_other_faults_where_the_area_is_understood() -> None:
    away = feature(point(at(9000, 0)), role="launch")
    bad = feature(point(at(0, 0)), role="prior")
    assert [fault[:11] for fault in faults_of(square(), bad, away)] == ["features[1]", "features[2]"]
    unclear = feature(polygon(BOWTIE), role="search")  # the launch point may be near this one
    assert "features[1]" in refusal(lambda: parse(collection(square(), unclear, away)))

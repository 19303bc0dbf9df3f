"""Files as teams really have them: odd encodings and spellings, folders that say what their things do not, tracks of
receivers, slips of the hand. Nothing of them is lost without a word, and no oddity refuses the whole."""

from __future__ import annotations

import io
import json
import math
import zipfile
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from service.area import PointPrior, RingPrior, SearchArea, parse_area
from service.area.document import few_notes, settings_in
from service.area.formats import read_document
from service.area.geojson import Where
from service.area.mending import goes_around, mend
from service.area.projection import surface_m2
from service.errors import BadInput
from tests.service.area.files import at, box, collection, feature, parse, point, polygon

FIELD, FARM = box(-200, -200, 200, 200), box(0, 0, 80, 80)
Json = dict[str, Any]


def ground(ring: list[list[float]]) -> str:
    corners = " ".join(f"{lon},{lat},0" for lon, lat in ring)
    inner = f"<LinearRing><coordinates>{corners}</coordinates></LinearRing>"
    return f"<Polygon><outerBoundaryIs>{inner}</outerBoundaryIs></Polygon>"


def mark(name: str, geometry: str, more: str = "") -> str:
    return f"<Placemark><name>{name}</name>{more}{geometry}</Placemark>"


def kml(body: str, root: str = 'xmlns="http://www.opengis.net/kml/2.2"', encoding: str = "utf-8") -> bytes:
    text = f'<?xml version="1.0" encoding="{encoding}"?>\r\n<kml {root}><Document>{body}</Document></kml>'
    return text.encode(encoding)


def spot(east: float, north: float) -> str:
    return "<Point><coordinates>{},{}</coordinates></Point>".format(*at(east, north))


def gpx(body: str, encoding: str = "utf-8") -> bytes:
    head = f'<?xml version="1.0" encoding="{encoding}"?>'
    return (
        f'{head}<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1">{body}</gpx>'.encode(
            encoding
        )
    )


def track(name: str, positions: list[list[float]]) -> str:
    points = "".join(f'<trkpt lat="{lat}" lon="{lon}"/>' for lon, lat in positions)
    return f"<trk><name>{name}</name><trkseg>{points}</trkseg></trk>"


def plan(*items: Json, **members: Any) -> bytes:
    mission = {"version": 2, "items": list(items), "plannedHomePosition": at(-200, -200)[::-1]}
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission, **members}).encode()


def a_survey(ring: list[list[float]]) -> Json:
    return {"type": "ComplexItem", "complexItemType": "survey", "polygon": [p[::-1] for p in ring[:-1]]}


def caltopo(kind: str, title: str, geometry: Json | None, **properties: Any) -> Json:
    made = feature(geometry, **{"class": kind, "title": title, **properties})
    return {**made, "id": properties.get("id", "0a1b")}


def read(data: bytes) -> SearchArea:
    return parse_area(data, source="map")


def noted(area: SearchArea, *words: str) -> bool:
    return any(all(word in note for word in words) for note in area.notes)


@pytest.mark.parametrize("encoding", ["iso-8859-1", "windows-1252", "utf-16", "utf-8-sig"])
def test_names_are_read_in_the_encoding_that_the_file_declares(encoding: str) -> None:
    declared = "utf-8" if encoding == "utf-8-sig" else encoding
    walked = gpx(track("Fläche Höhe", FIELD), declared)
    drawn = kml(mark("Suchgebiet Höhe", ground(FIELD)), encoding=declared)
    if encoding == "utf-8-sig":
        walked, drawn = b"\xef\xbb\xbf" + walked, b"\xef\xbb\xbf" + drawn
    assert read_document(walked, Where("a")).items[0].words == "Fläche Höhe"
    assert read_document(drawn, Where("a")).items[0].words == "Suchgebiet Höhe"


@pytest.mark.parametrize(
    "data",
    [
        kml(mark("Search & rescue", ground(FIELD), "<gx:balloonVisibility>1</gx:balloonVisibility>")),
        kml(mark("area&nbsp;1", ground(FIELD)), root='xsi:schemaLocation="a b"'),
        kml(mark("area", ground(FIELD)), root=""),
        kml(mark("area", ground(FIELD).replace(",0 ", ", 0 ").replace(",4", ", 4"))),
    ],
    ids=["undeclared gx", "undeclared xsi", "no namespace", "spaces after commas"],
)
def test_kml_that_only_a_lenient_reader_takes_is_taken(data: bytes) -> None:
    assert read(data).polygon.area == pytest.approx(parse(polygon(FIELD)).polygon.area)


def test_a_folder_says_what_the_things_in_it_are() -> None:
    drawn = (
        f"<Folder><name>Segments</name>{mark('101', ground(FIELD))}</Folder>"
        f"<Folder><name>No fly zones</name>{mark('farm', ground(FARM))}</Folder>"
        f"<Folder><name>Clues</name>{mark('red glove', spot(-50, 0))}</Folder>"
    )
    area = read(kml(drawn))
    assert [each.label for each in area.exclusions] == ['placemark 2 ("farm")']
    assert [type(prior) for prior in area.priors] == [PointPrior]
    folder = {**caltopo("Folder", "Hazards", None, id="f1"), "id": "f1"}
    shapes = [
        caltopo("Shape", "farm", polygon(FARM), folderId="f1"),
        caltopo("Assignment", "", polygon(FIELD)),
    ]
    assert len(parse(collection(folder, *shapes)).exclusions) == 1


def test_a_folder_of_segments_does_not_make_ground_of_what_lies_beside_named_ground() -> None:
    drawn = mark("Search area", ground(FIELD)) + mark(
        "operational boundary", ground(box(-900, -900, 900, 900))
    )
    area = read(kml(f"<Folder><name>Search</name>{drawn}</Folder>"))
    assert area.polygon.area == pytest.approx(parse(polygon(FIELD)).polygon.area)
    assert noted(area, '"operational boundary"', "left out")


@pytest.mark.parametrize(
    "name",
    [
        "Nofly_zone",
        "NoFlyZone 2",
        "Do not fly",
        "Area closed, no flying",
        "R-12 prohibited",
        "Flugverbotszone",
    ],
)
def test_ground_never_to_fly_over_is_known_by_many_names(name: str) -> None:
    area = parse(collection(feature(polygon(FIELD)), feature(polygon(FARM), name=name)))
    assert len(area.exclusions) == 1
    assert noted(area, "never flown over, by its name")


@pytest.mark.parametrize("name", ["Letzter Standort Müller", "zuletzt gesehen 14:30", "PLS/LKP", "Last_seen"])
def test_the_last_place_known_is_known_by_many_names(name: str) -> None:
    (prior,) = parse(collection(feature(polygon(FIELD)), feature(point(at(0, 0)), name=name))).priors
    assert isinstance(prior, PointPrior)


def test_the_home_of_whom_is_looked_for_is_no_launch_point() -> None:
    home = feature(point(at(0, 0)), name="Missing person's home")
    assert parse(collection(feature(polygon(FIELD)), home)).launch is None
    assert (
        parse(collection(feature(polygon(FIELD)), feature(point(at(0, 0)), name="Home"))).launch is not None
    )


def test_a_short_description_says_what_a_numbered_waypoint_is() -> None:
    lat, lon = at(0, 0)[::-1]
    way = f'<wpt lat="{lat}" lon="{lon}"><name>001</name><desc>LKP</desc></wpt>'
    assert len(read(gpx(way + track("area", FIELD))).priors) == 1


def test_columns_of_a_shapefile_are_in_capitals_and_a_table_has_numbers_as_text() -> None:
    area = parse(
        collection(
            feature(polygon(FIELD), NAME="Search area", ROLE="search", Outside="0.1"),
            feature(polygon(FARM), NAME="farm", ROLE="exclude", SEARCHABLE=1),
            feature(point(at(0, 0)), role="prior", sigma_m="80", weight="2", WEIGHT_KG=70),
        )
    )
    assert (area.name, area.outside, area.exclusions[0].searchable) == ("Search area", 0.1, True)
    assert [(prior.weight, prior.sigma_m) for prior in area.priors if isinstance(prior, PointPrior)] == [
        (2, 80)
    ]
    data = "".join(
        f'<Placemark><ExtendedData><SchemaData schemaUrl="#a"><SimpleData name="NAME">{name}</SimpleData>'
        f'<SimpleData name="ROLE">{role}</SimpleData></SchemaData></ExtendedData>{ground(ring)}</Placemark>'
        for name, role, ring in (("Wood", "search", FIELD), ("farm", "exclude", FARM))
    )
    assert [each.label for each in read(kml(data)).exclusions] == ['placemark 2 ("farm")']


def test_cover_can_be_said_in_a_description() -> None:
    wood = mark("wood", ground(FARM), "<description>role=cover kind=woodland</description>")
    assert [cover.kind for cover in read(kml(mark("area", ground(FIELD)) + wood)).covers] == ["woodland"]


def test_polygons_that_nothing_is_known_of_are_searched_and_named() -> None:
    area = parse(collection(feature(polygon(FIELD)), feature(polygon(FARM), name="wood")))
    assert noted(area, "searched, since no name says what else it is: features[0], features[1]")


@pytest.mark.parametrize("turns", [1, 2])
def test_a_walk_around_an_area_may_cross_itself(turns: int) -> None:
    rng = np.random.default_rng(3)
    angles = np.linspace(0, 2 * math.pi * turns, 200 * turns + 1)
    walked = np.column_stack([150 * np.cos(angles), 150 * np.sin(angles)]) + rng.normal(
        0, 3, (len(angles), 2)
    )
    area = read(gpx(track("round the wood", [at(*place) for place in walked])))
    assert area.polygon.area == pytest.approx(
        math.pi / 4 * parse(polygon(box(-150, -150, 150, 150))).polygon.area, rel=0.05
    )
    assert noted(area, "crosses itself by a slip")


def test_a_way_out_and_back_is_no_area() -> None:
    out = [at(4.0 * step, 2.0 * step) for step in range(40)]
    back = [at(4.0 * step + 3.0 * math.sin(step), 2.0 * step + 5.0) for step in reversed(range(40))]
    area = read(gpx(track("area", FIELD) + track("team 1", out + back)))
    assert noted(area, '"team 1"', "a line says nothing by itself")
    with pytest.raises(BadInput, match=r"the search area is empty.*\(track 1.*left out"):
        read(gpx(track("team 1", out + back)))


def test_a_bow_tie_is_no_slip() -> None:
    bow = [FIELD[0], FIELD[2], FIELD[1], FIELD[3], FIELD[0]]
    with pytest.raises(BadInput, match="crosses or touches itself"):
        parse(polygon(bow))
    assert not goes_around(bow)


def test_a_slip_keeps_the_holes() -> None:
    slip = [*FIELD[:2], at(200, 0), at(201, 1), at(201, -1), at(200, 0), *FIELD[2:]]
    slip = [*slip[:3], at(203, 1), at(199, 2), *slip[3:]]
    geometry = polygon(slip, FARM)
    assert mend(geometry)
    whole = shapely.geometry.shape(geometry)
    assert whole.is_valid
    assert not whole.contains(shapely.Point(at(40, 40)))


@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=3, max_size=12))
def test_whatever_is_mended_is_valid_and_encloses_what_it_did(corners: list[tuple[int, int]]) -> None:
    ring = [[float(east), float(north)] for east, north in [*corners, corners[0]]]
    geometry = polygon(ring)
    if mend(geometry) is not None:
        made = shapely.geometry.shape(geometry)
        assert shapely.is_valid(shapely.union_all(shapely.get_parts(made)))
        assert made.area >= shapely.Polygon(ring).area * (1 - 1e-9) or made.area > 0


def test_a_receiver_writes_words_where_numbers_belong() -> None:
    lat, lon = (str(part).replace(".", ",") for part in at(0, 0)[::-1])
    way = f'<wpt lat="{lat}" lon="{lon}"><ele>n/a</ele><time>gestern</time><name>LKP</name></wpt>'
    area = read(gpx(way + track("area", FIELD)))
    assert [prior.position for prior in area.priors if isinstance(prior, PointPrior)] == [
        pytest.approx(tuple(at(0, 0)[::-1]))
    ]


def test_lines_are_the_area_where_nothing_is_drawn_as_one() -> None:
    line = {"type": "LineString", "coordinates": FIELD}
    assert noted(parse(collection(feature(line, name="Path 1"))), "comes back to its start")
    assert noted(
        parse(collection(feature(line, name="Path 1"), feature(polygon(FIELD)))), "a line says nothing"
    )


def test_features_on_lines_of_their_own_in_a_list_and_in_an_answer_are_a_collection() -> None:
    each = json.dumps(feature(polygon(FIELD)))
    other = json.dumps(feature(polygon(box(300, 0, 400, 100))))
    answer = {
        "result": {"state": collection(feature(polygon(FIELD)), feature(polygon(box(300, 0, 400, 100))))}
    }
    written = [f"{each}\n{other}\n", f"\x1e{each}\n\x1e{other}\n", f"[{each}, {other}]", json.dumps(answer)]
    for text in written:
        area = read(text.encode())
        assert len(area.polygon.geoms) == 2
        assert not read_document(text.encode(), Where("a")).plain  # a run keeps it as plain GeoJSON


@pytest.mark.parametrize("code", ["EPSG::4269", "EPSG::4258", "EPSG:6.9:4283"])
def test_degrees_that_are_nearly_wgs84_are_taken_with_a_note(code: str) -> None:
    crs = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:{code}"}}
    assert noted(parse(collection(feature(polygon(FIELD)), crs=crs)), "less than two metres")


def test_what_is_empty_is_left_out() -> None:
    nothing = [feature(polygon()), feature({"type": "MultiPolygon", "coordinates": []}), feature(None)]
    area = parse(collection(feature(polygon(FIELD)), *nothing))
    assert sum("left out" in note for note in area.notes) == 3
    drawn = read(plan(a_survey(FIELD), a_survey([[0.0, 0.0]])))
    assert noted(drawn, "mission item 2", "was never drawn")


def test_rings_of_distances_are_no_ground_to_search() -> None:
    rings = [
        caltopo("Shape", f"{share}%", polygon(box(-9 * share, -9 * share, 9 * share, 9 * share)))
        for share in (25, 50)
    ]
    area = parse(collection(*rings, caltopo("Shape", "wood", polygon(FIELD))))
    assert area.polygon.area == pytest.approx(parse(polygon(FIELD)).polygon.area)
    assert noted(area, '"25%"', "ring of distances")


def test_whoever_gives_a_subject_hears_what_is_wrong_with_it() -> None:
    ipp = caltopo("Marker", "IPP", point(at(0, 0)), description='subject="Wanderer"')
    with pytest.raises(BadInput, match="there is no subject 'Wanderer'"):
        parse(collection(ipp, caltopo("Assignment", "1", polygon(FIELD))))
    ipp["properties"]["description"] = "subject=dementia terrain=urban"
    (prior,) = parse(collection(ipp, caltopo("Assignment", "1", polygon(FIELD)))).priors
    assert isinstance(prior, RingPrior)


def test_a_fence_alone_and_a_plan_of_the_first_version_are_plans() -> None:
    fence = {"polygons": [{"polygon": [p[::-1] for p in FIELD[:-1]], "inclusion": True}], "circles": []}
    alone = json.dumps({"fileType": "Plan", "version": 1, "geoFence": fence}).encode()
    assert read(alone).polygon.area == pytest.approx(parse(polygon(FIELD)).polygon.area)
    home = {"coordinate": [*at(-200, -200)[::-1], 0]}
    first = {"items": [a_survey(FIELD)], "plannedHomePosition": home, "version": 1}
    old = read(plan(mission=first, geoFence={"polygon": [[0, 0]], "version": 1}))
    assert old.launch == tuple(at(-200, -200)[::-1])
    assert noted(old, "the fence: left out")


def test_a_corridor_scan_is_searched_as_wide_as_it_is() -> None:
    scan: Json = {"type": "ComplexItem", "complexItemType": "CorridorScan", "version": 2, "CorridorWidth": 50}
    scan["polyline"] = [at(*where)[::-1] for where in ((-200, 0), (0, 0), (0, 300))]
    area = read(plan(mission={"items": [scan], "version": 2}))
    assert surface_m2(area.polygon) == pytest.approx(50 * 500, rel=0.01)
    assert area.polygon.covers(shapely.Point(at(20, 290)))
    assert not area.polygon.covers(shapely.Point(at(30, 290)))
    for wrong in ({"CorridorWidth": 0}, {"polyline": scan["polyline"][:1]}, {"polyline": [[91, 0], [92, 0]]}):
        with pytest.raises(BadInput, match=r"CorridorScan.*it needs a line and a width in metres"):
            read(plan(mission={"items": [{**scan, **wrong}], "version": 2}))


def test_a_kmz_is_read_with_what_it_links_to_within_itself() -> None:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
        archive.writestr("__MACOSX/._doc.kml", b"\0\5")
        archive.writestr("doc.kml", kml("<NetworkLink><Link><href>files/a.kml</href></Link></NetworkLink>"))
        archive.writestr("files/a.kml", kml(mark("area", ground(FIELD))))
    assert not read(whole.getvalue()).ground.is_empty
    with pytest.raises(BadInput, match="only links to a map"):
        read(kml("<NetworkLink><Link><href>https://example.org/a.kml</href></Link></NetworkLink>"))


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"SQLite format 3\x00", "GeoPackage; export the layer as GeoJSON"),
        (b"\x00\x00\x27\x0a\x00", "a Shapefile"),
        (b"\x1f\x8b\x08", "packed with gzip"),
        (b"%PDF-1.7", "a PDF"),
        (b"\x89PNG\r\n", "a picture"),
        (b"\x0e\x10\x00\x00\x00\x00\x00\x00.FIT", "a FIT file"),
        (b"QGC WPL 110\n0\t1", "a list of waypoints"),
        (b"\n<!DOCTYPE html><html>", "a web page and no map"),
        (b"POLYGON((8 47, 9 47))", "well-known text"),
        (b"name,lat,lon\nLKP,47,8", 'begins with "name,lat,lon" and is neither GeoJSON nor KML nor GPX'),
        (b'{"geometryType": "esriGeometryPolygon", "features": []}', "Esri's own JSON"),
        (b'{"groundStation": "QGroundControl", "items": []}', "an old plan of QGroundControl"),
    ],
)
def test_what_no_reader_reads_is_called_by_its_name(data: bytes, said: str) -> None:
    with pytest.raises(BadInput) as caught:
        read(data)
    assert said in str(caught.value)


def test_many_notes_of_one_kind_are_counted() -> None:
    notes = few_notes(
        [f'features[{n}] ("tree: {n}"): left out, of no known name' for n in range(500)] + ["other"]
    )
    assert len(notes) == 11
    assert notes[9:] == ["491 more: left out, of no known name", "other"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("subject=child 4-6 terrain=dry flat seen at noon", {"subject": "child 4-6", "terrain": "dry flat"}),
        ("subject=hiker by her brother", {"subject": "hiker"}),
        ("role=cover kind=dense woodland", {"role": "cover", "kind": "dense woodland"}),
        ("rings_m=100,200,300,400 weight=2,5", {"rings_m": [100.0, 200.0, 300.0, 400.0], "weight": 2.5}),
        ("weight=2,sigma_m=80", {"weight": 2.0, "sigma_m": 80.0}),
    ],
)
def test_a_description_needs_no_quotes(text: str, said: Json) -> None:
    assert settings_in(text) == said


def test_a_circle_without_a_radius_is_a_fault_and_not_forgotten() -> None:
    fence = {"circles": [{"circle": {"center": at(0, 0)[::-1], "radius": 0}, "inclusion": False}]}
    with pytest.raises(BadInput, match="fence circle 1: it needs a centre and a radius"):
        read(plan(a_survey(FIELD), geoFence=fence))


def test_what_lies_in_many_folders_is_not_lost() -> None:
    assert not read(kml("<Folder>" * 60 + mark("area", ground(FIELD)) + "</Folder>" * 60)).ground.is_empty


@pytest.mark.parametrize(
    "geometry",
    [
        "<gx:Track><gx:coord>11 47 500</gx:coord><gx:coord>11.001 47 500</gx:coord></gx:Track>",
        "<gx:Track/>",
        "<gx:MultiTrack><gx:Track><when>2026-05-01T08:00:00Z</when></gx:Track></gx:MultiTrack>",
        "<MultiGeometry/>",
    ],
)
def test_a_placemark_that_cannot_be_read_does_not_take_the_others_with_it(geometry: str) -> None:
    root = 'xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"'
    area = read(kml(mark("field", ground(FIELD)) + mark("walked", geometry), root))
    assert noted(area, 'placemark 2 ("walked"): left out, it has no geometry that can be read')


def test_a_track_that_was_interrupted_goes_around_as_a_whole() -> None:
    pieces = "".join(
        "<trkseg>{}</trkseg>".format("".join(f'<trkpt lat="{lat}" lon="{lon}"/>' for lon, lat in piece))
        for piece in (FIELD[:2], [], FIELD[2:])
    )
    area = read(gpx(f"<trk><name>perimeter</name>{pieces}</trk>"))
    assert noted(area, 'track 1 ("perimeter"): its 2 parts are taken as one')
    assert area.ground.equals(parse(polygon(FIELD)).ground)


@pytest.mark.parametrize("rings", [[FIELD[:-1]], [FIELD, FARM[:-1]]])
def test_a_ring_that_does_not_come_back_is_closed(rings: list[Any]) -> None:
    area = parse(polygon(*rings))
    assert noted(area, "does not come back to its start; it is closed")
    assert area.ground.equals(parse(polygon(*([*ring[:-1], *ring[-1:], ring[0]] for ring in rings))).ground)


def test_parts_are_counted_as_people_count() -> None:
    both = {"type": "GeometryCollection", "geometries": [polygon(FIELD), point(at(0, 0))]}
    area = parse(collection(feature(both, name="LKP")))
    assert noted(area, 'features[0] ("LKP"), part 2: taken as a prior')


def test_whoever_has_only_points_is_told_how_ground_is_drawn_in_that_kind_of_file() -> None:
    with pytest.raises(BadInput, match=r"make a track or route that comes back to its start, or .*plan'"):
        read(gpx('<wpt lat="47" lon="11"><name>LKP</name></wpt>'))
    with pytest.raises(BadInput, match="draw a survey or an inclusion fence"):
        read(plan())


def test_an_empty_place_in_a_list_of_features_is_a_note() -> None:
    assert noted(parse({**collection(feature(polygon(FIELD)), None)}), "features[1]: left out, it is empty")

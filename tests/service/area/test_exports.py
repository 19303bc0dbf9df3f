"""Files in the shapes that other programs write: each is read for what it says, and nothing of it is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import shapely

from service.area import (
    LinePrior,
    PointPrior,
    RingPrior,
    SearchArea,
    area_of,
    build_grid,
    parse_area,
    read_area,
)
from service.area.document import as_geojson, settings_in
from service.area.formats import read_document
from service.area.geojson import Where
from service.area.roles import ROLES
from service.area.words import ROLE_NAMES
from service.cli import main
from service.errors import BadInput
from tests.service.area.files import at, box, collection, feature, parse, point, polygon

EXPORTS = Path(__file__).parent / "exports"
ALL = sorted(EXPORTS.iterdir())
FIELD_HA = 8.1


def read(name: str) -> SearchArea:
    return read_area(EXPORTS / name)


def noted(area: SearchArea, *words: str) -> bool:
    return any(all(word in note for word in words) for note in area.notes)


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.name)
def test_every_export_is_an_area_with_a_grid(path: Path) -> None:
    area = read_area(path)
    assert area.polygon.bounds == pytest.approx((8.3, 47.05, 8.304, 47.0524), abs=1e-4)
    grid = build_grid(area, 25.0)
    assert grid.searchable.sum() > 100
    assert grid.prior.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.name)
def test_what_is_written_of_it_is_the_same_area_to_the_last_bit(path: Path) -> None:
    document = read_document(path.read_bytes(), Where("a"))
    area = area_of(document, source="a")
    again = parse_area(as_geojson(document, area.name).encode(), source="a")
    assert shapely.equals_exact(again.polygon, area.polygon)
    assert (again.launch, again.outside, again.name) == (area.launch, area.outside, area.name)
    assert (build_grid(again, 25.0).prior == build_grid(area, 25.0).prior).all()


def test_caltopo_is_read_by_class_title_and_description() -> None:
    area = read("caltopo.json")
    lkp, clue, stream = area.priors
    assert isinstance(lkp, RingPrior)
    assert lkp.about == "hiker, temperate mountainous"
    assert isinstance(clue, PointPrior)
    assert isinstance(stream, LinePrior)
    assert stream.width_m == 40.0
    assert [each.label for each in area.exclusions] == ['features[7] ("No fly farm")']
    assert area.launch == (47.0499, 8.2999)
    assert noted(area, '"ICP"', "left out")
    assert noted(area, '"Operational boundary"', "left out")
    assert noted(area, '"Team 3"', "left out")


def test_google_earth_is_read_by_name_description_and_data() -> None:
    area = read("google-earth.kml")
    seen, river = area.priors
    assert isinstance(seen, PointPrior)
    assert (seen.sigma_m, seen.weight) == (80.0, 3.0)
    assert isinstance(river, LinePrior)
    assert area.name == "North slope"
    assert len(area.exclusions) == 1
    assert noted(area, '"Camp"', "left out")
    assert noted(area, '"old map"', "marks no place")


def test_kmz_is_the_same_as_its_kml() -> None:
    kml, kmz = read("google-earth.kml"), read("google-earth.kmz")
    assert (kmz.priors, kmz.launch, kmz.notes) == (kml.priors, kml.launch, kml.notes)


def test_gpx_has_no_polygons_but_a_track_that_comes_back() -> None:
    area = read("garmin.gpx")
    assert area.name == "Search of the field"
    assert [type(prior) for prior in area.priors] == [RingPrior, LinePrior]
    assert noted(area, '"TO THE HUT"', "left out")


def test_a_survey_is_searched_and_its_fence_excludes() -> None:
    area = read("survey.plan")
    assert area.launch == (47.0499, 8.2999)
    assert len(area.exclusions) == 2
    assert noted(area, "fence polygon 1", "left out")
    assert read("fence.plan").polygon.equals(area.polygon)  # without a survey the fence is what is searched


def test_a_fence_circle_is_excluded_whole() -> None:
    circle = read("survey.plan").exclusions[1].polygon
    centre = shapely.Point(8.3032, 47.0517)
    east = 25.0 / (111_320.0 * 0.6814)
    assert shapely.contains(circle, shapely.Point(centre.x + east * 0.99, centre.y))
    assert not shapely.contains(circle, shapely.Point(centre.x + east * 1.02, centre.y))


def test_qgis_writes_every_column_in_every_row_and_heights() -> None:
    area = read("qgis-3d.geojson")
    assert area.outside == 0.1
    assert [prior.weight for prior in area.priors] == [1.0, 1.0, 1]  # the weight of a MultiPoint is shared
    assert area.exclusions[0].searchable


def test_a_geometry_collection_is_all_that_is_in_it() -> None:
    assert read("collection.geojson").polygon.area == pytest.approx(read("fence.plan").polygon.area)


def test_a_point_of_a_known_name_has_a_role_in_geojson_too() -> None:
    field = [[8.3, 47.05], [8.304, 47.05], [8.304, 47.0524], [8.3, 47.0524], [8.3, 47.05]]
    area = parse_area(
        json.dumps(
            collection(feature(polygon(field)), feature(point([8.301, 47.051]), title="LKP"))
        ).encode(),
        source="a",
    )
    assert [type(prior) for prior in area.priors] == [PointPrior]
    assert noted(area, '"LKP"', "sigma_m = 200")


def test_what_was_only_guessed_is_left_out_where_it_cannot_be() -> None:
    far = feature(point([8.9, 47.9]), name="home")
    clue = feature(point([8.9, 47.9]), name="clue")
    area = parse(collection(feature(polygon(box(-200, -200, 200, 200))), far, clue))
    assert area.launch is None
    assert area.priors == ()
    assert noted(area, '"home"', "km from the area", "left out")
    assert noted(area, '"clue"', "entirely outside", "left out")


def open_line(*places: tuple[float, float]) -> dict[str, Any]:
    return {"type": "LineString", "coordinates": [at(*place) for place in places]}


@pytest.mark.parametrize(
    ("geometry", "said"),
    [
        (polygon([at(0, 0), at(60, 60), at(60, 0), at(0, 60), at(0, 0)]), "crosses or touches itself"),
        (open_line((0, 0), (60, 0), (60, 60)), "a LineString does not say where; draw it as a Polygon"),
        (point(at(0, 0)), "a Point does not say where; draw it as a Polygon"),
    ],
)
def test_ground_that_is_never_flown_over_by_its_name_is_kept_to_or_refused(
    geometry: dict[str, Any], said: str
) -> None:
    """A hospital, drawn by a slip as a bow-tie, was left out with one note among others, and flown over."""
    field = feature(polygon(box(-200, -200, 200, 200)))
    with pytest.raises(BadInput, match=f'"No fly zone hospital".*{said}'):
        parse(collection(field, feature(geometry, name="No fly zone hospital")))
    assert parse(collection(field, feature(point(at(0, 0)), name="Hazard: wire"))).exclusions == ()


def test_a_description_sets_only_what_is_ours() -> None:
    said = settings_in('<b>seen</b> role=prior, sigma_m = 80; color=red subject="child 4-6" weight=x')
    assert said == {"role": "prior", "sigma_m": 80.0, "subject": "child 4-6", "weight": "x"}


def test_area_check_tells_what_was_understood_and_writes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "area.geojson"
    assert main(["area", "check", str(EXPORTS / "garmin.gpx"), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "GPX" in said
    assert "67% rings of 0.32, 0.97, 2.4 and 13 km" in said
    assert 'waypoint 3 ("CAR"): left out' in said
    assert json.loads(out.read_text())["notes"]
    assert main(["area", "check", str(out)]) == 0


def test_area_check_does_not_write_over_the_file_that_it_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    teams = tmp_path / "caltopo.json"
    teams.write_bytes(before := (EXPORTS / "caltopo.json").read_bytes())
    assert main(["area", "check", str(teams), "--out", str(tmp_path / "." / "caltopo.json")]) == 2
    assert "--out is the file itself, which is left as it is; give another one" in capsys.readouterr().err
    assert teams.read_bytes() == before


def test_area_check_writes_places_as_the_team_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = tmp_path / "service.toml"
    settings.write_text('[run]\ncoordinates = "mgrs"\n')
    area = Path(__file__).parents[3] / "config" / "area.geojson"
    assert main(["area", "check", str(area), "--config", str(settings)]) == 0
    assert "launch     30V UH 93053 74988" in capsys.readouterr().out


def test_area_check_tells_all_faults_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = tmp_path / "bad.geojson"
    bow = [[11.0, 47.0], [11.002, 47.002], [11.002, 47.0], [11.0, 47.002], [11.0, 47.0]]
    bad.write_text(
        json.dumps(
            collection(
                feature(polygon(bow), role="search"),
                feature(point([11.0, 47.0]), role="prior", sigma_m=50, wieght=2),
                feature(point([11.0, 47.0]), role="lunch"),
                feature(point([11.0, 47.0]), rolle="prior"),
            )
        )
    )
    assert main(["area", "check", str(bad)]) == 2
    said = capsys.readouterr().err
    assert "4 things are wrong" in said
    assert "features[0]: the ring crosses or touches itself" in said
    assert "features[1]: it has no property \"wieght\" that is known; did you mean 'weight'?" in said
    assert "features[2]: unknown role \"lunch\"; did you mean 'launch'?" in said
    assert "features[3]: it has no property \"rolle\" that is known; did you mean 'role'?" in said


def test_a_height_is_no_misspelt_weight() -> None:
    hut = feature(point([11.0, 47.0]), role="prior", sigma_m=50, height=3)
    assert parse(collection(feature(polygon(box(-200, -200, 200, 200))), hut)).priors


def test_the_names_of_roles_are_those_of_the_table() -> None:
    assert set(ROLE_NAMES) == set(ROLES)

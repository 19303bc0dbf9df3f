"""News from the field: what they say about the ground, and that what is taken back leaves no trace."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from service.area import Grid, build_grid, parse_area
from service.entries import as_json, understood
from service.errors import BadInput
from service.evidence.observe import Observation
from service.journal import Row
from service.known import Judgement, Known, Said, Withdrawn
from service.news.bearing import FieldNews
from service.news.request import EXAMPLES, FARTHEST_M, MOST_CELLS, NewsRequest, apart_m, news_schema
from service.rows import NewsRow, WithdrawnRow
from tests.integration.flight import FIELD

SHIPPED = Path(__file__).parents[3] / "config" / "news.schema.json"


def field(cell_m: float = 10.0) -> Grid:
    return build_grid(parse_area(json.dumps(FIELD).encode(), source="field"), cell_m)


GRID = field()
CELLS = np.argwhere(GRID.searchable)


def request(role: str = "clue", kind: str = "Point", **said: Any) -> NewsRequest:
    """News about the west of the field, half of it when it is a polygon."""
    coordinates = {
        "Point": [8.3006, 47.0507],
        "LineString": [[8.3006, 47.0500], [8.3006, 47.0514]],
        "Polygon": [
            [[8.2999, 47.049], [8.3013, 47.049], [8.3013, 47.052], [8.2999, 47.052], [8.2999, 47.049]]
        ],
    }[kind]
    usual: dict[str, Any] = {"pod": 0.8} if role == "searched" else {"bayes_factor": 10.0}
    if role == "clue" and kind != "Polygon":
        usual["sigma_m"] = 30.0
    geometry = {"type": kind, "coordinates": coordinates}
    feature = {"type": "Feature", "geometry": geometry, "properties": {"role": role, **usual, **said}}
    return NewsRequest.model_validate(feature)


def look(cell: int, *, hit: bool = False) -> Observation:
    at = CELLS[cell % len(CELLS)].reshape(1, 2)
    return Observation(at, np.array([hit]), np.array([0.9]), np.array([0.95]), np.array([True]))


def known(*said: Said) -> Known:
    whole = Known(GRID, 0.9, 0.95)
    for each in said:
        whole.take(each)
    return whole


def test_a_clue_in_a_polygon_multiplies_the_odds_there_by_its_bayes_factor() -> None:
    news = request(kind="Polygon").news(GRID, "a")
    before, after = known().belief.probability(), known(news).belief.probability()
    inside = np.zeros(GRID.frame.shape, dtype=bool)
    inside[news.cells[:, 0], news.cells[:, 1]] = news.values == 10.0
    outside = GRID.searchable & (before > 0.0)
    outside[news.cells[:, 0], news.cells[:, 1]] = False
    assert inside.sum() > 50
    assert outside.sum() > 50
    odds = (after[inside] / before[inside]).mean() / (after[outside] / before[outside]).mean()
    assert odds == pytest.approx(10.0)
    assert after.sum() + known(news).belief.outside == pytest.approx(1.0)


def test_a_clue_at_a_point_or_a_line_falls_off_with_the_distance() -> None:
    for kind in ("Point", "LineString"):
        news = request(kind=kind).news(GRID, "a")
        middle = GRID.frame.to_metres([(47.0507, 8.3006)])[0]
        metres = (news.cells[:, ::-1] + 0.5) * GRID.frame.cell_m - middle
        away = np.hypot(*metres.T)
        near = news.values[np.argmin(away)]
        assert 9.0 < near <= 10.0
        if kind == "Point":
            assert np.allclose(news.values, 1.0 + 9.0 * np.exp(-0.5 * (away / 30.0) ** 2))


def test_ground_that_others_have_searched_counts_as_searched_and_moves_the_target_elsewhere() -> None:
    news = request("searched", "Polygon").news(GRID, "a")
    before, after = known(), known(news)
    share = float(before.belief.mass_at(news.cells) @ (news.values / 0.8))
    assert after.record.pos == pytest.approx(0.8 * share)
    expected = before.belief.probability()
    expected[news.cells[:, 0], news.cells[:, 1]] *= 1.0 - news.values
    expected /= expected.sum() + before.belief.outside
    assert np.allclose(after.belief.probability(), expected)


def test_what_was_seen_before_a_clue_counts_as_it_does_after_it() -> None:
    news = request().news(GRID, "a")
    looks = [look(each) for each in range(0, 200, 3)]
    first, last = known(news, *looks), known(*looks, news)
    assert first.belief.digest() == last.belief.digest()
    assert first.record.pos == last.record.pos


SAYINGS = st.lists(
    st.one_of(
        st.tuples(st.just("look"), st.integers(0, 10_000), st.booleans()),
        st.tuples(st.just("judged"), st.integers(0, 10_000), st.booleans()),
        st.tuples(st.sampled_from(["clue", "searched"]), st.floats(0.05, 0.95), st.just(True)),
    ),
    min_size=1,
    max_size=12,
)


@given(sayings=SAYINGS, taken_back=st.data())
@settings(max_examples=60, deadline=None)
def test_news_that_are_taken_back_leave_no_trace_to_the_last_bit(sayings: list[Any], taken_back: Any) -> None:
    """Whatever else was said before, between and after."""
    said: list[Said] = []
    never: list[Said] = []
    for number, (what, value, flag) in enumerate(sayings):
        each: Said
        if what in ("clue", "searched"):
            how = {"pod": value} if what == "searched" else {"bayes_factor": 1.5 + 20.0 * value}
            each = request(what, "Polygon", **how).news(GRID, f"news-{number}")
            back = taken_back.draw(st.booleans())
            said += [each, Withdrawn(f"news-{number}")] if back else [each]
            never += [] if back else [each]
            continue
        if what == "look":
            each = look(value, hit=flag)
        else:
            each = Judgement(tuple(CELLS[value % len(CELLS)].tolist()), look(value, hit=flag), flag)
        said.append(each)
        never.append(each)
    whole, other = known(*said), known(*never)
    assert whole.belief.digest() == other.belief.digest()
    assert whole.record.pos == other.record.pos
    assert whole.confirmed == other.confirmed
    assert [news.id for news in whole.news] == [news.id for news in other.news]


def test_an_exclusion_says_nothing_of_the_target_and_nothing_is_reckoned_anew_for_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks = [look(each, hit=each == 30) for each in range(0, 200, 3)]
    never, whole = known(*looks), known(*looks[:20])
    monkeypatch.setattr(Known, "_believe_all", None)  # what calls it fails
    whole.take(told("exclude", square(8.301, 47.05)).news(GRID, "lz"))
    for each in looks[20:]:
        whole.take(each)
    assert [each.id for each in whole.excluded] == ["lz"]
    whole.take(Withdrawn("lz"))
    assert whole.excluded == []
    assert whole.belief.digest() == never.belief.digest()


def test_a_copy_goes_its_own_way() -> None:
    news = request().news(GRID, "a")
    whole = known(news)
    twin = whole.copy()
    twin.take(Withdrawn("a"))
    assert [each.id for each in whole.news] == ["a"]
    assert twin.belief.digest() == known().belief.digest() != whole.belief.digest()


def test_the_journal_keeps_every_bit() -> None:
    news = request(kind="LineString", words="a track").news(GRID, "a")
    for row in (NewsRow(news), WithdrawnRow("a")):
        back = understood(Row(1, 2.0, row.kind, None, json.loads(as_json(row))), Path("journal")).said
        assert as_json(back) == as_json(row)  # type: ignore[arg-type]
        if isinstance(back, NewsRow):
            assert np.array_equal(back.news.values, news.values)


HOLE = [[8.3003, 47.0502], [8.3005, 47.0502], [8.3005, 47.0504], [8.3003, 47.0504], [8.3003, 47.0502]]


@pytest.mark.parametrize(
    "geometry",
    [
        {"type": "Point", "coordinates": [8.3006, 47.0507]},
        {
            "type": "MultiPolygon",
            "coordinates": [
                [*[[[8.3, 47.05], [8.301, 47.05], [8.301, 47.051], [8.3, 47.051], [8.3, 47.05]]], HOLE],
                [[[8.302, 47.05], [8.3022, 47.05], [8.3022, 47.0502], [8.302, 47.0502], [8.302, 47.05]]],
            ],
        },
    ],
)
def test_the_journal_keeps_the_shape_and_an_early_one_is_read_without(geometry: dict[str, Any]) -> None:
    clue = {"bayes_factor": 5.0, **({"sigma_m": 20.0} if geometry["type"] == "Point" else {})}
    news = told("clue", geometry, **clue).news(GRID, "a")
    body = json.loads(as_json(NewsRow(news)))
    back = read_news(body)
    assert back.drawn == news.drawn
    assert shapely.equals(shapely.geometry.shape(back.drawn), shapely.geometry.shape(geometry))
    shape = body.pop("shape")
    early = read_news(body | ({"ground": shape["coordinates"]} if news.ground is not None else {}))
    assert early.ground == news.ground
    assert early.says_as(news)
    assert (early.drawn is None) == (geometry["type"] == "Point")


def test_a_shape_of_many_corners_is_drawn_with_few() -> None:
    ring = shapely.Point(8.301, 47.0507).buffer(0.0005, quad_segs=2000)
    news = told("exclude", json.loads(shapely.to_geojson(ring))).news(GRID, "a")
    assert news.drawn is not None
    drawn = shapely.geometry.shape(news.drawn)
    assert 10 < shapely.get_num_coordinates(drawn) <= 500
    assert shapely.hausdorff_distance(drawn, news.ground) < 2e-5
    assert news.ground is not None
    assert shapely.get_num_coordinates(news.ground) > 8000


def read_news(body: dict[str, Any]) -> FieldNews:
    row = understood(Row(1, 2.0, "news", None, body), Path("journal")).said
    assert isinstance(row, NewsRow)
    return row.news


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"geometry": {"type": "Point", "coordinates": [47.05, 95.0]}}, "latitude 95 is out of range"),
        ({"geometry": {"type": "Point", "coordinates": ["a", 1]}}, "is not a position"),
        ({"properties": {"role": "clue", "bayes_factor": 3}}, "needs a sigma_m in metres"),
        ({"properties": {"role": "clue", "bayes_factor": 0, "sigma_m": 5}}, "greater than or equal to 0.001"),
        ({"properties": {"role": "searched", "pod": 0.5}}, "is a Polygon or a MultiPolygon, not a Point"),
        ({"properties": {"role": "rumour"}}, "does not match any of the expected tags"),
        ({"id": ".."}, "cannot stand in an address"),
        ({"geometry": {"type": "MultiPoint", "coordinates": []}}, "has no position"),
        (
            {"properties": {"role": "clue", "bayes_factor": 3, "sigma_m": 5, "Word": "hat"}},
            "there is no property 'Word'; did you mean 'words'",
        ),
        (
            {"properties": {"role": "clue", "bayes_factor": 3, "sigma_m": 5, "pod": 0.5}},
            "of the role 'clue' has no 'pod'",
        ),
    ],
)
def test_news_that_cannot_be_is_refused_in_words(change: dict[str, Any], words: str) -> None:
    feature = {**EXAMPLES["a clue at a point"], **change}
    with pytest.raises(ValidationError, match=words):
        NewsRequest.model_validate(feature)


def test_news_about_no_ground_that_is_searched_or_about_too_much_is_refused() -> None:
    far = NewsRequest.model_validate(EXAMPLES["a clue at a point"])
    with pytest.raises(Exception, match="no ground that is searched"):
        far.news(GRID, "a")
    assert MOST_CELLS >= 100_000


def square(lon: float, lat: float, degrees: float = 0.002) -> dict[str, Any]:
    """A ground of that size north-east of a place."""
    east, north = lon + degrees, lat + degrees
    ring = [[lon, lat], [east, lat], [east, north], [lon, north], [lon, lat]]
    return {"type": "Polygon", "coordinates": [ring]}


def told(role: str, geometry: dict[str, Any], **said: Any) -> NewsRequest:
    feature = {"type": "Feature", "geometry": geometry, "properties": {"role": role, **said}}
    return NewsRequest.model_validate(feature)


@pytest.mark.parametrize(
    ("lon", "lat"),
    [
        (47.05, 8.30),  # the two swapped
        (8.30, 47.07),  # 2 km off
        (8.30 - 180.0, -47.05),  # the other side of the earth, which is projected into the area
    ],
)
def test_an_exclusion_or_ground_far_from_the_area_is_refused(lon: float, lat: float) -> None:
    ground = square(lon, lat)
    with pytest.raises(BadInput, match=r"km from the area .*are longitude and latitude swapped\?"):
        told("exclude", ground).news(GRID, "a")
    for role, said in (("searched", {"pod": 0.5}), ("clue", {"bayes_factor": 5.0})):
        with pytest.raises(BadInput, match="no ground that is searched"):
            told(role, ground, **said).news(GRID, "a")


def test_an_exclusion_beside_the_area_is_taken_it_may_lie_on_the_way_home() -> None:
    beside = told("exclude", square(8.305, 47.053)).news(GRID, "a")
    assert 0.0 < apart_m(GRID, beside.ground) < FARTHEST_M
    assert not len(beside.cells)


def test_an_exclusion_may_be_of_any_size_and_one_of_an_early_journal_says_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("service.news.request.MOST_CELLS", 10)
    half = told("exclude", request(kind="Polygon").geometry.model_dump()).news(GRID, "a")
    early = replace(half, cells=CELLS[:50], values=np.ones(50))
    assert half.says_as(early)
    assert not half.says_as(told("exclude", square(8.301, 47.05)).news(GRID, "a"))
    with pytest.raises(BadInput, match="at most 10 are taken"):
        request("searched", "Polygon").news(GRID, "a")


def test_what_maps_write_beside_is_left_out() -> None:
    plain = NewsRequest.model_validate(EXAMPLES["ground that a team has searched"])
    drawn = json.loads(json.dumps(EXAMPLES["ground that a team has searched"]))
    drawn["bbox"] = drawn["geometry"]["bbox"] = [-4.742, 56.608, -4.739, 56.6095]
    drawn["title"] = "Team 3"
    drawn["properties"] |= {"name": "Team 3", "stroke": "#f00", "stroke-width": 2, "class": "Shape"}
    assert NewsRequest.model_validate(drawn) == plain


def test_a_clue_may_be_at_several_points() -> None:
    points = {"type": "MultiPoint", "coordinates": [[8.3006, 47.0507], [8.3016, 47.0507]]}
    news = told("clue", points, bayes_factor=10.0, sigma_m=15.0).news(GRID, "a")
    for lon, lat in points["coordinates"]:
        cell = GRID.frame.to_cells([(lat, lon)])[0]
        assert news.values[(news.cells == cell).all(axis=1)] > 7.0


def clued_area() -> Grid:
    """The field with two more parts of its prior, and an order of magnitude between their weights."""
    area: dict[str, Any] = json.loads(json.dumps(FIELD))
    for name, place_, weight in (("phone fix", [8.3004, 47.0512], 10.0), ("hut", [8.3022, 47.0503], 1.0)):
        point = {"type": "Point", "coordinates": place_}
        said = {"role": "prior", "name": name, "sigma_m": 20, "weight": weight}
        area["features"].append({"type": "Feature", "geometry": point, "properties": said})
    return build_grid(parse_area(json.dumps(area).encode(), source="field"), 10.0)


PARTS = clued_area()


def refuted(prior: str, name: str = "r") -> FieldNews:
    said = {"role": "refute", "prior": prior, "words": "of another phone"}
    feature = {"type": "Feature", "geometry": None, "properties": said}
    return NewsRequest.model_validate(feature).news(PARTS, name)


def test_a_prior_that_is_refuted_was_never_assumed_and_one_click_undoes_it_to_the_last_bit() -> None:
    looks = [look(each, hit=each == 30) for each in range(0, 200, 3)]
    clue = request().news(PARTS, "a")
    never, whole = Known(PARTS, 0.9, 0.95), Known(PARTS, 0.9, 0.95)
    for each in (*looks[:20], clue, *looks[20:]):
        never.take(each)
    for said in (*looks[:20], refuted("phone fix"), clue, *looks[20:], Withdrawn("r")):
        whole.take(said)
    assert whole.belief.digest() == never.belief.digest()
    assert whole.record.pos == never.record.pos


def test_without_a_prior_the_rest_stands_as_the_area_file_has_it() -> None:
    whole = Known(PARTS, 0.9, 0.95)
    whole.take(refuted("phone fix"))
    rest = PARTS.prior_without({"phone fix"})
    assert whole.belief.probability() == pytest.approx(rest * (1.0 - PARTS.outside))
    assert whole.belief.outside == pytest.approx(PARTS.outside)
    row, col = PARTS.frame.to_cells([(47.0512, 8.3004)])[0]
    assert rest[row, col] < 0.01 * PARTS.prior[row, col]
    for name in [next(iter(PARTS.prior_places)), "hut"]:
        whole.take(refuted(name, name))
    ground = np.where(PARTS.searchable, PARTS.covered, 0.0)
    assert whole.belief.probability() == pytest.approx(ground / ground.sum() * (1.0 - PARTS.outside))


def test_a_prior_of_no_such_name_is_refused_with_those_there_are() -> None:
    with pytest.raises(BadInput, match=r"no prior 'fone' in the area file; there is .*'phone fix', 'hut'"):
        refuted("fone")
    with pytest.raises(BadInput, match="its prior has no parts"):
        NewsRequest.model_validate(EXAMPLES["a prior that proved wrong"]).news(
            GRID.with_prior(GRID.prior), "a"
        )
    with pytest.raises(ValidationError, match="of the role 'exclude' needs a geometry"):
        NewsRequest.model_validate({"type": "Feature", "geometry": None, "properties": {"role": "exclude"}})


def test_the_journal_keeps_what_is_refuted() -> None:
    news = refuted("hut")
    back = read_news(json.loads(as_json(NewsRow(news))))
    assert (back.prior, back.says_as(news), back.says_as(refuted("phone fix"))) == ("hut", True, False)


def test_the_shipped_schema_is_the_one_that_is_checked_and_its_examples_are_good() -> None:
    schema = news_schema()
    assert json.loads(SHIPPED.read_text(encoding="utf-8")) == schema, (
        "roisearch-service schema news > config/news.schema.json"
    )
    for example in EXAMPLES.values():
        jsonschema.validate(example, schema)
        NewsRequest.model_validate(example)


def test_a_collection_around_one_feature_is_that_and_a_number_is_an_id() -> None:
    feature = EXAMPLES["a clue at a point"]
    one = NewsRequest.model_validate({"type": "FeatureCollection", "features": [{**feature, "id": 7}]})
    assert one == NewsRequest.model_validate({**feature, "id": "7"})
    with pytest.raises(ValidationError, match="send each feature of the collection by itself"):
        NewsRequest.model_validate({"type": "FeatureCollection", "features": [feature, feature]})
    with pytest.raises(ValidationError, match="send each feature of the collection by itself"):
        NewsRequest.model_validate({"type": "FeatureCollection"})

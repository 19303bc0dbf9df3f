"""What a run tells of its end: what is known of the place, whether or not it counts as found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.chances import sure
from service.evidence.found import Found
from service.evidence.observe import Observation
from service.mission.states import State
from service.report import by_sortie, in_words, outcome_of, place_known, track_features, track_geojson
from service.search import Search
from tests.service.export.recorded import SETTINGS, field_grid

HERE = Found(47.0, 11.0, 0.97, 4.0, {"semi_major_m": 9.8, "semi_minor_m": 5.0, "bearing_deg": 20.0})


@pytest.mark.parametrize(
    ("state", "searched", "found", "probable", "outcome"),
    [
        (State.DONE, True, HERE, HERE, "found"),
        (State.ABORTED, False, HERE, HERE, "found"),
        (State.DONE, True, None, HERE, "probable"),
        (State.DONE, True, None, None, "not_found"),
        (State.DONE, False, None, HERE, "aborted"),
        (State.ABORTED, True, None, HERE, "aborted"),
        (State.YIELDED, True, None, None, "aborted"),
    ],
)
def test_an_outcome_says_what_is_known(
    state: State, searched: bool, found: Found | None, probable: Found | None, outcome: str
) -> None:
    assert outcome_of(state, searched=searched, found=found, probable=probable) == outcome


def searched(folder: Path, *, hits: int) -> tuple[Search, tuple[int, int]]:
    """A search that saw something so often in the middle of its likeliest cells, and the cell."""
    search = Search(field_grid(folder), SETTINGS)
    row, col = search.place.cell
    for _ in range(hits):
        sure = np.array([0.9])
        search.take(Observation(np.array([[row, col]]), np.array([True]), sure, sure, np.array([True])))
    return search, (row, col)


def test_a_search_that_ends_on_a_probable_place_tells_it_with_probability_and_ellipse(tmp_path: Path) -> None:
    search, cell = searched(tmp_path, hits=2)
    assert search.found() is None
    probable = search.probable()
    assert probable is not None
    assert probable.probability > 0.5
    known = place_known("probable", search, None)
    assert known["position"] == known["best_place"] == {"lat": probable.lat, "lon": probable.lon}
    assert known["probability"] == probable.probability
    assert known["ellipse"]["semi_major_m"] > 0.0
    assert search.cell_at((probable.lat, probable.lon)) == cell
    report: dict[str, Any] = {
        **known,
        "outcome": "probable",
        "stopped_because": "battery low",
        "outside": 0.1,
        "sorties": [],
    }
    assert in_words(report).startswith(
        f"NOT FOUND, but PROBABLE at {probable.lat:.6f}, {probable.lon:.6f}, {sure(probable.probability)} sure"
    )
    assert in_words(report).endswith(" m: battery low")
    (place,) = track_geojson([], [], report)["features"]
    assert place["properties"] == {"role": "probable", "probability": probable.probability}
    assert "PROBABLE at" in in_words({**report, "outcome": "aborted"})
    said = in_words({**report, "outcome": "found", "probability": 0.618, "confirmed": True})
    assert said.endswith("confirmed by an operator; the map gives it 61.8 %"), (
        "no word of a probability that nobody used"
    )
    assert "over 99.9 % sure" in in_words({**report, "outcome": "found", "probability": 0.99972})


def test_a_sharp_prior_is_no_probable_place_but_the_best_one_is_told(tmp_path: Path) -> None:
    search, _ = searched(tmp_path, hits=0)
    assert search.probable() is None
    known = place_known("not_found", search, None)
    assert known["position"] is None
    assert search.cell_at((known["best_place"]["lat"], known["best_place"]["lon"])) is not None
    assert 0.0 < known["probability"] < 0.5
    assert known["ellipse"]["semi_major_m"] > 0.0


def test_a_place_that_was_found_is_the_position_whatever_the_belief_has_become(tmp_path: Path) -> None:
    search, _ = searched(tmp_path, hits=0)
    known = place_known("found", search, HERE)
    assert (known["position"], known["probability"]) == ({"lat": 47.0, "lon": 11.0}, 0.97)
    assert (known["ellipse"], known["sigma_m"]) == (HERE.ellipse, HERE.sigma_m)


TRACK = [(float(second), 47.0, 11.0 + second * 1e-5, 30.0) for second in range(10)]


def test_a_track_is_cut_at_each_landing() -> None:
    parts = by_sortie(TRACK, [3.0, 6.5])
    assert [[point[0] for point in part] for part in parts] == [[0, 1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert by_sortie(TRACK, []) == [TRACK]


def test_each_sortie_is_a_line_with_its_number_and_one_of_a_single_point_is_none() -> None:
    features = track_features(TRACK, [3.0, 4.0], "kite")
    told = [(each["properties"]["sortie"], each["properties"]["aircraft"]) for each in features]
    assert told == [(1, "kite"), (3, "kite")]
    assert [len(each["geometry"]["coordinates"]) for each in features] == [4, 5]
    assert features[1]["properties"]["times"] == [5.0, 6.0, 7.0, 8.0, 9.0]
    assert "aircraft" not in track_features(TRACK, [])[0]["properties"]

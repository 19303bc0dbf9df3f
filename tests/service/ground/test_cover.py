"""What hides a target from above: the open is flown first, and POS is what it says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from roisearch import SearchState, make_planner
from service.area import build_grid, parse_area
from service.area.grid import NEEDS_A_TEAM
from service.config import Settings
from service.errors import BadInput
from service.evidence.cover import UnderCover, covered_p_tp, detection_p, sensor_over
from service.evidence.observe import FramePose, Observation
from service.evidence.reports import Report
from service.ground.cover import visibility_of
from service.search import Search
from sim.soak import ground

SETTINGS = Settings.model_validate({"flight": {"altitude_m": 15.0}, "sensor": {"cell_m": 20.0}})


def square(east: float, north: float, side: float) -> dict[str, Any]:
    ring = [(east, north), (east + side, north), (east + side, north + side), (east, north + side)]
    # the soak's own way from metres to degrees, so that its field and this square lie alike
    return {"type": "Polygon", "coordinates": [ground.ring(ring)]}


def area_with(*covers: dict[str, Any]) -> Any:
    document = ground.square(200.0)
    for cover in covers:
        geometry = square(*cover.pop("square"))
        document["features"].append(
            {"type": "Feature", "geometry": geometry, "properties": {"role": "cover", **cover}}
        )
    return parse_area(json.dumps(document).encode(), source="woodland")


def woodland(kind: str = "dense woodland") -> Any:
    """A square field whose west half is a wood, and a search over it."""
    area = area_with(
        {"square": (-1.0, -1.0, 101.0), "kind": kind}, {"square": (-1.0, 99.0, 102.0), "kind": kind}
    )
    grid = build_grid(area, 20.0)
    visibility = visibility_of(area, grid, SETTINGS)
    assert visibility is not None
    return area, grid.under(visibility)


def test_covers_become_the_share_of_what_is_found_in_the_open() -> None:
    area = area_with(
        {"square": (0.0, 0.0, 100.0), "p_tp": 0.45}, {"square": (100.0, 100.0, 50.0), "kind": " Scrub"}
    )
    grid = build_grid(area, 20.0)
    visibility = visibility_of(area, grid, SETTINGS)
    assert visibility is not None
    rows = visibility.shape[0]
    assert visibility[rows - 2, 2] == pytest.approx(0.5)
    assert visibility[1, 1] == 1.0
    assert 0.6 <= visibility.min() + 0.2 <= 1.0
    assert visibility_of(area_with(), grid, SETTINGS) is None


@pytest.mark.parametrize(
    ("properties", "said"),
    [
        ({"kind": "jungle"}, 'the kind of cover is "jungle"; use open, scrub'),
        ({}, "use open, scrub"),
        ({"p_tp": 1.5}, "p_tp is 1.5; give the chance"),
        ({"p_tp": "low"}, 'p_tp is "low"'),
    ],
)
def test_a_cover_that_says_nothing_of_itself_is_refused(properties: dict[str, Any], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        area_with({"square": (0.0, 0.0, 50.0), **properties})


def test_a_raster_of_cover_is_its_mean_over_each_cell_and_what_is_no_factor_is_refused(
    tmp_path: Path,
) -> None:
    from tests.service.ground.rasters import write

    area = area_with()
    grid = build_grid(area, 20.0)
    file = write(tmp_path / "cover.tif", grid.frame, lambda e, s: np.where(e < 100.0, 0.25, 1.0), pitch=5.0,
                 reach_m=-40.0)  # fmt: skip
    settings = SETTINGS.model_copy(
        update={"ground": SETTINGS.ground.model_copy(update={"cover_file": str(file)})}
    )
    visibility = visibility_of(area, grid, settings)
    assert visibility is not None
    assert visibility[5, 3] == pytest.approx(0.25)
    assert visibility[5, 7] == 1.0
    write(file, grid.frame, lambda e, s: e, pitch=5.0)
    with pytest.raises(BadInput, match="has the factor"):
        visibility_of(area, grid, settings)


def test_a_look_at_what_cannot_be_seen_says_nothing_either_way() -> None:
    one = np.array([0.9]), np.array([0.9])
    assert covered_p_tp(*one, np.array([1.0]))[0] == 0.9
    assert covered_p_tp(*one, np.array([0.0]))[0] == pytest.approx(0.1)  # as likely as a false alarm
    for share in (0.0, 0.3, 1.0):
        told = covered_p_tp(*one, np.array([share]))
        assert detection_p(told, one[1], np.array([share]))[0] == pytest.approx(0.9 * share)
    _, grid = woodland()
    sensor = sensor_over(grid.under(np.where(grid.visibility < 1.0, 0.0, 1.0)), SETTINGS)
    assert isinstance(sensor, UnderCover)
    wood = tuple(int(i) for i in np.argwhere(grid.visibility < 0.5)[12])
    lat, lon = grid.frame.to_latlon([wood])[0]
    report = Report.model_validate(
        {
            "id": "a",
            "source": "b",
            "captured_at": 1.0,
            "detections": [{"class": "t", "score": 0.9, "lat": lat, "lon": lon}],
        }
    )  # fmt: skip
    reading = sensor.read(FramePose(lat, lon, 15.0, 0.0, 1.0), report)
    assert reading.hits[wood] == pytest.approx(1.0)
    assert reading.footprint.p_tp[0] == pytest.approx(0.1)


def test_the_wood_is_told_to_need_a_ground_team_and_its_mass_stays() -> None:
    _, grid = woodland()
    assert any("needs a ground team" in note for note in grid.notes)
    assert grid.reachable_mass < 0.65
    _, light = woodland("woodland")
    assert not any("ground team" in note for note in light.notes)
    assert NEEDS_A_TEAM < 0.3


def flown(search: Search, planner: Any, steps: int) -> list[tuple[int, int]]:
    """The cells that the planner enters, each looked at in vain."""
    cell, heading, entered = search.grid.start, "north", []
    rng = np.random.default_rng(1)
    for _ in range(steps):
        path = planner.plan(search.belief, SearchState(cell=cell, heading=heading), rng).path
        cell = path[0]
        entered.append(cell)
        at = np.array([cell], dtype=np.int64)
        v = search.grid.visibility[at[:, 0], at[:, 1]]
        p_tn = np.array([0.9])
        told = covered_p_tp(np.array([0.9]), p_tn, v)
        search.take(Observation(at, np.zeros(1, dtype=np.bool_), told, p_tn, np.ones(1, dtype=np.bool_)))
    return entered


@pytest.mark.parametrize("moves", ["seconds", "steps"])
def test_the_open_ground_is_flown_first_and_pos_is_right_against_drawn_targets(moves: str) -> None:
    _, grid = woodland()
    search = Search(grid, SETTINGS)
    planner = make_planner(
        "puct-regions-lite", fov=search.fov, flyable=grid.flyable, regions=search.regions,
        visibility=grid.visibility, iterations=20, **({"motion": search.motion} if moves == "seconds" else {}),
    )  # fmt: skip
    entered = flown(search, planner, 45)
    deep = [float(grid.visibility[cell]) < 0.3 for cell in entered]
    assert (
        np.mean(deep) < 0.15
    )  # the way out of it, from the launch point; its edge may be a lane worth flying
    assert not any(deep[8:])
    rng = np.random.default_rng(5)
    found, drawn = 0, 1000
    weights = (grid.prior * (1.0 - grid.outside)).ravel()
    for target in rng.choice(weights.size, size=drawn, p=weights / weights.sum()):
        at = divmod(int(target), grid.prior.shape[1])
        chance = 0.9 * float(grid.visibility[at])
        found += any(rng.random() < chance for cell in entered if cell == at)
    error = np.sqrt(0.25 / drawn)
    assert abs(search.record.searched - found / drawn) < 3.0 * error


def test_without_cover_every_planner_decides_as_before() -> None:
    prior = np.random.default_rng(3).random((12, 12))
    from roisearch import Belief, FieldOfView

    for fov in (FieldOfView.point(), FieldOfView.donut()):
        paths = []
        for visibility in ({}, {"visibility": np.ones((12, 12))}):
            planner = make_planner("puct-regions-lite", fov=fov, iterations=30, **visibility)
            belief, cell, way = Belief(prior), (5, 5), []
            for _ in range(10):
                rng = np.random.default_rng(7)
                cell = planner.plan(belief, SearchState(cell=cell, heading="north"), rng).path[0]
                way.append(cell)
            paths.append(way)
        assert paths[0] == paths[1]

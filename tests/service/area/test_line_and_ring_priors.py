"""Priors along lines and at distances that were published: their mass is where it belongs, and they add up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from service.area import RingPrior, build_grid
from service.area.describing import few
from service.area.frame import lay_frame
from service.area.lost_persons import CHECKED_TWICE, SUBJECTS, TERRAINS, rings, terrains_of
from service.area.model import RING_MASS
from service.area.prior import cell_squares, prior_parts, ring_mass, rings_inside
from tests.service.area.files import Json, at, box, collection, feature, parse, point, polygon, square
from tests.service.area.test_reading import refusal


def line(*corners: tuple[float, float]) -> Json:
    return {"type": "LineString", "coordinates": [at(*corner) for corner in corners]}


def test_a_line_prior_is_a_strip_of_its_width() -> None:
    area = parse(
        collection(square(), feature(line((-300, 0), (300, 0)), role="prior", width_m=40, kind="trail"))
    )
    grid = build_grid(area, 20.0)
    east, north = grid.prior.sum(axis=0), grid.prior.sum(axis=1)
    assert north[9:11].sum() == pytest.approx(1.0)  # 20 m to each side
    assert east == pytest.approx(np.full(20, 1 / 20), rel=1e-3)


def test_a_line_prior_bends_with_its_line_and_stops_at_the_area() -> None:
    area = parse(
        collection(square(), feature(line((-100, 500), (-100, 0), (500, 0)), role="prior", width_m=10))
    )
    grid = build_grid(area, 20.0)
    cells = grid.frame.to_cells([(at(-100, 100)[1], at(-100, 100)[0]), (at(100, 0)[1], at(100, 0)[0])])
    assert all(grid.prior[tuple(cell)] > 0.01 for cell in cells)
    assert grid.prior[18, 18] == 0.0


RING = feature(point(at(0, 0)), role="ipp", rings_m=[50, 100, 150, 250])


def test_rings_hold_what_they_say() -> None:
    area = parse(collection(square(600.0), RING))
    grid = build_grid(area, 5.0)
    metres = (np.indices(grid.prior.shape).transpose(1, 2, 0) + 0.5) * 5.0 - 600.0
    away = np.hypot(metres[..., 0], metres[..., 1])
    for radius, held in zip((50, 100, 150, 250, 500), np.cumsum(RING_MASS), strict=True):
        assert grid.prior[away < radius].sum() == pytest.approx(held, abs=0.012)


def test_ring_mass_is_exact_and_sums_to_what_lies_in_the_ground() -> None:
    prior = RingPrior((0.0, 0.0), (50.0, 100.0, 150.0, 250.0), "", 1.0, "")
    area = parse(square(600.0))
    for cell_m in (17.0, 60.0):
        frame = lay_frame(area.polygon, cell_m)
        squares, ground = cell_squares(frame), frame.flatten(area.ground)
        centre = (frame.cols * cell_m / 2, frame.rows * cell_m / 2)
        assert ring_mass(prior, centre, squares, ground).sum() == pytest.approx(1.0, abs=1e-6)
        assert rings_inside(prior, centre, ground) == pytest.approx(1.0, abs=1e-6)
        edge = (frame.cols * cell_m / 2, 0.0)
        half = ring_mass(prior, edge, squares, ground).sum()
        assert half == pytest.approx(rings_inside(prior, edge, ground), abs=1e-6)
        assert 0.45 < half < 0.52


def test_the_file_is_told_how_much_of_the_rings_it_covers() -> None:
    area = parse(collection(square(50.0), RING))
    (note,) = area.notes
    inside = sum(
        (0.25 * 1.0, 0.25 * (100.0**2 - math.pi * 50.0**2) / (math.pi * (100.0**2 - 50.0**2)))
    )  # the square goes 50 m to each side: the first ring whole, the corners of the second
    assert f"{100 * inside:.2g} % lie in the area" in note
    assert f"would be {1 - inside:.3f}" in note


def test_priors_add_up_by_their_weight() -> None:
    files = [
        feature(point(at(-100, 0)), role="prior", sigma_m=20, weight=3),
        feature(line((-200, 100), (200, 100)), role="prior", width_m=30),
        feature(point(at(50, 50)), role="ipp", rings_m=[50, 100, 150, 250], weight=2),
        feature(polygon(box(100, -100, 150, -50)), role="prior", weight=2),
    ]
    area = parse(collection(square(), *files))
    grid = build_grid(area, 20.0)
    squares = cell_squares(grid.frame)
    parts = list(prior_parts(area, grid.frame, squares, grid.covered, grid.searchable))
    assert [part.sum() for part in parts] == pytest.approx([1.0, 1 / 3, 2 / 3, 2 / 3])
    assert sum(parts) / sum(part.sum() for part in parts) == pytest.approx(grid.prior)


def bad(**properties: object) -> str:
    return refusal(lambda: parse(collection(square(), feature(point(at(0, 0)), role="ipp", **properties))))


def test_what_is_no_subject_or_terrain_is_told_with_what_is() -> None:
    assert "needs a subject, such as 'hiker', or rings_m" in bad()
    assert "there is no subject 'hikr'; did you mean 'hiker'?" in bad(subject="hikr")
    assert "'hiker' differs by terrain; give terrain: temperate mountainous," in bad(subject="hiker")
    assert "did you mean 'dry flat'?" in bad(subject="hiker", terrain="dry flatt")
    assert "no terrain 'mountains'; take temperate mountainous, dry mountainous" in bad(
        subject="hiker", terrain="mountains"
    )
    assert "no subject 'child'; take child 1-3, child 4-6, child 7-9, child 10-12, child 13-15" in bad(
        subject="child"
    )
    assert "no figures for 'hiker' on 'urban' ground" in bad(subject="hiker", terrain="urban")
    assert "within which 25, 50, 75 and 95 % are found" in bad(rings_m=[1, 2, 3])
    assert "each larger than the last" in bad(rings_m=[100, 50, 200, 300])
    far = feature(point(at(5000, 0)), role="ipp", rings_m=[50, 100, 150, 250])
    assert "further than its last ring" in refusal(lambda: parse(collection(square(), far)))
    wide = feature(line((0, 0), (9, 9)), role="prior")
    assert "a line prior needs width_m" in refusal(lambda: parse(collection(square(), wide)))
    away = feature(line((500, 0), (900, 9)), role="prior", width_m=50)
    assert "entirely outside the area" in refusal(lambda: parse(collection(square(), away)))


@pytest.mark.parametrize("subject", SUBJECTS)
def test_figures_grow_from_quantile_to_quantile(subject: str) -> None:
    for terrain in terrains_of(subject):
        found, about = rings(subject, terrain)
        assert 0.0 < found[0] < found[1] < found[2] < found[3]
        assert about == f"{subject}, {terrain}"
    assert len(set(terrains_of(subject))) == len(terrains_of(subject))


def test_figures_agree_with_the_second_source_in_kilometres() -> None:
    """The publisher's chapter on dementia (p. 165) and SAREnv's hikers print kilometres, rounded before or after the
    miles were: 0.15 km apart at most, on 19.3."""
    dementia = {
        "temperate mountainous": (0.3, 0.8, 1.9, 8.3),
        "temperate flat": (0.3, 1.0, 2.4, 12.8),
        "dry mountainous": (1.0, 1.9, 3.1, 6.1),
        "dry flat": (0.5, 1.6, 3.6, 11.8),
        "urban": (0.3, 1.1, 3.2, 12.6),
    }
    hiker = {
        "temperate flat": (0.6, 1.8, 3.2, 9.9),
        "dry flat": (1.3, 2.1, 6.6, 13.1),
        "temperate mountainous": (1.1, 3.1, 5.8, 18.3),
        "dry mountainous": (1.6, 3.2, 6.5, 19.3),
    }
    assert {"dementia", "hiker"} == CHECKED_TWICE
    for subject, table in (("dementia", dementia), ("hiker", hiker)):
        for terrain, kilometres in table.items():
            assert terrain in TERRAINS
            ours = [each / 1000.0 for each in rings(subject, terrain)[0]]
            assert ours == pytest.approx(kilometres, abs=0.15)


def test_a_subject_is_known_however_it_is_spelt() -> None:
    assert rings("Child (4-6)", "Temperate Flat") == rings("child 4-6", "temperate flat")
    assert rings("Skier-Alpine", None) == (rings("skier alpine", "urban")[0], "skier alpine")


def test_numbers_for_people_never_become_powers_of_ten() -> None:
    assert [few(value) for value in (0.0484, 1.13, 9.9, 9.96, 18.2, 100.0, 1234.0)] == [
        "0.048", "1.1", "9.9", "10", "18", "100", "1234",
    ]  # fmt: skip

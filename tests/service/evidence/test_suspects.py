"""Suspects and what was found: position, error ellipse, picture, and an operator's word."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

from roisearch.place import likely_places, most_likely_place, place_at
from service.area import GridFrame, build_grid, read_area
from service.clock import Clock
from service.config import Settings
from service.evidence.found import IN_95_PERCENT
from service.evidence.intake import Intake
from service.evidence.moments import Moments
from service.evidence.observe import FramePose, Observation, Sighting, observe
from service.evidence.passes import Passes
from service.evidence.reports import Report
from service.evidence.sensors import make_sensor
from service.evidence.suspects import Sightings, found_at
from service.journal import Journal
from service.resume import replay
from service.search import Search
from tests.integration.flight import write_area

FRAME = GridFrame(47.05, 8.30, 30.0, 25.0, 20, 30, -375.0, 250.0)


def at(row: float, col: float) -> tuple[float, float]:
    lat, lon = FRAME.to_latlon([[row, col]])[0]
    return float(lat), float(lon)


def test_the_most_probable_of_the_given_cells_that_do_not_share_a_square() -> None:
    p = np.zeros((20, 30))
    p[3, 4], p[3, 5], p[10, 20], p[15, 2] = 0.4, 0.2, 0.3, 0.02
    places = likely_places(p, [(3, 4), (3, 5), (10, 20), (15, 2), (0, 0)])
    assert [place.cell for place in places] == [(3, 4), (10, 20)]
    assert places[0].probability == pytest.approx(0.6)
    assert likely_places(p, []) == []
    assert most_likely_place(p).cell == place_at(p, (3, 4)).cell


def test_the_ellipse_is_that_of_the_posterior_turned_with_the_grid() -> None:
    p = np.zeros(FRAME.shape)
    p[5, 5:8] = 1 / 3  # along the grid's east, which points to 120 degrees
    found = found_at(FRAME, place_at(p, (5, 6)))
    assert found.ellipse["bearing_deg"] == pytest.approx(120.0, abs=0.1)
    assert found.ellipse["semi_major_m"] == pytest.approx(
        25.0 * math.sqrt(2 / 3 + 1 / 12) * IN_95_PERCENT, abs=0.01
    )
    assert found.ellipse["semi_minor_m"] == pytest.approx(25.0 * math.sqrt(1 / 12) * IN_95_PERCENT, abs=0.01)
    assert (found.lat, found.lon) == pytest.approx(at(5, 6), abs=1e-9)


def test_detections_that_know_better_than_cells_place_the_target() -> None:
    p = np.zeros(FRAME.shape)
    p[5, 6] = 1.0
    there = at(5.3, 6.2)
    seen = [Sighting(*there, (16.0, 0.0, 4.0), "https://x.example/1.jpg"), Sighting(*there, (16.0, 0.0, 4.0))]
    found = found_at(FRAME, place_at(p, (5, 6)), seen)
    assert (found.lat, found.lon) == pytest.approx(there, abs=1e-9)
    assert found.ellipse["semi_major_m"] == pytest.approx(
        4.0 * IN_95_PERCENT, abs=0.01
    )  # two are no better than one
    assert found.ellipse["semi_minor_m"] == pytest.approx(2.0 * IN_95_PERCENT, abs=0.01)
    assert found.ellipse["bearing_deg"] == pytest.approx(120.0, abs=0.1)
    assert found.thumbnail == "https://x.example/1.jpg"
    rough = found_at(FRAME, place_at(p, (5, 6)), [Sighting(*there, (900.0, 0.0, 900.0)), Sighting(*there)])
    assert (rough.lat, rough.lon) == pytest.approx(at(5, 6), abs=1e-9)


def test_hits_that_tell_places_without_an_accuracy_place_the_target_better_than_a_cells_centre(
    tmp_path: Path,
) -> None:
    """Every true hit tells its place, and none how exact it is: the sensor's own accuracy is taken."""
    search = fresh_search(tmp_path)
    frame, sensor = search.grid.frame, make_sensor(SETTINGS, search.grid)
    there = frame.to_latlon([[3.35, 3.4]])[0].tolist()
    lat, lon = frame.to_latlon([[3, 3]])[0].tolist()
    passes = Passes()
    for number in range(8):
        for row, time in ((3, 10.0 * number), (5, 10.0 * number + 5.0)):
            over = frame.to_latlon([[row, 3]])[0].tolist()
            seen = [{"lat": there[0], "lon": there[1]}] if row == 3 else []
            report = Report.model_validate({"id": f"{time}", "captured_at": time, "detections": seen})
            reading = sensor.read(FramePose(*over, 30.0, 0.0, time), report)
            if (observation := observe(passes, "cam", time, reading)) is not None:
                search.take(observation)
    found = search.found()
    assert found is not None
    assert frame.to_metres([[found.lat, found.lon]])[0] == pytest.approx(frame.to_metres([there])[0], abs=0.5)
    assert abs(found.lat - lat) + abs(found.lon - lon) > 1e-6
    assert found.ellipse["semi_major_m"] < 0.5 * frame.cell_m


def test_detections_that_disagree_make_the_ellipse_larger() -> None:
    p = np.full(FRAME.shape, 1e-9)
    p[5, 5:8] = 1 / 3
    seen = [Sighting(*at(5, 5.7), (4.0, 0.0, 4.0)), Sighting(*at(5, 6.3), (4.0, 0.0, 4.0))]
    found = found_at(FRAME, place_at(p, (5, 6)), seen)
    assert found.ellipse["semi_major_m"] == pytest.approx(math.hypot(2.0, 7.5) * IN_95_PERCENT, rel=0.01)


def test_suspects_are_places_with_a_hit() -> None:
    p = np.zeros(FRAME.shape)
    p[3, 4], p[10, 20] = 0.3, 0.6
    sightings = Sightings(FRAME)
    assert sightings.suspects(p) == []
    sightings.add([(3, 4)], [Sighting(*at(3, 4), None, "https://x.example/a.jpg"), Sighting(*at(3, 4))])
    (suspect,) = sightings.suspects(p)
    assert suspect["probability"] == pytest.approx(0.3)
    assert (suspect["hits"], suspect["thumbnail"]) == (2, "https://x.example/a.jpg")
    assert (suspect["lat"], suspect["lon"]) == pytest.approx(at(3, 4), abs=1e-9)
    sightings.forget((4, 5))
    assert sightings.suspects(p) == []
    assert not sightings.near((3, 4))


# ---- an operator's word: journalled, believed, replayed


SETTINGS = Settings.model_validate({"sensor": {"cell_m": 20.0}, "search": {"planner": "index"}})


def fresh_search(folder: Path) -> Search:
    return Search(build_grid(read_area(write_area(folder)), 20.0), SETTINGS)


@contextmanager
def intake_for(search: Search, journal: Path) -> Iterator[Intake]:
    def over(moment: float) -> FramePose:
        lat, lon = search.grid.frame.to_latlon([[2 + int(moment) % 3, 3]])[0]
        return FramePose(float(lat), float(lon), 30.0, 0.0, moment)

    with closing(Journal(journal)) as opened:
        sensor = make_sensor(SETTINGS, search.grid)
        yield Intake(search, sensor, opened, Moments(Clock(), history_s=1e12), over, lambda *_: None)


def reports(search: Search) -> list[Report]:
    lat, lon = search.grid.frame.to_latlon([[3, 3]])[0]
    seen = ({"lat": lat, "lon": lon, "accuracy_m": 4.0, "thumbnail": "https://x.example/3.jpg"},)
    return [
        Report.model_validate(
            {"id": f"r{i}", "captured_at": 1000.0 + i, "detections": seen if i % 3 == 1 else ()}
        )
        for i in range(12)
    ]


def test_a_verdict_is_evidence_and_is_replayed_to_the_last_bit(tmp_path: Path) -> None:
    search = fresh_search(tmp_path)

    async def fly() -> None:
        with intake_for(search, tmp_path / "j.sqlite") as intake:
            first = [intake.submit(report) for report in reports(search)[:6]]
            await asyncio.gather(*first, intake.judge((3, 3), confirmed=False))
            before = search.belief.digest()
            await intake.judge((6, 7), confirmed=True)
            assert search.belief.digest() != before
            await asyncio.gather(*(intake.submit(report) for report in reports(search)[6:]))

    asyncio.run(fly())
    again = fresh_search(tmp_path)
    with intake_for(again, tmp_path / "other.sqlite") as intake:
        assert replay(tmp_path / "j.sqlite", again, intake) == 12
    assert again.belief.digest() == search.belief.digest()
    assert again.confirmed == search.confirmed == (6, 7)
    probability = search.belief.probability()
    assert again.sightings.suspects(probability) == search.sightings.suspects(probability)


def test_a_pass_that_a_kill_interrupts_is_one_look(tmp_path: Path) -> None:
    """Two frames of a hover over one cell, and a service that is killed between them."""
    search = fresh_search(tmp_path)
    lat, lon = search.grid.frame.to_latlon([[3, 3]])[0].tolist()
    pose = {"lat": lat, "lon": lon, "height_m": 30.0, "heading_deg": 0.0}

    def frame(number: int) -> Report:
        return Report.model_validate({"id": f"r{number}", "captured_at": 1000.0 + number, "pose": pose})

    with intake_for(search, tmp_path / "j.sqlite") as intake:
        assert asyncio.run(intake.submit(frame(0))).looks == 1
        assert asyncio.run(intake.submit(frame(1))).looks == 0
    again = fresh_search(tmp_path)
    with intake_for(again, tmp_path / "j.sqlite") as intake:
        replay(tmp_path / "j.sqlite", again, intake)
        assert asyncio.run(intake.submit(frame(2))).looks == 0
        away = frame(4).model_copy(update={"pose": None})  # over other ground
        asyncio.run(intake.submit(away))
        assert asyncio.run(intake.submit(frame(5))).looks == 1


def test_a_verdict_multiplies_the_odds_as_bayes_rule_says(tmp_path: Path) -> None:
    for confirmed, factor in ((False, 0.01 / 0.99), (True, 0.99 / 0.01)):
        search = fresh_search(tmp_path)
        before = search.belief.probability()
        with intake_for(search, tmp_path / f"{confirmed}.sqlite") as intake:
            asyncio.run(intake.judge((3, 3), confirmed=confirmed))
        inside = np.zeros(before.shape, dtype=bool)
        inside[2:5, 2:5] = True
        exact = np.where(inside, factor, 1.0) * before
        assert search.belief.probability() == pytest.approx(exact / exact.sum(), rel=1e-9)


def test_a_rejected_place_needs_a_new_hit_to_be_found(tmp_path: Path) -> None:
    search = fresh_search(tmp_path)
    k = np.ones(1)
    hit = Observation(np.array([[3, 3]]), np.array([True]), 0.9 * k, 0.9999999 * k, np.array([True]))
    search.take(hit)
    found = search.found()
    assert found is not None
    assert found.probability > 0.999
    with intake_for(search, tmp_path / "j.sqlite") as intake:
        asyncio.run(intake.judge((3, 3), confirmed=False))
    assert search.found() is None
    for _ in range(3):  # however probable it gets by what is ruled out elsewhere
        rest = np.argwhere(np.abs(np.indices(search.belief.shape) - 3).max(axis=0) > 1)
        n = len(rest)
        search.take(Observation(rest, np.zeros(n, bool), np.full(n, 0.99999), np.ones(n), np.zeros(n, bool)))
    assert search.place.probability > 0.999
    assert search.found() is None
    search.take(hit)
    assert search.found() is not None

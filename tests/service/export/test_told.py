"""What was told in flight is in what is exported of it: excluded ground above all, which a plan must not fly over."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
import shapely

from service.area import leg_is_clear
from service.export.formats import FORMATS
from service.export.model import ExportedRun
from service.export.run import read_run
from service.export.wishes import Wishes
from service.news.request import NewsRequest
from service.rows import NewsRow, ReplacedRow, SortieRow, WithdrawnRow
from tests.service.area.files import box, polygon
from tests.service.export.recorded import SETTINGS, Recorder

GROUND = polygon(box(160, 60, 200, 100))
"""In the middle of the field."""


def told(recorder: Recorder, name: str, role: str, **said: object) -> NewsRow:
    feature = {"type": "Feature", "geometry": GROUND, "properties": {"role": role, **said}}
    return NewsRow(NewsRequest.model_validate(feature).news(recorder.grid, name))


def recorded(folder: Path) -> Recorder:
    """A run that has looked at a few cells."""
    recorder = Recorder(folder)
    recorder.start()
    for cell in list(recorder.cells())[:10]:
        recorder.look(cell)
    return recorder


@pytest.fixture
def run(tmp_path: Path) -> ExportedRun:
    """A run in which ground was excluded in flight."""
    recorder = recorded(tmp_path)
    recorder.write("news", **told(recorder, "lz", "exclude", words="landing <site>").body())
    recorder.journal.close()
    return read_run(tmp_path)


def test_a_plan_keeps_clear_of_ground_that_was_excluded_in_flight_and_fences_it(run: ExportedRun) -> None:
    plan = json.loads(FORMATS["plan"].write(run, Wishes(minutes=12.0)))
    points = [each["params"][4:6] for each in plan["mission"]["items"] if each["command"] == 16]
    way = shapely.LineString([(lon, lat) for lat, lon in points])
    ground = shapely.geometry.shape(GROUND)
    assert not shapely.intersects(way, ground)
    legs = [run.grid.launch, *map(tuple, points), run.grid.launch]
    assert all(leg_is_clear(run.grid, a, b) for a, b in itertools.pairwise(legs))
    fenced = [
        shapely.Polygon([(lon, lat) for lat, lon in each["polygon"]])
        for each in plan["geoFence"]["polygons"]
        if not each["inclusion"]
    ]
    assert len(fenced) == 2
    assert fenced[1].equals_exact(ground, 1e-7)


def test_every_drawing_of_it_has_what_was_excluded_in_flight(run: ExportedRun) -> None:
    features = json.loads(FORMATS["geojson"].write(run, Wishes()))["features"]
    names = [each["properties"]["name"] for each in features if each["properties"]["role"] == "exclude"]
    assert names == ["exclusion 1, mast", "exclusion 2, landing <site>"]
    assert b"landing &lt;site&gt;" in FORMATS["kml"].write(run, Wishes())
    middle = shapely.geometry.shape(GROUND).centroid
    assert not run.grid.flyable[tuple(run.frame.to_cells([(middle.y, middle.x)])[0])]


def test_what_was_taken_back_excludes_nothing(tmp_path: Path) -> None:
    recorder = recorded(tmp_path)
    recorder.write("news", **told(recorder, "lz", "exclude").body())
    recorder.write("withdrawn", **WithdrawnRow("lz").body())
    recorder.journal.close()
    run = read_run(tmp_path)
    assert len(run.area.exclusions) == 1
    assert np.array_equal(run.grid.flyable, recorder.grid.flyable)


def test_the_timeline_has_news_sorties_and_who_took_whose_place(tmp_path: Path) -> None:
    recorder = recorded(tmp_path)
    recorder.write("news", **told(recorder, "lz", "exclude", words="landing site").body())
    recorder.write("news", **told(recorder, "team", "searched", pod=0.5).body())
    recorder.write("withdrawn", **WithdrawnRow("team").body())
    recorder.write("sortie", **SortieRow(1, recorder.time, 90.0, 12, 0.2, "battery at 20 %").body())
    recorder.write("replaced", **ReplacedRow(7, 1, "px4").body())
    recorder.journal.close()
    run = read_run(tmp_path)
    said = [each.text for each in run.timeline if each.kind in ("news", "sortie", "replaced")]
    assert said == [
        "told: not flown over any more, landing site",
        "told: searched by others, team",
        "taken back: searched by others, team",
        "flight 1 is over after 1.5 min and 12 cells: battery at 20 %",
        "system 1 (px4) is let go for system 7",
    ]
    for name in ("csv", "html"):
        text = FORMATS[name].write(run, Wishes()).decode()
        assert all(each in text for each in said)


def test_a_track_is_cut_at_the_landings_of_its_own_aircraft_alone(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    tables = [{"name": "kite"}, {"name": "crow"}]
    recorder.journal.set_meta("settings", {**SETTINGS.model_dump(), "aircraft": tables})
    recorder.aircraft = {"aircraft": "kite"}
    recorder.start()
    cells = list(recorder.cells())
    for number, cell in enumerate(cells[:12]):
        recorder.aircraft = {"aircraft": ("kite", "crow")[number % 2]}
        recorder.look(cell)
        if number == 5:
            recorder.aircraft = {"aircraft": "crow"}
            recorder.write("sortie", **SortieRow(1, recorder.time + 0.9, 90.0, 3, 0.1, "battery").body())
    recorder.journal.close()
    pieces = [(piece[0].aircraft, len(piece)) for piece in read_run(tmp_path).track]
    assert pieces == [("kite", 6), ("crow", 3), ("crow", 3)]

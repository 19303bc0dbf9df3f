"""A run that is over, at any of its times."""

from __future__ import annotations

import json
from pathlib import Path

import shapely

from service.news.request import NewsRequest
from service.rows import NewsRow, ReportRow, SortieRow, WithdrawnRow
from service.view.feed import Feed
from service.view.maps import geojson_text
from service.view.replay import ReplayView
from tests.service.area.files import box, polygon
from tests.service.export.recorded import SETTINGS, Recorder, record


def test_a_time_shows_the_same_from_whichever_side_it_is_come_to(tmp_path: Path) -> None:
    folder = record(tmp_path / "run", found=True)
    view, other = ReplayView(folder), ReplayView(folder)
    first, last = view.span()

    def shown(view: ReplayView, part: int) -> str:
        view.seek(first + part * (last - first) / 5)
        return json.dumps(view.state())

    there = [shown(view, part) for part in range(6)]
    back = [shown(other, part) for part in (5, 4, 3, 2, 1, 0)]
    assert there == back[::-1]
    assert len(set(there)) == 6


def test_a_replay_tells_of_reports_track_and_what_was_found(tmp_path: Path) -> None:
    view = ReplayView(record(tmp_path / "run", found=True))
    reports = [entry for entry in view.rows if isinstance(entry.said, ReportRow)]
    state = view.state()
    assert state["reports"]["accepted"] == len(reports) == len(view.tracks()[0])
    assert state["found"]["probability"] == 0.9994
    assert state["state"] == "DONE"


def test_a_replay_knows_each_of_several_aircraft(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    recorder.journal.set_meta(
        "settings", {**SETTINGS.model_dump(), "aircraft": [{"name": "kite"}, {"name": "crow"}]}
    )
    cells, heard = list(recorder.cells()), []
    for name, seen in (("kite", cells[:3]), ("crow", cells[3:5])):
        recorder.aircraft = {"aircraft": name}
        recorder.start()
        for cell in seen:
            recorder.look(cell, hit=cell == cells[4])
            heard.append(recorder.time)
    recorder.aircraft = {"aircraft": "kite"}
    recorder.write("transition", **{"from": "SEARCHING", "event": "hold", "to": "HOLDING", "reason": "test"})
    for name in ("kite", "crow"):
        recorder.aircraft = {"aircraft": name}
        recorder.write("sortie", **SortieRow(1, recorder.time, 60.0, 3, 0.1, f"battery of {name}").body())
    recorder.journal.close()
    view = ReplayView(tmp_path)
    kite, crow = view.state()["aircraft"]
    assert [(each["name"], each["colour"], each["state"]) for each in (kite, crow)] == [
        ("kite", 0, "HOLDING"),
        ("crow", 1, "SEARCHING"),
    ]
    own = [
        [(each["aircraft"], each["number"], each["why"]) for each in one["sorties"]] for one in (kite, crow)
    ]
    assert own == [[("kite", 1, "battery of kite")], [("crow", 1, "battery of crow")]]
    where = recorder.grid.frame.to_latlon([cells[2], cells[4]]).tolist()
    assert [[kite["lat"], kite["lon"]], [crow["lat"], crow["lon"]]] == where
    flown = recorder.grid.frame.to_latlon(cells[:5]).tolist()
    assert [[list(place) for place in track] for track in view.tracks()] == [flown[:3], flown[3:]]
    assert (len(view.hits()), view.state()["reports"]["accepted"]) == (1, 5)
    shown = json.loads(geojson_text(view.ground, view.moment()))["features"]
    tracks = [each for each in shown if each["properties"]["role"] == "track"]
    assert [each["properties"]["aircraft"] for each in tracks] == ["kite", "crow"]
    assert [len(each["geometry"]["coordinates"]) for each in tracks] == [3, 2]
    feed = Feed(view.search.grid.searchable)
    whole = feed.message(view.moment())["tracks"]
    assert [(news["from"], len(news["rows"])) for news in whole] == [(0, 3), (0, 2)]
    view.seek(heard[3])
    assert [each["sorties"] for each in (view.state(), *view.state()["aircraft"])] == [[], [], []]
    assert [len(track) for track in view.tracks()] == [3, 1]
    assert feed.message(view.moment())["tracks"] == [None, {"from": 1, "rows": []}]
    view.seek(view.span()[0])
    assert view.tracks() == [[], []]
    assert [each["state"] for each in view.state()["aircraft"]] == ["READY", "WAITING"]
    assert view.hits() == []


def test_a_replay_draws_news_where_they_were_told_and_while_they_stood(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    recorder.start()
    recorder.look(next(recorder.cells()))
    ground = polygon(box(160, 60, 200, 100))
    feature = {"type": "Feature", "geometry": ground, "properties": {"role": "exclude"}}
    news = NewsRequest.model_validate(feature).news(recorder.grid, "lz")
    recorder.write("news", **NewsRow(news).body())
    told = recorder.time
    recorder.write("withdrawn", **WithdrawnRow("lz").body())
    recorder.journal.close()
    view = ReplayView(tmp_path)
    assert view.state()["news"] == []
    view.seek(told)
    (shown,) = view.state()["news"]
    assert shapely.equals(shapely.geometry.shape(shown["geometry"]), shapely.geometry.shape(ground))
    features = json.loads(geojson_text(view.ground, view.moment()))["features"]
    excluded = [each for each in features if each["properties"]["role"] == "exclude"]
    assert len(excluded) == 2
    assert excluded[1]["geometry"] == json.loads(json.dumps(shown["geometry"]))
    with_it = view.picture()()
    view.seek(told + 1.0)
    assert view.picture()() != with_it

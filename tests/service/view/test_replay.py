"""A run that is over, at any of its times."""

from __future__ import annotations

import json
from pathlib import Path

from service.rows import ReportRow, SortieRow
from service.view.replay import ReplayView
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
    assert state["reports"]["accepted"] == len(reports) == len(view.track())
    assert state["found"]["probability"] == 0.9994
    assert state["state"] == "DONE"


def test_a_replay_knows_each_of_several_aircraft(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    recorder.journal.set_meta(
        "settings", {**SETTINGS.model_dump(), "aircraft": [{"name": "kite"}, {"name": "crow"}]}
    )
    cells = list(recorder.cells())
    for name, seen in (("kite", cells[:3]), ("crow", cells[3:5])):
        recorder.aircraft = {"aircraft": name}
        recorder.start()
        for cell in seen:
            recorder.look(cell, hit=cell == cells[4])
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
    assert (len(view.track()), len(view.hits()), view.state()["reports"]["accepted"]) == (3, 1, 5)
    view.seek(view.span()[0])
    assert [each["state"] for each in view.state()["aircraft"]] == ["READY", "WAITING"]
    assert view.hits() == []

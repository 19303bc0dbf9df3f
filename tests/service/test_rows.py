"""The kinds of journal rows as values: there and back, from every form they ever had, and refused when damaged."""

from __future__ import annotations

import json
import shutil
import sqlite3
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import shapely

from roisearch import Regions
from service.drawing import Drawing, RegionsRow
from service.entries import UnknownRow, read_entries, read_last_entries
from service.errors import BadInput
from service.evidence.found import IN_95_PERCENT, Found
from service.evidence.observe import FramePose, Observation, Sighting
from service.export.run import read_run
from service.journal import Journal, read_rows
from service.mission.states import Event, State
from service.news.bearing import FieldNews
from service.reasons import Option
from service.rows import (
    ClockRow,
    CommandRow,
    DecisionRow,
    FlightRow,
    FoundRow,
    KnownRow,
    ModeRow,
    NewsRow,
    NotTakenRow,
    OrderRow,
    ReplacedRow,
    ReportRow,
    ResumedRow,
    SortieRow,
    TransitionRow,
    VehicleClockRow,
    VehicleRow,
    VerdictRow,
    WithdrawnRow,
    YieldedRow,
)
from service.survey import JOURNAL
from service.timebase import Tie
from service.view.replay import ReplayView
from tests.service.export.recorded import record

LOOK = Observation(
    np.array([[1, 2], [1, 3]]),
    np.array([True, False]),
    np.array([0.1 + 0.2, 0.9]),
    np.array([0.95, 0.9]),
    np.array([True, True]),
    (Sighting(47.0, 11.0, (1.0, 0.0, 1.0), "https://camera.example/1.jpg"),),
)
ELLIPSE = {"semi_major_m": 9.0, "semi_minor_m": 4.0, "bearing_deg": 30.0}
OPTION = Option("region 1", 1, 40, 0.25, 0.5, None, True, "ROI 1: 50 % of the mass")
REGIONS = Regions(
    np.array([[0, 2], [2, 0]], dtype=np.int32), 2, np.array([[0.0, 0.0], [0.5, 0.5]]), np.array([[0, 0], [0, 1]]),
    np.array([0.1 + 0.2, 0.0, 0.7]),
)  # fmt: skip
ROWS: list[KnownRow] = [
    TransitionRow(State.READY, Event.AIRBORNE, State.SEARCHING, "in the air"),
    OrderRow("reject", "SEARCHING", (47.0, 11.0)),
    OrderRow("hold", "SEARCHING"),
    CommandRow("reposition", 47.0, 11.0, 525.0),
    CommandRow("take off", height_m=30.0),
    CommandRow("hold"),
    ModeRow("GUIDED", True),
    NotTakenRow(47.0, 11.0),
    YieldedRow("the pilot selected LOITER"),
    DecisionRow("region 1", ((1, 2), (1, 3)), "ROI 1: 50 % of the mass", (OPTION,)),
    FlightRow(61.5, 0.0, 12, ((5.0, 47.0, 11.0, 30.0),)),
    FoundRow(Found(47.0, 11.0, 0.999, 3.7, ELLIPSE, None)),
    ReportRow({"id": "a", "captured_at": 5.5}, FramePose(47.0, 11.0, 30.0, 90.0, 5.5, 1.0, -2.0), LOOK),
    ReportRow({"id": "b", "captured_at": 6.5}, FramePose(47.0, 11.0, 30.0, 90.0, 6.5), None),
    VerdictRow(False, (1, 2), LOOK),
    ResumedRow("1.2.3", {"search.found_at": 0.9}),
    ClockRow(Tie(5.0, 1.8e9, 77.25, "a", -3.5)),
    VehicleClockRow(5.0, 61.5, -60.0),
    VehicleRow(7, "ardupilot"),
    ReplacedRow(None, 1, "px4"),
    ReplacedRow(7, 1, "px4"),
    SortieRow(2, 1700.5, 0.1 + 0.2, 37, 0.25, "battery at 20 %", 7, "ardupilot"),
    SortieRow(1, 900.0, 61.5, 12, 0.125, "the operator asked to return"),
    NewsRow(
        FieldNews(
            "n2",
            "exclude",
            "",
            (47.0, 11.0),
            np.empty((0, 2), dtype=np.int64),
            np.empty(0),
            shapely.MultiPolygon(
                [
                    (
                        ((10.0, 46.0), (12.0, 46.0), (12.0, 48.0), (10.0, 46.0)),
                        [((11.1, 46.2), (11.5, 46.2), (11.5, 46.4), (11.1, 46.2))],
                    ),
                    (((13.0, 46.0), (14.0, 46.0), (14.0, 47.1), (13.0, 46.0)), []),
                ]
            ),
        )
    ),
    NewsRow(FieldNews("n1", "clue", "a glove", (47.0, 11.0), np.array([[1, 2]]), np.array([0.1 + 0.2]))),
    WithdrawnRow("n1"),
    RegionsRow(Drawing.of(3, REGIONS, ("the burn", "open ground"), "region 1 (the burn) is spent")),
]


def bodies(rows: list[Any]) -> list[tuple[str, str]]:
    """What distinguishes rows: arrays have no equality of their own."""
    return [(row.kind, json.dumps(row.body())) for row in rows]


def written(path: Path, *rows: tuple[str, Any]) -> Path:
    """A journal with rows of these kinds and bodies."""
    journal = Journal(path)
    for number, (kind, body) in enumerate(rows):
        journal.write(float(number), kind, body).result()
    journal.close()
    return path


def test_every_kind_of_row_comes_back_from_disk_as_it_was_written(tmp_path: Path) -> None:
    journal = Journal(tmp_path / JOURNAL)
    for number, row in enumerate(ROWS):
        assert journal.write(float(number), row).result() == number + 1
    journal.close()
    entries = list(read_entries(tmp_path / JOURNAL))
    assert [(entry.seq, entry.time) for entry in entries] == [(n + 1, float(n)) for n in range(len(ROWS))]
    assert [type(entry.said) for entry in entries] == [type(row) for row in ROWS]
    assert bodies([entry.said for entry in entries]) == bodies(ROWS)


def test_every_kind_of_row_is_among_them() -> None:
    assert {type(row) for row in ROWS} == set(get_args(KnownRow))


def test_a_sortie_of_a_time_when_it_was_not_told_who_flew_it_is_read(tmp_path: Path) -> None:
    body = {"number": 1, "landed": 900.0, "seconds": 61.5, "steps": 12, "pos": 0.1, "why": "battery"}
    (entry,) = read_entries(written(tmp_path / JOURNAL, ("sortie", body)))
    assert entry.said == SortieRow(1, 900.0, 61.5, 12, 0.1, "battery", None, None)


def test_rows_are_read_by_kind_and_from_the_end(tmp_path: Path) -> None:
    journal = Journal(tmp_path / JOURNAL)
    for number, row in enumerate(ROWS):
        journal.write(float(number), row).result()
    journal.close()
    commands = [entry.said.body()["command"] for entry in read_entries(tmp_path / JOURNAL, CommandRow)]
    assert commands == ["reposition", "take off", "hold"]
    (last,) = read_last_entries(tmp_path / JOURNAL, CommandRow, 1)
    assert last.said == CommandRow("hold")


def test_the_bodies_of_the_first_versions_are_understood(tmp_path: Path) -> None:
    """Orders without a place, decisions without options, finds without an ellipse, poses without attitude."""
    seen = LOOK.to_dict()
    del seen["sightings"]
    path = written(
        tmp_path / JOURNAL,
        ("order", {"command": "hold", "state": "SEARCHING"}),
        ("decision", {"action": "east", "path": [[1, 2]], "reason": "one cell east"}),
        ("found", {"lat": 47.0, "lon": 11.0, "probability": 0.99, "sigma_m": 4.0}),
        ("report", {"report": {"id": "a", "captured_at": 2.5}, "pose": [47.0, 11.0, 30.0, 90.0], "observation": seen}),
        ("report", {"report": {"id": "b", "captured_at": 9.0, "clock": "boot"}, "pose": [47.0, 11.0, 30.0, 90.0],
                    "observation": None}),
    )  # fmt: skip
    order, decision, found, report, by_boot = (entry.said for entry in read_entries(path))
    assert order == OrderRow("hold", "SEARCHING", None)
    assert decision == DecisionRow("east", ((1, 2),), "one cell east", ())
    assert isinstance(found, FoundRow)
    assert found.found.ellipse["semi_major_m"] == found.found.ellipse["semi_minor_m"] == 4.0 * IN_95_PERCENT
    assert isinstance(report, ReportRow)
    assert isinstance(by_boot, ReportRow)
    assert (report.pose, report.captured) == (FramePose(47.0, 11.0, 30.0, 90.0, 2.5), 2.5)
    assert by_boot.captured == 4.0  # when it was written down


WRONG = {
    "a state that never was": ("transition", {"from": "READY", "event": "airborne", "to": "LOST", "reason": ""}),
    "no reason": ("transition", {"from": "READY", "event": "airborne", "to": "SEARCHING"}),
    "a number for a text": ("order", {"command": 7, "state": "SEARCHING"}),
    "half a place": ("order", {"command": "reject", "state": "SEARCHING", "place": [47.0]}),
    "a text for a number": ("command", {"command": "reposition", "lat": "47", "lon": 11.0}),
    "a flag that is none": ("mode", {"mode": "GUIDED", "commanded": 1}),
    "a cell of three": ("decision", {"action": "east", "path": [[1, 2, 3]], "reason": ""}),
    "an option that is none": ("decision", {"action": "east", "path": [], "reason": "", "options": [7]}),
    "half a place of a track": ("flight", {"seconds": 1.0, "earlier_s": 0.0, "steps": 1, "track": [[1.0, 47.0]]}),
    "half a step": ("flight", {"seconds": 1.0, "earlier_s": 0.0, "steps": 1.5, "track": []}),
    "no probability": ("found", {"lat": 47.0, "lon": 11.0, "sigma_m": 4.0}),
    "no pose": ("report", {"report": {"id": "a"}, "observation": None}),
    "a pose of two": ("report", {"report": {"id": "a"}, "pose": [47.0, 11.0], "observation": None}),
    "no id": ("report", {"report": {}, "pose": [47.0, 11.0, 30.0, 90.0], "observation": None}),
    "cells without their likelihoods": (
        "report",
        {"report": {"id": "a"}, "pose": [47.0, 11.0, 30.0, 90.0], "observation": {**LOOK.to_dict(), "p_tp": [0.9]}},
    ),
    "half an observation": ("verdict", {"confirmed": True, "cell": [1, 2], "observation": {"cells": [[1, 2]]}}),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_row_with_a_body_that_is_not_its_kinds_is_refused_by_its_number(name: str, tmp_path: Path) -> None:
    kind, body = WRONG[name]
    path = written(tmp_path / JOURNAL, ("yielded", {"reason": "the pilot"}), (kind, body))
    with pytest.raises(
        BadInput, match=rf"journal\.sqlite: row 2 is no {kind} that this version knows \(.+\)$"
    ):
        list(read_entries(path))


def test_a_row_of_a_kind_that_is_not_known_is_nobodys_business(tmp_path: Path) -> None:
    path = written(tmp_path / JOURNAL, ("tea", {"sugar": 2}))
    (entry,) = read_entries(path)
    assert entry.said == UnknownRow("tea", {"sugar": 2})


@pytest.mark.parametrize("schema", [1, 2])
def test_a_run_of_every_schema_is_replayed_exported_and_gone_on_with(schema: int, tmp_path: Path) -> None:
    """With the bodies that each had: the first schema had no checksums, poses of four and no ellipse."""
    folder = record(tmp_path / "run", found=True)
    whole = (read_run(folder), ReplayView(folder).state())
    with sqlite3.connect(folder / JOURNAL) as database:
        if schema == 1:
            database.execute("ALTER TABLE events DROP COLUMN crc")
            database.execute("UPDATE meta SET value = '1' WHERE key = 'schema'")
    database.close()
    run, state = read_run(folder), ReplayView(folder).state()
    assert (run.pos, run.belief.digest(), run.find) == (whole[0].pos, whole[0].belief.digest(), whole[0].find)
    assert state == whole[1]
    shutil.copyfile(folder / JOURNAL, tmp_path / "copy.sqlite")
    Journal(tmp_path / "copy.sqlite").close()  # as a resume opens it
    assert list(read_rows(tmp_path / "copy.sqlite")) == list(read_rows(folder / JOURNAL))

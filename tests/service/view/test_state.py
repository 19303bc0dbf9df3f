"""Where a search stands: one type for live and replay, and the schema that the door shows of it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jsonschema
import numpy as np
import pytest
from pydantic import TypeAdapter

from service.clock import Clock
from service.config import Settings
from service.evidence.cover import sensors_over
from service.http import create_app
from service.mission.flight import Flight
from service.mission.states import State
from service.search import Search
from service.survey import AREA, survey
from service.view.live import RunView, flight_left_s, pose_of
from service.view.replay import ReplayView
from service.view.state import RunState, pose_state
from tests.service.export.recorded import SETTINGS, record
from tests.service.http.door import FakeRun
from tests.service.mission.flown import START, reached, telemetry

KNOWN_LIVE_ALONE = {
    "flight_left_s",
    "battery_percent",
    "battery_doubt",
    "battery",
    "link",
    "detector",
    "wind",
}
"""What a journal does not keep."""


def states(folder: Path) -> tuple[RunState, RunState]:
    """Of a live run that has not begun yet, and of one that is over, on the same ground."""
    view = ReplayView(record(folder, found=True))
    settings: Settings = SETTINGS
    area, grid = survey(folder / AREA, None, settings)
    live = RunView(area, Search(grid, settings), sensors_over(grid, settings), settings, Clock(1.0))
    return live.state(), view.state()


def test_live_and_replay_tell_the_same_fields_and_differ_in_what_is_unknown(tmp_path: Path) -> None:
    live, replay = states(tmp_path / "run")
    assert list(live) == list(replay)
    for name, value in replay.items():
        if name != "mode":  # of which this journal happens to tell nothing
            assert (value is None) == (name in KNOWN_LIVE_ALONE), name
    for state in (live, replay):
        TypeAdapter(RunState).validate_python(state, strict=True)


def test_cells_that_are_passed_in_vain_are_told_as_not_seen_from_the_air(tmp_path: Path) -> None:
    record(tmp_path / "run", found=True)
    area, grid = survey(tmp_path / "run" / AREA, None, SETTINGS)
    search = Search(grid, SETTINGS)
    view = RunView(area, search, sensors_over(grid, SETTINGS), SETTINGS, Clock(1.0))
    assert view.state()["unseen"] == []
    row, col = search.place.cell
    search.common.overlooked.cells[row, col] = True
    rest = np.argwhere(grid.searchable)
    search.belief.observe(rest, np.zeros(len(rest), dtype=bool), 0.5, 0.9)  # what is left does not sum to 1
    (told,) = view.state()["unseen"]
    lat, lon = grid.frame.to_latlon([[row, col]])[0]
    assert (told["lat"], told["lon"]) == (lat, lon)
    assert told["probability"] == pytest.approx(search.belief.probability()[row, col])
    assert told["written"] == f"{lat:.6f}, {lon:.6f}"


def test_the_openapi_document_has_the_schema_of_the_state_and_it_holds(tmp_path: Path) -> None:
    api = create_app(FakeRun()).openapi()
    answer = api["paths"]["/api/state"]["get"]["responses"]["200"]["content"]["application/json"]
    assert answer["schema"] == {"$ref": "#/components/schemas/RunState"}
    schema = {"components": api["components"], **answer["schema"]}
    for state in states(tmp_path / "run"):
        jsonschema.validate(json.loads(json.dumps(state)), schema)


def test_steps_are_cells_flown_in_a_replay_too(tmp_path: Path) -> None:
    folder = record(tmp_path / "run", found=True)
    view = ReplayView(folder)
    flown = view.rows
    assert view.state()["steps"] > 0  # though its planner has journalled no decision
    assert view.decisions(10) == []
    assert view.state()["steps"] < len(flown)


def test_a_live_view_has_the_tracks_of_all_in_their_order_and_of_none_before_they_are_heard(
    tmp_path: Path,
) -> None:
    record(tmp_path / "run")
    area, grid = survey(tmp_path / "run" / AREA, None, SETTINGS)
    view = RunView(area, Search(grid, SETTINGS), sensors_over(grid, SETTINGS), SETTINGS, Clock(1.0))
    assert view.tracks() == []
    kite, crow = [(START, 47.0, 8.0, 15.0), (START + 1.0, 47.1, 8.0, 15.0)], [(START, 46.0, 8.0, 25.0)]
    missions = {
        name: SimpleNamespace(flight=Flight(track=track)) for name, track in (("kite", kite), ("crow", crow))
    }
    squad: Any = SimpleNamespace(missions=missions)
    view.squad = squad
    assert view.tracks() == [[(47.0, 8.0), (47.1, 8.0)], [(46.0, 8.0)]]


@pytest.mark.parametrize("heading", [0.0, 350.0, math.nan])
def test_a_heading_that_is_not_known_is_told_as_that_and_not_as_north(heading: float) -> None:
    pose = pose_state(pose_of(stands(heading_deg=heading)), "degrees")
    assert pose is not None
    assert pose["heading_deg"] == (None if math.isnan(heading) else heading)


def stands(home_m: float = 0.0, **told: float) -> Any:
    """A mission whose home lies `home_m` above the launch point."""
    core = SimpleNamespace(helm=SimpleNamespace(heights=SimpleNamespace(home_m=home_m)))
    return SimpleNamespace(vehicle=SimpleNamespace(telemetry=telemetry(**told)), core=core)


@pytest.mark.parametrize(("home_m", "height_m"), [(30.0, 45.0), (math.nan, 15.0)])
def test_a_live_height_is_over_the_launch_point_as_a_replays_is_wherever_home_lies(
    home_m: float, height_m: float
) -> None:
    pose = pose_of(stands(home_m, alt_home_m=15.0))
    assert pose is not None
    assert pose.height_m == height_m


def test_the_time_left_is_that_of_this_sortie_by_the_aircrafts_own_settings() -> None:
    talk = reached(
        State.SEARCHING,
        {"flight": {"max_flight_s": 600.0}},
        flight=Flight(flown=True, carried_s=500.0, earlier_s=500.0, left_at=START),
    )
    talk.pass_by(100.0)
    mission: Any = SimpleNamespace(
        core=talk.core, energy=SimpleNamespace(seconds_left=lambda flight: 5000.0), flight=talk.core.flight
    )
    assert talk.core.flight.seconds(talk.now) > 590.0
    left = flight_left_s(mission, talk.now)
    assert left is not None
    assert 450.0 < left < 510.0

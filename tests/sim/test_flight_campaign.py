"""Flights of a campaign that are kept are not flown again, and those that were interrupted are."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from service.errors import BadInput
from sim import flights, flights_together
from sim.flight_campaign import add_flavors, add_options, kept, seeds_of
from sim.flight_times import Times
from sim.flights import Result, SearchFlight
from sim.flights_together import JointOutcome, Together
from sim.overground import OverGround

AREA = Path(__file__).parents[2] / "config" / "area.geojson"


def test_what_was_flown_is_read_and_what_was_interrupted_is_flown_anew(tmp_path: Path) -> None:
    folder, count = tmp_path / "ridge-px4-1", 0

    def fly() -> OverGround:
        nonlocal count
        count += 1
        assert not folder.exists(), "nothing of the interrupted one is left"
        folder.mkdir()
        return OverGround("ridge", "px4", 1, 0, {"flight_time_s": 60.0}, math.inf, False, "said")

    folder.mkdir()
    (folder / "settings.toml").write_text("", encoding="utf-8")
    first = kept(folder, OverGround, fly)
    assert kept(folder, OverGround, fly) == first
    assert count == 1


def campaign(out: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[list[SearchFlight], Callable[..., int]]:
    """Flights that are not flown but counted, and the command."""
    flew: list[SearchFlight] = []

    def fly(flight: SearchFlight, runs: Path, speedup: float, patience_s: float) -> Result:
        flew.append(flight)
        report = {"flight_time_s": 60.0, "simulated": {"error_cells": 0.2}, "hit_to_waypoint": {"samples": 0}}
        return Result(flight, 0, report, "said", Times((10.0, 20.0, None), 7.0, 0.5))

    monkeypatch.setattr(flights, "fly", fly)
    words = [str(AREA), "--seeds", "2", "--out", str(out)]
    return flew, lambda *more: flights.main([*words, *more])


def test_whole_searches_go_on_with_the_same_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    flew, run = campaign(tmp_path, monkeypatch)
    assert run() == 0
    first, flown = capsys.readouterr().out, len(flew)
    assert flown == 4
    assert run("--jobs", "1", "--speedup", "3") == 0
    again = capsys.readouterr().out
    assert len(flew) == flown
    assert again.split("of 4 found")[0] == first.split("of 4 found")[0], "table and all"
    assert run("--seeds", "3") == 0
    assert len(flew) == flown + 2


def test_a_folder_of_other_flights_is_refused_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, run = campaign(tmp_path, monkeypatch)
    run()
    with pytest.raises(
        BadInput, match="is of another flight than the one that is asked for; give another --out"
    ):
        run("--no-target")


def test_several_aircraft_go_on_with_the_same_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flew: list[Together] = []

    def fly(search: Together, folder: Path) -> JointOutcome:
        flew.append(search)
        return JointOutcome(search, 0, {"outcome": "found"}, together=3, error_cells=0.1)

    monkeypatch.setattr(flights_together, "fly", fly)
    words = [str(AREA), "--aircraft", "2", "--seeds", "2", "--out", str(tmp_path)]
    assert flights.main(words) == flights.main([*words, "--speedup", "2"]) == 0
    assert len(flew) == 2
    with pytest.raises(BadInput, match="give another --out"):
        flights.main([*words, "--trouble"])


def test_every_campaign_has_seeds_from_the_first_and_a_speed() -> None:
    parser = argparse.ArgumentParser()
    add_flavors(parser, jobs=2)
    add_options(parser, "area", speedup=20.0, patience_s=600.0)
    options = parser.parse_args(["--seeds", "3", "--first-seed", "7"])
    assert list(seeds_of(options)) == [7, 8, 9]
    assert (options.speedup, options.patience, options.jobs, options.out) == (20.0, 600.0, 2, None)

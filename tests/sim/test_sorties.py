"""Searches over several batteries: what counts as good, what is said, and what a journal says against one."""

from __future__ import annotations

import json
from contextlib import ExitStack
from io import StringIO
from pathlib import Path
from typing import Any

import httpx
import pytest
from rich.console import Console

from service.config import Settings
from service.errors import BadInput
from service.resume import retrace, stored_run
from service.search import Search as KnownGround
from service.survey import survey
from sim import sorties, sorties_campaign
from sim.sorties import TROUBLES, Outcome, Search, area_of
from sim.sorties_campaign import flown, lost_in, main, table, told
from tests.service.export.recorded import Recorder

SEARCH = Search("px4", 3, 1000.0, 15.0, True, 20.0, 60.0)


def outcome(**changes: Any) -> Outcome:
    pos = [0.2, 0.4, 0.5, 0.6]
    sorties = [{"pos": each, "number": number} for number, each in enumerate(pos, 1)]
    usual = {
        "code": 0,
        "report": {"outcome": "found", "sorties": sorties, "flight_time_s": 3000.0},
        "pos": pos,
        "troubles": list(TROUBLES),
    }
    return Outcome(SEARCH, **{**usual, "error_cells": 0.4, **changes})


@pytest.mark.parametrize(
    ("changes", "good"),
    [
        ({}, True),
        ({"code": 3}, False),
        ({"error_cells": 2.0}, False),
        ({"wrong": ["POS 0.500000 became 0.400000 killed in the air"]}, False),
        ({"report": {"sorties": [{"pos": 0.2}] * 3}}, False),
        ({"troubles": ["killed on the ground", "another aircraft"]}, False),
    ],
)
def test_a_search_is_good_when_it_is_found_over_four_sorties_and_nothing_was_lost(
    changes: dict[str, Any], good: bool
) -> None:
    assert outcome(**changes).good is good


def test_what_went_wrong_is_said() -> None:
    said = told(outcome(wrong=["POS was lost at a landing"], troubles=["killed on the ground"]))
    assert "px4 seed 3: exit 0, found after 4 sorties (POS 20.0%, 40.0%, 50.0%, 60.0%)" in said
    assert "killed on the ground" in said
    assert said.endswith("\nPOS was lost at a landing")


def test_the_square_is_as_large_as_it_is_asked_for(tmp_path: Path) -> None:
    file = tmp_path / "area.geojson"
    file.write_text(json.dumps(area_of(1000.0)), encoding="utf-8")
    _, grid = survey(file, None, Settings.model_validate({"sensor": {"cell_m": 25.0}}))
    assert float(grid.covered.sum()) * 625.0 == pytest.approx(1e6, rel=0.01)


def sorties_of(folder: Path, *told_pos: float | None) -> Path:
    """A run with a landing after every ten looks, at which the POS was told (None: as it is)."""
    recorder = Recorder(folder)
    recorder.start()
    cells, search = list(recorder.cells()), KnownGround(recorder.grid, Settings())
    for number, pos in enumerate(told_pos):
        for cell in cells[10 * number : 10 * number + 10]:
            recorder.look(cell)
            (*_, last) = stored_run(folder)[3]
            retrace(last, search)
        shown = search.record.searched if pos is None else pos
        body = {"number": number + 1, "landed": recorder.time, "seconds": 60.0, "steps": 10, "pos": shown}
        recorder.write("sortie", **body, why="battery")
        recorder.write("resumed", version="1", changed={})
    recorder.end(found=False)
    return folder


def test_a_journal_that_gives_what_was_told_at_each_landing_has_lost_nothing(tmp_path: Path) -> None:
    assert lost_in(sorties_of(tmp_path, None, None, None)) == []


def test_what_the_rows_of_a_journal_do_not_give_is_lost(tmp_path: Path) -> None:
    (wrong,) = lost_in(sorties_of(tmp_path, None, 0.9))
    assert wrong.startswith("POS 0.900000 was told, and the rows give 0.")


def test_pos_that_falls_from_one_landing_to_the_next_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = sorties_of(tmp_path, None, None)

    def forgetful(entry: Any, search: Any) -> None:
        if entry.said.kind == "resumed":  # as if a restart had begun anew
            search.known.record.__init__(search.grid.prior)
        retrace(entry, search)

    monkeypatch.setattr(sorties_campaign, "retrace", forgetful)
    assert any("became 0.000000" in wrong for wrong in lost_in(folder))


def test_a_campaign_goes_on_where_it_was_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    flew: list[Path] = []

    def fly(search: Search, folder: Path, told: Any) -> Outcome:
        assert not folder.exists()  # what an interrupted one has left is gone
        flew.append(folder)
        folder.mkdir(parents=True)
        good = outcome()
        good.search = search
        return good

    monkeypatch.setattr(sorties_campaign, "fly", fly)
    words = ["--battery-min", "15", "--trouble", "--seeds", "2", "--jobs", "2", "--out", str(tmp_path)]
    (tmp_path / "px4-2" / "runs").mkdir(parents=True)
    assert main(words) == 0
    assert sorted(folder.name for folder in flew) == ["ardupilot-1", "ardupilot-2", "px4-1", "px4-2"]
    assert "4 of 4 found over 4 sorties or more, nothing lost" in capsys.readouterr().out
    flew.clear()
    (tmp_path / "px4-1" / "result.json").unlink()
    assert main([*words, "--speedup", "5"]) == 0
    assert [folder.name for folder in flew] == ["px4-1"]


def test_the_result_of_another_search_is_not_taken_for_this_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fly(search: Search, folder: Path, told: Any) -> Outcome:
        folder.mkdir(parents=True)
        return outcome()

    monkeypatch.setattr(sorties_campaign, "fly", fly)
    flown(SEARCH, tmp_path / "a", Console(file=StringIO()))
    other = Search("px4", 3, 500.0, 15.0, True, 20.0, 60.0)
    with pytest.raises(
        BadInput, match="is of another flight than the one that is asked for; give another --out"
    ):
        flown(other, tmp_path / "a", Console(file=StringIO()))


def test_the_table_has_a_line_for_each_flavour() -> None:
    good, bad = outcome(), outcome(code=3)
    bad.search = Search("ardupilot", 3, 1000.0, 15.0, True, 20.0, 60.0)
    drawn = Console(file=StringIO(), width=120)
    drawn.print(table([good, bad]))
    lines = drawn.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert any("px4" in line and "4 to 4" in line and "20%, 40%, 50%, 60%" in line for line in lines)
    assert any("ardupilot" in line and " 0 " in line for line in lines)


class _Shut:
    """A search that was found on the ground: its door is shut when it is asked after the landing."""

    def __init__(self, search: Search, folder: Path, stack: ExitStack) -> None:
        self.flown, self._alive = Outcome(search), search.seed == 2

    def begin(self) -> None: ...

    def lands(self, sortie: int) -> bool:
        return True

    def pos(self) -> float:
        raise httpx.ConnectError("[Errno 111] Connection refused")

    def ends(self) -> bool:
        return not self._alive

    def end(self) -> None:
        self.flown.code = 0


def test_a_search_that_ends_on_the_ground_is_judged_and_one_that_only_does_not_answer_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sorties, "LongSearch", _Shut)
    over, silent = (
        sorties.fly(Search("px4", seed, 1000.0, 15.0, False, 20.0, 60.0), tmp_path) for seed in (1, 2)
    )
    assert (over.code, over.wrong) == (0, [])
    assert silent.wrong == ["[Errno 111] Connection refused"]

"""A run read back from its journal: under way or over, and never to the harm of whoever writes it."""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
from pathlib import Path

import numpy as np
import pytest

from roisearch import Belief
from service.errors import BadInput
from service.evidence.observe import Observation, Sighting
from service.evidence.verdict import verdict_on
from service.export.formats import FORMATS
from service.export.gaps import find_gaps, gap_cells
from service.export.run import read_run
from service.export.wishes import Wishes
from service.journal import read_rows
from service.rows import VerdictRow
from service.survey import AREA, JOURNAL
from tests.service.export.recorded import BEGAN, SETTINGS, Recorder, record


def test_a_run_is_what_its_journal_says(tmp_path: Path) -> None:
    run = read_run(record(tmp_path / "run", found=True))
    belief = Belief(run.grid.prior, searchable=run.grid.searchable, outside=run.grid.outside)
    for row in read_rows(tmp_path / "run" / JOURNAL, "report"):
        o = Observation.from_dict(row.body["observation"])
        belief.observe(o.cells, o.hits, o.p_tp, o.p_tn)
    assert run.belief.digest() == belief.digest()
    assert run.looks == run.reports == len(run.track[0])
    assert run.pos == pytest.approx(0.9 * 0.9 * run.grid.prior[run.pod > 0].sum())
    assert run.curve[-1][1] == pytest.approx(run.pos, abs=1e-3)
    assert (len(run.hits), len(run.detections)) == (1, 2)
    assert [each.counted for each in run.detections] == [True, False]
    assert run.find is not None
    assert (run.state, run.over, run.autopilot, run.launch_amsl_m) == ("DONE", True, "px4", 500.0)
    assert run.track[0][0].time == pytest.approx(BEGAN + 3.75)
    assert run.flown_m == pytest.approx((len(run.track[0]) - 1) * 20.0, rel=0.2)


def test_a_track_is_broken_where_a_run_was_resumed(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    recorder.start()
    cells = list(recorder.cells())
    for cell in cells[:4]:
        recorder.look(cell)
    recorder.time -= 1000.0  # a simulated clock starts over
    for cell in cells[4:9]:
        recorder.look(cell)
    recorder.journal.close()
    run = read_run(tmp_path)
    assert [len(piece) for piece in run.track] == [4, 5]
    assert not run.over


def test_of_several_aircraft_each_has_a_track_of_its_own(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    tables = [{"name": "kite"}, {"name": "crow"}]
    recorder.journal.set_meta("settings", {**SETTINGS.model_dump(), "aircraft": tables})
    recorder.aircraft = {"aircraft": "crow"}
    recorder.start()
    cells = list(recorder.cells())
    for number, cell in enumerate(cells[:8]):  # of both in turn
        recorder.aircraft = {"aircraft": ("crow", "kite")[number % 2]}
        recorder.look(cell)
    recorder.journal.close()
    run = read_run(tmp_path)
    assert [{fix.aircraft for fix in piece} for piece in run.track] == [{"crow"}, {"kite"}]
    assert [len(piece) for piece in run.track] == [4, 4]
    assert (
        run.launch_amsl_m == 490.0
    )  # 525 m above the sea, in the second layer: 25 m and 10 m above the launch
    assert run.timeline[0].text.startswith("aircraft crow: WAITING")
    wishes = Wishes()
    gpx, kml = (FORMATS[name].write(run, wishes).decode() for name in ("gpx", "kml"))
    for name in ("crow", "kite"):
        assert f"<name>flight of aircraft {name}</name>" in gpx
        assert f", aircraft {name}</name>" in kml
    assert "aircraft kite" in FORMATS["csv"].write(run, wishes).decode()


def test_a_find_that_an_operator_has_rejected_is_none(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    recorder.start()
    cell = list(recorder.cells())[20]
    recorder.look(cell, hit=True)
    lat, lon = recorder.grid.frame.to_latlon([cell])[0].tolist()
    recorder.write("found", lat=lat, lon=lon, probability=0.9995, sigma_m=6.0)
    find = read_run(tmp_path).find
    assert find is not None
    assert find.ellipse == pytest.approx((6.0 * 2.4477, 6.0 * 2.4477, 0.0), abs=1e-3)
    before = read_run(tmp_path).poa[cell]
    said = verdict_on(cell, recorder.grid.frame.shape, 0.99, confirmed=False)
    recorder.write("verdict", **VerdictRow(False, cell, said).body())
    recorder.journal.close()
    run = read_run(tmp_path)
    assert run.find is None
    assert run.poa[cell] < 0.2 * before
    assert run.timeline[-1].text == "operator: it is not here"


def test_a_detection_told_in_pixels_stands_where_the_service_placed_it(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    recorder.start()
    cell = next(recorder.cells())
    lat, lon = recorder.grid.frame.to_latlon([cell])[0].tolist()
    placed = Sighting(lat, lon, (9.0, 0.0, 9.0))
    recorder.look(cell, hit=True, detections=({"class": "person", "box": [1, 2, 3, 4]},), sightings=(placed,))
    recorder.journal.close()
    (seen,) = read_run(tmp_path).detections
    assert (seen.kind, seen.lat, seen.lon, seen.counted) == ("person", lat, lon, True)


def test_reading_a_live_run_again_and_again_does_not_disturb_its_writer(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    recorder.start()
    done = threading.Event()
    seen: list[int] = []
    failed: list[BaseException] = []

    def read() -> None:
        try:
            while not done.is_set():
                seen.append(read_run(tmp_path).reports)
        except BaseException as error:  # told below, in the test's own thread
            failed.append(error)

    reader = threading.Thread(target=read)
    reader.start()
    for cell in list(recorder.cells()) * 3:
        recorder.look(cell)
    while len(seen) < 3 and not failed:
        recorder.look((0, 0))
    recorder.end(found=False)
    done.set()
    reader.join()
    assert failed == []
    assert seen == sorted(seen)
    run = read_run(tmp_path)
    assert run.reports == recorder.frames
    assert [row.seq for row in read_rows(tmp_path / JOURNAL)][-1] == recorder.frames + 3 + 2


def test_a_killed_run_is_read_with_the_rows_that_are_only_in_its_write_ahead_log(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    recorder.start()
    recorder.look((2, 2)) if recorder.grid.flyable[2, 2] else recorder.look(next(recorder.cells()))
    dead = tmp_path / "dead"
    dead.mkdir()
    for path in tmp_path.glob("*.*"):
        shutil.copy(path, dead)
    assert (dead / (JOURNAL + "-wal")).stat().st_size > 0
    assert read_run(dead).reports == 1
    recorder.journal.close()


def test_a_finished_run_is_read_where_nothing_may_be_written() -> None:
    with tempfile.TemporaryDirectory(prefix="read only #?%20 ") as name:
        folder = record(Path(name) / "run")
        before = sorted(path.name for path in folder.iterdir())
        for path in (folder, *folder.iterdir(), Path(name)):
            path.chmod(0o555)
        me = os.geteuid()
        try:
            if me == 0:
                os.seteuid(65534)  # nobody: root may write everywhere
            assert read_run(folder).reports > 0
        finally:
            os.seteuid(me)
            for path in (Path(name), folder):
                path.chmod(0o755)
        assert sorted(path.name for path in folder.iterdir()) == before


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda folder: (folder / JOURNAL).unlink(), "there is no journal here"),
        (lambda folder: (folder / AREA).unlink(), "area.geojson"),
        (
            lambda folder: (folder / JOURNAL).write_bytes(b"no database at all, and long enough"),
            "cannot be read",
        ),
    ],
)
def test_what_is_no_run_is_one_clear_sentence(tmp_path: Path, spoil: object, words: str) -> None:
    record(tmp_path)
    assert callable(spoil)
    spoil(tmp_path)
    with pytest.raises(BadInput, match=words):
        read_run(tmp_path)


def test_a_run_that_has_not_begun_or_has_another_grid_is_refused(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    with pytest.raises(BadInput, match="nothing has happened yet"):
        read_run(tmp_path)
    recorder.journal.set_meta("settings", {**SETTINGS.model_dump(), "sensor": {"cell_m": 40.0}})
    with pytest.raises(BadInput, match="another grid"):
        read_run(tmp_path)
    recorder.journal.close()


def test_gaps_are_the_cells_that_were_not_searched_well_and_are_worth_it(tmp_path: Path) -> None:
    run = read_run(record(tmp_path))
    cells = gap_cells(run, Wishes())
    average = 0.9 / run.grid.searchable.sum()
    assert cells.any()
    assert not (cells & (run.pod > 0.5)).any()
    assert (run.poa[cells] >= 0.5 * average).all()
    rest = run.grid.searchable & ~cells
    assert ((run.pod >= 0.5) | (run.poa < 0.5 * average))[rest].all()
    gaps = find_gaps(run, Wishes())
    assert sum(gap.poa for gap in gaps) == pytest.approx(run.poa[cells].sum())
    assert [gap.poa for gap in gaps] == sorted((gap.poa for gap in gaps), reverse=True)
    assert sum(gap.area_m2 for gap in gaps) == pytest.approx(
        (run.grid.covered[cells] * 400.0).sum(), rel=1e-6
    )
    assert find_gaps(run, Wishes(poa_above=1e6)) == []
    assert np.count_nonzero(gap_cells(run, Wishes(pod_below=1.0))) >= np.count_nonzero(cells)


@pytest.mark.parametrize("wrong", [{"pod_below": 0.0}, {"poa_above": -1.0}, {"minutes": 0.0}])
def test_a_wish_out_of_range_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(BadInput, match="--"):
        Wishes(**wrong)

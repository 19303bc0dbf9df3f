"""Regions that follow the belief: drawn beside the flight, journalled, the same when replayed and resumed."""

from __future__ import annotations

import threading
import time
import zlib
from base64 import b64encode
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from roisearch import Belief, Regions
from service.drawing import Drawing, RegionsRow, news_of
from service.evidence.observe import Observation
from service.redrawing import EVERY_S, Redrawing, Sketch
from service.resume import retrace_all
from service.rowbody import Body
from service.search import Search
from service.survey import JOURNAL
from service.view.replay import ReplayView
from tests.service.export.recorded import SETTINGS, Recorder, field_grid, record

NAMES = ("the burn", "the wood", "open ground")


def names(regions: Regions) -> tuple[str, ...]:
    return NAMES[: regions.count]


@pytest.fixture
def search(tmp_path: Path) -> Search:
    found = Search(field_grid(tmp_path), SETTINGS)
    found.common.redraw_by(Redrawing(0.2, found.grid.searchable, names))
    return found


def searched(search: Search, region: int) -> None:
    """All of a region has been looked at twice, and nothing was there."""
    cells = np.argwhere(search.regions.labels == region).repeat(2, axis=0)
    k = len(cells)
    no, sure = np.zeros(k, dtype=bool), np.full(k, 0.9)
    search.take(Observation(cells, no, sure, sure, np.ones(k, dtype=bool)))


def soon(search: Search, now: float) -> Sketch:
    """The drawing that becomes ready."""
    for _ in range(2000):
        if (sketch := search.redrawn(now)) is not None:
            return sketch
        time.sleep(0.01)
    raise AssertionError("nothing was drawn")


def test_regions_are_drawn_again_once_enough_has_moved(search: Search) -> None:
    assert search.redrawn(0.0) is None
    searched(search, 1)
    sketch = soon(search, EVERY_S)
    assert sketch.drawing.number == 1
    assert search.drawing.number == 0
    before = search.regions
    search.take_sketch(sketch)
    assert search.regions is sketch.drawing.regions
    assert sketch.drawing.words == news_of(before, search.regions, names(search.regions))
    assert search.redrawn(EVERY_S) is None  # nothing has moved since, and it was looked at just now


def test_nothing_is_drawn_while_nothing_has_moved(search: Search) -> None:
    search.redrawn(0.0)
    for beat in range(1, 4):
        assert search.redrawn(beat * EVERY_S) is None
        for thread in threading.enumerate():
            if thread.name == "regions":
                thread.join()
    assert search.drawing.number == 0


def test_drawing_waits_for_nobody(search: Search) -> None:
    """The names are never done: the flight is answered all the same, and no second thread is begun."""
    go_on = threading.Event()

    def never(regions: Regions) -> tuple[str, ...]:
        go_on.wait()
        return names(regions)

    search.common.redraw_by(Redrawing(0.2, search.grid.searchable, never))
    search.redrawn(0.0)
    searched(search, 1)
    assert [search.redrawn(beat * EVERY_S) for beat in range(1, 9)] == [None] * 8
    assert sum(thread.name == "regions" for thread in threading.enumerate()) == 1
    go_on.set()
    assert soon(search, 0.0).drawing.number == 1


def test_a_drawing_that_fails_costs_the_flight_nothing(
    search: Search, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(regions: Regions) -> tuple[str, ...]:
        raise RuntimeError("no names")

    search.common.redraw_by(Redrawing(0.2, search.grid.searchable, broken))
    search.redrawn(0.0)
    searched(search, 1)
    search.redrawn(EVERY_S)
    for _ in range(2000):
        assert search.redrawn(0.0) is None
        if caplog.records:
            break
        time.sleep(0.01)
    assert "goes on with those of before" in caplog.text


def test_news_name_the_ground() -> None:
    labels = np.array([[1, 1], [2, 2]], dtype=np.int32)
    none, here = np.zeros((3, 2)), np.zeros((3, 2), dtype=np.int64)
    before = Regions(labels, 2, none[:2], here[:2])
    after = Regions(np.where(labels == 1, 3, labels).astype(np.int32), 3, none, here)
    assert news_of(before, after, NAMES) == "region 3 (open ground) appeared, region 1 (the burn) is spent"
    assert news_of(before, before, NAMES) == ""


def drawn_run(folder: Path) -> tuple[Path, Drawing]:
    """A recorded run in whose middle the regions were drawn again."""
    recorder = Recorder(folder)
    search = Search(recorder.grid, SETTINGS)
    labels = np.where(search.regions.labels == 1, 0, search.regions.labels).astype(np.int32)
    labels[0, :] = search.regions.count + 1
    count = search.regions.count + 1
    none = np.zeros((count, 2))
    regions = Regions(labels, count, none, none.astype(np.int64), np.full(count + 1, 1 / (count + 1)))
    drawing = Drawing.of(1, regions, tuple(f"place {k}" for k in range(count)), "region 1 (place 0) is spent")
    recorder.start()
    recorder.look((1, 1))
    recorder.write("regions", **RegionsRow(drawing).body())
    recorder.look((2, 2))
    recorder.journal.close()
    return folder, drawing


def test_a_resumed_run_has_the_regions_that_it_had(tmp_path: Path) -> None:
    folder, drawing = drawn_run(tmp_path)
    search = Search(field_grid(folder), SETTINGS)
    retrace_all(folder / JOURNAL, search)
    assert search.drawing.number == 1
    assert search.drawing.names == drawing.names
    np.testing.assert_array_equal(search.regions.labels, drawing.regions.labels)


def test_a_replay_shows_the_regions_of_each_time(tmp_path: Path) -> None:
    folder, drawing = drawn_run(tmp_path)
    view = ReplayView(folder)
    first, last = view.span()
    assert view.state()["drawn"] == {"number": 1, "words": drawing.words}
    assert view.ground_now().described_regions()["names"] == list(drawing.names)
    assert len(view.state()["regions"]) == drawing.regions.count
    view.seek(first)
    assert view.state()["drawn"] == {"number": 0, "words": None}
    assert view.ground_now() is view.ground
    view.seek(last)
    assert view.ground_now().drawn == 1
    np.testing.assert_array_equal(view.ground_now().labels, drawing.regions.labels)


def test_names_stay_with_their_regions_and_new_ones_are_unlike_all_of_them(tmp_path: Path) -> None:
    view = ReplayView(record(tmp_path, found=True))
    before = view.names()
    regions = drawn_run_regions(view.search.regions)
    told = view.ground.named(regions, before)
    assert told[: len(before)] == before
    assert len(set(told)) == len(told) == regions.count


def drawn_run_regions(before: Regions) -> Regions:
    labels = before.labels.copy()
    labels[0, :], labels[-1, :] = before.count + 1, before.count + 2
    none = np.zeros((before.count + 2, 2))
    return Regions(labels, before.count + 2, none, none.astype(np.int64))


def body(**changed: Any) -> Body:
    regions = Regions(np.ones((2, 3), dtype=np.int32), 1, np.zeros((1, 2)), np.zeros((1, 2), dtype=np.int64),
                      np.array([0.0, 1.0]))  # fmt: skip
    return Body({**RegionsRow(Drawing.of(1, regions, ("a",))).body(), **changed})


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"labels": "AAAA"}, "damaged"),
        ({"labels": b64encode(zlib.compress(bytes(20))).decode()}, "20 bytes, not 24"),
        ({"labels": b64encode(zlib.compress(bytes(1 << 20))).decode()}, "25 bytes, not 24"),
        ({"labels": b64encode(zlib.compress(b"\x02\0\0\0" * 6)).decode()}, "from 2 to 2, with 1 regions"),
        ({"shape": [1 << 20, 1 << 20]}, "a map of"),
        ({"shares": [1.0]}, "1 shares"),
        ({"names": [1]}, "not a text"),
    ],
)
def test_a_damaged_row_of_regions_is_refused(changed: dict[str, Any], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        RegionsRow.read(body(**changed), 0.0)


def test_a_drawing_of_another_map_is_refused(search: Search) -> None:
    with pytest.raises(ValueError, match="cells, the search on"):
        search.take_drawing(RegionsRow.read(body(), 0.0).drawing)


def test_the_planner_takes_new_regions_between_two_decisions(search: Search) -> None:
    """In its own thread, where no decision is under way."""
    assert isinstance(search.belief, Belief)
    searched(search, 1)
    search.redrawn(0.0)
    sketch = soon(search, EVERY_S)
    where: list[str] = []
    search.take_sketch(
        Sketch(sketch.drawing, search.planner, lambda: where.append(threading.current_thread().name))
    )
    search.replan()
    search._thread.shutdown(wait=True)  # private: its queue is what is tested
    assert len(where) == 1
    assert where[0].startswith("planner")

"""What a watcher is sent: enough to have the map as it is, and no more than what has changed."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import Belief
from service.view.feed import Feed, Moment


class Watcher:
    """Does what the page's run.js does."""

    def __init__(self, cells: int) -> None:
        self.codes = np.zeros(cells, dtype=np.uint8)
        self.pod = np.zeros(cells, dtype=np.uint8)
        self.tracks: list[list[Any]] = []
        self.sent = 0

    def take(self, message: dict[str, Any]) -> None:
        self.belief = message["belief"]
        for target, news in ((self.codes, message["belief"]), (self.pod, message["pod"])):
            if "codes" not in news:
                continue
            codes = np.frombuffer(base64.b64decode(news["codes"]), dtype=np.uint8)
            self.sent += codes.size
            at = np.frombuffer(base64.b64decode(news["at"]), dtype="<u4") if "at" in news else slice(None)
            target[at] = codes
        for number, news in enumerate(message.get("tracks", [message.get("track")])):
            self.tracks += [[]] if number == len(self.tracks) else []
            if news is not None:
                self.tracks[number][news["from"] :] = news["rows"]

    def probability(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        octaves = self.belief["reference"] + (self.codes.astype(float) - 255) / 8
        return np.where(self.codes > 0, 2.0 ** (octaves - self.belief["log2_total"]), 0.0)


def moment(belief: Belief, pod: Any, *tracks: list[Any]) -> Moment:
    return Moment({"state": "SEARCHING"}, belief.weights, belief.total, pod, tracks, [], [])


looks = st.lists(st.tuples(st.integers(0, 11), st.booleans()), max_size=40)


@settings(deadline=None, max_examples=50)
@given(looks=looks, every=st.integers(1, 5))
def test_the_watcher_has_every_cell_to_a_step_of_the_scale(looks: list[tuple[int, bool]], every: int) -> None:
    searchable = np.arange(12).reshape(3, 4) != 5
    belief = Belief(np.arange(1.0, 13.0).reshape(3, 4), searchable=searchable, outside=0.1)
    feed, watcher, pod = Feed(searchable), Watcher(12), np.zeros((3, 4))
    watcher.take(feed.message(moment(belief, pod)))
    for number, (cell, hit) in enumerate(looks):
        if cell != 5:
            belief.observe([divmod(cell, 4)], [hit], 0.9, 0.99)
        pod[divmod(cell, 4)] = 1 - (1 - pod[divmod(cell, 4)]) * 0.1
        if number % every == 0:
            watcher.take(feed.message(moment(belief, pod)))
    watcher.take(feed.message(moment(belief, pod)))
    shown, true = watcher.probability(), belief.probability().ravel()
    assert (watcher.codes[~searchable.ravel()] == 0).all()
    visible = true > 1e-4
    assert np.allclose(shown[visible], true[visible], rtol=0.05)
    assert (shown[~visible] < 2e-4).all()
    assert np.abs(watcher.pod / 255 - pod.ravel()).max() <= 0.5 / 255 + 1e-12


def test_a_look_sends_the_cells_that_it_saw_and_not_the_map() -> None:
    belief = Belief(np.ones((100, 100)), outside=0.05)
    feed, watcher, pod = Feed(np.ones((100, 100), dtype=bool)), Watcher(10_000), np.zeros((100, 100))
    watcher.take(feed.message(moment(belief, pod)))
    assert watcher.sent == 20_000
    belief.observe([(3, 4), (3, 5)], [False, False], 0.9, 0.9)
    pod[3, 4:6] = 0.9
    watcher.take(feed.message(moment(belief, pod)))
    assert watcher.sent == 20_004
    assert set(feed.message(moment(belief, pod))["belief"]) == {"reference", "log2_total"}


def test_lists_grow_and_are_cut_when_time_is_set_back() -> None:
    belief = Belief(np.ones((2, 2)))
    feed, watcher, rows = Feed(np.ones((2, 2), dtype=bool)), Watcher(4), [[float(i), 0.0] for i in range(9)]
    for length in (3, 3, 7, 2, 9):
        message = feed.message(moment(belief, np.zeros((2, 2)), rows[:length]))
        watcher.take(message)
        assert watcher.tracks == [rows[:length]]
    assert message["track"]["from"] == 2


def test_each_of_several_aircraft_has_its_own_list_of_which_only_what_is_new_is_sent() -> None:
    belief = Belief(np.ones((2, 2)))
    feed, watcher = Feed(np.ones((2, 2), dtype=bool)), Watcher(4)
    kite, crow = ([[float(i), east] for i in range(9)] for east in (0.0, 1.0))
    said = []
    for far, near in ((3, 2), (5, 2), (5, 2), (2, 1), (9, 0)):
        message = feed.message(moment(belief, np.zeros((2, 2)), kite[:far], crow[:near]))
        watcher.take(message)
        assert watcher.tracks == [kite[:far], crow[:near]]
        assert "track" not in message
        said.append(message.get("tracks"))
    assert said[1] == [{"from": 3, "rows": kite[3:5]}, None]
    assert said[2] is None
    assert said[3] == [{"from": 2, "rows": []}, {"from": 1, "rows": []}]


def test_one_that_several_go_on_with_keeps_its_list() -> None:
    belief = Belief(np.ones((2, 2)))
    feed, watcher = Feed(np.ones((2, 2), dtype=bool)), Watcher(4)
    rows = [[float(i), 0.0] for i in range(4)]
    for tracks in ([rows[:2]], [rows[:3], rows[:1]], [rows[:2]], [rows, rows[:2]]):
        message = feed.message(moment(belief, np.zeros((2, 2)), *tracks))
        watcher.take(message)
        assert watcher.tracks[: len(tracks)] == tracks
        assert ("tracks" in message) == (len(tracks) > 1)

"""News at the door of a flight: each counts once under its id, and none is lost because of another one's."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.area import parse_area
from service.config import Settings
from service.errors import BadInput
from service.evidence.sensors import make_sensor
from service.journal import read_rows
from service.known import Withdrawn
from service.news.request import NewsRequest
from service.resume import retrace_all
from service.search import Search
from service.squad import Squad
from service.view.live import RunView
from sim.soak import ground
from tests.service.mission.aloft import aloft
from tests.service.mission.flown import GRID, place

pytestmark = pytest.mark.timeout(120)


def clue(name: str | None, bayes_factor: float = 20.0) -> NewsRequest:
    lat, lon = place(100.0, 100.0)
    said = {"role": "clue", "bayes_factor": bayes_factor, "sigma_m": 40.0, "words": "a glove"}
    feature: dict[str, Any] = {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [lon, lat]},
        "properties": said,
    }
    return NewsRequest.model_validate(feature | ({} if name is None else {"id": name}))


def told(folder: Path, ask: Callable[[RunView], Awaitable[None]]) -> int:
    """Ask the view of a flight; how many news its journal has then."""

    async def fly() -> None:
        async with aloft(folder) as mission:
            settings = mission.core.settings
            area = parse_area(json.dumps(ground.area()).encode(), source="field")
            view = RunView(area, mission.search, make_sensor(settings, GRID), settings, mission.clock)
            view.begin(Squad([mission], settings))
            await ask(view)

    asyncio.run(fly())
    return sum(1 for _ in read_rows(folder / "journal.sqlite", "news"))


def test_what_is_told_twice_in_one_moment_counts_once(tmp_path: Path) -> None:
    async def ask(view: RunView) -> None:
        heard = await asyncio.gather(*(view.hear(clue("team-3")) for _ in range(4)))
        assert sorted(each["status"] for each in heard) == ["accepted", *["duplicate"] * 3]
        unnamed = await asyncio.gather(*(view.hear(clue(None)) for _ in range(3)))
        assert len({each["id"] for each in unnamed}) == 3

    assert told(tmp_path, ask) == 4


def test_a_name_that_a_sender_has_used_is_not_given_to_other_news(tmp_path: Path) -> None:
    async def ask(view: RunView) -> None:
        await view.hear(clue("news-2"))
        assert (await view.hear(clue(None, 3.0)))["id"] == "news-3"
        heard = [await view.hear(clue(None, 3.0)) for _ in range(2)]
        assert {each["status"] for each in heard} == {"accepted"}

    assert told(tmp_path, ask) == 4


def test_an_id_that_comes_again_with_other_news_or_after_they_were_taken_back_is_refused(
    tmp_path: Path,
) -> None:
    async def ask(view: RunView) -> None:
        await view.hear(clue("team-3"))
        with pytest.raises(BadInput, match="news 'team-3' says something else than it did before; tell it"):
            await view.hear(clue("team-3", 5.0))
        await view.withdraw("team-3")
        with pytest.raises(BadInput, match="news 'team-3' was taken back; to tell it once more, give it"):
            await view.hear(clue("team-3"))
        with pytest.raises(BadInput, match="there is no news 'team-3' that could be taken back"):
            await view.withdraw("team-3")

    assert told(tmp_path, ask) == 1


def test_an_exclusion_outlives_the_process_and_can_be_taken_back_after_it(tmp_path: Path) -> None:
    flyable: list[Any] = []

    async def ask(view: RunView) -> None:
        corners = [
            place(*at) for at in ((90.0, 10.0), (110.0, 10.0), (110.0, 140.0), (90.0, 140.0), (90.0, 10.0))
        ]
        ground = {"type": "Polygon", "coordinates": [[[lon, lat] for lat, lon in corners]]}
        feature = {"type": "Feature", "geometry": ground, "properties": {"role": "exclude"}}
        heard = await view.hear(NewsRequest.model_validate(feature))
        assert heard["notes"] == list(view.search.grid.layout_notes[len(GRID.layout_notes) :])
        assert "cut off" in heard["notes"][0]
        flyable.append(view.search.grid.flyable)

    assert told(tmp_path, ask) == 1
    after = Search(GRID, Settings())
    retrace_all(tmp_path / "journal.sqlite", after)
    assert np.array_equal(after.grid.flyable, flyable[0])
    assert not np.array_equal(after.grid.flyable, GRID.flyable)
    after.take(Withdrawn("news-1"))
    assert np.array_equal(after.grid.flyable, GRID.flyable)

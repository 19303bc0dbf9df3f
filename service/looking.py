"""What a look is worth now: at which cells of a path, whether to stay for another, and what comes of those in vain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from service.evidence.overlooked import MOST_IN_VAIN
from service.geometry import Cell
from service.places import written
from service.search import Search


def worth_a_look(search: Search, path: Sequence[Cell]) -> frozenset[Cell]:
    """The cells of `path` that are at least as likely as the mean of those that can be searched; none over flat
    ground, where a look comes with every cell that is flown over."""
    if search.heights is None or not path:
        return frozenset()
    worth = likely(search, np.array(path, dtype=np.int64))
    return frozenset(cell for cell, is_worth in zip(path, worth.tolist(), strict=True) if is_worth)


def likely(search: Search, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether cells [k, 2] are at least as likely as the mean, and can be seen: bool [k]."""
    mean = 1.0 / max(1, int(np.count_nonzero(search.grid.searchable)))
    hidden = search.common.overlooked.cells[cells[:, 0], cells[:, 1]]
    return np.asarray((search.belief.mass_at(cells) >= mean) & ~hidden)


def pays_to_hover(search: Search, cells: Sequence[Cell]) -> bool:
    """Whether to look at one of these cells again now, hovering, since something was reported there.

    What was seen of a target that walks does not keep: it is somewhere else when the aircraft comes by again. So
    another look pays where its chance is worth the time that it takes, in seconds until the target is detected. Of
    one that stands still nothing is lost by going on, and it is looked at again when that is on the way.
    """
    if search.grid.walk is None or search.expected_s is None:
        return False
    took_s = search.settings.sensor.hover_look_s + search.motion.corner_seconds(180)
    least = took_s / max(took_s, search.expected_s) / float(search.fov.p_tp[0])
    hit = [cell for cell in cells if search.sightings.near(cell)]
    return bool(hit) and float(search.belief.mass_at(np.array(hit)).max()) >= least


def passed(search: Search, cell: Cell, heading: str, now: float) -> str:
    """The aircraft has entered a cell for a look; what follows for the plan, as a sentence, or nothing."""
    cells, _, _ = search.fov.looks(cell, heading, search.grid.frame.shape)
    given_up = search.common.passed(cells[likely(search, cells)], now)
    if not given_up:
        return ""
    ((lat, lon),) = search.grid.frame.to_latlon(np.array([cell]))
    where = written((float(lat), float(lon)), search.grid.coordinates)
    which = "a cell" if given_up == 1 else f"{given_up} cells"
    return (
        f"no look counted in {MOST_IN_VAIN} passes or more of {which} at {where}: taken as not to be seen from the "
        "air, so that needs a ground team"
    )


def place_in_sight(search: Search) -> bool:
    """Whether the most likely place can be looked at, as far as is known."""
    return not search.common.overlooked.cells[search.place.cell]

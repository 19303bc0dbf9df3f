"""The map of a moment for those who take it away: cell by cell, as GeoJSON, as a picture.

A map of a million cells is tens of megabytes of text, which takes seconds to write. So it is written row by row:
beside it, in the same process, others have their turn, where one call to write it all would hold the interpreter.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from service.area import SearchArea
from service.area.model import Exclusion
from service.chances import share, sure
from service.view.feed import Moment
from service.view.scene import SearchGround
from service.view.shapes import area_features, cell_features, feature, line, point

_CELLS_AT_ONCE = 500


def map_text(ground: SearchGround, moment: Moment, digest: str) -> bytes:
    """The belief and the probability of detection, cell by cell (null where nothing is searched), as JSON.

    `digest` is the belief's, in the same moment.
    """
    grid = ground.grid
    members = {
        "frame": _said(grid.frame.to_dict()),
        "corners": _said(grid.frame.corners().tolist()),
        "probability": _rows(_probability(ground, moment), grid.searchable),
        "pod": _rows(moment.pod, grid.searchable),
        "regions": _said(ground.labels.tolist()),
        "outside": _said(moment.state["outside"]),
        "digest": _said(digest),
        "reports": _said(moment.state["reports"]["accepted"]),
    }
    return ("{" + ",".join(f'"{name}":{text}' for name, text in members.items()) + "}").encode()


def geojson_text(ground: SearchGround, moment: Moment) -> bytes:
    """The map for other programs (RFC 7946): area, regions with their mass, cells, tracks, hits, the place found."""
    state = moment.state
    members = {name: _said(state[name]) for name in ("pos", "outside", "time")}
    features = ",".join(_said(each) for each in _features(ground, moment))
    head = ",".join(f'"{name}":{text}' for name, text in members.items())
    return f'{{"type":"FeatureCollection",{head},"features":[{features}]}}'.encode()


def _features(ground: SearchGround, moment: Moment) -> Iterator[dict[str, Any]]:
    state, grid = moment.state, ground.grid
    yield from area_features(ground.area, grid)
    for told in state["news"]:
        if told["geometry"] is not None:
            yield feature({**told["geometry"]}, told["role"], id=told["id"], words=told["words"])
    for outline in ground.outlines:
        number = outline["properties"]["number"]
        mass = state["regions"][number - 1]
        yield feature(outline["geometry"], "region", number=number, mass=mass)
    probability, cells = _probability(ground, moment), np.argwhere(grid.searchable)
    for start in range(0, len(cells), _CELLS_AT_ONCE):
        yield from cell_features(grid, probability, moment.pod, cells[start : start + _CELLS_AT_ONCE])
    for number, track in enumerate(moment.tracks):
        if len(track) > 1:
            whose = {"aircraft": state["aircraft"][number]["name"]} if len(moment.tracks) > 1 else {}
            yield feature(line(track), "track", **whose)
    for hit in moment.hits:
        yield feature(point(hit[0], hit[1]), "hit")
    if found := state["found"]:
        yield feature(point(found["lat"], found["lon"]), "found", probability=found["probability"])


def draw_map(ground: SearchGround, moment: Moment) -> bytes:
    """The map as a PNG; it takes long, and may be left to another thread."""
    from service.view.picture import PictureScene, draw_scene  # matplotlib: it takes long to import, too

    state = moment.state
    pose, found = state["pose"], state["found"]
    said = f"POS {share(state['pos'])}, {state['steps']} steps, {state['flight_time_s']:.0f} s in the air"
    if found:
        said += f" · found at {found['written']}"
        said += ", confirmed by an operator" if found["confirmed"] else f", {sure(found['probability'])} sure"
    return draw_scene(
        PictureScene(
            grid=ground.grid,
            probability=_probability(ground, moment),
            pod=moment.pod,
            labels=ground.labels,
            tracks=[_places(each) for each in moment.tracks],
            ahead=_places(state["ahead"]),
            hits=_places(moment.hits),
            aircraft=(pose["lat"], pose["lon"]) if pose else None,
            found=(found["lat"], found["lon"]) if found else None,
            title=f"{ground.area.name}: {state['words'].lower()}",
            subtitle=said,
            area=_area_now(ground, moment),
            names=ground.names,
        )
    )


def _area_now(ground: SearchGround, moment: Moment) -> SearchArea:
    """The area with what is excluded by then."""
    told = [
        each for each in moment.state["news"] if each["role"] == "exclude" and each["geometry"] is not None
    ]
    return replace(
        ground.area,
        exclusions=(
            *ground.area.exclusions,
            *(Exclusion(shapely.geometry.shape(each["geometry"]), True, "news") for each in told),
        ),
    )


def _places(rows: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    return [(row[0], row[1]) for row in rows]


def _probability(ground: SearchGround, moment: Moment) -> NDArray[np.float64]:
    return np.asarray(moment.weights / moment.total).reshape(ground.grid.frame.shape)


def _rows(values: NDArray[np.float64], inside: NDArray[np.bool_]) -> str:
    """Values, float [rows, cols], as JSON: null where not `inside`."""
    rows = (
        _said([value if shown else None for value, shown in zip(row.tolist(), mask.tolist(), strict=True)])
        for row, mask in zip(values, inside, strict=True)
    )
    return "[" + ",".join(rows) + "]"


def _said(value: Any) -> str:
    return json.dumps(value, allow_nan=False, separators=(",", ":"))

"""What the default planner works on, made for a map: the chart, the rules of the search, and room for a plan."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.fov import FieldOfView
from roisearch.ground import Ground, Part
from roisearch.kernels.records import Floats, Steps
from roisearch.planners.lookahead.chart import AREA, BLOCK, LEVELS, Chart, Wave
from roisearch.planners.lookahead.others import nobody
from roisearch.planners.lookahead.plans import PlanRules, PlanTree
from roisearch.planners.lookahead.settings import LookaheadSettings
from roisearch.regions import Regions

ROLLOUT_BALANCES = ((0.4, 1.0), (0.33, 1.0), (0.45, 1.0), (0.4, 2.0), (0.4, 0.3), (0.5, 2.0))
OPTION_BALANCES = ((0.25, 1.0), (0.6, 0.0), (1.0, 0.0), (0.4, 4.0))
"""Power and shift of the distance in the score of a cell: what a rollout draws from, and what an option also may."""


def make_chart(ground: Ground, part: Part, regions: Regions) -> Chart:
    """An empty chart of `part` of the ground, for its field of view: to be given a mass and drawn up."""
    rows, cols = ground.shape
    cells, fov = rows * cols, ground.fov
    spread, share = spread_of(fov)
    blocks = (-(-rows // BLOCK), -(-cols // BLOCK))
    areas = (-(-blocks[0] // BLOCK), -(-blocks[1] // BLOCK))
    districts = (-(-areas[0] // BLOCK), -(-areas[1] // BLOCK))
    kept = blocks[0] * blocks[1]  # a simulation may change every block; memory is taken only when it does
    room = [np.zeros(0 if ground.is_open else cells, dtype=np.int64) for _ in range(4)]
    labels, home, homes = region_map(regions, (rows, cols))
    mass = np.zeros(cells)
    tops, crests, levels = np.zeros(areas), np.zeros(districts), np.zeros((LEVELS, 2))
    return Chart(
        rows=rows,
        cols=cols,
        mass=mass,
        worth=mass if fov.is_point else np.zeros(cells),
        peaks=np.zeros(blocks),
        tops=tops,
        crests=crests,
        levels=levels,
        scale=np.ones(1),
        legal=part.legal,
        offsets=fov.offsets,
        p_tp=fov.p_tp,
        spread=spread,
        share=share,
        is_point=fov.is_point,
        is_open=ground.is_open,
        labels=labels,
        home=home,
        homes=homes,
        wave=Wave(room[0], room[1], room[2], room[3], np.zeros(1, dtype=np.int64)),
        stamp=np.zeros(kept, dtype=np.int64),
        log=np.zeros(kept, dtype=np.int64),
        old=np.zeros((kept, 2, BLOCK**2)),
        old_peak=np.zeros(kept),
        old_tops=np.zeros_like(tops),
        old_crests=np.zeros_like(crests),
        old_levels=np.zeros_like(levels),
        counters=np.zeros(2, dtype=np.int64),
        others=nobody(),
    )


def make_tree(settings: LookaheadSettings, regions: int) -> PlanTree:
    """Room for a plan on a map with so many regions."""
    most, nodes = 3 * settings.horizon + 4096, 2 + settings.horizon // settings.spacing
    return PlanTree(
        path=np.zeros(most, dtype=np.int64),
        trial=np.zeros(most, dtype=np.int64),
        action=np.zeros(most, dtype=np.int64),
        trial_action=np.zeros(most, dtype=np.int64),
        mark=np.zeros(4, dtype=np.int64),
        at=np.zeros(nodes, dtype=np.int64),
        value=np.zeros(3),
        **room_for_regions(nodes, regions)._asdict(),
    )


class RegionRoom(NamedTuple):
    """What of a plan's room depends on how many regions there are; see `PlanTree`."""

    stats: Floats
    worths: Floats
    scores: Floats


def room_for_regions(nodes: int, regions: int) -> RegionRoom:
    """Room for so many nodes and regions."""
    return RegionRoom(
        np.zeros((nodes, 6 + regions, 3)), np.zeros((nodes, 1 + regions)), np.zeros(1 + regions)
    )


def make_rules(settings: LookaheadSettings, ground: Ground) -> PlanRules:
    """The settings as the kernels take them, with distances as long as the ground may have them."""
    s, (rows, cols), p = settings, ground.shape, float(ground.fov.p_tp.max())
    farthest = rows + cols + 2 if ground.is_open else rows * cols + 2
    distance = np.arange(farthest, dtype=np.float64)
    nears = np.array(
        [np.maximum(distance + shift, 1.0) ** -power for power, shift in ROLLOUT_BALANCES + OPTION_BALANCES]
    )
    return PlanRules(
        nears=nears,
        followers=len(ROLLOUT_BALANCES),
        chain=s.chain,
        explore=s.explore,
        keep=s.keep,
        spread=s.spread,
        spacing=s.spacing,
        overhead=s.overhead,
        looks_per_halving=1.0 if p == 1.0 else float(np.log(2.0) / -np.log1p(-p)),
        looks_per_step=max(1.0, fresh_per_step(ground.fov)),
    )


def spread_of(fov: FieldOfView) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """From where a cell is seen: offsets int [n, 2], and p_tp from there over the headings, float [n]."""
    total: dict[tuple[int, int], float] = {}
    for seen in fov.offsets:
        for (row, col), p in zip(seen.tolist(), fov.p_tp.tolist(), strict=True):
            total[-row, -col] = total.get((-row, -col), 0.0) + p / 4.0
    return np.array(list(total), dtype=np.int64).reshape(-1, 2), np.array(list(total.values()))


def fresh_per_step(fov: FieldOfView) -> float:
    """How many new cells a step straight ahead sees."""
    now = {tuple(cell) for cell in fov.offsets[1].tolist()}
    before = {(row, col - back) for row, col in now for back in range(1, 8)}
    return float(len(now - before))


def region_map(regions: Regions, shape: tuple[int, int]) -> tuple[Steps, Steps, Steps]:
    """The region of each cell, the nearest one's for a cell in none, and the least and the largest in each block and in
    each area of a chart. Raises ValueError when the regions are of another map."""
    if regions.labels.shape != shape:
        raise ValueError(f"the regions have the shape {regions.labels.shape}, the map {shape}")
    labels = nearest_labels(regions.labels)
    return labels, labels_within(labels, shape, BLOCK), labels_within(labels, shape, AREA)


def nearest_labels(labels: NDArray[np.integer[Any]]) -> NDArray[np.int32]:
    """Each cell's region, and for a cell in none the nearest one's; 0 everywhere when there is no region."""
    from scipy import ndimage

    if not labels.any():
        return np.zeros(labels.size, dtype=np.int32)
    nearest = ndimage.distance_transform_edt(labels == 0, return_distances=False, return_indices=True)
    return np.ascontiguousarray(labels[tuple(nearest)].ravel(), dtype=np.int32)


def labels_within(labels: NDArray[np.int32], shape: tuple[int, int], size: int) -> NDArray[np.int32]:
    """The least and the largest label in each square of `size` x `size` cells: int [squares, 2], row by row."""
    rows, cols = shape
    full = np.pad(labels.reshape(shape), ((0, -rows % size), (0, -cols % size)), mode="edge")
    tiles = full.reshape(full.shape[0] // size, size, full.shape[1] // size, size)
    both = np.stack([tiles.min(axis=(1, 3)).ravel(), tiles.max(axis=(1, 3)).ravel()], axis=1)
    return np.ascontiguousarray(both, dtype=np.int32)

"""The planners by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from roisearch.fov import FieldOfView
from roisearch.planners.base import Planner
from roisearch.planners.greedy import GreedyPlanner
from roisearch.planners.index import IndexPlanner
from roisearch.planners.pattern import CoveragePlanner, SpiralPlanner
from roisearch.planners.policies import DirectPolicySearch
from roisearch.planners.puct import PuctPlanner
from roisearch.planners.settings import settings_for
from roisearch.planners.sweep import SweepPlanner
from roisearch.planners.sweep_settings import sweep_settings_for

_SHARED = ("flyable", "regions")


def _puct(name: str) -> Callable[..., Planner]:
    def make(*, fov: FieldOfView, preset: str = "default", **options: Any) -> Planner:
        shared = {key: options.pop(key) for key in _SHARED if key in options}
        if name == "puct-regions-lite" and preset == "default":
            return SweepPlanner(sweep_settings_for(name, options), name=name, fov=fov, **shared)
        preset = "default" if name == "puct-regions-lite" and preset == "trips" else preset
        return PuctPlanner(name, settings_for(name, preset, options), fov=fov, **shared)

    return make


_PLANNERS: dict[str, Callable[..., Planner]] = {
    "puct": _puct("puct"),
    "puct-regions": _puct("puct-regions"),
    "puct-regions-lite": _puct("puct-regions-lite"),
    "greedy": GreedyPlanner,
    "direct-policy-search": DirectPolicySearch,
    "coverage": CoveragePlanner,
    "spiral": SpiralPlanner,
    "index": IndexPlanner,
}

PLANNERS: tuple[str, ...] = tuple(_PLANNERS)
"""The names that `make_planner` knows."""


def make_planner(name: str, *, fov: FieldOfView, **options: Any) -> Planner:
    """The planner called `name`.

    Args:
        fov: the field of view of the sensor.
        options: for every planner `flyable` (bool [rows, cols]) and `regions` (segmented from the first
            belief unless given); for the PUCT planners `preset` ("default" or "paper") and any of
            `PuctSettings`; for the others see their classes.

    Raises:
        ValueError: when there is no such planner or option, or a value is out of range.
    """
    if name not in _PLANNERS:
        raise ValueError(f"there is no planner '{name}'; there is {', '.join(_PLANNERS)}")
    try:
        return _PLANNERS[name](fov=fov, **options)
    except TypeError as error:
        raise ValueError(f"{name}: {error}") from None

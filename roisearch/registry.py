"""The planners by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

from roisearch.fov import FieldOfView
from roisearch.planners.base import Planner
from roisearch.planners.coverage import CoveragePlanner
from roisearch.planners.index import IndexPlanner
from roisearch.planners.puct import PuctPlanner, PuctSettings

_SHARED = ("flyable", "regions")

_PAPER: dict[str, Any] = {
    "iterations": 40,
    "rollout": 60,
    "explore": 0.5,
    "factor": 8e-6,
    "penalty": None,
    "rollout_policy": "random",
    "goal": "peak",
    "elsewhere": False,
    "backup": "mean",
    "prior": "rewards",
    "choose": "visits",
}
_MODELS: dict[str, dict[str, Any]] = {
    "puct": {"options": False},
    "puct-regions": {"option_reward": "trip", "fades": True},
    "puct-regions-lite": {},
}
_PAPER_MODELS: dict[str, dict[str, Any]] = {
    "puct": {"options": False, "fades": False},
    "puct-regions": {"option_reward": "trip", "fades": True},
    "puct-regions-lite": {"option_reward": "density", "fades": False},
}


def _puct(name: str) -> Callable[..., Planner]:
    def make(*, fov: FieldOfView, preset: str = "default", **options: Any) -> Planner:
        if preset not in ("default", "paper"):
            raise ValueError(f"a preset is one of default, paper, not '{preset}'")
        known = {field.name for field in fields(PuctSettings)}
        shared = {key: options.pop(key) for key in _SHARED if key in options}
        unknown = sorted(set(options) - known)
        if unknown:
            raise ValueError(f"{name} has no option '{unknown[0]}'; it has {', '.join(sorted(known))}")
        base = {**_PAPER, **_PAPER_MODELS[name]} if preset == "paper" else _MODELS[name]
        return PuctPlanner(name, PuctSettings(**{**base, **options}), fov=fov, **shared)

    return make


_PLANNERS: dict[str, Callable[..., Planner]] = {
    "puct": _puct("puct"),
    "puct-regions": _puct("puct-regions"),
    "puct-regions-lite": _puct("puct-regions-lite"),
    "index": IndexPlanner,
    "coverage": CoveragePlanner,
}

PLANNERS: tuple[str, ...] = tuple(_PLANNERS)
"""The names that `make_planner` knows."""


def make_planner(name: str, *, fov: FieldOfView, **options: Any) -> Planner:
    """The planner called `name`.

    Args:
        fov: the field of view of the sensor.
        options: for every planner `flyable` (bool [rows, cols]) and `regions` (segmented from the first belief
            unless given); for the PUCT planners `preset` ("default" or "paper") and any of `PuctSettings`; for
            the others see their classes.

    Raises:
        ValueError: when there is no such planner or option, or a value is out of range.
    """
    if name not in _PLANNERS:
        raise ValueError(f"there is no planner '{name}'; there is {', '.join(_PLANNERS)}")
    try:
        return _PLANNERS[name](fov=fov, **options)
    except TypeError as error:
        raise ValueError(f"{name}: {error}") from None

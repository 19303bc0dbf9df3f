"""The planners by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from roisearch.fov import FieldOfView
from roisearch.motion import Motion
from roisearch.planners.base import Planner
from roisearch.planners.greedy import GreedyPlanner
from roisearch.planners.index import IndexPlanner
from roisearch.planners.lookahead.planner import LookaheadPlanner
from roisearch.planners.lookahead.settings import lookahead_settings_for
from roisearch.planners.outside import installed, is_outside
from roisearch.planners.outside import make as make_outside
from roisearch.planners.pattern import CoveragePlanner, SpiralPlanner
from roisearch.planners.policies import DirectPolicySearch
from roisearch.planners.puct.planner import PuctPlanner
from roisearch.planners.puct.presets import settings_for
from roisearch.planners.survey import SurveyPlanner
from roisearch.planners.tour.planner import TourPlanner
from roisearch.planners.tour.settings import tour_settings_for

_LITE = "puct-regions-lite"
_SHARED = ("flyable", "regions", "visibility")
_IN_SECONDS = ("survey",)
"""The planners, beside those by PUCT, that take a `motion`; the others count steps whatever it is."""


def _puct(name: str) -> Callable[..., Planner]:
    def make(
        *, fov: FieldOfView, preset: str = "default", motion: Motion | None = None, **options: Any
    ) -> Planner:
        heights = options.pop("heights", None)
        shared = {key: options.pop(key) for key in _SHARED if key in options}
        if name == _LITE and preset == "default":
            if motion is not None and not motion.is_steps and fov.is_point:
                settings = tour_settings_for(name, options)
                return TourPlanner(settings, name=name, fov=fov, motion=motion, heights=heights, **shared)
            return LookaheadPlanner(lookahead_settings_for(name, options), name=name, fov=fov, **shared)
        return PuctPlanner(name, settings_for(name, preset, options), fov=fov, **shared)

    return make


_PLANNERS: dict[str, Callable[..., Planner]] = {
    "puct": _puct("puct"),
    "puct-regions": _puct("puct-regions"),
    _LITE: _puct(_LITE),
    "greedy": GreedyPlanner,
    "direct-policy-search": DirectPolicySearch,
    "coverage": CoveragePlanner,
    "spiral": SpiralPlanner,
    "index": IndexPlanner,
    "survey": SurveyPlanner,
}

PLANNERS: tuple[str, ...] = tuple(_PLANNERS)
"""The names that `make_planner` knows."""


def make_planner(name: str, *, fov: FieldOfView, **options: Any) -> Planner:
    """The planner called `name`: one of PLANNERS, `package.module:Class`, or an entry point (`planners.outside`).

    Args:
        fov: the field of view of the sensor.
        options: for every planner `flyable` (bool [rows, cols]) and `regions` (segmented from the first
            belief unless given) and `motion`, what a path costs in seconds: `survey`, and `puct-regions-lite` with
            a point field of view, plan by it and to eight neighbours; for the PUCT planners `preset` ("default",
            "paper" or "reference") and any of `PuctSettings`, but for `puct-regions-lite` by default any of
            `LookaheadSettings`, or with such a motion of `TourSettings`; for the others see their classes. One from
            outside is given of `flyable`, `regions`, `motion`, `visibility` and `heights` what its constructor takes.
            `visibility` (float [rows, cols], 0 to 1) is how much of the field of view's p_tp a look has at each cell:
            `puct-regions-lite` plans with it by default, the others take all cells alike. `heights` (float
            [rows, cols], metres at which each cell is flown over) belong to `motion`: where climbs and descents take
            longer than the way across, those that plan in seconds know it.

    Raises:
        ValueError: when there is no such planner or option, or a value is out of range.
    """
    if name not in _PLANNERS and is_outside(name):
        try:
            return cast(Planner, make_outside(name, {"fov": fov, **options}))
        except TypeError as error:
            raise ValueError(f"the planner '{name}' cannot be made: {error}; see BasePlanner") from None
    if name not in _PLANNERS:
        raise ValueError(f"there is no planner '{name}'; there is {', '.join((*_PLANNERS, *installed()))}")
    if name != _LITE or options.get("preset", "default") != "default":
        options.pop("visibility", None)
    if not name.startswith("puct") and name not in _IN_SECONDS:
        options.pop("motion", None)
        options.pop("heights", None)
    try:
        return _PLANNERS[name](fov=fov, **options)
    except TypeError as error:
        raise ValueError(f"{name}: {error}") from None

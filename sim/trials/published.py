"""What the paper prints: its table, and what its text says of its figures (which are not to be had as numbers)."""

from __future__ import annotations

TIME_PER_STEP_MS: dict[str, tuple[float, float, float, float, float]] = {
    # table I: 5th, 25th, 50th, 75th and 95th percentile
    "puct-regions-lite": (23.38, 27.92, 38.11, 47.97, 59.10),
    "puct-regions": (41.82, 56.87, 66.55, 75.50, 87.06),
    "puct": (11.56, 18.67, 18.80, 19.84, 19.91),
    "direct-policy-search": (40.49, 51.82, 53.93, 58.58, 59.04),
    "greedy": (24.35, 28.05, 33.19, 37.63, 41.02),
}
LITE_CHEAPER = 0.57
"""'reduced the median time per step by 57 %' beside Regions; its own table says 43 %."""
LITE_MORE_STEPS = 0.61
"""'an increased number of steps per trial by 61 %' beside Regions, on median."""
BEAT_BEST_QUARTER_OF_PUCT = 0.75
"""'~75 % of PUCT Regions and PUCT Regions Lite trials ... in fewer steps than the best ~25 % of PUCT trials'."""
GREEDY_ABOVE_PUCT = 6934
"""'its median result was still ~6934 steps longer than that of PUCT'."""
DPS_OVER_LIMIT = 0.50
"""'over 50 % of DPS trials exceeded the maximum number of steps'."""
MULTI_CELL_P95 = 0.25
"""'the multi-cell FOV have a 95th percentile ~25 % of the point observation'."""
SEEN = {"puct-regions": 0.0596, "puct-regions-lite": 0.0971}
"""Median share of the map that was looked at."""

NAMES = {
    "puct-regions-lite": "PUCT Regions Lite",
    "puct-regions": "PUCT Regions",
    "puct": "PUCT",
    "direct-policy-search": "Direct Policy Search",
    "greedy": "Greedy",
    "index": "Index",
    "coverage": "Coverage",
    "spiral": "Spiral",
}


def base_name(spec: str) -> str:
    """The planner's name without what was asked of it."""
    return spec.partition(":")[0].partition("@")[0]


def time_per_step(spec: str) -> tuple[float, float, float, float, float] | None:
    """The published percentiles for this planner, in ms, if there are any."""
    return TIME_PER_STEP_MS.get(base_name(spec))


def shown(spec: str) -> str:
    """The name of a planner for people: the paper's, with what was asked of it beside."""
    name = base_name(spec)
    return NAMES.get(name, name) + spec[len(name) :].replace("@", " @")

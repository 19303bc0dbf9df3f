"""The settings of the PUCT planners by name: ours, the paper's, and those of the authors' research code."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from roisearch.planners.puct.settings import PuctSettings

_PAPER: dict[str, Any] = {
    "iterations": 40,
    "rollout": 60,
    "rollout_policy": "random",
    "explore": 0.5,
    "discount": 0.99,
    "penalty": None,
    "gain": "mass",
    "most_regions": None,
    "elsewhere": False,
    "goal": "peak",
    "factor": 8e-6,
    "backup": "mean",
    "prior": "rewards",
    "choose": "visits",
    "commit": "trip",
}
"""The paper's values, and where it is silent the plain textbook choice. Its value normalisation and random
rollouts are ours: without the first, masses of 1e-4 beside c = 0.5 make the search a round robin."""

_REFERENCE: dict[str, Any] = {**_PAPER, "rollout_policy": "repeat", "normalise": False}
"""As the authors' public research code fills the gaps: Q = W / (1 + n), rollouts that repeat one move."""

_MODELS: dict[str, dict[str, dict[str, Any]]] = {
    # model: preset: what the model sets
    "puct": {"default": {"options": False}, "paper": {"options": False, "fades": True}},
    "puct-regions": {"default": {}, "paper": {"option_reward": "trip", "fades": True}},
    "puct-regions-lite": {"paper": {"option_reward": "density", "fades": False}},  # default: see `lookahead`
}

PRESETS = ("default", "paper", "reference")


def settings_for(name: str, preset: str, options: dict[str, Any]) -> PuctSettings:
    """The settings of planner `name` under a preset, with single `options` changed.

    Raises:
        ValueError: when the preset or an option does not exist or has no such value.
    """
    if preset not in PRESETS:
        raise ValueError(f"a preset is one of {', '.join(PRESETS)}, not '{preset}'")
    known = {field.name for field in fields(PuctSettings)}
    unknown = sorted(set(options) - known)
    if unknown:
        raise ValueError(f"{name} has no option '{unknown[0]}'; it has {', '.join(sorted(known))}")
    base = {"default": {}, "paper": _PAPER, "reference": _REFERENCE}[preset]
    model = _MODELS[name]["default" if preset == "default" else "paper"]
    return PuctSettings(**{**base, **model, **options})

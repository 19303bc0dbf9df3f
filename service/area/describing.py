"""Priors in words: what each is, and how much of the whole it makes up."""

from __future__ import annotations

from service.area.model import LinePrior, PointPrior, Prior, RingPrior, SearchArea


def described_priors(area: SearchArea) -> list[str]:
    """A sentence for each prior of an area, in the file's order."""
    whole = sum(prior.weight for prior in area.priors)
    return [f"{prior.weight / whole:.0%} {what(prior)}: {prior.label}" for prior in area.priors]


def few(value: float) -> str:
    """A number for people: whole from ten on, two figures below."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"


def what(prior: Prior) -> str:
    """What a prior is, in a few words."""
    if isinstance(prior, PointPrior):
        return f"around a point, sigma_m = {prior.sigma_m:g}"
    if isinstance(prior, LinePrior):
        return f"along a line, {prior.width_m:g} m wide"
    if isinstance(prior, RingPrior):
        near, half, most, nearly_all = (few(each / 1000) for each in prior.rings_m)
        return f"rings of {near}, {half}, {most} and {nearly_all} km ({prior.about})"
    return "even over a polygon"

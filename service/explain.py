"""A decision in words: where to, how much is there, how far it is, and what else was weighed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from roisearch import Decision, Regions
from roisearch.directions import DIRECTIONS
from service.chances import share
from service.geometry import Cell
from service.reasons import Option, Reason

MOST_OPTIONS = 12


def explain(
    decision: Decision, cell: Cell, probability: NDArray[np.float64], regions: Regions, cell_m: float
) -> Reason:
    """The reason of a decision that was made at `cell`, with `probability` [rows, cols] as it is now.

    The options are those that the planner weighed, then the regions that it did not, without visits and value. A
    planner that follows a plan weighs none: chosen is then the first region on its way.
    """
    ground = _Ground(cell, probability, regions, cell_m)
    ranked = sorted(decision.alternatives, key=lambda each: (each.action != decision.action, -each.visits))
    weighed = [
        _option(each.action, each.region, each.visits, each.value, decision, ground) for each in ranked
    ]
    known = {option.region for option in weighed}
    others = [
        _option(f"region {number}", number, 0, None, decision, ground)
        for number in regions.numbers
        if number not in known
    ]
    if not weighed:
        first = ground.first(decision)
        others = [replace(option, chosen=option.region == first) for option in others]
    others.sort(key=lambda option: (not option.chosen, -(option.mass or 0.0)))
    options = (*weighed, *others)[:MOST_OPTIONS]
    rates = {option.action: ground.rate(option) for option in options if option.mass}
    best = max(rates, key=lambda action: rates[action], default="")
    options = tuple(
        replace(option, words=option.words + ", best rate")
        if option.action == best and len(rates) > 1
        else option
        for option in options
    )
    named = options if weighed else ()
    chosen = next((option for option in named if option.chosen and option.mass is not None), None)
    return Reason(chosen.words if chosen else ground.along(decision), options)


@dataclass(frozen=True)
class _Ground:
    """Where the aircraft is in its belief."""

    cell: Cell
    probability: NDArray[np.float64]
    regions: Regions
    cell_m: float

    @cached_property
    def masses(self) -> NDArray[np.float64]:
        """The mass outside all regions, and of each."""
        count = self.regions.count + 1
        return np.asarray(
            np.bincount(self.regions.labels.ravel(), self.probability.ravel(), count), np.float64
        )

    @cached_property
    def likeliest(self) -> NDArray[np.int64]:
        """The likeliest cell outside all regions, and of each, the first of equal ones; flat."""
        labels, there = self.regions.labels.ravel(), self.probability.ravel()
        top = np.zeros(self.regions.count + 1)
        np.maximum.at(top, labels, there)
        tops = np.flatnonzero(there == top[labels])[::-1]
        cells = np.zeros(top.size, dtype=np.int64)
        cells[labels[tops]] = tops  # of cells of one region the last is kept
        return cells

    def survey(self, region: int) -> tuple[float, float | None]:
        """The mass of a region (0: outside all), and the metres to its likeliest cell."""
        if self.masses[region] <= 0.0:
            return 0.0, None
        row, col = divmod(int(self.likeliest[region]), self.probability.shape[1])
        return float(self.masses[region]), self.metres((row, col))

    def metres(self, there: Cell) -> float:
        """Metres from the aircraft along the grid."""
        return (abs(self.cell[0] - there[0]) + abs(self.cell[1] - there[1])) * self.cell_m

    def rate(self, option: Option) -> float:
        """Mass for each metre of the way there."""
        away = self.cell_m if option.distance_m is None else max(option.distance_m, self.cell_m)
        return (option.mass or 0.0) / away

    def first(self, decision: Decision) -> int:
        """The first region on its way; 0 when there is none."""
        on_way = (int(self.regions.labels[cell]) for cell in (self.cell, *decision.path))
        return next((region for region in on_way if region), 0)

    def along(self, decision: Decision) -> str:
        """A plan without one goal: the first two regions on its way, with what they hold."""
        said: list[str] = []
        named: set[int] = set()
        for steps, cell in enumerate((self.cell, *decision.path)):
            region = int(self.regions.labels[cell])
            if region and region not in named and len(named) < 2:
                named.add(region)
                said.append(_where(f"region {region}", region, self.survey(region)[0], steps * self.cell_m))
        if said:
            return "; then ".join(said)
        cells = np.array(sorted(set(decision.path)))
        mass = float(self.probability[cells[:, 0], cells[:, 1]].sum())
        return (
            f"open ground: {_percent(mass)} of the mass on the next {len(decision.path) * self.cell_m:.0f} m"
        )


def _option(
    action: str, region: int | None, visits: int, value: float | None, decision: Decision, ground: _Ground
) -> Option:
    mass, away = (None, None)
    if region is not None or action == "elsewhere":
        mass, away = ground.survey(region or 0)
    chosen = action == decision.action
    return Option(action, region, visits, value, mass, away, chosen, _where(action, region, mass, away))


def _where(action: str, region: int | None, mass: float | None, away: float | None) -> str:
    """An option in words, such as 'ROI 3: 12 % of the mass, 240 m'."""
    if region is not None:
        name = f"ROI {region}"
    elif action in DIRECTIONS:
        name = f"one cell {action}" if mass is None else "open ground"
    else:
        name = "outside all ROIs" if action == "elsewhere" else action
    parts = [f"{_percent(mass)} of the mass"] if mass is not None else []
    parts += [f"{away:.0f} m" if away else "here"] if away is not None else []
    return f"{name}: {', '.join(parts)}" if parts else name


def _percent(part: float) -> str:
    """Whole percents, and one figure of what is less than one."""
    percent = 100 * part
    if percent >= 0.95 or percent == 0.0:
        return share(part) if percent >= 1.0 else f"{percent:.0f} %"
    return f"{percent:.1g} %" if percent >= 0.001 else "under 0.001 %"

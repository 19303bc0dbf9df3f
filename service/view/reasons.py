"""A decision in words: where to, how much is there, how far it is, and what else was weighed."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import Decision, Regions

Cell = tuple[int, int]
MOST_OPTIONS = 12


@dataclass(frozen=True)
class Option:
    """One way on that the planner weighed.

    `mass` is the probability of the region it leads to and `distance_m` the way to that region's likeliest cell
    along the grid; both are None for a single move. `visits` and `value` are the planner's own measures; it did
    not weigh an option without them.
    """

    action: str
    region: int | None
    visits: int
    value: float | None
    mass: float | None
    distance_m: float | None
    chosen: bool
    words: str


@dataclass(frozen=True)
class Reason:
    """Why the aircraft goes where it goes, for a person: one line, and the root options, the chosen one first."""

    text: str
    options: tuple[Option, ...] = ()

    def rows(self) -> list[dict[str, Any]]:
        """The options as JSON has them."""
        return [asdict(option) for option in self.options]


def explain(
    decision: Decision, cell: Cell, probability: NDArray[np.float64], regions: Regions, cell_m: float
) -> Reason:
    """The reason of a decision that was made at `cell`, with `probability` [rows, cols] as it is now.

    The options are those that the planner weighed, then the regions that it did not, without visits and value.
    """
    ground = _Ground(cell, probability, regions, cell_m)
    ranked = sorted(decision.alternatives, key=lambda each: (each.action != decision.action, -each.visits))
    weighed = [
        _option(each.action, each.region, each.visits, each.value, decision, ground) for each in ranked
    ]
    known = {option.region for option in weighed}
    others = [
        _option(f"region {number}", number, 0, None, decision, ground)
        for number in range(1, regions.count + 1)
        if number not in known
    ]
    others.sort(key=lambda option: -(option.mass or 0.0))
    options = (*weighed, *others)[:MOST_OPTIONS]
    rates = {option.action: ground.rate(option) for option in options if option.mass}
    best = max(rates, key=lambda action: rates[action], default="")
    options = tuple(
        replace(option, words=option.words + ", best rate")
        if option.action == best and len(rates) > 1
        else option
        for option in options
    )
    chosen = next((option for option in options if option.chosen and option.mass is not None), None)
    return Reason(chosen.words if chosen else ground.along(decision), options)


@dataclass(frozen=True)
class _Ground:
    """Where the aircraft is in its belief."""

    cell: Cell
    probability: NDArray[np.float64]
    regions: Regions
    cell_m: float

    def survey(self, region: int) -> tuple[float, float | None]:
        """The mass of a region (0: outside all), and the metres to its likeliest cell."""
        inside = np.where(self.regions.labels == region, self.probability, 0.0)
        if inside.max() <= 0.0:
            return 0.0, None
        row, col = np.unravel_index(int(inside.argmax()), inside.shape)
        return float(inside.sum()), self.metres((int(row), int(col)))

    def metres(self, there: Cell) -> float:
        """Metres from the aircraft along the grid."""
        return (abs(self.cell[0] - there[0]) + abs(self.cell[1] - there[1])) * self.cell_m

    def rate(self, option: Option) -> float:
        """Mass for each metre of the way there."""
        away = self.cell_m if option.distance_m is None else max(option.distance_m, self.cell_m)
        return (option.mass or 0.0) / away

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
    elif action in ("north", "east", "south", "west"):
        name = f"one cell {action}" if mass is None else "open ground"
    else:
        name = "outside all ROIs" if action == "elsewhere" else action
    parts = [f"{_percent(mass)} of the mass"] if mass is not None else []
    parts += [f"{away:.0f} m" if away else "here"] if away is not None else []
    return f"{name}: {', '.join(parts)}" if parts else name


def _percent(part: float) -> str:
    return f"{100 * part:.0f} %" if part >= 0.0995 or part == 0.0 else f"{100 * part:.1g} %"

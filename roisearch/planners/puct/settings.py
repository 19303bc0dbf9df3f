"""What can be set about PUCT over the paper's models; `roisearch.planners.puct.presets` has the paper's values."""

from __future__ import annotations

from dataclasses import dataclass

CODES: dict[str, tuple[str, ...]] = {
    # in the order of the numbers in planners.puct.records
    "rollout_policy": ("random", "repeat", "steepest"),
    "option_reward": ("density", "trip"),
    "backup": ("mean", "max"),
    "prior": ("uniform", "rewards", "index"),
    "choose": ("visits", "value"),
    "goal": ("peak", "index"),
    "commit": ("never", "trip", "margin"),
    "gain": ("mass", "detection"),
}


@dataclass(frozen=True)
class PuctSettings:
    """What can be set about the search; the defaults are those of `puct-regions`.

    Attributes:
        iterations: simulations a decision, None for as many as the deadline allows. Paper: 40.
        rollout: moves after the new node. Paper: 60.
        rollout_policy: "steepest" goes to the neighbour that sees most, straight on among equals; "random"
            draws each move; "repeat" repeats one drawn move (reference code).
        explore: c of the PUCT score. Paper: 0.5.
        discount: of each further step; the paper has none, the reference code 0.99.
        penalty: d, the time penalty of a step, in probability; None for 1 / number of cells. The paper gives
            no value; of this order, a step on empty ground is worth less than an option.
        gain: what a look at a cell counts: its "mass" (paper), or its chance of "detection", p_tp * mass.
        options: whether there are options to go to the regions.
        most_regions: the most regions that a decision has options for, those that promise most from where the drone is
            (`puct.choosing`), the ground outside all regions counted as one; None for all of them.
        elsewhere: whether the ground outside all regions is one more region to go to.
        goal: where an option goes: "peak", the region's most probable cell (paper), or "index", its cell with
            the largest m ** alpha / steps from the drone.
        option_reward: "density", the lite model's f * mean mass / (A^2 * distance), or "trip", what the
            option sees on its way, as in the BMDP-O.
        factor: f of the lite model. Paper: 8e-6.
        area: A of the lite model, in maps. With the whole map as the unit the printed f makes an option
            worth a little more than nothing, and a step on empty ground is worth a little less than nothing.
        fades: whether what the tree has seen fades by 1 - p_tp (the paper's in-tree belief update).
        backup: "mean" or "max" of the returns. The model is deterministic, so the best return is attainable.
        normalise: scale Q to 0 .. 1 over the tree's values before the exploration term is added; else the
            sum of returns / (1 + n), as in the reference code.
        prior: P(a) from the one-step "rewards" (paper), from m ** alpha / steps ("index"), or "uniform".
        choose: the root action with most "visits" or the best "value".
        commit: "trip" flies a chosen option to its end unless a hit arrives (reference code); "margin" keeps
            it unless a new search finds an option better by more than `margin`; "never" starts afresh each
            time.
        margin: how much better, relative to the kept option's value.
        floor: what the least promising action gets of P(a), the best getting 1 + floor, before scaling.
        alpha: exponent of the mass in "index".
        depth: the most actions down the tree in one iteration.
    """

    iterations: int | None = 100
    rollout: int = 60
    rollout_policy: str = "steepest"
    explore: float = 0.5
    discount: float = 0.99
    penalty: float | None = 0.0
    gain: str = "detection"
    options: bool = True
    most_regions: int | None = 8
    elsewhere: bool = True
    goal: str = "index"
    option_reward: str = "trip"
    factor: float = 8e-6
    area: float = 1.0
    fades: bool = True
    backup: str = "max"
    normalise: bool = True
    prior: str = "index"
    choose: str = "value"
    commit: str = "margin"
    margin: float = 0.0
    floor: float = 0.1
    alpha: float = 2.5
    depth: int = 64

    def __post_init__(self) -> None:
        for name, allowed in CODES.items():
            if getattr(self, name) not in allowed:
                raise ValueError(f"{name} is one of {', '.join(allowed)}, not '{getattr(self, name)}'")
        if self.iterations is not None and self.iterations < 1:
            raise ValueError(f"iterations must be at least 1, or None with a deadline, not {self.iterations}")
        if self.most_regions is not None and self.most_regions < 1:
            raise ValueError(f"most_regions must be at least 1, or None for all, not {self.most_regions}")
        for name, least in (("rollout", 0), ("depth", 1)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, not {getattr(self, name)}")
        for name in ("alpha", "area"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")
        if not 0.0 < self.discount <= 1.0:
            raise ValueError(f"discount must be above 0 and at most 1, not {self.discount}")

    def code(self, name: str) -> int:
        """The number of a named choice in `planners.puct.records`."""
        return CODES[name].index(getattr(self, name))

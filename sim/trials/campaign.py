"""What a campaign is: its settings, its jobs, and the seeds that make each job the same everywhere."""

from __future__ import annotations

import hashlib
import io
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import PLANNERS, FieldOfView, Planner, make_planner
from roisearch.planners.outside import is_outside
from sim.scenario import PAPER_SHAPE, PAPER_START, PAPER_STEPS, paper_prior

FOVS = ("point", "donut", "wide-angle")
PAPER_PLANNERS = ("puct-regions-lite", "puct-regions", "puct", "direct-policy-search", "greedy")
PAPER_POINT_ONLY = ("puct", "direct-policy-search", "greedy")
PAPER_TRIALS = 250
SEARCH, CURVE, BOUND = "search", "curve", "bound"


@dataclass(frozen=True, slots=True)
class Job:
    """One piece of work: a sampled `search`, a detection `curve`, or a `bound` (which has no planner)."""

    kind: str
    planner: str
    fov: str
    trial: int


@dataclass(frozen=True)
class Scenario:
    """A map to search.

    Attributes:
        prior: float [rows, cols], sums to 1 over the map.
        flyable: bool [rows, cols], None for everything.
    """

    prior: NDArray[np.float64]
    flyable: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Campaign:
    """All that decides the numbers of a campaign; where and on how many workers it runs does not.

    Attributes:
        planners: names as `make_planner` knows them, each with `@preset` and `:option=value` if wanted.
        fovs: names of fields of view.
        first_fov_only: those of the planners that fly with the first field of view only.
        trials: how many sampled searches a scenario (a planner with a field of view) has.
        curves: how many detection curves a scenario has; the first priors are used.
        seed: trial i draws everything from the i-th child of this seed, whatever the planner.
        found: "hit", the search ends with the first true hit; "covered", with the target first in view.
        preset: for the planners that have presets and do not name one.
        cap: the most steps of a search.
        iterations: of the tree searches; None leaves them as the preset has them, or as the deadline allows.
        deadline_s: of every decision, or None.
        p_tp, p_tn: the detector, in every cell of the field of view.
        shape, start: of the paper's map; the heading at the start is north.
        tail: a detection curve is followed until less than this probability is left undetected.
        prior: hash of the map that is searched instead of the paper's random ones, empty for those.
    """

    planners: tuple[str, ...]
    fovs: tuple[str, ...] = ("point",)
    first_fov_only: tuple[str, ...] = ()
    trials: int = 100
    curves: int = 0
    seed: int = 1
    found: str = "hit"
    preset: str = "default"
    cap: int = PAPER_STEPS
    iterations: int | None = None
    deadline_s: float | None = None
    p_tp: float = 0.9
    p_tn: float = 0.9
    shape: tuple[int, int] = PAPER_SHAPE
    start: tuple[int, int] = PAPER_START
    tail: float = 1e-4
    prior: str = ""
    prior_data: bytes = field(default=b"", repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in self.fovs:
            if name not in FOVS:
                raise ValueError(f"there is no field of view '{name}'; there is {', '.join(FOVS)}")
        if self.found not in ("hit", "covered"):
            raise ValueError(f"found is 'hit' or 'covered', not '{self.found}'")
        if not self.planners or not self.fovs:
            raise ValueError("a campaign needs a planner and a field of view")
        for name in ("planners", "fovs"):
            if len(set(getattr(self, name))) < len(getattr(self, name)):
                raise ValueError(f"one of the {name} is named twice")
        if self.trials < 0 or self.curves < 0 or self.trials + self.curves == 0:
            raise ValueError("a campaign needs at least one trial")
        if self.cap < 1:
            raise ValueError(f"cap must be at least 1 step, not {self.cap}")
        if not 0.0 < self.p_tp <= 1.0 or not 0.0 < self.p_tn <= 1.0:
            raise ValueError("p_tp and p_tn must be above 0 and at most 1")
        rows, cols = self.shape
        if rows < 2 or cols < 2:
            raise ValueError(f"the map must have at least 2 rows and 2 columns, not {rows} x {cols}")
        if not (0 <= self.start[0] < rows and 0 <= self.start[1] < cols):
            raise ValueError(f"the start {self.start} is not on the map of {rows} x {cols} cells")
        for planner in self.planners:
            self.planner(planner, self.fovs[0], None)

    def to_dict(self) -> dict[str, Any]:
        """The settings as plain JSON values."""
        values = asdict(self)
        del values["prior_data"]
        return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}

    @property
    def deterministic(self) -> bool:
        """Whether the same settings give the same numbers: not with a deadline."""
        return self.deadline_s is None

    def scenarios(self) -> list[tuple[str, str]]:
        """The pairs of planner and field of view, in the order of a report."""
        return [
            (planner, fov)
            for fov in self.fovs
            for planner in self.planners
            if fov == self.fovs[0] or planner not in self.first_fov_only
        ]

    def jobs(self) -> list[Job]:
        """Every job, trial by trial, so that an interrupted campaign holds whole comparisons."""
        scenarios = self.scenarios()
        jobs = []
        for trial in range(max(self.trials, self.curves)):
            jobs += [Job(BOUND, "", fov, trial) for fov in self.fovs]
            for planner, fov in scenarios:
                if trial < self.curves:
                    jobs.append(Job(CURVE, planner, fov, trial))
                if trial < self.trials:
                    jobs.append(Job(SEARCH, planner, fov, trial))
        return jobs

    def search_of(self, job: Job) -> Job | None:
        """The search whose result comes with that of `job`, a curve: see `sim.trials.trial.run_job`."""
        if job.kind == CURVE and self.found == "covered" and job.trial < self.trials:
            return replace(job, kind=SEARCH)
        return None

    def fov(self, name: str) -> FieldOfView:
        """The field of view of that name, with the campaign's detector."""
        makers = {
            "point": FieldOfView.point,
            "donut": FieldOfView.donut,
            "wide-angle": FieldOfView.wide_angle,
        }
        return makers[name](self.p_tp, self.p_tn)

    def planner(self, spec: str, fov: str, flyable: NDArray[np.bool_] | None) -> Planner:
        """A new planner as `spec` says.

        Raises:
            ValueError: when there is no such planner, preset or option.
        """
        name, preset, options = parse_planner(spec)
        if name not in PLANNERS and not is_outside(name):
            raise ValueError(f"there is no planner '{name}'; there is {', '.join(PLANNERS)}")
        if name in PLANNERS and name.startswith("puct"):
            options = {"preset": preset or self.preset, **options}
            if self.iterations is not None or self.deadline_s is not None:
                options.setdefault("iterations", self.iterations)
        elif preset:
            raise ValueError(f"{name} has no presets, so '@{preset}' means nothing")
        if flyable is not None:
            options["flyable"] = flyable
        return make_planner(name, fov=self.fov(fov), **options)

    def warm_up(self, spec: str, fov: str) -> None:
        """Compile what a planner needs."""
        replace(self, deadline_s=None).planner(spec, fov, None).warm_up()

    def scenario(self, trial: int) -> Scenario:
        """The map of trial `trial`: the same for every planner and field of view."""
        if self.prior:
            return read_scenario(self.prior_data)
        return Scenario(paper_prior(self.rng(trial, 0), self.shape))

    def rng(self, trial: int, use: int) -> np.random.Generator:
        """A generator for one use in one trial: 0 the prior, 1 the target, 2 the detector, 3 the planner."""
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(trial, use)))


def parse_planner(spec: str) -> tuple[str, str, dict[str, Any]]:
    """Name, preset (or empty) and options of "name[@preset][:option=value]..."; a name may be "module:Class".

    Raises:
        ValueError: when an option has no value.
    """
    head, *settings = spec.split(":")
    if settings and "=" not in settings[0] and head.partition("@")[0] not in PLANNERS:
        head, *settings = f"{head}:{settings[0]}", *settings[1:]  # package.module:Class
    name, _, preset = head.partition("@")
    options: dict[str, Any] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not key or not equals:
            raise ValueError(f"'{setting}' in '{spec}' is not OPTION=VALUE")
        options[key] = _value(value)
    return name, preset, options


def _value(text: str) -> Any:
    """A number, a truth value, None or the text itself."""
    named = {"true": True, "false": False, "none": None}
    if text.lower() in named:
        return named[text.lower()]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def read_scenario(data: bytes) -> Scenario:
    """The map in the bytes of a .npy file (the prior) or .npz file (prior, and searchable, flyable if any).

    Raises:
        ValueError: when it holds no such map.
    """
    loaded = np.load(io.BytesIO(data), allow_pickle=False)
    arrays = {"prior": loaded} if isinstance(loaded, np.ndarray) else dict(loaded)
    if "prior" not in arrays:
        raise ValueError(f"the file holds {', '.join(arrays) or 'nothing'}, but no array 'prior'")
    prior = np.array(arrays["prior"], dtype=np.float64)
    if prior.ndim != 2 or not np.isfinite(prior).all() or (prior < 0.0).any():
        raise ValueError("the prior must have rows and columns, finite and not negative")
    if "searchable" in arrays:
        prior[~arrays["searchable"].astype(bool)] = 0.0
    if prior.sum() <= 0.0:
        raise ValueError("the prior holds no probability where the target can be")
    flyable = arrays["flyable"].astype(bool) if "flyable" in arrays else None
    return Scenario(prior / prior.sum(), flyable)


def load_prior(path: Path) -> dict[str, Any]:
    """The settings of a campaign over the map in `path`.

    Raises:
        ValueError: one sentence that names the file.
    """
    try:
        data = path.read_bytes()
        scenario = read_scenario(data)
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} cannot be searched: {error}") from None
    return {"prior": hashlib.sha256(data).hexdigest(), "prior_data": data, "shape": scenario.prior.shape}

"""`roisearch-sim bench`: how much faster the planner is than its plain-Python twin, and how its cost grows.

Everything is a ratio within one run, of processor time of the measuring thread, so a busy machine or a slow
one changes little. One *decision* is one `plan()` through the public interface and the belief update that
follows it, while a search is flown in which nothing is found.
"""

from __future__ import annotations

import copy
import importlib
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Fleet, Motion, Regions, SearchState, make_planner, segment_regions
from roisearch.directions import direction_between
from roisearch.fov import HEADINGS, MOVES
from roisearch.planners.puct.presets import settings_for
from roisearch.watch import LOOKED
from service.errors import Parser
from sim.bench_memory import table as memory_table
from sim.bench_news import line as news_line
from sim.bench_prompt import PROMPT, slowest_ms
from sim.bench_regions import COST_AT_MOST, FEW, LOSS_AT_MOST, MANY, bounded_choice
from sim.bench_start import table as start_table
from sim.scenario import FIVE_HILLS, hills, scattered_hills
from sim.twin import TwinBelief, TwinPlanner

TWIN_AT_LEAST = 150.0
REGIONS_AT_MOST = 5.0
LARGE_MAP_AT_MOST = 1.5
DEADLINE_MS = 38.0
"""What a decision may take in the service, unless it is told otherwise: `search.deadline_s`."""
TOGETHER = 4
CHUNK = 20
PAPER: dict[str, Any] = {"preset": "paper", "commit": "never"}


@dataclass
class BenchFlight:
    """One search flown for the clock: the decisions, and processor time per decision in chunks."""

    actions: list[str] = field(default_factory=list)
    cells: list[tuple[int, int]] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    @property
    def cost(self) -> float:
        """Seconds of a decision: the lower quartile of the chunks, which a busy machine disturbs least."""
        return float(np.percentile(self.seconds, 25))


def turned(cell: tuple[int, int], near: tuple[int, int]) -> str:
    """The heading of a move between neighbours."""
    return HEADINGS[MOVES.index((near[0] - cell[0], near[1] - cell[1]))]


def fly(
    name: str,
    prior: NDArray[np.float64],
    steps: int,
    *,
    fov: FieldOfView,
    regions: Regions,
    start: tuple[int, int] = (5, 5),
    copies: bool = False,
    **options: Any,
) -> BenchFlight:
    """Fly `steps` decisions; everything is compiled and set up before the clock runs.

    `copies`: the planner is handed a copy of the belief each time, as the service does; the clock stands meanwhile.
    """
    planner = make_planner(name, fov=fov, regions=regions, **options)
    belief = Belief(prior)
    belief.follow(LOOKED)
    planner.plan(belief, SearchState(start), np.random.default_rng(0))
    rng = np.random.default_rng(1)
    cell, heading, flight = start, "north", BenchFlight()
    for _ in range(steps // CHUNK):
        spent = 0.0
        for _ in range(CHUNK):
            thought = belief.copy() if copies else belief
            began = time.thread_time()
            decision = planner.plan(thought, SearchState(cell, heading), rng)
            near = decision.path[0]
            heading, cell = direction_between(cell, near), near
            if fov.is_point:
                belief.observe([cell], False, 0.9, 0.9)
            else:
                belief.observe(fov.cells(cell, heading, prior.shape), False, 0.9, 0.9)
            spent += time.thread_time() - began
            flight.actions.append(decision.action)
            flight.cells.append(cell)
        flight.seconds.append(spent / CHUNK)
    return flight


def replan(name: str, prior: NDArray[np.float64], times: int, *, fov: FieldOfView) -> BenchFlight:
    """Let a planner make its plan anew in a corner of the map, each time after a hit, and think no further."""
    planner, belief = make_planner(name, fov=fov, iterations=0), Belief(prior)
    rng, flight = np.random.default_rng(1), BenchFlight()
    planner.plan(belief, SearchState((1, 1)), rng)
    for i in range(times):
        belief.observe([(1, 2 + i)], True, 0.9, 0.9)
        began = time.thread_time()
        decision = planner.plan(belief, SearchState((1, 1)), rng)
        flight.seconds.append(time.thread_time() - began)
        flight.actions.append(decision.action)
    return flight


def fly_both(
    name: str, prior: NDArray[np.float64], steps: int, *, fov: FieldOfView, regions: Regions
) -> tuple[float, float]:
    """Fly planner and twin side by side with the paper's settings; seconds of a decision of each.

    They take turns in chunks of decisions, the planner five times from the same state, so that whatever
    else the machine does slows both alike; what counts is the median of its five and the lower quartile of
    all chunks.

    Raises:
        AssertionError: when the twin decides otherwise than the planner.
    """
    planner = make_planner(name, fov=fov, regions=regions, preset="paper", commit="never")
    twin = TwinPlanner(settings_for(name, "paper", {"commit": "never"}), fov, regions)
    belief, twin_belief = Belief(prior), TwinBelief(prior)
    rng = np.random.default_rng(1)
    state = SearchState((5, 5))
    planner.plan(belief, state, np.random.default_rng(0))
    twin.plan(twin_belief, state.cell, state.heading, 0)
    costs: list[tuple[float, float]] = []
    for _ in range(steps // CHUNK):
        repeats = []
        for _ in range(5):
            again, draws, at = belief.copy(), copy.deepcopy(rng), state
            planner.plan(again, at, copy.deepcopy(rng))  # the copy is cold, the belief of a search is not
            began = time.thread_time()
            decisions = []
            for _ in range(CHUNK):
                decision = planner.plan(again, at, draws)
                near = decision.path[0]
                at = SearchState(near, turned(at.cell, near))
                again.observe([near], False, 0.9, 0.9)
                decisions.append((decision.action, near))
            repeats.append(time.thread_time() - began)
        began = time.thread_time()
        twin_decisions = []
        for _ in range(CHUNK):
            action, path = twin.plan(twin_belief, state.cell, state.heading, rng.bit_generator.random_raw())
            state = SearchState(path[0], turned(state.cell, path[0]))
            twin_belief.observe([path[0]], [False], [0.9], [0.9])
            twin_decisions.append((action, path[0]))
        costs.append((float(np.median(repeats)), time.thread_time() - began))
        assert decisions == twin_decisions, f"{name}: the planner and its twin decide differently"
        belief = again
    ours, theirs = (float(np.percentile(side, 25)) / CHUNK for side in zip(*costs, strict=True))
    return ours, theirs


@dataclass
class Growth:
    """How the cost of a decision grows with one thing: its values, and the cost of each."""

    title: str
    values: list[int]
    seconds: list[float]


def against_twin(steps: int, say: Callable[[str], None]) -> dict[str, float]:
    """The ratios at the paper's settings: twin to planner, and BMDP-O to lite.

    Raises:
        AssertionError: when the twin decides otherwise than the planner.
    """
    prior = hills((200, 200), FIVE_HILLS)
    regions, fov = segment_regions(prior), FieldOfView.point()
    ratios: dict[str, float] = {}
    costs: dict[str, float] = {}
    for name in ("puct-regions-lite", "puct-regions", "puct"):
        costs[name], twin = fly_both(name, prior, steps, fov=fov, regions=regions)
        ratios[name] = twin / costs[name]
        say(
            f"{name:18} {ratios[name]:6.0f} times faster than its twin "
            f"({twin * 1e3:.2f} ms, {costs[name] * 1e6:.1f} us); {steps} decisions, all the same"
        )
    ratios["BMDP-O / lite"] = costs["puct-regions"] / costs["puct-regions-lite"]
    say(f"{'BMDP-O':18} {ratios['BMDP-O / lite']:6.2f} times the lite decision")
    return ratios


def growths(largest: int, steps: int, say: Callable[[str], None]) -> list[Growth]:
    """How a lite decision with the paper's settings grows: map, regions, sensor, iterations.

    And one of the default planner, in steps and with a motion, when the hills lie as far apart as the map is large.
    """
    point, name = FieldOfView.point(), "puct-regions-lite"
    found: list[Growth] = []

    def measure(title: str, values: list[int], run: Callable[[int], BenchFlight]) -> None:
        seconds = []
        for value in values:
            say(f"  {title}: {value}")
            seconds.append(run(value).cost)
        found.append(Growth(title, values, seconds))

    def with_map(size: int) -> BenchFlight:
        prior = hills((size, size), FIVE_HILLS)
        return fly(name, prior, steps, fov=point, regions=segment_regions(prior), **PAPER)

    def with_regions(count: int) -> BenchFlight:
        side = int(np.ceil(np.sqrt(count)))
        middles = [(60.0 + 70 * (i // side), 60.0 + 70 * (i % side)) for i in range(count)]
        prior = hills((660, 660), middles)
        return fly(name, prior, steps, fov=point, regions=segment_regions(prior), **PAPER)

    prior = hills((200, 200), FIVE_HILLS)
    regions = segment_regions(prior)

    def with_sensor(cells: int) -> BenchFlight:
        side = round(cells**0.5)
        fov = FieldOfView.from_mask(np.ones((side, side)))
        return fly(name, prior, steps, fov=fov, regions=regions, **PAPER)

    def with_iterations(count: int) -> BenchFlight:
        return fly(name, prior, steps, fov=point, regions=regions, **PAPER, iterations=count)

    def with_default(size: int) -> BenchFlight:
        prior = scattered_hills(size)
        return fly(name, prior, max(CHUNK, steps // 10), fov=point, regions=segment_regions(prior))

    def made_anew(size: int) -> BenchFlight:
        across = np.exp(-20.0 * np.linspace(-0.5, 0.5, size) ** 2)
        return replan(name, np.outer(across, across), CHUNK, fov=point)

    def in_seconds(size: int) -> BenchFlight:
        prior = scattered_hills(size)
        motion, nothing = Motion(cell_m=25.0), segment_regions(np.ones((2, 2)))
        count = max(CHUNK, steps // 10)
        return fly(name, prior, count, fov=point, regions=nothing, motion=motion, copies=True)

    sizes = [size for size in (200, 400, 1000, 2000, 4000, 10_000) if size <= largest]
    measure("cells on a side of the map", sizes, with_map)
    measure("regions of interest", [1, 4, 16, 64], with_regions)
    measure("cells in the field of view", [1, 9, 25, 49], with_sensor)
    measure("iterations", [10, 40, 160, 640], with_iterations)
    measure(
        "default planner, a plan made anew in a corner: cells on a side, one broad hill", sizes, made_anew
    )
    measure("default planner: cells on a side, hills far apart", sizes, with_default)
    measure(
        "default planner with a motion, handed copies: cells on a side, hills far apart", sizes, in_seconds
    )
    return found


def together(searchers: int, steps: int, say: Callable[[str], None]) -> float:
    """Let so many searchers search the five hills together; what 99 of 100 of their decisions took at most, in ms.

    Processor time of `Fleet.plan`, with the default planner's settings, as each of them decides at every step; all is
    compiled before, as the service does.
    """
    prior = hills((200, 200), FIVE_HILLS)
    regions, belief, rng = segment_regions(prior), Belief(prior), np.random.default_rng(1)
    fleet = Fleet(size=searchers, regions=regions)
    names = [str(i) for i in range(searchers)]
    states = {name: SearchState((5, 5)) for name in names}
    for name in names:
        fleet.join(name, fov=FieldOfView.point())
        fleet.plan(name, belief, states[name], rng, now_s=0.0)  # sets the map up
    fleet.warm_up()
    took = []
    for step in range(steps):
        entered = []
        for name in names:
            began = time.thread_time()
            near = fleet.plan(name, belief, states[name], rng, now_s=float(step)).path[0]
            took.append(time.thread_time() - began)
            states[name] = SearchState(near, direction_between(states[name].cell, near))
            entered.append(near)
        belief.observe(entered, False, 0.9, 0.9)
    slowest = 1e3 * float(np.percentile(took, 99))
    say(
        f"{searchers} searchers on one belief: 99 of 100 decisions of each took at most {slowest:.1f} ms of the "
        f"processor, half of them {1e3 * float(np.median(took)):.1f} ms"
    )
    return slowest


def table(found: list[Growth]) -> str:
    """The growths as Markdown, each cost against the first of its row."""
    wide = max(len(growth.values) for growth in found)
    lines = ["| cost of a decision grows with | " + " | ".join([""] * wide) + " |", "|---" * (wide + 1) + "|"]
    for growth in found:
        cells = [
            f"{value}: x {cost / growth.seconds[0]:.2f}"
            for value, cost in zip(growth.values, growth.seconds, strict=True)
        ]
        lines.append(f"| {growth.title} | " + " | ".join(cells + [""] * (wide - len(cells))) + " |")
    return "\n".join(lines)


def plot(found: list[Growth], path: Path) -> None:
    """The growths as one picture, a panel each, the cost against the first value's."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, len(found), figsize=(4 * len(found), 3.4), layout="constrained")
    for panel, growth in zip(panels, found, strict=True):
        relative = np.array(growth.seconds) / growth.seconds[0]
        panel.plot(growth.values, relative, "o-", color="#1f6f8b")
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xticks(growth.values, [str(value) for value in growth.values])
        panel.minorticks_off()
        panel.set_ylim(0.5, max(2.0, 2.0 * float(relative.max())))
        panel.set_xlabel(growth.title)
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("cost of a decision, relative")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(arguments: list[str]) -> int:
    """Run the benchmark; 1 with `--check` when a ratio misses its target, else 0.

    `intake`, `autopilot` and `strangers` are other benchmarks.
    """
    others = {
        "intake": "sim.bench_intake",
        "autopilot": "sim.autopilot.bench",
        "strangers": "sim.soak.strangers",
    }
    if arguments and arguments[0] in others:
        code: int = importlib.import_module(others[arguments[0]]).main(arguments[1:])
        return code
    parser = Parser(prog="roisearch-sim bench", description=main.__doc__)
    parser.add_argument("--out", type=Path, default=Path("bench"), help="folder for bench.md and bench.png")
    parser.add_argument("--steps", type=int, default=100, help="decisions that the twin flies (default 100)")
    parser.add_argument("--largest", type=int, default=4000, help="side of the largest map (default 4000)")
    parser.add_argument("--check", action="store_true", help="exit 1 when a target is missed")
    options = parser.parse_args(arguments)
    if options.steps < CHUNK or options.largest < 200:
        parser.error(f"--steps must be at least {CHUNK} and --largest at least 200")
    lines: list[str] = []

    def say(line: str) -> None:
        print(line, flush=True)
        lines.append(line)

    def whisper(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    say(
        "paper settings: 200 x 200 cells, 5 regions, 40 iterations, rollout 60, point sensor, update included"
    )
    ratios = against_twin(options.steps, say)
    slowest = together(TOGETHER, options.steps, say)
    choice = bounded_choice(options.steps, say)
    prompt = {side: slowest_ms(side, 20 * options.steps) for side in dict.fromkeys((200, options.largest))}
    for side, took_ms in prompt.items():
        say(
            f"default planner with a motion and the service's deadline, {side} x {side}: {PROMPT:.1%} of "
            f"{20 * options.steps} decisions took at most {took_ms:.1f} ms of the processor"
        )
    found = growths(options.largest, 10 * options.steps, whisper)
    large, far, flown = (found[i].seconds[-1] / found[i].seconds[0] for i in (0, -2, -1))
    targets = [
        (f"twin / lite at least {TWIN_AT_LEAST:.0f}", ratios["puct-regions-lite"] >= TWIN_AT_LEAST),
        (f"BMDP-O / lite at most {REGIONS_AT_MOST:.0f}", ratios["BMDP-O / lite"] <= REGIONS_AT_MOST),
        (f"largest map / 200 x 200 at most {LARGE_MAP_AT_MOST}", large <= LARGE_MAP_AT_MOST),
        (f"the same of the default planner at most {LARGE_MAP_AT_MOST}", far <= LARGE_MAP_AT_MOST),
        (f"the same of the default with a motion at most {LARGE_MAP_AT_MOST}", flown <= LARGE_MAP_AT_MOST),
        (
            f"{MANY} regions cost at most x {COST_AT_MOST} a decision with {FEW}, and {LOSS_AT_MOST:.0%} of time",
            choice.cost <= COST_AT_MOST and choice.loss <= LOSS_AT_MOST,
        ),
        (
            f"{PROMPT:.1%} of the decisions in flight within {DEADLINE_MS:.0f} ms",
            max(prompt.values()) <= DEADLINE_MS,
        ),
        (f"a decision for each of {TOGETHER} searchers within {DEADLINE_MS:.0f} ms", slowest <= DEADLINE_MS),
    ]
    say("")
    say(table(found))
    say("")
    say(memory_table())
    say("")
    say(start_table(options.largest))
    say("")
    say(news_line())
    say("")
    for target, met in targets:
        say(f"{'met   ' if met else 'MISSED'} {target}")
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "bench.md").write_text("\n".join(["# Benchmark", "", *lines, ""]), encoding="utf-8")
    plot(found, options.out / "bench.png")
    print(f"written: {options.out / 'bench.md'}, {options.out / 'bench.png'}")
    return 1 if options.check and not all(met for _, met in targets) else 0

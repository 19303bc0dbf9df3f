"""Planners from outside: found by module and class or as an entry point, held to what every planner keeps to."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from roisearch import BasePlanner, Belief, Decision, FieldOfView, SearchState, make_planner
from roisearch.decision import Cell
from roisearch.planners.own import check
from service.cli import main as service_main
from service.config import read_settings
from service.errors import BadInput

ROOT = Path(__file__).parents[3]
MINE = """
from roisearch import BasePlanner

class Wanderer(BasePlanner):
    '''Goes where most mass is seen, and anywhere when none is; `hold` counts for nothing.'''

    def __init__(self, *, fov, flyable=None, regions=None, hold=1):
        super().__init__(fov=fov, flyable=flyable, regions=regions)
        self.hold = hold

    def choose(self, belief, state, rng):
        mass = belief.probability()
        moves = self.moves(belief, state)
        gains = [mass[tuple(self.seen(cell, heading, belief).T)].sum() for heading, cell in moves]
        best = [cell for (_, cell), gain in zip(moves, gains) if gain == max(gains)]
        return [best[rng.integers(len(best))]]
"""


class Wanderer(BasePlanner):
    """Any move that there is."""

    def choose(self, belief: Belief, state: SearchState, rng: np.random.Generator) -> Sequence[Cell]:
        moves = self.moves(belief, state)
        return [moves[rng.integers(len(moves))][1]]


class Through(Wanderer):
    """Flies through walls."""

    def choose(self, belief: Belief, state: SearchState, rng: np.random.Generator) -> Sequence[Cell]:
        return [(state.cell[0], state.cell[1] + 1)]


class Astray(Wanderer):
    """Wants to be where it is not."""

    def choose(self, belief: Belief, state: SearchState, rng: np.random.Generator) -> Sequence[Cell]:
        return [(state.cell[0] + 9, state.cell[1])]


class Moody(Wanderer):
    """Draws from elsewhere."""

    def choose(self, belief: Belief, state: SearchState, rng: np.random.Generator) -> Sequence[Cell]:
        return super().choose(belief, state, np.random.default_rng())


class Meddler(Wanderer):
    """Changes what it was handed."""

    def choose(self, belief: Belief, state: SearchState, rng: np.random.Generator) -> Sequence[Cell]:
        belief.observe([state.cell], True, 0.9, 0.9)
        return super().choose(belief, state, rng)


class Whole(Wanderer):
    """Answers with a decision of its own."""

    def choose(self, belief: Belief, state: SearchState, rng: np.random.Generator) -> Decision:
        from roisearch.decision import Effort

        (first, *_) = super().choose(belief, state, rng)
        return Decision((first,), "whim", 0.5, Effort(1, 0.0), remark="as I like")


class Bare:
    """Takes nothing."""


class NoPlanner:
    """Has no plan."""

    def __init__(self, *, fov: FieldOfView) -> None:
        self.name = "none"


def test_a_class_is_found_by_its_module_and_takes_its_options() -> None:
    planner = make_planner(f"{__name__}:Wanderer", fov=FieldOfView.point(), motion=None)
    decision = planner.plan(Belief(np.ones((5, 5))), SearchState((0, 0)), np.random.default_rng(1))
    assert decision.path[0] in ((0, 1), (1, 0))
    assert decision.action in ("east", "south")
    planner.warm_up()
    assert planner.name == "Wanderer"


def test_a_planner_may_answer_with_a_decision() -> None:
    planner = make_planner(f"{__name__}:Whole", fov=FieldOfView.point())
    decision = planner.plan(Belief(np.ones((5, 5))), SearchState((2, 2)), np.random.default_rng(1))
    assert (decision.action, decision.remark) == ("whim", "as I like")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("no.such.module:Planner", "cannot be had: ModuleNotFoundError"),
        (f"{__name__}:Nobody", "cannot be had: AttributeError"),
        (f"{__name__}:ROOT", "is no class"),
        (f"{__name__}:NoPlanner", "is no planner: it has no plan, warm_up; derive it from BasePlanner"),
        (f"{__name__}:BasePlanner", "abstract"),
    ],
)
def test_what_is_no_planner_is_refused_in_words(name: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_planner(name, fov=FieldOfView.point())
    with pytest.raises(ValueError, match="speed"):
        make_planner(f"{__name__}:Wanderer", fov=FieldOfView.point(), speed=3)


def test_whoever_writes_a_planner_can_have_it_tried() -> None:
    check(Wanderer)
    with pytest.raises(ValueError, match=r"no flyable neighbour|not flyable"):
        check(Through)
    with pytest.raises(ValueError, match="same seed"):
        check(Moody)
    with pytest.raises(ValueError, match="changes the belief"):
        check(Meddler)


def test_settings_take_a_planner_from_outside_and_name_what_is_near(tmp_path: Path) -> None:
    assert read_settings(flags={"search.planner": "mine:Planner"}).search.planner == "mine:Planner"
    with pytest.raises(BadInput, match="there is no such planner; did you mean 'greedy'"):
        read_settings(flags={"search.planner": "gredy"})


@pytest.mark.parametrize(
    ("planner", "said"),
    [
        (
            "nowhere:Planner",
            "search.planner: the planner 'nowhere:Planner' cannot be had: ModuleNotFoundError",
        ),
        (f"{__name__}:NoPlanner", f"search.planner: '{__name__}:NoPlanner' is no planner: it has no plan"),
        (f"{__name__}:Bare", f"search.planner: the planner '{__name__}:Bare' cannot be made: Bare() takes"),
        (f"{__name__}:Astray", "search.planner: Astray goes from "),
    ],
)
def test_what_is_wrong_with_a_planner_from_outside_is_one_sentence_before_the_flight(
    planner: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    area = ROOT / "config" / "uniform.geojson"
    words = ["--area", str(area), "--planner", planner, "--runs", str(tmp_path), "--http", "127.0.0.1:0"]
    assert service_main(words) == 2
    *_, last = capsys.readouterr().err.strip().splitlines()
    assert last.removeprefix("roisearch-service: ").startswith(said)
    assert not list(tmp_path.glob("*/journal*")), "a run that has not begun is none to go on with"
    assert service_main(["preview", "--area", str(area), "--planner", planner]) == 2
    assert said in capsys.readouterr().err


def test_a_module_in_the_present_folder_is_found_and_an_entry_point_too(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    info = tmp_path / "mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[roisearch.planners]\nwanderer = mine:Wanderer\n")
    tried = (
        "import sys; sys.path = [p for p in sys.path if p not in ('', {here!r})]\n"
        "from roisearch import make_planner, FieldOfView\n"
        "print(make_planner({name!r}, fov=FieldOfView.point(), hold=3).hold)\n"
    )
    for name, where in (("mine:Wanderer", ""), ("wanderer", str(tmp_path))):
        script = tmp_path / "try.py"
        script.write_text(tried.format(here=str(tmp_path), name=name))
        if where:
            script.write_text("from roisearch import *\n" + tried.format(here="", name=name))
        done = subprocess.run(
            [sys.executable, str(script)],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), where])},
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
        assert done.stdout.strip() == "3", done.stderr

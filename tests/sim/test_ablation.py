"""The command that measures the default planner: its figures, its table, and that it goes on where it stopped."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from roisearch import FieldOfView
from roisearch.planners.lookahead.planner import LookaheadPlanner
from roisearch.planners.lookahead.settings import LookaheadSettings
from sim import ablation
from sim.ruler import Ruler, detection_curve


def hills() -> np.ndarray:
    row, col = np.indices((40, 44))
    two = [np.exp(-((row - r) ** 2 + (col - c) ** 2) / 18.0) for r, c in ((10, 30), (30, 12))]
    return np.asarray(sum(two) / np.sum(two))


def test_ratio_of_sums_and_mean_of_ratios_with_their_errors() -> None:
    found = ablation.above(np.array([[110.0, 100.0], [360.0, 300.0]]))
    assert found["ratio_of_sums"] == pytest.approx(470 / 400 - 1)
    assert found["mean_of_ratios"] == pytest.approx(0.15)
    assert found["mean_of_ratios_error"] == pytest.approx(np.std([1.1, 1.2], ddof=1) / np.sqrt(2))
    left = 110 - 1.175 * 100
    assert found["ratio_of_sums_error"] == pytest.approx(np.sqrt(2 * 2 * left**2) / 400)


def test_following_an_unthought_path_gives_the_curve_of_planning_at_every_step() -> None:
    fov, curves = FieldOfView.point(0.9, 1.0), []
    for follow in (False, True):
        planner = LookaheadPlanner(LookaheadSettings(iterations=0, horizon=800), fov=fov)
        rng = np.random.default_rng(0)
        curves.append(detection_curve(planner, hills(), (2, 2), 1500, Ruler(0.9, follow=follow), rng))
    np.testing.assert_allclose(curves[0], curves[1], atol=1e-12)
    assert curves[0][-1] > 0.9


def test_it_goes_on_where_it_stopped_and_writes_table_summary_and_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(ablation, "PAPER_STEPS", 150)
    arguments = ["--variants", "iterations=0,horizon=200 index", "--out", str(tmp_path), "--first", "7"]
    assert ablation.main([*arguments, "--priors", "1"]) == 0
    first = (tmp_path / "results.csv").read_text()
    assert ablation.main([*arguments, "--priors", "2"]) == 0
    assert (tmp_path / "results.csv").read_text().startswith(first)
    with (tmp_path / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["variant"], row["seed"]) for row in rows] == [
        (variant, seed) for seed in ("7", "8") for variant in ("iterations=0,horizon=200", "index")
    ]
    assert all(float(row["expected"]) >= float(row["reference"]) > 0.0 for row in rows)
    assert "| `index` | 2 |" in (tmp_path / "ablation.md").read_text()
    assert (tmp_path / "summary.json").exists()
    assert (tmp_path / "above-bound.png").stat().st_size > 5000


def test_rows_of_another_stop_below_are_not_reused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ablation, "PAPER_STEPS", 30)
    for stop in ("1e-3", "0.999"):
        arguments = ["--variants", "index", "--priors", "1", "--stop-below", stop, "--out", str(tmp_path)]
        assert ablation.main(arguments) == 0
    with (tmp_path / "results.csv").open(newline="") as file:
        assert [row["stop_below"] for row in csv.DictReader(file)] == ["0.001", "0.999"]


def test_results_with_other_columns_are_refused_and_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "results.csv").write_text("variant,fov\n")
    assert ablation.main(["--variants", "index", "--out", str(tmp_path)]) == 2
    assert "results.csv has other columns" in capsys.readouterr().err
    assert (tmp_path / "results.csv").read_text() == "variant,fov\n"


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--fov", "point"], "the bound"),
        (["--fov", "point", "--p-tn", "0.9"], "the teleporting reference"),
        (["--fov", "donut", "--p-tn", "0.9"], "the bound"),
    ],
)
def test_table_and_figure_name_what_they_are_set_against_and_show_every_variant(
    words: list[str], named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: figures.append(figure))
    monkeypatch.setattr(ablation, "PAPER_STEPS", 20)
    variants = [f"iterations=0,horizon={horizon}" for horizon in range(64, 70)]
    arguments = ["--variants", " ".join(variants), "--priors", "1", *words, "--out", str(tmp_path)]
    assert ablation.main(arguments) == 0
    assert f"| of {named} |" in (tmp_path / "ablation.md").read_text()
    (panel,) = figures[0].axes
    assert panel.get_ylabel() == f"E[T] above {named}, %"
    lines = panel.get_lines()
    assert [str(line.get_label()).partition(":")[0] for line in lines] == variants
    assert len({(line.get_marker(), line.get_color()) for line in lines}) == len(variants)


def test_an_unknown_setting_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ablation.main(["--variants", "depth=4", "--out", str(tmp_path)]) == 2
    assert "'depth' is neither a planner nor one of the settings" in capsys.readouterr().err


def test_in_seconds_the_parts_of_the_tour_stand_above_the_bound_in_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(ablation, "PAPER_STEPS", 3000)
    arguments = [
        "--motion",
        "1.5",
        "--side",
        "24",
        "--priors",
        "1",
        "--stop-below",
        "0.02",
        "--out",
        str(tmp_path),
    ]
    assert ablation.main([*arguments, "--variants", "first=480 first=0,iterations=0 index"]) == 0
    with (tmp_path / "results.csv").open(newline="") as file:
        rows = {row["variant"]: row for row in csv.DictReader(file)}
    annealed, ruled, steps = (float(row["expected"]) for row in rows.values())
    assert float(rows["index"]["reference"]) < annealed <= ruled < steps
    assert "24 x 24 cells" in (text := (tmp_path / "ablation.md").read_text())
    assert "in seconds of flight, cells of 25 m, 8 m/s, 1.5 m/s2" in text
    assert ablation.main([*arguments, "--variants", "keep=0.5"]) == 2
    assert "'keep' is neither a planner nor one of the settings looks" in capsys.readouterr().err
    for words, said in (
        (["--deadline-ms", "38"], "leave --deadline-ms out"),
        (["--fov", "donut"], "there is a bound for a point field of view"),
        (["--side", "5"], "at least 20 cells on a side, not 5"),
    ):
        assert ablation.main([*arguments, *words]) == 2
        assert said in capsys.readouterr().err

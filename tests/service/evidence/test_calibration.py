"""From a score to evidence: the table, its errors, and Bayes' rule by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roisearch import Belief, FieldOfView
from service.area import GridFrame
from service.errors import BadInput
from service.evidence.calibration import Calibration, of_roc, read_calibration
from service.evidence.mask import Sensor
from service.evidence.observe import FramePose, observe
from service.evidence.passes import Passes
from service.evidence.reports import Report

FRAME = GridFrame(47.05, 8.30, 0.0, 25.0, 20, 30, -375.0, 250.0)
RATIOS = "score,likelihood_ratio\n0.2,0.5\n0.6,8\n0.9,200\n"
ROC = "score,p_tp,p_tn\n0.2,0.95,0.8\n0.5,0.8,0.95\n0.8,0.5,0.99\n"


def table(folder: Path, text: str) -> Calibration:
    file = folder / "scores.csv"
    file.write_text(text)
    return read_calibration(str(file))


def test_between_two_rows_the_ratio_is_interpolated_and_beyond_them_it_stays(tmp_path: Path) -> None:
    calibration = table(tmp_path, RATIOS)
    for score, ratio in (
        (0.0, 0.5),
        (0.2, 0.5),
        (0.4, 2.0),
        (0.6, 8.0),
        (0.75, 40.0),
        (0.9, 200.0),
        (1.0, 200.0),
    ):
        assert calibration.ratio(score) == pytest.approx(ratio)
    assert calibration.at(0.4) is None


def test_a_roc_says_what_a_hit_adds_and_what_a_miss_is_worth_at_the_threshold(tmp_path: Path) -> None:
    calibration = table(tmp_path, ROC)
    for score, ratio in (
        (0.1, 1.0),
        (0.3, 1.0),
        (0.5, 0.3 / 0.04),
        (0.79, 0.3 / 0.04),
        (0.8, 50.0),
        (1.0, 50.0),
    ):
        assert calibration.ratio(score) == pytest.approx(ratio)
    assert calibration.at(None) == calibration.at(0.1) == (0.95, 0.8)
    assert calibration.at(0.5) == (0.8, 0.95)
    assert calibration.at(0.65) == pytest.approx((0.65, 0.97))


def test_a_higher_score_is_never_worth_less(tmp_path: Path) -> None:
    dented = table(tmp_path, "score,p_tp,p_tn\n0.1,0.9,0.5\n0.3,0.8,0.9\n0.5,0.3,0.92\n0.7,0.2,0.99\n")
    ratios = [dented.ratio(score) for score in np.linspace(0, 1, 201)]
    assert ratios == sorted(ratios)
    assert dented.ratio(0.3) == dented.ratio(0.6) == pytest.approx(0.6 / 0.09)


@given(
    st.lists(st.tuples(st.integers(1, 50), st.integers(1, 50)), min_size=1, max_size=8),
)
def test_what_the_hits_are_worth_averages_out_over_false_alarms(counts: list[tuple[int, int]]) -> None:
    """The mean likelihood ratio of false alarms is P(hit | there) / P(hit | not there), whatever was taken together."""
    hits, alarms = np.array(counts, dtype=float).T
    above_hits, above_alarms = hits[::-1].cumsum()[::-1], alarms[::-1].cumsum()[::-1]
    p_tp, fp = above_hits / (hits.sum() + 5), above_alarms / (alarms.sum() + 5)
    scores = [(i + 1) / 10 for i in range(len(counts))]
    lines = list(range(2, 2 + len(scores)))
    calibration = of_roc("t", lines, scores, list(zip(p_tp.tolist(), (1 - fp).tolist(), strict=True)))
    mean = sum(
        share * calibration.ratio(score) for share, score in zip(alarms / alarms.sum(), scores, strict=True)
    )
    assert mean == pytest.approx(p_tp[0] / fp[0])


def sensor(calibration: Calibration | None) -> Sensor:
    return Sensor(FRAME, FieldOfView.point(), 0.9, 0.9, 0.2, 0.8, 30.0, calibration)


def after(calibration: Calibration | None, *frames: tuple[float | None, list[float]]) -> float:
    """The odds of the cell below against all others, after frames of (threshold, scores); 599 others."""
    lat, lon = FRAME.to_latlon([[3, 4]])[0].tolist()
    belief, passes, s = Belief(np.ones(FRAME.shape)), Passes(), sensor(calibration)
    for number, (threshold, scores) in enumerate(frames):
        seen = [{"lat": lat, "lon": lon, "score": score} for score in scores]
        report = Report.model_validate(
            {"id": "a", "captured_at": 1.0, "threshold": threshold, "detections": seen}
        )
        o = observe(passes, "camera", float(number), s.read(FramePose(lat, lon, 30.0, 0.0, 1.0), report))
        if o is not None:
            belief.observe(o.cells, o.hits, o.p_tp, o.p_tn)
    p = float(belief.probability()[3, 4])
    return p / (1.0 - p) * 599.0


def test_a_calibrated_hit_multiplies_the_odds_by_its_ratio(tmp_path: Path) -> None:
    calibration = table(tmp_path, RATIOS)
    for score, ratio in ((0.1, 0.5), (0.6, 8.0), (0.95, 200.0)):
        assert after(calibration, (None, [score])) == pytest.approx(ratio, rel=1e-9)
    assert after(calibration, (None, [0.2, 0.95, 0.6])) == pytest.approx(200.0, rel=1e-9), (
        "the best of the cell"
    )
    assert after(calibration, (None, [])) == pytest.approx(0.1 / 0.9, rel=1e-9), "a miss: from the settings"
    assert after(None, (None, [0.2])) == pytest.approx(9.0, rel=1e-9), "without a table every score is alike"


def test_in_one_pass_a_surer_hit_replaces_a_weaker_one_and_a_miss(tmp_path: Path) -> None:
    calibration = table(tmp_path, RATIOS)
    frames = [(None, []), (None, [0.6]), (None, []), (None, [0.95]), (None, [0.2])]
    assert after(calibration, *frames) == pytest.approx(200.0, rel=1e-9)


def test_a_miss_is_worth_what_it_is_at_the_threshold(tmp_path: Path) -> None:
    calibration = table(tmp_path, ROC)
    assert after(calibration, (0.5, [])) == pytest.approx((1 - 0.8) / 0.95, rel=1e-9)
    assert after(calibration, (0.8, [])) == pytest.approx((1 - 0.5) / 0.99, rel=1e-9)
    assert after(calibration, (None, [])) == pytest.approx((1 - 0.95) / 0.8, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the first line names the columns"),
        ("score\n0.5\n", "the first line names the columns"),
        ("score,likelihood_ratio\n", "no rows"),
        ("score,likelihood_ratio\n0.5,high\n", "line 2: '0.5,high' is not 2 numbers"),
        ("score,likelihood_ratio\n0.5,nan\n", "line 2"),
        ("score,likelihood_ratio\n0.5,0\n", "line 2: a likelihood_ratio is above 0"),
        ("score,likelihood_ratio\n0.5,3\n0.4,4\n", "line 3: the score 0.4 does not rise"),
        ("score,likelihood_ratio\n0.5,3\n0.6,2\n", "line 3: the likelihood_ratio falls from 3 to 2"),
        ("score,likelihood_ratio\n0.5,3\n1.6,4\n", "between 0 and 1"),
        (
            "score,likelihood_ratio\n0.5,3\n0.6,1e17\n",
            "line 3: a likelihood_ratio is above 0, from 1e-06 to 1e+06",
        ),
        ("score,likelihood_ratio\n0.5,1e-17\n", "line 2: a likelihood_ratio is above 0, from 1e-06 to 1e+06"),
        ("score,p_tp,p_tn\n0.5,0.9,0.999999999999\n", "a hit with scores from 0.5 on would be worth"),
        ("\nscore,likelihood_ratio\n\n0.5,3\n \n0.6,2\n", "line 6: the likelihood_ratio falls from 3 to 2"),
        ("score,likelihood_ratio\n\n0.5,3\n\n\n0.6,x\n", "line 6: '0.6,x' is not 2 numbers"),
        ("score,likelihood_ratio\n" + "0.5,3\n" * 200_000, "more than 1048576 bytes"),
        ("score,p_tp,p_tn\n0.5,0.9,1\n", "line 2: p_tp and p_tn are between 0 and 1"),
        ("score,p_tp,p_tn\n0.5,0.9,0.9\n0.6,0.95,0.95\n", "line 3: with a higher score"),
        ("score,p_tp,p_tn\n0.5,0.9,0.9\n0.6,0.9,0.95\n", "no target was seen with scores from 0.5"),
        ("score,p_tp,p_tn\n0.5,0.9,0.9\n0.6,0.8,0.9\n", None),
    ],
)
def test_a_wrong_table_is_refused_with_its_line(tmp_path: Path, text: str, words: str | None) -> None:
    if words is None:
        assert table(tmp_path, text).ratio(0.5) == pytest.approx(9.0), (
            "rows without alarms are taken together"
        )
        return
    with pytest.raises(BadInput, match=r"scores\.csv") as caught:
        table(tmp_path, text)
    assert words in str(caught.value)


def test_a_table_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    assert table(tmp_path, "\ufeff" + RATIOS).ratio(0.6) == pytest.approx(8.0)


def test_a_detection_is_spread_with_the_likelihoods_of_its_threshold(tmp_path: Path) -> None:
    """It lies on the border of two cells in view: each one's odds are the mean of a hit's and a miss's, and the miss
    is worth what it is at the report's threshold."""
    calibration = table(tmp_path, ROC)
    s = Sensor(FRAME, FieldOfView.donut(0.9, 0.9), 0.9, 0.9, 0.2, 0.8, 30.0, calibration)
    lat, lon = FRAME.to_latlon([[5, 5]])[0].tolist()
    there = FRAME.to_latlon([[4, 4.5]])[0].tolist()
    seen = {"lat": there[0], "lon": there[1], "score": 0.95, "accuracy_m": 5.0}
    report = Report.model_validate({"id": "a", "captured_at": 1.0, "threshold": 0.5, "detections": [seen]})
    reading = s.read(FramePose(lat, lon, 30.0, 0.0, 1.0), report)
    wanted = 0.5 * calibration.ratio(0.95) + 0.5 * (1.0 - 0.8) / 0.95
    for cell in ((4, 4), (4, 5)):
        assert reading.hits[cell] == pytest.approx(wanted, rel=0.02)


def test_a_missing_table_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none\.csv: the calibration cannot be read"):
        read_calibration(str(tmp_path / "none.csv"))

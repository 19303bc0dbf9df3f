"""What a detector is worth, measured from scored frames with the truth beside them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from service.commands.calibrate import main
from service.errors import BadInput
from service.evidence.calibration import read_calibration
from service.evidence.measured import Scored, at_threshold, read_scored, table

RNG = np.random.default_rng(7)


def drawn(count: int) -> list[Scored]:
    """Scores with a known likelihood ratio: density 2 s where the target is, 2 (1 - s) where not; s / (1 - s)."""
    there = [Scored(True, round(float(s), 3)) for s in np.sqrt(RNG.random(count))]
    return there + [Scored(False, round(1.0 - float(s), 3)) for s in np.sqrt(RNG.random(count))]


def as_csv(path: Path, passes: list[Scored]) -> Path:
    rows = [f"{'' if one.score is None else one.score},{int(one.there)}" for one in passes]
    path.write_text("score,there\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_the_rates_are_those_of_the_detector_and_their_intervals_hold_them() -> None:
    missed = 0
    for _ in range(100):
        measured = at_threshold(drawn(200), 0.5)
        assert measured.p_tp.value == pytest.approx(0.75, abs=0.15)
        missed += not measured.p_tp.low <= 0.75 <= measured.p_tp.high
    assert missed <= 14  # 5 expected
    surer, one = at_threshold(drawn(5000), 0.5).p_tn, at_threshold(drawn(50), 0.5).p_tn
    assert surer.high - surer.low < 0.2 * (one.high - one.low)


def test_the_table_is_one_that_the_service_reads_and_has_the_true_ratios(tmp_path: Path) -> None:
    scored, out = as_csv(tmp_path / "s.csv", drawn(4000)), tmp_path / "table.csv"
    assert main([str(scored), "--table", str(out), "--picture", str(tmp_path / "p.png")]) == 0
    calibration = read_calibration(str(out))
    for score in (0.3, 0.5, 0.7):
        assert math.log(calibration.ratio(score)) == pytest.approx(math.log(score / (1.0 - score)), abs=0.5)
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("passes", [drawn(2), drawn(5), [Scored(True, 0.9), Scored(False, None)], drawn(40)])
def test_few_cases_make_a_table_that_is_read_too(tmp_path: Path, passes: list[Scored]) -> None:
    out = tmp_path / "table.csv"
    assert main([str(as_csv(tmp_path / "s.csv", passes)), "--table", str(out)]) == 0
    read_calibration(str(out))
    assert table(passes)


def test_a_threshold_that_is_no_score_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main([str(tmp_path / "s.csv"), "--threshold", "4"])
    (said,) = capsys.readouterr().err.splitlines()
    assert "argument --threshold: '4' is no score between 0 and 1" in said


def test_frames_of_one_pass_count_once_by_their_best_score(tmp_path: Path) -> None:
    path = tmp_path / "s.csv"
    path.write_text("pass,score,there\na,0.2,1\na,,1\na,0.9,1\nb,,0\nb,,0\n", encoding="utf-8")
    assert read_scored(path) == [Scored(True, 0.9), Scored(False, None)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("score,truth\n0.5,1\n", "'score,there'"),
        ("score,there\n0.5,maybe\n", "line 2: there is 1 or 0"),
        ("score,there\n87,1\n", "line 2: a score lies between 0 and 1.*not '87'; divide per cent by 100"),
        (
            "score,there\n1.5,1\n,0\nx,perhaps\n",
            r"2 things are wrong:\n  line 2: a score .*\n  line 4: there is 1",
        ),
        ("score,there\n" + "87,1\n" * 40, r"line 10: .*\n  and 31 more lines$"),
        ("score,there\n0.5,1\n", "no pass without the target"),
        ("score,there\n,0\n", "no pass with the target there"),
        ("", "the first line names"),
    ],
)
def test_what_cannot_be_measured_is_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "s.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=words):
        read_scored(path)
    with pytest.raises(BadInput, match="there is no such file; give a CSV"):
        read_scored(tmp_path / "none.csv")


@pytest.mark.parametrize(
    "data",
    [
        b"\xef\xbb\xbfScore;There\r\n0,5;TRUE\r\n;FALSE\r\n",
        b"score\tthere\n0.5\tyes\n\tno\n",
        "score, there\n0.5,1\n,0\n".encode("utf-16"),
    ],
)
def test_a_table_is_read_as_spreadsheets_write_it(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "scored.csv"
    path.write_bytes(data)
    assert read_scored(path) == [Scored(True, 0.5), Scored(False, None)]


def test_a_spreadsheet_itself_is_refused_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "scored.xlsx"
    path.write_bytes(b"PK\x03\x04")
    with pytest.raises(BadInput, match="save it as CSV"):
        read_scored(path)

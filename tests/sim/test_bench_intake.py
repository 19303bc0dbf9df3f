"""The benchmark of the intake: a real searching service, and a count that notices what is missing."""

from __future__ import annotations

import pytest

from sim.__main__ import main
from sim.bench_intake import Tally, lost, p99_limit_ms
from tests.integration.flight import REPOSITORY


def tally(*names: str, sent: int) -> Tally:
    one = Tally("door", sent=sent)
    one.receive([{"id": name, "status": "accepted"} for name in names], since=0.0)
    return one


def test_a_report_is_lost_without_a_receipt_or_a_row_of_its_own() -> None:
    assert lost([tally("a", "b", sent=2)], ["a", "b", "others"]) == 0
    assert lost([tally("a", sent=2)], ["a", "b"]) == 1, "no receipt"
    assert lost([tally("a", "b", sent=2)], ["a"]) == 1, "not in the journal"
    assert lost([tally("a", "b", sent=2)], ["a", "b", "b"]) == 1, "twice in the journal"
    refused = tally("a", sent=2)
    refused.receive([{"id": "b", "status": "refused"}], since=0.0)
    assert lost([refused], ["a"]) == 2, "refused, and so not in the journal"


def test_the_limit_of_ninety_nine_in_a_hundred_is_read_from_the_services_counts() -> None:
    before = {0.01: 10.0, 0.02: 10.0, float("inf"): 10.0}
    assert p99_limit_ms(before, {0.01: 100.0, 0.02: 109.5, float("inf"): 110.0}) == 20.0


def test_nothing_is_lost_while_a_real_service_searches(capsys: pytest.CaptureFixture[str]) -> None:
    area = (
        REPOSITORY / "config" / "areas" / "mountain-valley.geojson"
    )  # large: the search outlasts the benchmark
    # flat out, messages of the aircraft wait among the reports: its position must not be old by then, which it is after
    # 0.2 s at ten times the wall clock's speed
    words = ["--area", str(area), "--rate", "200", "--seconds", "3", "--flat-out", "0.5", "--speedup", "4"]
    assert main(["bench", "intake", *words]) == 0
    said = capsys.readouterr().out
    assert "\nlost: 0\n" in said, said
    assert "met    nothing lost" in said
    assert "all doors at once" in said
    assert "1.0\n" in said.split("HTTP, one report a request, flat out")[1]

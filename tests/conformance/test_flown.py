"""The mock does what the real autopilots did in whole flights."""

from __future__ import annotations

import pytest

from tests.conformance.compare import differences
from tests.conformance.flown import FLOWN, Exchange
from tests.sim.autopilot.hovering import Flight

CASES = [(flavor, exchange) for flavor, facts in FLOWN.items() for exchange in facts]


@pytest.mark.parametrize(("flavor", "exchange"), CASES, ids=[f"{f}-{e.__name__}" for f, e in CASES])
def test_mock_does_what_was_seen_in_flight(flavor: str, exchange: Exchange) -> None:
    assert list(differences(FLOWN[flavor][exchange], exchange(Flight(flavor)))) == []

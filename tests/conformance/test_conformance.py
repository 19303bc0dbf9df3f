"""Each flavour of the mock answers each exchange as the real autopilot does."""

from __future__ import annotations

import functools

import pytest

from sim.autopilot.settings import Settings
from tests.conformance.compare import Facts, differences, record
from tests.conformance.dialogue import Dialogue
from tests.conformance.exchanges import EXCHANGES, hold
from tests.conformance.wire import Lockstep

FLAVORS = ("px4", "ardupilot")

# Facts that no user of the mock can see differ; "exchange.fact": why. Nothing is.
SKIPPED: dict[str, dict[str, str]] = {"px4": {}, "ardupilot": {}}


@functools.cache
def _answers(flavor: str) -> dict[str, Facts | Exception]:
    """What the mock answers to all exchanges, one after the other on one vehicle."""
    dialogue = Dialogue(Lockstep(Settings(flavor=flavor, sysid=7, seed=1)), flavor)
    facts: dict[str, Facts | Exception] = {}
    for name in EXCHANGES:
        try:
            facts[name] = hold(dialogue, name)
        except Exception as error:  # one broken exchange must not hide the others
            facts[name] = error
    return facts


@pytest.mark.parametrize("name", EXCHANGES)
@pytest.mark.parametrize("flavor", FLAVORS)
def test_mock_answers_as_the_real_autopilot(flavor: str, name: str) -> None:
    answer = _answers(flavor)[name]
    if isinstance(answer, Exception):
        raise answer
    wanted = {
        fact: value for fact, value in record(flavor)[name].items() if f"{name}.{fact}" not in SKIPPED[flavor]
    }
    assert list(differences(wanted, answer)) == []


@pytest.mark.parametrize("flavor", FLAVORS)
def test_every_recorded_exchange_is_held(flavor: str) -> None:
    assert list(EXCHANGES) == list(record(flavor))

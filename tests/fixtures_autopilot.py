"""Fixtures that start mock autopilots. A test module takes them with `pytest_plugins` or an import."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from sim.autopilot.process import AutopilotProcess

StartAutopilot = Callable[..., AutopilotProcess]


@pytest.fixture
def start_autopilot() -> Iterator[StartAutopilot]:
    """A function that starts a mock (arguments of AutopilotProcess); all are stopped after the test."""
    with ExitStack() as stack:

        def start(flavor: str, **options: object) -> AutopilotProcess:
            return stack.enter_context(AutopilotProcess(flavor, **options))  # type: ignore[arg-type]

        yield start


@pytest.fixture(params=["px4", "ardupilot"])
def flavor(request: pytest.FixtureRequest) -> str:
    """Each flavour in turn."""
    name: str = request.param
    return name

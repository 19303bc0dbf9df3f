"""What holds for all tests."""

import logging
import os
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import settings

# A slow machine is not a wrong result; in CI the examples are the same every time.
settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")


@pytest.fixture(autouse=True)
def log_as_it_was() -> Iterator[None]:
    """A test that runs the whole program leaves its log to the next as it found it."""
    log = logging.getLogger("roisearch")
    handlers, level, propagate = log.handlers, log.level, log.propagate
    yield
    log.handlers, log.propagate = handlers, propagate
    log.setLevel(level)


FLIGHTS = {
    "flights": (
        "tests/browser/",
        "tests/integration/test_faults_flight",
        "tests/integration/test_faults_link",
        "tests/integration/test_faults_position",
        "tests/integration/test_faults_process",
        "tests/integration/test_faults_told",
    ),
    "more flights": (
        "tests/conformance/test_over_sockets",
        "tests/integration/test_detectors",
        "tests/integration/test_exports_of_others",
        "tests/integration/test_faults_pilot",
        "tests/integration/test_lying_detectors",
        "tests/integration/test_news",
        "tests/integration/test_restart",
        "tests/integration/test_search",
        "tests/integration/test_sorties",
        "tests/service/mavlink/test_vehicle",
        "tests/sim/autopilot/test_mav",
        "tests/sim/test_bench",
        "tests/typed/",
    ),
    "late flights": (
        "tests/integration/test_several",
        "tests/integration/test_soak",
        "tests/integration/test_strangers",
    ),
    "last flights": ("tests/integration/",),
}
"""Files whose tests keep time with other processes, and mostly wait: each of these is done by one worker, a test at a
time, while another computes. The first two take about as long as each other and as all that is computed; the others
come at the end, side by side."""
COMPILES = ("tests/roisearch/", "tests/sim/trials/")
"""Files that need most kernels: begun when the flights have compiled them."""


def flown_with(nodeid: str) -> str:
    """Which of `FLIGHTS` a test is of; empty when it does not fly."""
    return next((name for name, files in FLIGHTS.items() if nodeid.startswith(files)), "")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With `-n 3`, two workers fly and the third takes a file at a time, and flies at last."""
    from xdist.scheduler import LoadScopeScheduling

    class TwoFly(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return flown_with(nodeid) or nodeid.partition("::")[0]

        def _assign_work_unit(self, node: Any) -> None:
            first, second, *last = FLIGHTS
            waiting = self.workqueue
            for name in [name for name in (second, first) if name in waiting]:
                waiting.move_to_end(name, last=False)
            for name in [name for name in waiting if name.startswith(COMPILES)]:
                waiting.move_to_end(name)
            for name in [name for name in last if name in waiting]:
                waiting.move_to_end(name)
            super()._assign_work_unit(node)

    return TwoFly(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A flight that fails is flown once more: it keeps time with five processes on a machine that others use, too."""
    for item in items:
        if flown_with(item.nodeid):
            item.add_marker(pytest.mark.flaky(reruns=1))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Whoever reads the output of a run that passed sees what was flown twice, and why."""
    for first in terminalreporter.stats.get("rerun", []):
        terminalreporter.write_sep("=", f"FLOWN TWICE: {first.nodeid}", yellow=True)
        terminalreporter.write_line(first.longreprtext)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """In CI a test that is skipped, for whatever part is missing, is a failure."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") and reporter is not None and reporter.stats.get("skipped"):
        reporter.write_line("ERROR: tests were skipped in CI, where every part must be there", red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED

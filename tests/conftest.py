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


FLIGHTS = ("tests/browser/", "tests/integration/")
"""Files whose tests keep time with other processes: one worker does them one at a time, whatever the other computes."""
LATE_FLIGHTS = (
    "tests/conformance/test_over_sockets",
    "tests/integration/test_exports_of_others",
    "tests/integration/test_faults_pilot",
    "tests/integration/test_news",
    "tests/integration/test_restart",
    "tests/integration/test_search",
    "tests/integration/test_sorties",
    "tests/service/mavlink/test_vehicle",
    "tests/sim/autopilot/test_mav",
    "tests/sim/test_bench",
    "tests/typed/",
)
"""Those that the other worker does when it has computed everything: by then all kernels are compiled, and two flights
at a time do not disturb each other."""


COMPILES = ("tests/roisearch/", "tests/sim/trials/")
"""Files that need most kernels: begun when the other worker, which flies, has compiled them."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With `-n 2`, one worker flies and the other takes a file at a time, and flies at last."""
    from xdist.scheduler import LoadScopeScheduling

    class OneFlies(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            if file.startswith(LATE_FLIGHTS):
                return "late"
            return "flights" if file.startswith(FLIGHTS) else file

        def _assign_work_unit(self, node: Any) -> None:
            for last in [file for file in self.workqueue if file.startswith(COMPILES)]:
                self.workqueue.move_to_end(last)
            if "late" in self.workqueue:
                self.workqueue.move_to_end("late")
            super()._assign_work_unit(node)

    return OneFlies(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A flight that fails is flown once more: it keeps time with five processes on a machine that others use, too."""
    for item in items:
        if item.nodeid.startswith((*FLIGHTS, *LATE_FLIGHTS)):
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

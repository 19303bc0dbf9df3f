"""What holds for all tests."""

import os

import pytest
from hypothesis import settings

# A slow machine is not a wrong result; in CI the examples are the same every time.
settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")


FLIGHTS = (
    "tests/browser/",
    "tests/conformance/test_over_sockets",
    "tests/integration/",
    "tests/service/test_mavlink_vehicle",
    "tests/sim/test_autopilot_mav",
    "tests/sim/test_bench",
)
"""Files whose tests keep time with other processes: one at a time, whatever the other worker computes meanwhile."""


def pytest_itemcollected(item: pytest.Item) -> None:
    """With `-n 2 --dist loadgroup`, one worker flies and the other takes a file at a time."""
    file = item.nodeid.partition("::")[0]
    item.add_marker(pytest.mark.xdist_group("flights" if file.startswith(FLIGHTS) else file))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """In CI a test that is skipped, for whatever part is missing, is a failure."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") and reporter is not None and reporter.stats.get("skipped"):
        reporter.write_line("ERROR: tests were skipped in CI, where every part must be there", red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED

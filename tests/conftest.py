"""Settings of all tests: coverage, hypothesis and the time limit.

A test that exceeds the time limit (pyproject.toml) prints the stacks of all threads; long tests have none. Coverage
measures only the test processes: measuring the commands and recorders that they start would take half as long again.
"""

import faulthandler
import os

import pytest
from hypothesis import settings

if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.pop("COVERAGE_PROCESS_CONFIG", None)

NO_TIME_LIMIT = ("benchmark", "campaign", "oracle")

settings.register_profile("busy", deadline=None)
settings.load_profile("busy")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if any(item.get_closest_marker(name) for name in NO_TIME_LIMIT):
        faulthandler.cancel_dump_traceback_later()

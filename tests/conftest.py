"""What holds for all tests: how they are measured, and what becomes of one that hangs.

A hang is told with the stacks of all threads (pyproject.toml); what takes long, on purpose or by load, is none.
Coverage is that of the tests' own processes. Commands and recorders that they start would take half as long again.
"""

import faulthandler
import os

import pytest
from hypothesis import settings

if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.pop("COVERAGE_PROCESS_CONFIG", None)

LONG = ("benchmark", "campaign", "oracle")

settings.register_profile("busy", deadline=None)
settings.load_profile("busy")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if any(item.get_closest_marker(name) for name in LONG):
        faulthandler.cancel_dump_traceback_later()

"""A hang is told with the stacks of all threads (pyproject.toml); what takes long, on purpose or by load, is none."""

import faulthandler

import pytest
from hypothesis import settings

LONG = ("benchmark", "campaign", "oracle")

settings.register_profile("busy", deadline=None)
settings.load_profile("busy")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if any(item.get_closest_marker(name) for name in LONG):
        faulthandler.cancel_dump_traceback_later()

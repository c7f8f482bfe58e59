"""Fixtures of the model tests."""

from dataclasses import replace

import pytest

from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters


@pytest.fixture
def default() -> ModelParameters:
    """The rig's default rotor."""
    return gj90c()


@pytest.fixture
def weightless() -> ModelParameters:
    """A rotor without weight, with enough imbalance to be stable."""
    return replace(gj90c(imbalance=1e-5), gravity=0.0)

"""Fixtures: the card at a stand-in device server, with the real nidaqmx client and real gRPC."""

from collections.abc import Iterator

import pytest

from daq.drivers.ni import NiSource, open_ni_source
from daq.drivers.simulation.card import SimulatedCard
from tests.daq.support.device_server import DeviceServer, serving
from tests.daq.support.ni_bench import bench
from tests.daq.support.ni_driver import NiDriver


@pytest.fixture
def driver() -> NiDriver:
    return NiDriver(lambda: SimulatedCard(bench()))


@pytest.fixture
def server(driver: NiDriver) -> Iterator[DeviceServer]:
    with serving(driver) as running:
        yield running


@pytest.fixture
def card(server: DeviceServer) -> Iterator[NiSource]:
    source = open_ni_source(bench(server.target))
    yield source
    source.close()

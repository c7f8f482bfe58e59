"""What is connected, without an acquisition: the list of devices, and the card's test of itself."""

import datetime as dt
from contextlib import closing
from dataclasses import dataclass

from daq.config.schema import DeviceSection
from daq.drivers.ni.extra import card_extra


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A device that the driver lists.

    Parameters
    ----------
    name : str
        The driver's name for it, as "Dev1"; it moves with the port.
    product : str
        Type, as "USB-6251".
    serial : str
        Serial number, hexadecimal as printed on the card.
    simulated : bool
        Whether the driver only simulates it.
    busy : bool or None
        Whether another acquisition holds it; None where that cannot be asked.
    driver : str
        Name and version of the driver, and where it is.
    """

    name: str
    product: str
    serial: str
    simulated: bool
    busy: bool | None
    driver: str


def connected_devices(section: DeviceSection) -> list[FoundDevice]:
    """Return what is connected to this machine, or to the device server that a section names.

    Raises
    ------
    DeviceError
        Package or driver not installed, server out of reach.
    """
    with card_extra():
        from daq.drivers.ni.system import NiSystem  # noqa: PLC0415 - an optional extra, and slow to import
    with closing(NiSystem(section)) as system:
        return system.devices()


def self_test(section: DeviceSection) -> dt.date | None:
    """Let the card that a section names test itself; it must be idle.

    Returns
    -------
    date or None
        When it last calibrated itself; None where it does not tell.

    Raises
    ------
    DeviceError
        Package or driver not installed, server out of reach, card missing, busy or failed.
    """
    with card_extra():
        from daq.drivers.ni.system import NiSystem  # noqa: PLC0415 - an optional extra, and slow to import
    with closing(NiSystem(section)) as system:
        return system.self_test()

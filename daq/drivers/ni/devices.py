"""The description of a device that the driver lists."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A device in the driver's list.

    Parameters
    ----------
    name : str
        The driver's name for it, as "Dev1"; it depends on the USB port.
    product : str
        Product type, as "USB-6251".
    serial : str
        Serial number, hexadecimal as printed on the card.
    simulated : bool
        Whether the driver only simulates it.
    busy : bool or None
        Whether another acquisition holds it; None if unknown.
    driver : str
        Name, version and location of the driver.
    """

    name: str
    product: str
    serial: str
    simulated: bool
    busy: bool | None
    driver: str

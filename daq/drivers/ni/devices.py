"""A device as the driver lists it."""

from dataclasses import dataclass


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

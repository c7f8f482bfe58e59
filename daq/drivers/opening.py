"""Which source a rig asks for."""

from daq.config.rig import Rig
from daq.config.schema import Backend
from daq.drivers.simulated_card import SimulatedCard
from daq.drivers.simulated_source import SimulatedSource
from daq.drivers.source import Source
from daq.errors import DeviceError, DeviceFault


def open_source(rig: Rig) -> Source:
    """Return the rig's source, opened and ready.

    Parameters
    ----------
    rig : Rig
        A validated rig.

    Raises
    ------
    DeviceError
        The device, or the software that speaks to it, is missing, busy or refuses the settings.
    """
    if rig.config.device.backend is Backend.SIMULATED:
        timing = rig.config.timing
        card = SimulatedCard(rig)
        rate = card.acquisition.rate
        return SimulatedSource(
            card,
            block=round(timing.block_s * rate),
            buffer=round(timing.buffer_s * rate),
            real_time=rig.config.simulation.pace == "real time",
        )
    try:
        from daq.drivers.usb6251 import open_usb6251  # noqa: PLC0415 - an optional extra: only where a card is asked for
    except ModuleNotFoundError as error:
        raise DeviceError(
            DeviceFault.MISSING,
            f"rig {rig.config.rig!r} asks for the {rig.config.device.product}, but the package {error.name!r} that "
            "speaks to it is not installed: install the extra 'card' (pip install 'rig-service[card]') and NI-DAQmx",
        ) from error
    return open_usb6251(rig)

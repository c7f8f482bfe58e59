"""Which source a rig asks for, and what of it is recorded."""

from daq.config.rig import Rig
from daq.config.schema import Backend, TriggerSection
from daq.config.trigger_condition import read_condition
from daq.drivers.ni import open_usb6251
from daq.drivers.reconnecting import Reconnecting
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.simulation.source import SimulatedSource
from daq.drivers.source import Restarts, Source
from daq.drivers.triggered import Trigger, Triggered, TriggerWatch
from daq.errors import DeviceError, DeviceFault
from model.errors import ModelError


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
    session = rig.config.session
    restarts = Restarts(session.restarts_per_minute)
    if rig.config.device.backend is Backend.NIDAQMX:
        return Reconnecting(
            lambda: open_usb6251(rig, restarts), restarts, retry=session.retry_s, patience=session.reconnect_s
        )
    try:
        card = SimulatedCard(rig)
    except ModelError as error:
        raise DeviceError(DeviceFault.REJECTED, f"the simulated shaft cannot start: {error}") from error
    rate = card.acquisition.rate
    return SimulatedSource(
        card,
        block=max(round(rig.config.timing.block_s * rate), 1),
        buffer=round(rig.config.timing.buffer_s * rate),
        real_time=rig.config.simulation.pace == "real time",
        restarts=restarts,
    )


def triggered(source: Source, section: TriggerSection, watch: TriggerWatch) -> Source:
    """Return an opened source with the conditions from and up to which it is recorded, if there are any.

    Parameters
    ----------
    source : Source
        What is acquired.
    section : TriggerSection
        The conditions, which have been found good.
    watch : TriggerWatch
        Who is told what the trigger does.
    """
    start, stop = read_condition(section.start), read_condition(section.stop)
    if start is None and stop is None:
        return source
    trigger = Trigger(start, stop, section.pre_s, section.hold_s, section.hold_off_s, section.events)
    return Triggered(source, trigger, watch)

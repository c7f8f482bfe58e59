"""Which source a rig asks for, and what of it is recorded."""

from daq.config.rig import Rig
from daq.config.schema import Backend, TriggerSection, parse_condition
from daq.drivers.ni import open_ni_source
from daq.drivers.reconnecting import ReconnectingSource
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.simulation.source import SimulatedSource
from daq.drivers.source import RestartLimiter, Source
from daq.drivers.triggered import Trigger, TriggeredSource, TriggerListener
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
    restarts = RestartLimiter(session.restarts_per_minute)
    if rig.config.device.backend is Backend.NIDAQMX:
        return ReconnectingSource(
            lambda: open_ni_source(rig, restarts), restarts, retry=session.retry_s, patience=session.reconnect_s
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


def apply_trigger(source: Source, section: TriggerSection, watch: TriggerListener) -> Source:
    """Return an opened source with the conditions from and up to which it is recorded, if there are any.

    Parameters
    ----------
    source : Source
        What is acquired.
    section : TriggerSection
        The conditions, which have been found good.
    watch : TriggerListener
        Who is told what the trigger does.
    """
    start, stop = parse_condition(section.start), parse_condition(section.stop)
    if start is None and stop is None:
        return source
    trigger = Trigger(start, stop, section.pre_s, section.hold_s, section.hold_off_s, section.events)
    return TriggeredSource(source, trigger, watch)

"""Opens the source that a rig names, and applies its trigger."""

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
        The rig.

    Raises
    ------
    DeviceError
        The device or its driver is missing, busy or rejects the settings.
    """
    session = rig.config.session
    restarts = RestartLimiter(session.restarts_per_minute)
    if rig.config.device.backend is Backend.NIDAQMX:
        return ReconnectingSource(
            lambda: open_ni_source(rig, restarts), restarts, retry_interval=session.retry_s, timeout=session.reconnect_s
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


def apply_trigger(source: Source, section: TriggerSection, listener: TriggerListener) -> Source:
    """Return a source limited to the samples between start and stop condition, or unchanged without conditions.

    Parameters
    ----------
    source : Source
        The opened source.
    section : TriggerSection
        The conditions.
    listener : TriggerListener
        Receives the trigger's events.
    """
    start, stop = parse_condition(section.start), parse_condition(section.stop)
    if start is None and stop is None:
        return source
    trigger = Trigger(start, stop, section.pre_s, section.hold_s, section.hold_off_s, section.events)
    return TriggeredSource(source, trigger, listener)

"""A recorded run's header with calibrations that were corrected since; `summarise` takes it."""

from collections.abc import Mapping
from dataclasses import replace

from analysis.signals.header import Calibration, Role, RunHeader
from daq.errors import UsageError


def corrected_header(header: RunHeader, calibrations: Mapping[str, Calibration]) -> RunHeader:
    """Return a run's header with other calibrations.

    Parameters
    ----------
    header : RunHeader
        Of the run.
    calibrations : mapping of str to Calibration
        By the name of the probe's channel; probes that are not named keep theirs.

    Raises
    ------
    UsageError
        The run has no probe of a name.
    """
    channels = header.acquisition.channels
    probes = [channel.name for channel in channels if channel.role is not Role.TACHO]
    for name in calibrations:
        if name not in probes:
            raise UsageError(f"run {header.run} has no probe {name!r}: expected {' or '.join(probes)}")
    corrected = tuple(
        replace(channel, calibration=calibrations.get(channel.name, channel.calibration)) for channel in channels
    )
    return replace(header, acquisition=replace(header.acquisition, channels=corrected))

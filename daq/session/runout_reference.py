"""Run-out vectors from the slow roll of an earlier run, entered in a rig's configuration."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.signals.blocks import SegmentEnd
from analysis.signals.header import Acquisition, RunOutSettings
from analysis.signals.snapshot import RunOut
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from analysis.spectra.order_map import order_vectors
from analysis.vectors.runout import RunOutEstimator
from daq.config.rig import Rig
from daq.config.schema import RunOutSection, RunOutVector
from daq.config.toml_files import to_toml
from daq.errors import UsageError
from daq.session.offline import results
from recordings.catalogue.catalogue import SUFFIX
from recordings.errors import RecordingError
from recordings.mcap.reader import RunReader


def with_reference_runout(rig: Rig, folder: Path) -> Rig:
    """Return the rig with the run-out of the run in ``runout.from_run``; the rig itself where none is named.

    Parameters
    ----------
    rig : Rig
        The rig.
    folder : Path
        The data folder that holds the run.

    Raises
    ------
    UsageError
        The run cannot be read, has no slow roll, or was measured with other probe angles or another tacho.
    """
    section = rig.config.runout
    if not section.from_run:
        return rig
    name = section.from_run
    path = rig.path.parent / name if name.endswith(SUFFIX) else folder / f"{name}{SUFFIX}"
    try:
        with RunReader(path) as reader:
            _require_same_sensors(rig, reader.header.acquisition)
            found = _slow_roll(reader, section.slow_roll_rpm * RPM)
            source = f"slow roll of {reader.header.run} up to {section.slow_roll_rpm:g} r/min"
    except RecordingError as error:
        raise UsageError(f"runout.from_run: {error}") from error
    if found is None:
        raise UsageError(f"runout.from_run: {path.stem} holds no order spectrum up to {section.slow_roll_rpm:g} r/min")
    vectors = tuple(_vector(order, found) for order in range(1, len(found.vectors) + 1))
    with_vectors = RunOutSection(correct_orbit=section.correct_orbit, vector=vectors, source=source)
    config = rig.config.model_copy(update={"runout": with_vectors})
    return replace(rig, config=config, toml=to_toml(config.model_dump(mode="json", exclude_none=True)))


def _slow_roll(reader: RunReader, speed: float) -> RunOut | None:
    settings = reader.header.settings
    watch = RunOutEstimator(RunOutSettings(slow_roll_speed=speed))
    for item in results(reader):
        if isinstance(item, SegmentEnd) or item.frame is None:
            continue
        frame = item.frame
        vectors = order_vectors(frame.spectrum, settings.revolutions, int(settings.highest_order))
        if watch.update(frame.speed, vectors, np.nan_to_num(frame.sigma)) is not None:
            break
    return watch.estimate


def _vector(order: int, runout: RunOut) -> RunOutVector:
    x, y = runout.vectors[order - 1].tolist()
    return RunOutVector(
        order=order,
        x_um=abs(x) / MICROMETRE,
        x_lag_deg=phase_lag_degrees(x) if x else 0.0,
        y_um=abs(y) / MICROMETRE,
        y_lag_deg=phase_lag_degrees(y) if y else 0.0,
        sigma_um=float(runout.sigma[order - 1]) / MICROMETRE if order <= len(runout.sigma) else 0.0,
    )


def _require_same_sensors(rig: Rig, earlier: Acquisition) -> None:
    """Raise UsageError where the earlier run has other probe angles or another tacho: its vectors do not apply."""
    angles = {channel.role: channel.angle_deg for channel in rig.config.channel}
    for channel in earlier.channels:
        if channel.calibration is not None and abs(math.degrees(channel.angle) - angles[channel.role]) > 1e-6:
            raise UsageError(
                f"runout.from_run: its probe {channel.name} is at {math.degrees(channel.angle):g} degrees, "
                f"expected {angles[channel.role]:g}: its vectors do not apply to this rig"
            )
    if earlier.tacho.edge is not rig.tacho.edge or earlier.tacho.pulses_per_revolution != 1:
        raise UsageError(
            f"runout.from_run: its tacho times the {earlier.tacho.edge.value} edge of "
            f"{earlier.tacho.pulses_per_revolution} marks, expected {rig.tacho.edge.value} of 1: "
            "its phases do not apply to this rig"
        )

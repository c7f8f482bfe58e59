"""Run-out as rig.toml gives it, checked and in SI units."""

import cmath
import math
from collections.abc import Iterator

from analysis.signals.header import RunOutSettings
from daq.config.messages import Fault
from daq.config.schema import RigConfig

MICRO = 1e-6
RPM = 2 * math.pi / 60


def runout_faults(config: RigConfig) -> Iterator[Fault]:
    """Return every contradiction in what is said of run-out."""
    runout = config.runout
    if runout.vector and (runout.slow_roll_rpm or runout.from_run):
        text = (
            "runout.vector: expected none beside slow_roll_rpm or from_run: the run-out is given or told by a slow roll"
        )
        yield Fault(("runout.vector", "runout.slow_roll_rpm", "runout.from_run"), text)
    if runout.from_run and not runout.slow_roll_rpm:
        text = f'runout.from_run = "{runout.from_run}": expected slow_roll_rpm beside it, the speed of its slow roll'
        yield Fault(("runout.from_run", "runout.slow_roll_rpm"), text)
    marks = config.tacho.pulses_per_revolution
    if (runout.vector or runout.slow_roll_rpm) and marks != 1:
        text = f"tacho.pulses_per_revolution = {marks}: expected 1 with [runout], whose phases need one mark"
        yield Fault(("tacho.pulses_per_revolution", "runout"), text)
    seen: set[int] = set()
    for number, vector in enumerate(runout.vector):
        key = f"runout.vector[{number}].order"
        if vector.order in seen:
            yield Fault((key,), f"{key} = {vector.order}: expected each order once")
        elif vector.order > config.analysis.highest_order:
            highest = config.analysis.highest_order
            expected = f"at most analysis.highest_order = {highest:g}"
            yield Fault((key, "analysis.highest_order"), f"{key} = {vector.order}: expected {expected}")
        seen.add(vector.order)


def runout_settings(config: RigConfig) -> RunOutSettings:
    """Return what is to be taken off as run-out; that of an earlier run must have been put in place of its name."""
    runout = config.runout
    sigmas = {vector.order: vector.sigma_um * MICRO for vector in runout.vector}
    return RunOutSettings(
        slow_roll_speed=runout.slow_roll_rpm * RPM,
        vectors=tuple(
            (
                vector.order,
                cmath.rect(vector.x_um * MICRO, -math.radians(vector.x_lag_deg)),
                cmath.rect(vector.y_um * MICRO, -math.radians(vector.y_lag_deg)),
            )
            for vector in runout.vector
        ),
        sigma=(sigmas.get(1, 0.0), sigmas.get(2, 0.0)),
        source=runout.source or ("rig.toml" if runout.vector else ""),
        from_orbit=runout.orbit,
    )

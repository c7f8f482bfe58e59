"""A validated rig: its configuration, calibrations, and their values in SI units."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from analysis.preflight.check_result import WiringLimits
from analysis.signals.header import AnalysisSettings, Calibration, Limits, RunOutSettings, Tacho, TachoCounter
from analysis.signals.units import MICROMETRE, MICROSECOND, RPM
from daq.config.devices import device_spec
from daq.config.schema import RigConfig


def runout_settings(config: RigConfig) -> RunOutSettings:
    """Return the run-out settings; the caller has replaced `from_run` by that run's vectors."""
    runout = config.runout
    sigmas = {vector.order: vector.sigma_um * MICROMETRE for vector in runout.vector}
    return RunOutSettings(
        slow_roll_speed=runout.slow_roll_rpm * RPM,
        vectors=tuple(
            (
                vector.order,
                cmath.rect(vector.x_um * MICROMETRE, -math.radians(vector.x_lag_deg)),
                cmath.rect(vector.y_um * MICROMETRE, -math.radians(vector.y_lag_deg)),
            )
            for vector in runout.vector
        ),
        sigma=(sigmas.get(1, 0.0), sigmas.get(2, 0.0)),
        source=runout.source or ("rig.toml" if runout.vector else ""),
        from_orbit=runout.correct_orbit,
    )


@dataclass(frozen=True, slots=True)
class Rig:
    """A validated rig.toml with the calibrations that it names.

    Parameters
    ----------
    path : Path
        The file.
    config : RigConfig
        Its content.
    calibrations : mapping of str to Calibration
        The calibration of each probe, by channel name.
    toml : str
        The complete configuration as TOML, with defaults; stored in the header of every run.
    """

    path: Path
    config: RigConfig
    calibrations: Mapping[str, Calibration]
    toml: str

    @property
    def tacho(self) -> Tacho:
        """The tacho's signal and mark."""
        section = self.config.tacho
        return Tacho(
            threshold=section.threshold_v,
            hysteresis=section.hysteresis_v,
            edge=section.edge,
            pulses_per_revolution=section.pulses_per_revolution,
            mark_fraction=section.mark_fraction,
            response_time=section.response_time_s,
            delay=section.delay_s,
            counter=self._counter,
        )

    @property
    def _counter(self) -> TachoCounter | None:
        section = self.config.tacho.counter
        if section is None:
            return None
        return TachoCounter(
            counter=section.counter,
            terminal=section.terminal,
            edge=section.edge or self.config.tacho.edge,
            timebase=section.timebase_hz or device_spec(self.config.device.product).fastest_counter_timebase,
            is_reference=section.reference == "counter",
            max_difference=section.max_difference_us * MICROSECOND,
        )

    @property
    def limits(self) -> Limits:
        """The alarm limits."""
        section = self.config.limits
        return Limits(
            peak_to_peak_alarm=section.peak_to_peak_alarm_um * MICROMETRE,
            peak_to_peak_danger=section.peak_to_peak_danger_um * MICROMETRE,
            clearance=section.clearance_um * MICROMETRE,
            speed=section.speed_rpm * RPM,
            hysteresis=section.hysteresis_fraction,
            hold=section.hold_s,
            latch=section.latch,
            order_1x_alarm=_limit(section.order_1x_peak_alarm_um, MICROMETRE),
            order_1x_danger=_limit(section.order_1x_peak_danger_um, MICROMETRE),
            below_1x_alarm=_limit(section.below_1x_peak_alarm_um, MICROMETRE),
            below_1x_danger=_limit(section.below_1x_peak_danger_um, MICROMETRE),
            speed_alarm=_limit(section.speed_alarm_rpm, RPM),
            speed_danger=_limit(section.speed_danger_rpm, RPM),
        )

    @property
    def wiring_limits(self) -> WiringLimits:
        """The limits of the preflight's wiring checks."""
        section = self.config.preflight
        return WiringLimits(
            hum_warn=section.hum_warn_um * MICROMETRE,
            hum_fail=section.hum_fail_um * MICROMETRE,
            tacho_scatter=section.tacho_scatter_fraction,
            mark_tolerance=section.tacho_mark_tolerance_fraction,
        )

    @property
    def settings(self) -> AnalysisSettings:
        """The settings of the analysis."""
        section = self.config.analysis
        return AnalysisSettings(
            update_interval=section.update_s,
            revolutions=section.revolutions,
            points_per_revolution=section.points_per_revolution,
            highest_order=section.highest_order,
            window=section.window,
            runout=runout_settings(self.config),
        )


def _limit(limit: float, unit: float) -> float:
    """Return a limit in SI units; infinity for 0, which means no limit."""
    return limit * unit if limit else math.inf

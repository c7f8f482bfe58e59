"""A validated rig: its configuration, calibrations and rotor, and their values in SI units."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from analysis.preflight.check_result import WiringLimits
from analysis.signals.header import (
    AnalysisSettings,
    Calibration,
    Channel,
    Limits,
    Role,
    RunOutSettings,
    Tacho,
    TachoCounter,
)
from analysis.signals.units import MICROMETRE, MICROSECOND, RPM
from daq.config.devices import device_spec
from daq.config.schema import ChannelSection, ModelSection, RigConfig
from daq.config.toml_files import read_tables, read_text, to_toml
from model.rotor.parameters import FloatingRing, Imbalance, ModelParameters
from model.rotor.rotor_file import parse_rotor


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
    """

    path: Path
    config: RigConfig
    calibrations: Mapping[str, Calibration]

    @property
    def toml(self) -> str:
        """The complete configuration as TOML, with defaults; stored in the header of every run."""
        return to_toml(self.config.model_dump(mode="json", exclude_none=True))

    def channel(self, section: ChannelSection, volts: tuple[float, float], scaling: tuple[float, ...]) -> Channel:
        """Return a channel of the acquisition, with the voltage range and scaling polynomial that the card reports."""
        probe = section.role is not Role.TACHO
        gap_low, gap_high = section.gap_window_v if probe else (-math.inf, math.inf)
        return Channel(
            name=section.name,
            role=section.role,
            physical=section.physical,
            range_low=volts[0],
            range_high=volts[1],
            scaling=scaling,
            calibration=self.calibrations.get(section.name),
            angle=math.radians(section.angle_deg) if probe else 0.0,
            gap_low=gap_low,
            gap_high=gap_high,
        )

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


def read_rotor(path: Path | str) -> dict[str, object]:
    """Return the content of a rotor file; ConfigError if it cannot be read or is not TOML."""
    return read_tables(read_text(Path(path)), str(path))


def default_rotor() -> dict[str, object]:
    """Return the content of the default rotor file: the thesis's GJ90C."""
    text = files("model.rotor").joinpath("gj90c.toml").read_text(encoding="utf-8")
    return read_tables(text, "gj90c.toml")


def parameters_from_tables(tables: Mapping[str, object]) -> ModelParameters:
    """Return the parameters in a rotor file, those of the GJ90C if it is empty; TableError if it is wrong."""
    return parse_rotor(tables) if tables else _gj90c()


@cache
def _gj90c() -> ModelParameters:
    return parse_rotor(default_rotor())


def model_parameters(config: RigConfig) -> ModelParameters:
    """Return the rotor model's parameters: those of the rotor file, with the changes in `[model]`.

    Raises
    ------
    ParameterError
        The rotor is wrong, or `[model]` contradicts it.
    """
    parameters = parameters_from_tables(config.rotor)
    angles = {channel.role: math.radians(channel.angle_deg) for channel in config.channel}
    return replace(
        parameters,
        bearing=_bearing(parameters.floating_ring, config.model),
        imbalances=_imbalances(parameters.imbalances, config.model),
        probe_angles=(angles.get(Role.PROBE_X, 0.0), angles.get(Role.PROBE_Y, math.pi / 2)),
    )


def _bearing(bearing: FloatingRing, section: ModelSection) -> FloatingRing:
    changes: dict[str, tuple[float | None, float]] = {
        "viscosity": (section.viscosity_pa_s, 1.0),
        "inner_clearance": (section.inner_clearance_um, MICROMETRE),
        "outer_clearance": (section.outer_clearance_um, MICROMETRE),
    }
    values: Any = {name: value * unit for name, (value, unit) in changes.items() if value is not None}
    return replace(bearing, **values)


def _imbalances(imbalances: tuple[Imbalance, ...], section: ModelSection) -> tuple[Imbalance, ...]:
    """Return the imbalances, the first one changed as in the section."""
    magnitude, station, phase = section.imbalance_kg_m, section.imbalance_station, section.imbalance_phase_deg
    if magnitude is None and station is None and phase is None:
        return imbalances
    first, *others = imbalances or (Imbalance(1, 0.0),)
    changed = Imbalance(
        station=first.station if station is None else station,
        magnitude=first.magnitude if magnitude is None else magnitude,
        phase=first.phase if phase is None else math.radians(phase),
    )
    return (changed, *others)

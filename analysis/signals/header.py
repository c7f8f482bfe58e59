"""Run header: channels, calibrations, tacho, analysis settings and limits.

Contains everything that turns recorded converter codes into metres, speed and phase.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import numpy as np

from analysis.signals import CodeArray, FloatArray
from analysis.signals.units import LENGTH, PEAK, PEAK_TO_PEAK, SPEED

CODE_MIN, CODE_MAX = -32768, 32767


class Role(StrEnum):
    """Quantity that a channel measures."""

    PROBE_X = "probe_x"
    PROBE_Y = "probe_y"
    TACHO = "tacho"


@dataclass(frozen=True, slots=True)
class Calibration:
    """A probe's calibration: gap = sum of ``coefficients[k] * volts**k``.

    Parameters
    ----------
    coefficients : tuple of float
        Polynomial coefficients in rising order, metres of gap per volt**k.
    volts_low, volts_high : float
        Calibrated range of the output voltage, V. Outside it the polynomial is extrapolated; such samples are counted.
    residual : float
        Largest deviation of the fit from the calibration points, m.
    sensor, conditioner : str
        Serial numbers.
    date : str
        Date of the calibration, ISO 8601.
    target : str
        Material and diameter of the target.
    operator : str
        Name of the person who calibrated.
    """

    coefficients: tuple[float, ...]
    volts_low: float
    volts_high: float
    residual: float = 0.0
    sensor: str = ""
    conditioner: str = ""
    date: str = ""
    target: str = ""
    operator: str = ""


@dataclass(frozen=True, slots=True)
class Channel:
    """One input of the card and the sensor wired to it.

    Parameters
    ----------
    name : str
        Name of the channel in the rig file, as "x".
    role : Role
        Measured quantity.
    physical : str
        Input of the card, as "ai0".
    range_low, range_high : float
        Input range, V.
    scaling : tuple of float
        Scaling polynomial of the device: volts = sum of ``scaling[k] * code**k``.
    calibration : Calibration or None
        For probes: volts to metres of gap.
    angle : float
        For probes: mounting angle, rad from +X (right), positive in the direction of rotation.
    gap_low, gap_high : float
        For probes: allowed range of the mean (gap) voltage, V.
    """

    name: str
    role: Role
    physical: str
    range_low: float
    range_high: float
    scaling: tuple[float, ...]
    calibration: Calibration | None = None
    angle: float = 0.0
    gap_low: float = -np.inf
    gap_high: float = np.inf

    def volts(self, codes: CodeArray) -> FloatArray:
        """Return the input voltage, V, of converter codes of any shape."""
        volts = np.polynomial.polynomial.polyval(codes.astype(np.float64), self.scaling)
        return np.asarray(volts, dtype=np.float64)

    def displacement(self, codes: CodeArray) -> FloatArray:
        """Return the shaft displacement towards the probe, m, of converter codes of any shape.

        The zero is at the probe tip: the displacement is minus the gap.
        """
        if self.calibration is None:
            raise ValueError(f"channel {self.name!r} has no calibration: it is not a probe")
        gap = np.polynomial.polynomial.polyval(self.volts(codes), self.calibration.coefficients)
        return np.asarray(-gap, dtype=np.float64)


class Edge(StrEnum):
    """Edge of the tacho pulse that is timed."""

    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True)
class TachoCounter:
    """A counter of the card that timestamps the tacho edges, in addition to the sampled waveform.

    Parameters
    ----------
    counter : str
        Counter of the card, as "ctr0".
    terminal : str
        Digital line of the card that the tacho is also wired to, as "PFI0".
    edge : Edge
        Edge at that line that is timestamped.
    timebase : float
        Tick rate, Hz; from the same oscillator as the sample clock.
    is_reference : bool
        Whether speed and phase use the timestamps; otherwise the waveform.
    max_difference : float
        Largest allowed difference between a timestamp and the edge in the waveform, s.
    """

    counter: str
    terminal: str
    edge: Edge
    timebase: float
    is_reference: bool
    max_difference: float


@dataclass(frozen=True, slots=True)
class Tacho:
    """Tacho settings: switching levels, keyphasor marks, sensor response and counter.

    Parameters
    ----------
    threshold : float
        Middle of the two switching levels, V.
    hysteresis : float
        Distance between the two switching levels, V.
    edge : Edge
        Edge at theta = 0.
    pulses_per_revolution : int
        Number of keyphasor marks on the shaft.
    mark_fraction : float
        Fraction of a revolution that the mark covers, 0 to 1.
    response_time : float
        Slowest response of the sensor, s: both light and dark must last longer.
    delay : float
        Time from the passing of the mark to the edge in the signal, s; subtracted from every edge.
    counter : TachoCounter or None
        Counter that timestamps the edges as well; None where only the waveform is sampled.
    """

    threshold: float
    hysteresis: float
    edge: Edge = Edge.RISING
    pulses_per_revolution: int = 1
    mark_fraction: float = 0.5
    response_time: float = 1e-3
    delay: float = 0.0
    counter: TachoCounter | None = None

    @property
    def reference(self) -> str:
        """Source of speed and phase: "counter" or "samples"."""
        return "counter" if self.counter is not None and self.counter.is_reference else "samples"


@dataclass(frozen=True, slots=True)
class Device:
    """The device that delivered the samples."""

    backend: str
    product: str
    serial: str
    driver: str
    simulated: bool


@dataclass(frozen=True, slots=True)
class Acquisition:
    """Actual acquisition settings, read back from the device after they were committed.

    Parameters
    ----------
    device : Device
        Device that delivered the samples.
    rate : float
        Coerced sample rate per channel, Hz.
    convert_rate : float
        Rate of the multiplexer's convert clock, Hz: channel k is sampled k / convert_rate after channel 0.
    channels : tuple of Channel
        Channels in the order of the rows of a block.
    tacho : Tacho
        Settings of the tacho channel.
    buffer : int
        Buffer size of the device, samples per channel; 0 without a device or where unknown.
    """

    device: Device
    rate: float
    convert_rate: float
    channels: tuple[Channel, ...]
    tacho: Tacho
    buffer: int = 0

    @property
    def buffer_time(self) -> float | None:
        """Length of the device buffer, s; None without a device or where unknown."""
        return self.buffer / self.rate if self.buffer else None

    @property
    def ticks_per_sample(self) -> float:
        """Ticks of the tacho counter per sample; 0 without a counter."""
        return 0.0 if self.tacho.counter is None else self.tacho.counter.timebase / self.rate

    def row(self, role: Role) -> int:
        """Return the row of the channel with this role in a block; ValueError where there is none."""
        for row, channel in enumerate(self.channels):
            if channel.role is role:
                return row
        raise ValueError(f"no channel has the role {role.value!r}; there are {[c.role.value for c in self.channels]}")


@dataclass(frozen=True, slots=True)
class RunOutSettings:
    """Run-out compensation of 1X, 2X and the orbit during a run; off by default.

    The compensated values are additional; the values as measured stay.

    Parameters
    ----------
    slow_roll_speed : float
        Run-out is measured from the frames of the run up to this speed, rad/s; 0: not measured.
    vectors : tuple of (int, complex, complex)
        Whole order and its known run-out at the probes x and y, m peak; empty where not known before the run.
    sigma : tuple of float
        Standard deviation of the amplitudes of 1X and 2X of ``vectors``, m peak; 0 where unknown.
    source : str
        Origin of the vectors, as text for the operator.
    from_orbit : bool
        Whether run-out is subtracted from the orbit too.
    """

    slow_roll_speed: float = 0.0
    vectors: tuple[tuple[int, complex, complex], ...] = ()
    sigma: tuple[float, float] = (0.0, 0.0)
    source: str = ""
    from_orbit: bool = False

    @property
    def is_enabled(self) -> bool:
        """Whether any run-out is to be subtracted."""
        return bool(self.vectors) or self.slow_roll_speed > 0.0


class WindowName(StrEnum):
    """Window of a spectrum; `analysis.spectra.windows` holds the constants of each."""

    HANN = "hann"
    FLAT_TOP = "flat top"
    UNIFORM = "uniform"


@dataclass(frozen=True, slots=True)
class AnalysisSettings:
    """Settings of the order analysis, the same live and in replay.

    Parameters
    ----------
    update_interval : float
        Time between snapshots, s of sample time.
    revolutions : int
        Whole revolutions in an order spectrum; the resolution is 1 / revolutions orders.
    points_per_revolution : int
        Angular samples per revolution; even.
    highest_order : float
        Highest order of the spectra.
    orbit_revolutions : int
        Revolutions of the orbit.
    runout : RunOutSettings
        Run-out compensation.
    window : WindowName
        Window of the order spectra and of 1X and 2X; the search below 1X always uses the Hann window.
    """

    update_interval: float = 0.1
    revolutions: int = 16
    points_per_revolution: int = 64
    highest_order: float = 8.0
    orbit_revolutions: int = 4
    runout: RunOutSettings = RunOutSettings()
    window: WindowName = WindowName.HANN


class Severity(StrEnum):
    """Severity of a monitored value against its limits, in rising order."""

    NORMAL = "normal"
    ALARM = "alarm"
    DANGER = "danger"

    @property
    def rank(self) -> int:
        """Position in rising order of severity, from 0."""
        return list(Severity).index(self)


@dataclass(frozen=True, slots=True)
class Limits:
    """Alarm and danger limits of vibration and speed, and the bearing clearance.

    Parameters
    ----------
    hysteresis : float
        Fraction of a limit by which a value must fall below it before the alarm ends, 0 to below 1.
    hold : float
        Time that vibration must exceed its limit before the alarm, s; a speed alarm comes immediately.
    latch : bool
        Whether an alarm stays visible until it is acknowledged.
    """

    peak_to_peak_alarm: Annotated[float, PEAK_TO_PEAK.of("Alarm limit of overall vibration at either probe")]
    peak_to_peak_danger: Annotated[float, PEAK_TO_PEAK.of("Danger limit of overall vibration at either probe")]
    clearance: Annotated[float, LENGTH.of("Radius of the clearance circle")]
    speed: Annotated[float, SPEED.of("Highest speed of the rig: the end of speed axes; raises no alarm")]
    hysteresis: float = 0.05
    hold: float = 1.0
    latch: bool = True
    order_1x_alarm: Annotated[
        float,
        PEAK.of("Alarm limit of 1X at either probe, as measured; unknown where not monitored", "order_1x_peak_alarm"),
    ] = np.inf
    order_1x_danger: Annotated[float, PEAK.of("Danger limit of it", "order_1x_peak_danger")] = np.inf
    below_1x_alarm: Annotated[
        float,
        PEAK.of(
            "Alarm limit of the sum of amplitudes of all components below 1X at either probe; "
            "unknown where not monitored",
            "below_1x_peak_alarm",
        ),
    ] = np.inf
    below_1x_danger: Annotated[float, PEAK.of("Danger limit of it", "below_1x_peak_danger")] = np.inf
    speed_alarm: Annotated[float, SPEED.of("Alarm limit of the speed; unknown where not monitored")] = np.inf
    speed_danger: Annotated[float, SPEED.of("Danger limit of the speed")] = np.inf

    def clearance_fraction(self, peak_to_peak: float) -> float:
        """Return an overall vibration, m peak-to-peak, over the diameter of the clearance circle."""
        return peak_to_peak / (2.0 * self.clearance)

    def severity(self, peak_to_peak: float) -> Severity:
        """Return the severity of an overall vibration, m peak-to-peak; a value equal to a limit exceeds it."""
        if peak_to_peak >= self.peak_to_peak_danger:
            return Severity.DANGER
        return Severity.ALARM if peak_to_peak >= self.peak_to_peak_alarm else Severity.NORMAL


@dataclass(frozen=True, slots=True)
class RunHeader:
    """Everything known about a run at its start; written at the beginning of its file.

    Parameters
    ----------
    run : str
        Id of the run, as "2026-11-24T09-12-07-gj90c".
    rig : str
        Name of the rig.
    started_ns : int
        Wall clock at the start, ns since 1970.
    acquisition : Acquisition
        Channels, rates, calibrations and tacho.
    settings : AnalysisSettings
        Settings of the order analysis.
    limits : Limits
        Alarm limits and clearance.
    config_toml : str
        Rig configuration in force, TOML.
    program : str
        Name and version of the recording program.
    note : str
        Note of the operator.
    """

    run: str
    rig: str
    started_ns: int
    acquisition: Acquisition
    settings: AnalysisSettings
    limits: Limits
    config_toml: str
    program: str
    note: str = ""

"""What an acquisition knew: everything needed to turn recorded codes into metres, speed and phase."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

CODE_MIN, CODE_MAX = -32768, 32767


class Role(StrEnum):
    """What a channel measures."""

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
        Span of output voltage that was calibrated, V. Outside it the polynomial is extrapolated and that is said.
    residual : float
        Largest deviation of the fit from the calibration points, m.
    sensor, conditioner : str
        Serial numbers.
    date : str
        Day of the calibration, ISO 8601.
    target : str
        Material and diameter of what it was calibrated against.
    operator : str
        Who did it.
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
    """One input of the card and what is wired to it.

    Parameters
    ----------
    name : str
        The operator's name, as "x".
    role : Role
        What it measures.
    physical : str
        The card's input, as "ai0".
    range_low, range_high : float
        Input range, V.
    scaling : tuple of float
        The device's polynomial: volts = sum of ``scaling[k] * code**k``.
    calibration : Calibration or None
        For probes: volts to metres of gap.
    angle : float
        For probes: where the probe sits, rad from +X (right), positive in the direction of rotation.
    gap_low, gap_high : float
        For probes: window in which the mean (gap) voltage should lie, V.
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

    def volts(self, codes: NDArray[np.int16]) -> NDArray[np.float64]:
        """Return the voltage at the input, V, for converter codes of any shape."""
        volts = np.polynomial.polynomial.polyval(codes.astype(np.float64), self.scaling)
        return np.asarray(volts, dtype=np.float64)

    def displacement(self, codes: NDArray[np.int16]) -> NDArray[np.float64]:
        """Return the shaft's displacement towards the probe, m, for converter codes of any shape.

        The zero is the probe's tip: minus the gap.
        """
        if self.calibration is None:
            raise ValueError(f"channel {self.name!r} has no calibration: it is no probe")
        gap = np.polynomial.polynomial.polyval(self.volts(codes), self.calibration.coefficients)
        return np.asarray(-gap, dtype=np.float64)


class Edge(StrEnum):
    """Which edge of the tacho's pulse is timed."""

    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True)
class TachoCounter:
    """A counter of the card that stamps the tacho's edges, beside its waveform.

    Parameters
    ----------
    counter : str
        The card's counter, as "ctr0".
    terminal : str
        The card's line that the tacho is wired to as well, as "PFI0".
    edge : Edge
        Edge at that line that is stamped.
    timebase : float
        Rate of its ticks, Hz; they come from the oscillator that the samples come from.
    is_reference : bool
        Whether speed and phase are taken from its stamps; else from the waveform.
    max_difference : float
        How far a stamp may lie from the edge in the waveform, s.
    """

    counter: str
    terminal: str
    edge: Edge
    timebase: float
    is_reference: bool
    max_difference: float


@dataclass(frozen=True, slots=True)
class Tacho:
    """How the tacho is read.

    Parameters
    ----------
    threshold : float
        Middle level, V.
    hysteresis : float
        Full distance between the two switching levels, V.
    edge : Edge
        Edge that marks theta = 0.
    pulses_per_revolution : int
        Marks on the shaft.
    mark_fraction : float
        Part of the turn that the mark covers, 0 to 1.
    response_time : float
        Slowest response of the sensor, s: both light and dark must last longer.
    delay : float
        From the mark's passing to the edge in the signal, s; taken off every edge.
    counter : TachoCounter or None
        The counter that stamps its edges as well; None where only its waveform is sampled.
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
        """What speed and phase are taken from: "counter" or "samples"."""
        return "counter" if self.counter is not None and self.counter.is_reference else "samples"


@dataclass(frozen=True, slots=True)
class Device:
    """Which device delivered the samples."""

    backend: str
    product: str
    serial: str
    driver: str
    simulated: bool


@dataclass(frozen=True, slots=True)
class Acquisition:
    """The acquisition as it really was, read back from the device after it was committed.

    Parameters
    ----------
    device : Device
        What delivered the samples.
    rate : float
        Coerced sample rate per channel, Hz.
    convert_rate : float
        Rate of the multiplexer's convert clock, Hz: channel k is sampled k / convert_rate after channel 0.
    channels : tuple of Channel
        In the order of the rows of a block.
    tacho : Tacho
        How the tacho channel is read.
    buffer : int
        Samples per channel that the device holds for a late reader; 0 where there is no device or nobody knows.
    """

    device: Device
    rate: float
    convert_rate: float
    channels: tuple[Channel, ...]
    tacho: Tacho
    buffer: int = 0

    @property
    def buffer_time(self) -> float | None:
        """How long the device holds samples for a late reader, s; None where there is no device or nobody knows."""
        return self.buffer / self.rate if self.buffer else None

    @property
    def ticks_per_sample(self) -> float:
        """Ticks of the tacho's counter from one sample to the next; 0 where there is no counter."""
        return 0.0 if self.tacho.counter is None else self.tacho.counter.timebase / self.rate

    def row(self, role: Role) -> int:
        """Return the row of a block that holds the channel of this role; ValueError where there is none."""
        for row, channel in enumerate(self.channels):
            if channel.role is role:
                return row
        raise ValueError(f"no channel has the role {role.value!r}; there are {[c.role.value for c in self.channels]}")


@dataclass(frozen=True, slots=True)
class RunOutSettings:
    """What is taken off 1X, 2X and the orbit while a run goes, beside what was measured; by default nothing is.

    Parameters
    ----------
    slow_roll_speed : float
        Frames of the run up to this speed tell its run-out, rad/s; 0: none does.
    vectors : tuple of (int, complex, complex)
        Whole order, and the run-out at the probes x and y that was known before, m peak; empty: not known before.
    sigma : tuple of float
        Standard deviation of the amplitudes of 1X and 2X among them, m peak; 0 where nobody knows.
    source : str
        Where the vectors come from, for people.
    from_orbit : bool
        Whether it is taken off the orbit too.
    """

    slow_roll_speed: float = 0.0
    vectors: tuple[tuple[int, complex, complex], ...] = ()
    sigma: tuple[float, float] = (0.0, 0.0)
    source: str = ""
    from_orbit: bool = False

    @property
    def is_enabled(self) -> bool:
        """Whether any run-out is to be taken off."""
        return bool(self.vectors) or self.slow_roll_speed > 0.0


@dataclass(frozen=True, slots=True)
class AnalysisSettings:
    """How a run is analysed live and afterwards, alike.

    Parameters
    ----------
    update_interval : float
        Time between snapshots, s of sample time.
    revolutions : int
        Whole revolutions in an order spectrum; the resolution is 1 / revolutions orders.
    points_per_revolution : int
        Angular samples a revolution; even.
    highest_order : float
        Order up to which spectra are given.
    orbit_revolutions : int
        Revolutions drawn as orbit.
    runout : RunOutSettings
        What is taken off as run-out.
    """

    update_interval: float = 0.1
    revolutions: int = 16
    points_per_revolution: int = 64
    highest_order: float = 8.0
    orbit_revolutions: int = 4
    runout: RunOutSettings = RunOutSettings()


class Severity(StrEnum):
    """What is watched against its limits, from harmless to worst."""

    NORMAL = "normal"
    ALARM = "alarm"
    DANGER = "danger"

    @property
    def rank(self) -> int:
        """0 for the harmless one, rising."""
        return list(Severity).index(self)


@dataclass(frozen=True, slots=True)
class Limits:
    """What the operator must not pass, and the room there is.

    Parameters
    ----------
    peak_to_peak_alarm, peak_to_peak_danger : float
        Overall vibration at either probe, m peak-to-peak.
    clearance : float
        Radius of the circle that the shaft can move in, m.
    speed : float
        Highest speed of the rig, rad/s: how far picture and prediction reach; no alarm by itself.
    hysteresis : float
        Part of a limit by which what is watched must fall below it before its alarm ends, 0 to below 1.
    hold : float
        Time that a vibration must pass its limit before its alarm comes, s; that of the speed comes at once.
    latch : bool
        Whether an alarm stays in sight until somebody acknowledges it.
    order_1x_alarm, order_1x_danger : float
        1X at either probe as measured, m peak; infinite where it is not watched, as all that follow.
    below_1x_alarm, below_1x_danger : float
        All components below 1X together at either probe: the sum of their amplitudes, m peak.
    speed_alarm, speed_danger : float
        Speed of the shaft, rad/s.
    """

    peak_to_peak_alarm: float
    peak_to_peak_danger: float
    clearance: float
    speed: float
    hysteresis: float = 0.05
    hold: float = 1.0
    latch: bool = True
    order_1x_alarm: float = np.inf
    order_1x_danger: float = np.inf
    below_1x_alarm: float = np.inf
    below_1x_danger: float = np.inf
    speed_alarm: float = np.inf
    speed_danger: float = np.inf

    def clearance_fraction(self, peak_to_peak: float) -> float:
        """Return an overall vibration, m peak-to-peak, over the clearance's diameter: 1 is all the room there is."""
        return peak_to_peak / (2.0 * self.clearance)

    def severity(self, peak_to_peak: float) -> Severity:
        """Return how an overall vibration, m peak-to-peak, stands to the limits; a limit that is met is passed."""
        if peak_to_peak >= self.peak_to_peak_danger:
            return Severity.DANGER
        return Severity.ALARM if peak_to_peak >= self.peak_to_peak_alarm else Severity.NORMAL


@dataclass(frozen=True, slots=True)
class RunHeader:
    """All that is known of a run when it starts; written first into its file.

    Parameters
    ----------
    run : str
        Its id, as "2026-11-24T09-12-07-gj90c".
    rig : str
        Name of the rig.
    started_ns : int
        Wall clock at the start, ns since 1970.
    acquisition : Acquisition
        What turns codes into quantities.
    settings : AnalysisSettings
        How it is analysed.
    limits : Limits
        What is watched.
    config_toml : str
        The rig's configuration as it was in force, TOML.
    program : str
        Name and version of the program that recorded it.
    note : str
        The operator's words.
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

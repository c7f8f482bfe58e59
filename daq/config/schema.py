"""rig.toml: what is wired where, how it is calibrated, how fast it is read, what is watched and where it is kept."""

import re
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from analysis.signals.header import Edge, Role


class Section(BaseModel):
    """A table of rig.toml: unknown keys are faults, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


INPUT_RANGES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)  # of an M Series card, V, plus and minus


def _input_range(value: float) -> float:
    if value not in INPUT_RANGES:
        raise ValueError(f"expected one of the card's ranges {', '.join(f'{r:g}' for r in INPUT_RANGES)}")
    return value


InputRange = Annotated[float, AfterValidator(_input_range)]


class Backend(StrEnum):
    """What delivers the samples."""

    NIDAQMX = "nidaqmx"
    SIMULATED = "simulated"


class DeviceSection(Section):
    """`[device]`: which card, or the simulated one."""

    backend: Backend = Backend.SIMULATED
    product: str = "USB-6251"
    name: str = "Dev1"
    serial: Annotated[
        str, Field(pattern=r"^(0[xX])?[0-9A-Fa-f]{0,16}$", description="the hexadecimal number printed on the card")
    ] = ""  # hexadecimal as printed on the card; when given, binds the card wherever it is plugged
    target: Annotated[str, Field(pattern=r"^(\S+:\S+)?$", description='an address as "host:port", or nothing')] = (
        ""  # of a gRPC device server; empty: the driver on this machine
    )
    deadline_s: Positive = 3.0  # for every call over gRPC, beyond the call's own time-out


class TimingSection(Section):
    """`[timing]`: how fast, in what portions."""

    rate_hz: Positive = 100_000.0  # per channel
    block_s: Annotated[float, Field(ge=0.005, le=1.0)] = 0.1
    buffer_s: Annotated[float, Field(ge=0.5, le=60.0)] = 8.0


class ChannelSection(Section):
    """`[[channel]]`: one input and what is wired to it."""

    name: Annotated[
        str,
        Field(
            pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$", description="up to 32 letters, digits, - and _, a letter first"
        ),
    ]
    role: Role
    physical: Annotated[str, Field(pattern=r"^ai[0-9]{1,2}$", description='an input of the card, as "ai0"')]
    terminal: Literal["differential", "rse", "nrse"] = "differential"
    range_v: InputRange = 10.0  # plus and minus
    angle_deg: float = 0.0
    calibration: str = ""  # file, relative to rig.toml; for probes
    gap_window_v: tuple[float, float] = (1.0, 9.0)


class CounterSection(Section):
    """`[tacho.counter]`: a counter of the card that stamps the tacho's edges, beside the channel that samples it."""

    counter: Annotated[str, Field(pattern=r"^ctr[0-9]$", description='a counter of the card, as "ctr0"')] = "ctr0"
    terminal: Annotated[str, Field(pattern=r"^PFI[0-9]{1,2}$", description='a line of the card, as "PFI0"')] = "PFI0"
    edge: Edge | None = None  # at that line; left out: as tacho.edge
    timebase_hz: Positive = 80e6
    reference: Literal["samples", "counter"] = "samples"  # what speed and phase are taken from
    max_difference_us: Positive = 50.0  # how far apart the two may have an edge before it is told


class TachoSection(Section):
    """`[tacho]`: how the mark is read."""

    threshold_v: float = 2.5
    hysteresis_v: Positive = 1.0
    edge: Edge = Edge.RISING
    pulses_per_revolution: Annotated[int, Field(ge=1, le=1024)] = 1
    mark_fraction: Annotated[float, Field(gt=0, lt=1)] = 0.5
    response_time_s: NotNegative = 1e-3
    delay_s: NotNegative = 0.0
    counter: CounterSection | None = None


class LimitsSection(Section):
    """`[limits]`: what must not be passed."""

    peak_to_peak_alarm_um: Positive = 80.0
    peak_to_peak_danger_um: Positive = 95.0
    clearance_um: Positive = 100.0  # radius of the circle the shaft can move in
    speed_rpm: Positive = 20_000.0
    hysteresis_fraction: Annotated[float, Field(ge=0, le=0.5)] = 0.05  # part of a limit, below it, where its alarm ends
    hold_s: Annotated[float, Field(ge=0, le=60)] = 1.0  # how long vibration must pass a limit before its alarm
    latch: bool = True  # an alarm stays in sight until somebody acknowledges it
    order_1x_peak_alarm_um: NotNegative = 0.0  # of 1X at either probe; 0: not watched, as all that follow
    order_1x_peak_danger_um: NotNegative = 0.0
    below_1x_peak_alarm_um: NotNegative = 0.0  # of all components below 1X at either probe, added
    below_1x_peak_danger_um: NotNegative = 0.0
    speed_alarm_rpm: NotNegative = 0.0
    speed_danger_rpm: NotNegative = 0.0


class AnalysisSection(Section):
    """`[analysis]`: how a run is analysed, live and afterwards."""

    update_s: Annotated[float, Field(ge=0.02, le=2.0)] = 0.1
    revolutions: Annotated[int, Field(ge=4, le=256)] = 16
    points_per_revolution: Annotated[int, Field(ge=16, le=1024, multiple_of=2)] = 64
    highest_order: Annotated[float, Field(ge=2, le=64)] = 8.0


class RunOutVector(Section):
    """`[[runout.vector]]`: what the probes see of the surface at one whole order."""

    order: Annotated[int, Field(ge=1, le=64)] = 1
    x_um: NotNegative  # peak, at probe x
    x_lag_deg: float  # after the tacho's mark
    y_um: NotNegative
    y_lag_deg: float
    sigma_um: NotNegative = 0.0  # standard deviation of either amplitude; 0 where nobody knows


class RunOutSection(Section):
    """`[runout]`: what is taken off 1X and 2X as run-out, beside the values as measured."""

    slow_roll_rpm: NotNegative = 0.0  # frames of a run up to this speed tell its run-out; 0: none does
    from_run: str = ""  # its id or file; empty: of the present run
    correct_orbit: bool = False  # take it off the orbit too
    vector: tuple[RunOutVector, ...] = ()  # given instead
    source: str = ""  # where the vectors come from, for people


class StorageSection(Section):
    """`[storage]`: where runs go and how much room must stay."""

    folder: str = ""  # empty: $RIG_DATA, else ./data
    reserve_gb: NotNegative = 1.0  # recording stops cleanly before less is free
    split_gb: NotNegative = 0.0  # a run goes on in a further file when one is so large; 0: never
    split_minutes: NotNegative = 0.0  # or holds so many minutes; 0: never
    catalogue: Annotated[
        str,
        Field(
            pattern=r"^((postgresql|sqlite)(\+[a-z0-9]+)?://\S*)?$",
            description='an address as "postgresql+psycopg://user@host/name", or nothing',
        ),
    ] = ""  # database of the runs; empty: $RIG_CATALOGUE, else in the folder


SPEED, TIME = "speed", "time"
_NUMBER = r"[+-]?(?:[0-9]{1,3}(?:,[0-9]{3})+|[0-9][0-9_]*)(?:\.[0-9]+)?"  # a comma parts thousands, never decimals
_CONDITION = re.compile(rf"\s*([A-Za-z][A-Za-z0-9_-]{{0,31}})\s*([<>])\s*({_NUMBER})\s*")


@dataclass(frozen=True, slots=True)
class TriggerCondition:
    """A quantity above or below a value.

    Parameters
    ----------
    quantity : str
        "speed", "time", or the name of a channel.
    is_above : bool
        Whether it must be above the value; else below.
    value : float
        r/min of the speed, s of the time, V of a channel.
    """

    quantity: str
    is_above: bool
    value: float

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return {SPEED: "r/min", TIME: "s"}.get(self.quantity, "V")

    def __str__(self) -> str:
        """Return it as the operator writes it, with its unit."""
        return f"{self.quantity} {'>' if self.is_above else '<'} {self.value:g} {self.unit}"

    def holds(self, value: float) -> bool:
        """Return whether it holds for a value of its quantity; never for NaN."""
        return value > self.value if self.is_above else value < self.value


def parse_condition(text: str) -> TriggerCondition | None:
    """Return the condition that a text says, None for an empty one.

    Raises
    ------
    ValueError
        The text says none; the message tells what is expected.
    """
    if not text.strip():
        return None
    found = _CONDITION.fullmatch(text)
    if found is None:
        raise ValueError('expected a condition such as "speed > 2000" (r/min), "x > 4.5" (V) or "time > 10" (s)')
    quantity, sign, value = found.groups()
    return TriggerCondition(quantity, sign == ">", float(value.replace("_", "").replace(",", "")))


def _condition(value: str) -> str:
    parse_condition(value)
    return value


ConditionText = Annotated[str, AfterValidator(_condition)]


class TriggerSection(Section):
    """`[trigger]`: from when to when a run is recorded."""

    start: ConditionText = ""  # as "speed > 2000" (r/min), "x > 4.5" (V), "time > 10" (s); empty: at once
    stop: ConditionText = ""  # likewise; empty: until it is stopped
    pre_s: Annotated[float, Field(ge=0, le=30)] = 2.0  # of samples from before the start that are recorded too
    hold_s: Annotated[float, Field(ge=0, le=60)] = 0.5  # how long a condition must hold
    events: Annotated[int, Field(ge=0, le=100_000)] = 1  # recordings, each a file of its own; 0: until it is stopped
    hold_off_s: Annotated[float, Field(ge=0, le=86_400)] = 0.0  # after a stop, before a start is looked for again


class PreflightSection(Section):
    """`[preflight]`: what `rig preflight` still takes for good, where that is a matter of the rig."""

    hum_warn_um: NotNegative = 1.0  # mains hum of a probe, peak: above it is said,
    hum_fail_um: NotNegative = 5.0  # and above this it stands against a run
    calibration_days: Annotated[int, Field(ge=1, le=36_500)] = 365  # how old a probe's calibration may be
    self_calibration_days: Annotated[int, Field(ge=1, le=36_500)] = 365  # how long ago the card calibrated itself
    residual_fraction: Annotated[float, Field(gt=0, le=0.5)] = 0.01  # of the calibrated gap, a fit's worst point
    tacho_scatter_fraction: Annotated[float, Field(gt=0, le=1)] = 0.05  # of the period
    tacho_mark_tolerance_fraction: Annotated[float, Field(gt=0, lt=1)] = (
        0.15  # of the turn, light against mark_fraction
    )
    disk_duration_h: NotNegative = 1.0  # that should fit on the disk where no duration is planned


class SessionSection(Section):
    """`[session]`: how a recording goes on after a fault, in a new segment."""

    restarts_per_minute: Annotated[int, Field(ge=0, le=60)] = 5  # new segments; 0: the first fault ends the run
    reconnect_s: Annotated[float, Field(ge=0, le=86_400)] = 60.0  # how long a card that went away is waited for
    retry_s: Annotated[float, Field(ge=0.2, le=1.0)] = 0.5  # between two attempts to open it again


class ModelSection(Section):
    """`[model]`: the rotor that is laid over the measurement, and what differs here from its file."""

    rotor: str = ""  # file, relative to rig.toml; empty: the thesis's GJ90C
    imbalance_kg_m: NotNegative | None = None  # this and the next two: of the file's first imbalance
    imbalance_station: Annotated[int, Field(ge=1)] | None = None
    imbalance_phase_deg: float | None = None  # from the tacho mark, in the direction of rotation
    viscosity_pa_s: Positive | None = None
    inner_clearance_um: Positive | None = None
    outer_clearance_um: Positive | None = None


class ProfilePoint(Section):
    """A corner of the speed profile."""

    time_s: Annotated[float, Field(ge=0, le=86_400)]  # a day at most
    speed_rpm: NotNegative


class WhirlSection(Section):
    """`[[simulation.whirl]]`: a sub-synchronous component that the bench shows whether the model does or not."""

    order: Annotated[float, Field(gt=0, lt=1)]
    onset_rpm: Positive
    end_rpm: Positive
    amplitude_um: Positive  # peak, reached a tenth of the onset speed above the onset and kept up to its end
    forward: bool = True


class Miswiring(StrEnum):
    """What is wired wrongly at the simulated bench."""

    NONE = "none"
    X_OPEN = "probe x open"
    Y_OPEN = "probe y open"
    X_CLOSED = "probe x gap closed"
    Y_OUT_OF_REACH = "probe y out of reach"
    X_REVERSED = "probe x reversed"
    BRIDGED = "probes bridged"
    PROBES_EXCHANGED = "probes exchanged"
    TACHO_EXCHANGED = "probe x and tacho exchanged"
    TACHO_SILENT = "tacho silent"
    TACHO_REVERSED = "tacho reversed"
    TACHO_WEAK = "tacho weak"
    HUM = "mains hum"


class SimulationSection(Section):
    """`[simulation]`: the rig that is simulated; only read by the simulated backend.

    The shaft follows the model, integrated in time along the speed profile ("model"), or its synchronous motion with
    the whirls that are listed ("bench").
    """

    motion: Literal["model", "bench"] = "bench"
    seed: Annotated[int, Field(ge=0)] = 2012  # the same seed makes the same run, bit for bit
    pace: Literal["real time", "flat out"] = "real time"
    profile: tuple[ProfilePoint, ...] = (
        ProfilePoint(time_s=0, speed_rpm=1000),
        ProfilePoint(time_s=20, speed_rpm=15_600),
    )
    whirl: tuple[WhirlSection, ...] = ()
    speed_fluctuation: Annotated[float, Field(ge=0, le=0.1)] = 0.002  # rms, relative: the air is not steady
    fluctuation_time_s: Annotated[float, Field(ge=0.1, le=60)] = (
        1.0  # how slowly the air and the rotor's inertia let it vary
    )
    speed_drift: Annotated[float, Field(ge=-0.1, le=0.1)] = 0.0  # relative per minute
    run_out_um: NotNegative = 1.0  # residual, 1X at the probe, peak
    second_order_um: NotNegative = 1.5  # the steady 2X that the thesis saw, peak
    sag_um: NotNegative = 20.0  # how far below the bearing's centre the shaft runs ("model" finds its own)
    glitches_per_s: Annotated[float, Field(ge=0, le=1000)] = 0.5  # of each probe
    glitch_um: NotNegative = 6.0  # rms of their heights
    sensor_noise_um: NotNegative = 0.1  # rms
    sensor_bandwidth_hz: Positive = 50_000.0
    gap_um: tuple[NotNegative, NotNegative] = (500.0, 500.0)  # of x and y with the shaft in the bearing's centre
    tacho_jitter_us: NotNegative = 5.0  # rms
    tacho_high_v: float = 4.2
    tacho_low_v: float = 0.1
    tacho_rise_us: Positive = 30.0  # from one level to the other
    tacho_noise_v: NotNegative = 0.01  # rms
    miswiring: Miswiring = Miswiring.NONE  # what the preflight is to find; the seed draws how wrong it is


class RigConfig(Section):
    """A whole rig.toml."""

    rig: Annotated[
        str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,31}$", description="up to 32 small letters, digits and hyphens")
    ] = "gj90c"
    device: DeviceSection = DeviceSection()
    timing: TimingSection = TimingSection()
    channel: tuple[ChannelSection, ...]
    tacho: TachoSection = TachoSection()
    limits: LimitsSection = LimitsSection()
    analysis: AnalysisSection = AnalysisSection()
    runout: RunOutSection = RunOutSection()
    storage: StorageSection = StorageSection()
    session: SessionSection = SessionSection()
    trigger: TriggerSection = TriggerSection()
    preflight: PreflightSection = PreflightSection()
    model: ModelSection = ModelSection()
    rotor: dict[str, object] = {}  # content of the rotor file, put here when rig.toml is read
    simulation: SimulationSection = SimulationSection()

"""The schema of rig.toml, and the syntax of trigger conditions."""

import re
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from analysis.signals.header import Edge, Role, WindowName


class Section(BaseModel):
    """Base class of rig.toml's tables: unknown keys are errors, instances are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Backend(StrEnum):
    """The source of the samples."""

    NIDAQMX = "nidaqmx"
    SIMULATED = "simulated"


class DeviceSection(Section):
    """`[device]`: the card, real or simulated."""

    backend: Backend = Backend.SIMULATED
    product: str = "USB-6251"  # determines the limits, see daq.config.devices
    name: str = "Dev1"
    serial: Annotated[
        str, Field(pattern=r"^(0[xX])?[0-9A-Fa-f]{0,16}$", description="the hexadecimal number printed on the card")
    ] = ""  # identifies the card at any USB port; empty: `name` does
    # Address of a gRPC device server; empty: the driver on this machine.
    target: Annotated[str, Field(pattern=r"^(\S+:\S+)?$", description='an address as "host:port", or nothing')] = ""
    deadline_s: Positive = 3.0  # of every gRPC call, in addition to the call's own time-out


class TimingSection(Section):
    """`[timing]`: sample rate, block length and buffer."""

    rate_hz: Positive = 100_000.0  # per channel
    block_s: Annotated[float, Field(ge=0.005, le=1.0)] = 0.1
    buffer_s: Annotated[float, Field(ge=0.5, le=60.0)] = 8.0


class ChannelSection(Section):
    """`[[channel]]`: an input and the sensor connected to it."""

    name: Annotated[
        str,
        Field(
            pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$", description="up to 32 letters, digits, - and _, a letter first"
        ),
    ]
    role: Role
    physical: Annotated[str, Field(pattern=r"^ai[0-9]{1,2}$", description='an input of the card, as "ai0"')]
    terminal: Literal["differential", "rse", "nrse"] = "differential"
    range_v: Positive = 10.0  # plus and minus
    angle_deg: float = 0.0
    calibration: str = ""  # file, relative to rig.toml; for probes
    gap_window_v: tuple[float, float] = (1.0, 9.0)


class CounterSection(Section):
    """`[tacho.counter]`: a counter of the card that timestamps the tacho's edges, beside the sampled channel."""

    counter: Annotated[str, Field(pattern=r"^ctr[0-9]$", description='a counter of the card, as "ctr0"')] = "ctr0"
    terminal: Annotated[str, Field(pattern=r"^PFI[0-9]{1,2}$", description='a line of the card, as "PFI0"')] = "PFI0"
    edge: Edge | None = None  # at that line; default: tacho.edge
    timebase_hz: Positive | None = None  # default: the fastest clock of the card
    reference: Literal["samples", "counter"] = "samples"  # source of speed and phase
    max_difference_us: Positive = 50.0  # between the two times of an edge, before it is reported


class TachoSection(Section):
    """`[tacho]`: signal of the keyphasor mark."""

    threshold_v: float = 2.5
    hysteresis_v: Positive = 1.0
    edge: Edge = Edge.RISING
    pulses_per_revolution: Annotated[int, Field(ge=1, le=1024)] = 1
    mark_fraction: Annotated[float, Field(gt=0, lt=1)] = 0.5
    response_time_s: NotNegative = 1e-3
    delay_s: NotNegative = 0.0
    counter: CounterSection | None = None


class LimitsSection(Section):
    """`[limits]`: alarm limits."""

    peak_to_peak_alarm_um: Positive = 80.0
    peak_to_peak_danger_um: Positive = 95.0
    clearance_um: Positive = 100.0  # radius of the circle the shaft can move in
    speed_rpm: Positive = 20_000.0
    hysteresis_fraction: Annotated[float, Field(ge=0, le=0.5)] = 0.05  # of a limit: an alarm ends this far below it
    hold_s: Annotated[float, Field(ge=0, le=60)] = 1.0  # how long vibration must exceed a limit before its alarm
    latch: bool = True  # an alarm stays visible until it is acknowledged
    order_1x_peak_alarm_um: NotNegative = 0.0  # of 1X at either probe; 0: no limit, as for all keys below
    order_1x_peak_danger_um: NotNegative = 0.0
    below_1x_peak_alarm_um: NotNegative = 0.0  # sum of all components below 1X at either probe
    below_1x_peak_danger_um: NotNegative = 0.0
    speed_alarm_rpm: NotNegative = 0.0
    speed_danger_rpm: NotNegative = 0.0


class AnalysisSection(Section):
    """`[analysis]`: settings of the analysis, live and offline."""

    update_s: Annotated[float, Field(ge=0.02, le=2.0)] = 0.1
    revolutions: Annotated[int, Field(ge=4, le=256)] = 16
    points_per_revolution: Annotated[int, Field(ge=16, le=1024, multiple_of=2)] = 64
    highest_order: Annotated[float, Field(ge=2, le=64)] = 8.0
    window: WindowName = WindowName.HANN  # of the order spectra; the search below 1X always uses "hann"


class RunOutVector(Section):
    """`[[runout.vector]]`: run-out at the probes at one integer order."""

    order: Annotated[int, Field(ge=1, le=64)] = 1
    x_um: NotNegative  # peak, at probe x
    x_lag_deg: float  # phase lag behind the keyphasor mark
    y_um: NotNegative
    y_lag_deg: float
    sigma_um: NotNegative = 0.0  # standard deviation of either amplitude; 0 if unknown


class RunOutSection(Section):
    """`[runout]`: run-out to subtract from 1X and 2X; the values as measured are reported too."""

    slow_roll_rpm: NotNegative = 0.0  # run-out is measured up to this speed; 0: it is not measured
    from_run: str = ""  # id or file of the run that measures it; empty: the current run
    correct_orbit: bool = False  # subtract it from the orbit too
    vector: tuple[RunOutVector, ...] = ()  # known run-out, instead of a measurement
    source: str = ""  # origin of the vectors, as a note


class StorageSection(Section):
    """`[storage]`: data folder, free space, splitting of files, catalogue."""

    folder: str = ""  # empty: $RIG_DATA, else ./data
    reserve_gb: NotNegative = 1.0  # recording stops cleanly when less is free
    split_gb: NotNegative = 0.0  # a run continues in a further file at this size; 0: never
    split_minutes: NotNegative = 0.0  # or at this duration; 0: never
    catalogue: Annotated[
        str,
        Field(
            pattern=r"^((postgresql|sqlite)(\+[a-z0-9]+)?://\S*)?$",
            description='an address as "postgresql+psycopg://user@host/name", or nothing',
        ),
    ] = ""  # database of the runs; empty: $RIG_CATALOGUE, else in the folder


SPEED, TIME = "speed", "time"  # quantities of a condition; any other is a channel
_NUMBER = r"[+-]?(?:[0-9]{1,3}(?:,[0-9]{3})+|[0-9][0-9_]*)(?:\.[0-9]+)?"  # a comma separates thousands, never decimals
_CONDITION = re.compile(rf"\s*([A-Za-z][A-Za-z0-9_-]{{0,31}})\s*([<>])\s*({_NUMBER})\s*")


@dataclass(frozen=True, slots=True)
class TriggerCondition:
    """The condition that a quantity is above or below a value.

    Parameters
    ----------
    quantity : str
        "speed", "time", or the name of a channel.
    is_above : bool
        Whether it must be above the value; otherwise below.
    value : float
        Speed, r/min; time, s; or a channel's voltage, V.
    """

    quantity: str
    is_above: bool
    value: float

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return {SPEED: "r/min", TIME: "s"}.get(self.quantity, "V")

    def __str__(self) -> str:
        """Return the condition as the operator writes it, with unit."""
        return f"{self.quantity} {'>' if self.is_above else '<'} {self.value:g} {self.unit}"

    def holds(self, value: float) -> bool:
        """Return whether it holds for a value of its quantity; False for NaN."""
        return value > self.value if self.is_above else value < self.value


def parse_condition(text: str) -> TriggerCondition | None:
    """Return the condition in a text such as "speed > 2000", None for an empty text.

    Raises
    ------
    ValueError
        The text is not a condition; the message gives examples.
    """
    if not text.strip():
        return None
    matched = _CONDITION.fullmatch(text)
    if matched is None:
        raise ValueError('expected a condition such as "speed > 2000" (r/min), "x > 4.5" (V) or "time > 10" (s)')
    quantity, sign, value = matched.groups()
    return TriggerCondition(quantity, sign == ">", float(value.replace("_", "").replace(",", "")))


def _condition(value: str) -> str:
    parse_condition(value)
    return value


ConditionText = Annotated[str, AfterValidator(_condition)]


class TriggerSection(Section):
    """`[trigger]`: conditions that start and stop a recording."""

    start: ConditionText = ""  # as "speed > 2000" (r/min), "x > 4.5" (V), "time > 10" (s); empty: at once
    stop: ConditionText = ""  # likewise; empty: until stopped
    pre_s: Annotated[float, Field(ge=0, le=30)] = 2.0  # pre-trigger time
    hold_s: Annotated[float, Field(ge=0, le=60)] = 0.5  # how long a condition must hold
    events: Annotated[int, Field(ge=0, le=100_000)] = 1  # recordings, each in a separate file; 0: until stopped
    hold_off_s: Annotated[float, Field(ge=0, le=86_400)] = 0.0  # time after a stop before the trigger is rearmed


class PreflightSection(Section):
    """`[preflight]`: rig-specific limits of `rig preflight`."""

    hum_warn_um: NotNegative = 1.0  # mains hum of a probe, peak: above this a warning,
    hum_fail_um: NotNegative = 5.0  # above this a failed check
    calibration_days: Annotated[int, Field(ge=1, le=36_500)] = 365  # maximum age of a probe's calibration
    self_calibration_days: Annotated[int, Field(ge=1, le=36_500)] = 365  # maximum age of the card's self-calibration
    residual_fraction: Annotated[float, Field(gt=0, le=0.5)] = 0.01  # of the calibrated gap: maximum residual of a fit
    tacho_scatter_fraction: Annotated[float, Field(gt=0, le=1)] = 0.05  # of the period: maximum scatter
    tacho_mark_tolerance_fraction: Annotated[float, Field(gt=0, lt=1)] = 0.15  # of the turn: |light - mark_fraction|
    disk_duration_h: NotNegative = 1.0  # assumed run duration for the disk check if none is given


class SessionSection(Section):
    """`[session]`: continuation of a recording in a new segment after a fault."""

    restarts_per_minute: Annotated[int, Field(ge=0, le=60)] = 5  # new segments; 0: the first fault ends the run
    reconnect_s: Annotated[float, Field(ge=0, le=86_400)] = 60.0  # how long to wait for a disconnected card
    retry_s: Annotated[float, Field(ge=0.2, le=1.0)] = 0.5  # between two attempts to reconnect


class ModelSection(Section):
    """`[model]`: the rotor model for the prediction, and changes to its file."""

    rotor: str = ""  # rotor file, relative to rig.toml; empty: the thesis's GJ90C
    imbalance_kg_m: NotNegative | None = None  # this and the next two keys change the file's first imbalance
    imbalance_station: Annotated[int, Field(ge=1)] | None = None
    imbalance_phase_deg: float | None = None  # from the keyphasor mark, in the direction of rotation
    viscosity_pa_s: Positive | None = None
    inner_clearance_um: Positive | None = None
    outer_clearance_um: Positive | None = None


class ProfilePoint(Section):
    """`[[simulation.profile]]`: a corner of the speed profile."""

    time_s: Annotated[float, Field(ge=0, le=86_400)]  # a day at most
    speed_rpm: NotNegative


class WhirlSection(Section):
    """`[[simulation.whirl]]`: a prescribed sub-synchronous component, independent of the model."""

    order: Annotated[float, Field(gt=0, lt=1)]
    onset_rpm: Positive
    end_rpm: Positive
    amplitude_um: Positive  # peak, from 1.1 times the onset speed up to the end
    forward: bool = True


class Miswiring(StrEnum):
    """A wiring fault of the simulated bench."""

    NONE = "none"
    X_OPEN = "probe x open"
    Y_OPEN = "probe y open"
    X_INTERMITTENT = "probe x intermittent"
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
    """`[simulation]`: the simulated rig; ignored by other backends.

    The shaft's motion is the model's, integrated in time along the speed profile ("model"), or the model's synchronous
    motion with the listed whirls ("bench").
    """

    motion: Literal["model", "bench"] = "bench"
    seed: Annotated[int, Field(ge=0)] = 2012  # the same seed gives the same run, bit for bit
    pace: Literal["real time", "flat out"] = "real time"
    profile: tuple[ProfilePoint, ...] = (
        ProfilePoint(time_s=0, speed_rpm=1000),
        ProfilePoint(time_s=20, speed_rpm=15_600),
    )
    whirl: tuple[WhirlSection, ...] = ()
    speed_fluctuation: Annotated[float, Field(ge=0, le=0.1)] = 0.002  # rms, relative: unsteady drive air
    fluctuation_time_s: Annotated[float, Field(ge=0.1, le=60)] = 1.0  # correlation time of the fluctuation
    speed_drift: Annotated[float, Field(ge=-0.1, le=0.1)] = 0.0  # relative per minute
    run_out_um: NotNegative = 1.0  # residual, 1X at the probe, peak
    second_order_um: NotNegative = 1.5  # the constant 2X that the thesis measured, peak
    sag_um: NotNegative = 20.0  # how far below the bearing's centre the shaft runs ("bench" only)
    glitches_per_s: Annotated[float, Field(ge=0, le=1000)] = 0.5  # at each probe
    glitch_um: NotNegative = 6.0  # rms of their heights
    sensor_noise_um: NotNegative = 0.1  # rms
    sensor_bandwidth_hz: Positive = 50_000.0
    gap_um: tuple[NotNegative, NotNegative] = (500.0, 500.0)  # of x and y with the shaft in the bearing's centre
    tacho_jitter_us: NotNegative = 5.0  # rms
    tacho_high_v: float = 4.2
    tacho_low_v: float = 0.1
    tacho_rise_us: Positive = 30.0  # from one level to the other
    tacho_noise_v: NotNegative = 0.01  # rms
    miswiring: Miswiring = Miswiring.NONE  # a fault for the preflight to detect; the seed determines its size


class RigConfig(Section):
    """The content of a rig.toml."""

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
    rotor: dict[str, object] = {}  # content of the rotor file, inserted when rig.toml is loaded
    simulation: SimulationSection = SimulationSection()

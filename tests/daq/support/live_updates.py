"""Live updates of a run-up in closed form, for tests of the view and the service without file, card or model."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.live.alarms import Alarm, AlarmMonitor, MonitoredQuantity, visible_alarms, worst_severity
from analysis.signals.blocks import TimeInRun
from analysis.signals.header import (
    Acquisition,
    AnalysisSettings,
    Calibration,
    Channel,
    Device,
    Limits,
    Role,
    RunHeader,
    RunOutSettings,
    Severity,
    Tacho,
)
from analysis.signals.snapshot import OVERALL, OrderFrame, RunOut, Snapshot, TachoReport, TachoState, Trace, Whirl
from analysis.signals.units import RPM
from daq.session.live_update import LiveUpdate, RunState, Status
from model.prediction.prediction_map import Prediction

RATE = 100_000.0
LOW, HIGH = 1_000.0 * RPM, 15_600.0 * RPM

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def make_header(run: str = "2026-11-24T09-12-07-gj90c") -> RunHeader:
    """Return the header of a run with two probes 90° apart and the bench's limits."""
    calibration = Calibration(coefficients=(0.0, 1e-4), volts_low=0.2, volts_high=9.8)
    scaling = (0.0, 10.0 / 32768.0)
    probes = tuple(
        Channel(name, role, physical, -10.0, 10.0, scaling, calibration, angle, gap_low=1.0, gap_high=9.0)
        for name, role, physical, angle in (("x", Role.PROBE_X, "ai0", 0.0), ("y", Role.PROBE_Y, "ai1", math.pi / 2))
    )
    tacho = Channel("tacho", Role.TACHO, "ai2", -10.0, 10.0, scaling)
    return RunHeader(
        run=run,
        rig="gj90c",
        started_ns=1_795_511_527_000_000_000,
        acquisition=Acquisition(
            device=Device("simulated", "USB-6251", "1A2B3C", "", simulated=True),
            rate=RATE,
            convert_rate=1e6,
            channels=(*probes, tacho),
            tacho=Tacho(threshold=2.5, hysteresis=1.0),
        ),
        settings=AnalysisSettings(),
        limits=Limits(peak_to_peak_alarm=60e-6, peak_to_peak_danger=90e-6, clearance=50e-6, speed=20_000.0 * RPM),
        config_toml="",
        program="rig 0.1.0",
    )


def _synchronous(speed: float, critical: float, scale: float) -> ComplexArray:
    """Return 1X vectors at x and y, m peak: imbalance response with one well damped critical speed."""
    ratio = speed / critical
    vector = scale * ratio**2 / (1.0 - ratio**2 + 0.5j * ratio)
    return np.array([vector, 0.9 * vector * np.exp(-1j * (math.pi / 2 + 0.1))])


def _whirl(speed: float, onset: float, order: float, size: float) -> tuple[float, float]:
    """Return order and peak amplitude, m, of a whirl above its onset speed, rad/s, limited by the film's stiffness."""
    excess = speed / onset - 1.0
    return (order, size * math.sqrt(excess)) if excess > 0.0 else (math.nan, 0.0)


def _measured_whirl(speed: float) -> tuple[float, float]:
    outer = _whirl(speed, 14_700.0 * RPM, 0.17, 110e-6)
    return outer if outer[1] > 0.0 else _whirl(speed, 10_980.0 * RPM, 0.49, 26e-6)


def _hann_line(orders: FloatArray, order: float, revolutions: int) -> FloatArray:
    """Return the main lobe of the Hann window about an order, 1 at its maximum."""
    bins = np.abs(orders - order) * revolutions
    bins = np.where(np.abs(bins - 1.0) < 1e-9, 1.0 + 1e-9, bins)
    lobe = np.sinc(bins) / (1.0 - bins**2)
    return np.where(bins < 2.0, np.abs(lobe), 0.0)


def _motion(theta: FloatArray, vectors: ComplexArray, order: float, amplitude: float) -> FloatArray:
    """Return displacement in X and Y, m: 1X, 2X and a forward circular component below 1X."""
    turns = np.exp(1j * np.outer(np.arange(1, 3), theta))
    motion = np.einsum("kp,kn->pn", vectors, turns).real
    if amplitude > 0.0:
        motion += amplitude * np.stack([np.cos(order * theta), np.sin(order * theta)])
    return np.asarray(motion - motion.mean(axis=1, keepdims=True), dtype=np.float64)


def make_prediction(speed: float, settings: AnalysisSettings) -> Prediction:
    """Return a prediction that is nearly right, with whirl too early and too strong."""
    one = _synchronous(speed, 9_200.0 * RPM, 5.5e-6)
    vectors = np.stack([one, 0.03 * one])
    order, amplitude = _whirl(speed, 9_500.0 * RPM, 0.70, 40e-6)
    orders = np.arange(0.0, settings.highest_order + 1e-9, 1.0 / settings.revolutions)
    lines = (
        np.abs(vectors)[:, :, None] * np.stack([_hann_line(orders, k, settings.revolutions) for k in (1, 2)])[:, None]
    )
    spectrum = lines.sum(axis=0)
    if amplitude > 0.0:
        spectrum += amplitude * _hann_line(orders, order, settings.revolutions)
    theta = 2.0 * np.pi * np.arange(settings.orbit_revolutions * 64) / 64
    orbit = _motion(theta, vectors, order, amplitude)
    return Prediction(
        speed=speed,
        orders=orders,
        spectrum=spectrum,
        vectors=vectors,
        whirl_order=order,
        whirl_amplitude=amplitude,
        peak_to_peak=np.ptp(orbit, axis=1),
        orbit=orbit,
        growth_rate=30.0 if amplitude > 0.0 else -12.0,
    )


def make_snapshot(time: float, speed: float, settings: AnalysisSettings, noise: np.random.Generator) -> Snapshot:
    """Return the snapshot at a time, s, and speed, rad/s, of the run-up."""
    one = _synchronous(speed, 9_500.0 * RPM, 5e-6) * (1.0 + 0.02 * noise.standard_normal())
    vectors = np.stack([one, 0.08 * one])
    order, amplitude = _measured_whirl(speed)
    orders = np.arange(0.0, settings.highest_order + 1e-9, 1.0 / settings.revolutions)
    shapes = np.stack([_hann_line(orders, k, settings.revolutions) for k in (1, 2)])
    spectrum = np.einsum("kp,kn->pn", vectors, shapes)
    floor = 0.08e-6
    spectrum += floor * (noise.standard_normal((2, orders.size)) + 1j * noise.standard_normal((2, orders.size)))
    whirl = None
    if amplitude > 0.0:
        spectrum += amplitude * _hann_line(orders, order, settings.revolutions)
        whirl = Whirl(
            order, amplitude, 0.05 * amplitude, amplitude * np.array([1.0, -1.0j], dtype=np.complex128), 0.0004, 0.07e-6
        )
    start = 2.0 * np.pi * noise.random() / max(order, 1.0) if amplitude > 0.0 else 0.0
    theta = 2.0 * np.pi * np.arange(settings.orbit_revolutions * settings.points_per_revolution)
    theta = theta / settings.points_per_revolution
    orbit = _motion(theta + 2.0 * np.pi * round(start), vectors, order, amplitude)
    clock = np.arange(0.0, 0.04, 4.0 / RATE)
    turning = speed * clock
    waveform = _motion(turning, vectors, order, amplitude) + 0.2e-6 * noise.standard_normal((2, clock.size))
    return Snapshot(
        segment=0,
        sample=round(time * RATE),
        time=time,
        speed=speed,
        tacho=TachoReport(TachoState.GOOD, pulses=round(time * 100), filled=0, rejected=0, jitter=2e-6),
        gap_volts=np.array([5.1, 4.8]),
        gap_in_window=np.array([True, True]),
        overall=np.array([np.ptp(waveform, axis=1)] * len(OVERALL.rows)),
        clipped=np.zeros(3, dtype=np.int64),
        frame=OrderFrame(
            speed=speed,
            acceleration=40.0 * RPM,
            orders=orders,
            spectrum=spectrum,
            vectors=vectors,
            noise=floor,
            whirls=() if whirl is None else (whirl,),
            orbit=orbit,
            sigma=np.full(2, 0.07e-6),
            angle_sigma=0.002,
        ),
        trace=Trace(
            time=time - clock[-1] + clock,
            displacement=waveform,
            tacho=np.where(np.mod(turning, 2.0 * np.pi) < np.pi, 5.0, 0.2),
        ),
    )


def run_up(count: int, run: str = "2026-11-24T09-12-07-gj90c") -> Iterator[LiveUpdate]:
    """Yield ``count`` live updates, one every 0.1 s, from 1,000 to 15,600 r/min: 1X, 2X, then 0.49X, then 0.17X."""
    header = make_header(run)
    noise = np.random.default_rng(7)
    watch = AlarmMonitor(header.limits, ("x", "y"))
    for index in range(count):
        time = 0.1 * (index + 1)
        speed = LOW + (HIGH - LOW) * index / max(1, count - 1)
        snapshot = make_snapshot(time, speed, header.settings, noise)
        watch.update(snapshot)
        alarms = visible_alarms(watch.alarms, 0, latch=True)
        status = Status(
            state=RunState.RECORDING,
            elapsed=time,
            samples=round(time * RATE),
            backlog=0.08,
            disk_left=41.0 * 3600.0,
            severity=worst_severity([alarm for alarm in alarms if alarm.is_active]),
            latched=worst_severity(alarms),
            model="ready",
            alarms=alarms,
        )
        yield LiveUpdate(header, status, snapshot, make_prediction(speed, header.settings))


def make_live_updates(count: int) -> list[LiveUpdate]:
    """Return `run_up` as a list."""
    return list(run_up(count))


def with_alarm(update: LiveUpdate, severity: Severity) -> LiveUpdate:
    """Return an update with a latched alarm whose condition is over."""
    limits, place = update.header.limits, TimeInRun(0, 10.0, 12_000.0 * RPM)
    limit = limits.peak_to_peak_danger if severity is Severity.DANGER else limits.peak_to_peak_alarm
    over = TimeInRun(0, 12.0, 12_500.0 * RPM)
    alarm = Alarm(1, MonitoredQuantity.OVERALL, "x", severity, limit, place, 1.02 * limit, place, over)
    status = replace(update.status, severity=Severity.NORMAL, latched=severity, alarms=(alarm,))
    return replace(update, status=status)


def with_further_alarms(update: LiveUpdate) -> LiveUpdate:
    """Return an update with alarms at 1X, below 1X and of the speed; only the 1X alarm is over."""
    place, over = TimeInRun(0, 10.0, 12_000.0 * RPM), TimeInRun(0, 12.0, 12_500.0 * RPM)
    limits = replace(
        update.header.limits,
        order_1x_alarm=20e-6,
        order_1x_danger=30e-6,
        below_1x_alarm=12.5e-6,
        speed_alarm=18_000.0 * RPM,
        speed_danger=19_500.0 * RPM,
    )
    alarms = (
        Alarm(1, MonitoredQuantity.ORDER_1X, "x", Severity.ALARM, 20e-6, place, 24.04e-6, place, over),
        Alarm(2, MonitoredQuantity.BELOW_1X, "y", Severity.ALARM, 12.5e-6, place, 14.06e-6, place),
        Alarm(3, MonitoredQuantity.SPEED, "", Severity.DANGER, 19_500.0 * RPM, place, 19_642.0 * RPM, place),
    )
    status = replace(update.status, severity=Severity.DANGER, latched=Severity.DANGER, alarms=alarms)
    return replace(update, header=replace(update.header, limits=limits), status=status)


def with_runout(update: LiveUpdate) -> LiveUpdate:
    """Return an update with a subtracted run-out of 2 µm at 1X from a slow roll, also in the orbit."""
    assert update.snapshot is not None
    assert update.snapshot.frame is not None
    vectors = np.array([[2e-6, 2e-6j], [0.1e-6, 0.0]], dtype=np.complex128)
    runout = RunOut(vectors, np.full(2, 0.03e-6))
    shown = update.snapshot.frame
    points = update.header.settings.points_per_revolution
    compensated = shown.orbit - np.tile(runout.waveform(points), (1, shown.orbit.shape[1] // points))
    order_frame = replace(shown, runout=runout, compensated_orbit=compensated)
    settings = RunOutSettings(slow_roll_speed=600.0 * RPM, from_orbit=True)
    header = replace(update.header, settings=replace(update.header.settings, runout=settings))
    return replace(update, header=header, snapshot=replace(update.snapshot, frame=order_frame), runout=runout)


def with_second_whirl(update: LiveUpdate) -> LiveUpdate:
    """Return an update with a further, weaker backward component at 0.31X."""
    assert update.snapshot is not None
    assert update.snapshot.frame is not None
    weaker = Whirl(0.31, 0.2e-6, 3e-6, 3e-6 * np.array([1.0, 1.0j], dtype=np.complex128), 0.002, 0.07e-6)
    order_frame = replace(update.snapshot.frame, whirls=(*update.snapshot.frame.whirls, weaker))
    return replace(update, snapshot=replace(update.snapshot, frame=order_frame))

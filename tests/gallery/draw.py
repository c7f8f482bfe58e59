"""Draws every kind of plot that the analysis has data for, from one simulated run, into one picture.

    python tests/gallery/draw.py docs/gallery.png

The run goes from 700 to 18,000 r/min and back: a critical speed at 8,000 r/min, run-out, a whirl at 0.47X from
11,000 r/min on that locks to 115 Hz, a shaft that rises in its clearance, a few glitches.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from analysis.alarm import LimitWatch
from analysis.angular_record import AngularRecord, angular_record
from analysis.centreline import centreline
from analysis.filtered_orbit import FilteredOrbit, direct_orbit, filtered_orbit, orbit_without
from analysis.findings import Moment
from analysis.frequency_spectrum import frequency_spectrum
from analysis.full_spectrum import ProbeMismatch, full_cascade, full_spectrum, probe_mismatch
from analysis.glitches import find_glitches
from analysis.orbit import ProbePair
from analysis.order_map import OrderMap, order_map
from analysis.order_track import track_order
from analysis.poincare import bifurcation, poincare_section
from analysis.pulse_record import pulse_record
from analysis.run import Limits, Tacho
from analysis.runout import SlowRoll, slow_roll
from analysis.shaft_angle import ShaftAngle, shaft_angle
from analysis.speed_curve import speed_curves
from analysis.subsynchronous import subsynchronous_tracks
from analysis.uncertainty import sigma_of_floor
from analysis.vold_kalman import order_envelopes

FloatArray = NDArray[np.float64]

MICRO = 1e-6
RPM = 60.0 / (2.0 * np.pi)
RATE, DURATION = 40_000.0, 30.0
SLOWEST, FASTEST, CRITICAL, ONSET, LOCK = 700.0, 18_000.0, 8_000.0, 11_000.0, 115.0  # r/min; Hz
LIMITS = Limits(50 * MICRO, 80 * MICRO, 100 * MICRO, 2_000.0)
X, Y, WHIRL, GREY = "#0072b2", "#d55e00", "#cc2277", "0.55"


@dataclass(frozen=True)
class Run:
    """The simulated run and what several plots share."""

    time: FloatArray
    displacement: FloatArray
    tacho: FloatArray
    angle: ShaftAngle
    raw: AngularRecord
    record: AngularRecord  # run-out taken off
    roll: SlowRoll
    frames: OrderMap
    mismatch: ProbeMismatch
    parked: FloatArray

    def at(self, rpm: float, revolutions: int = 128) -> AngularRecord:
        """Return the revolutions of the run-up about a speed."""
        middle = int(np.argmax(self.record.speeds * RPM >= rpm))
        return self.record.part(middle - revolutions // 2, middle + revolutions // 2)


def simulated() -> Run:
    """Return the run."""
    random = np.random.default_rng(7)
    time = np.arange(int(RATE * DURATION)) / RATE
    hold = 1.5
    ramp = np.interp(time, [0, hold, 16, 18, DURATION], [SLOWEST, SLOWEST, FASTEST, FASTEST, SLOWEST])
    turn_rate = ramp / 60.0
    turns = np.concatenate([[0.0], np.cumsum(0.5 * (turn_rate[1:] + turn_rate[:-1]) / RATE)]) + 0.3
    theta = 2 * np.pi * turns
    ratio = ramp / CRITICAL
    response = ratio**2 / (1 - ratio**2 + 2j * 0.12 * ratio)
    frequency = np.minimum(0.47 * turn_rate, LOCK)
    phase = 2 * np.pi * np.concatenate([[0.0], np.cumsum(0.5 * (frequency[1:] + frequency[:-1]) / RATE)])
    strength = 12 * MICRO * np.clip((ramp - ONSET) / 1_500.0, 0.0, 1.0)
    z = 5 * MICRO * response * np.exp(1j * (theta + 0.5)) + 0.8 * MICRO * np.conj(response) * np.exp(-1j * theta)
    z += 2 * MICRO * ratio / (1 + ratio) * np.exp(1j * (2 * theta + 1.0)) + strength * np.exp(1j * phase)
    lift = ramp / FASTEST
    z += 35 * MICRO * lift**0.5 * np.exp(1j * (0.5 * np.pi - 1.1 * (1 - lift)))
    surface = 3 * MICRO * np.cos(theta - 2.0) - 5 * MICRO * np.exp(-0.5 * ((turns % 1.0 - 0.62) / 0.02) ** 2)
    displacement = np.stack([z.real, z.imag]) + surface + 0.15 * MICRO * random.standard_normal((2, time.size))
    for place in random.integers(0, time.size, 12):
        displacement[place % 2, place] += 90 * MICRO
    pulses = np.interp(np.arange(1.0, np.floor(turns[-1])), turns, time) + 1e-6 * random.standard_normal(
        int(turns[-1]) - 1
    )
    tacho = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-4)
    angle = shaft_angle(pulse_record(pulses, tacho))
    clean = find_glitches(displacement, RATE, angle)
    raw = angular_record(clean.displacement, RATE, angle, ProbePair(0.0, np.pi / 2))
    roll = slow_roll(raw, 0.9 * SLOWEST / RPM, 1.1 * SLOWEST / RPM)
    record = roll.off_waveform(raw)
    frames = order_map(record)
    return Run(
        time=time,
        displacement=displacement,
        tacho=np.where(turns % 1.0 < 0.5, 4.0, 0.0),
        angle=angle,
        raw=raw,
        record=record,
        roll=roll,
        frames=frames,
        mismatch=probe_mismatch(frames),
        parked=np.zeros(2),
    )


def timebase(axes: Axes, run: Run) -> None:
    window = slice(int(13.0 * RATE), int(13.03 * RATE))
    shown = 1e3 * (run.time[window] - run.time[window.start])
    for row, (name, colour) in enumerate((("x", X), ("y", Y))):
        wave = run.displacement[row, window]
        axes.plot(shown, (wave - wave.mean()) / MICRO, colour, lw=0.9, label=name)
    axes.plot(shown, 2 * run.tacho[window] - 45, GREY, lw=0.8, label="tacho, not to scale")
    axes.set(title="Time base, 14,000 r/min", xlabel="time, ms", ylabel="displacement, µm", ylim=(-50, 38))
    axes.legend(ncols=3, loc="upper left")


def orbit(axes: Axes, found: FilteredOrbit, title: str) -> None:
    for turn in range(found.motion.shape[1]):
        path = found.motion[:, turn] / MICRO
        path = (
            np.column_stack([path, found.motion[:, turn + 1, 0] / MICRO]) if turn + 1 < found.motion.shape[1] else path
        )
        axes.plot(path[0], path[1], X, lw=1.0)
    axes.plot(*(found.marks / MICRO), "o", color=Y, ms=4)
    axes.set(title=title, xlabel="X, µm", ylabel="Y, µm", aspect="equal")


def one_x_orbit(axes: Axes, run: Run) -> None:
    found = filtered_orbit(run.at(14_000), (1.0,))
    orbit(axes, found, "1X orbit, ellipse and mark")
    ellipse = found.ellipses[0]
    along = np.exp(1j * ellipse.tilt) / MICRO
    for end in (ellipse.major * along, 1j * ellipse.minor * along):
        axes.plot([-end.real, end.real], [-end.imag, end.imag], GREY, lw=0.8, ls="--")
    sense = "forward" if ellipse.minor > 0 else "backward"
    text = (
        f"{ellipse.major / MICRO:.2f} x {abs(ellipse.minor) / MICRO:.2f} ± {found.sigma / MICRO:.3f} µm peak\n{sense}"
    )
    axes.text(0.5, 0.52, text, transform=axes.transAxes, ha="center", fontsize=7)


def centre(axes: Axes, run: Run) -> None:
    line = centreline(run.raw, run.parked, LIMITS.clearance)
    dots = axes.scatter(
        line.positions[0] / MICRO, line.positions[1] / MICRO, c=line.speeds * RPM / 1e3, s=4, cmap="viridis"
    )
    axes.plot(*(line.circle() / MICRO), "k", lw=1.0)
    axes.plot(0, 0, "k+", ms=6)
    axes.figure.colorbar(dots, ax=axes, label="speed, 1000 r/min")
    axes.set(title="Shaft centreline in its clearance", xlabel="X, µm", ylabel="Y, µm", aspect="equal")


def order_lines(axes: Axes, run: Run) -> None:
    part = order_map(run.at(14_000))
    floor = float(sigma_of_floor(part.noise).mean())
    axes.semilogy(part.orders, part.amplitudes()[0].mean(axis=0) / MICRO, X, lw=1.0, label="x")
    axes.semilogy(part.orders, part.amplitudes()[1].mean(axis=0) / MICRO, Y, lw=1.0, label="y")
    axes.axhline(floor / MICRO, color=GREY, lw=0.8, ls="--", label="1 σ of the floor")
    axes.set(title="Order spectrum, Hann, 16 turns", xlabel="order", ylabel="amplitude, µm peak", ylim=(1e-3, 30))
    axes.legend()


def full_lines(axes: Axes, run: Run) -> None:
    part = order_map(run.at(14_000))
    found = full_spectrum(part.orders, part.spectrum, part.pair, run.mismatch)
    axes.semilogy(found.axis, found.amplitudes.mean(axis=0) / MICRO, X, lw=1.0)
    axes.axvline(0.0, color=GREY, lw=0.8)
    axes.set(title="Full spectrum", xlabel="backward    order    forward", ylabel="amplitude, µm peak")
    axes.set(xlim=(-4, 4), ylim=(1e-3, 30))


def frequency_lines(axes: Axes, run: Run) -> None:
    window = slice(int(16 * RATE), int(18 * RATE))
    found = frequency_spectrum(run.displacement[:, window], RATE, resolution=2.0)
    for row, colour in enumerate((X, Y)):
        axes.semilogy(found.frequencies, found.amplitudes[row] / MICRO, colour, lw=0.9, label="xy"[row])
    axes.set(title="Frequency spectrum, 18,000 r/min", xlabel="frequency, Hz", ylabel="amplitude, µm peak")
    axes.set(xlim=(0, 1500), ylim=(1e-3, 30))
    axes.legend()


def colours(axes: Axes, x: FloatArray, y: FloatArray, amplitude: FloatArray) -> None:
    shown = axes.pcolormesh(
        x, y, 20 * np.log10(np.maximum(amplitude / MICRO, 1e-3)), vmin=-40, vmax=28, cmap="magma", rasterized=True
    )
    axes.figure.colorbar(shown, ax=axes, label="dB re 1 µm peak")


def cascade(axes: Axes, run: Run) -> None:
    speeds, rows = full_cascade(run.frames, 150.0 / RPM, run.mismatch)
    colours(axes, rows.axis, speeds * RPM / 1e3, rows.amplitudes)
    axes.set(title="Full cascade (against speed)", xlabel="backward    order    forward", ylabel="speed, 1000 r/min")
    axes.set(xlim=(-3, 3))


def waterfall(axes: Axes, run: Run) -> None:
    step = max(run.frames.times.size // 300, 1)
    amplitude = run.frames.amplitudes()[0, ::step]
    colours(axes, run.frames.orders, run.frames.times[::step], amplitude)
    axes.set(title="Waterfall (against time), x", xlabel="order", ylabel="time, s", xlim=(0, 4))


def speed_frequency(axes: Axes, run: Run) -> None:
    up = (run.frames.times > 2.0) & (run.frames.times < 16.0)
    speeds, orders = run.frames.speeds[up] * RPM / 1e3, run.frames.orders
    frequency = np.linspace(0, 700, 300)
    at = frequency[None] / (speeds[:, None] * 1e3 / 60)
    size = run.frames.amplitudes()[0][up]
    rows = np.array([np.interp(row, orders, line, right=0.0) for row, line in zip(at, size, strict=True)])
    step = max(rows.shape[0] // 300, 1)
    colours(axes, speeds[::step], frequency, rows[::step].T)
    axes.set(title="Speed-frequency map, run-up, x", xlabel="speed, 1000 r/min", ylabel="frequency, Hz")


def bode(amplitudes: Axes, phases: Axes, run: Run) -> None:
    raw = speed_curves(track_order(run.raw, 1.0), 150.0 / RPM)[0]
    amplitudes.plot(raw.speeds * RPM / 1e3, raw.amplitudes[0] / MICRO, GREY, lw=0.9, label="with run-out")
    for curve, style in zip(speed_curves(track_order(run.record, 1.0), 150.0 / RPM), ("-", "--"), strict=False):
        speeds = curve.speeds * RPM / 1e3
        low, high = (curve.amplitudes[0] + k * curve.sigma[0] for k in (-2, 2))
        amplitudes.fill_between(speeds, low / MICRO, high / MICRO, color=X, alpha=0.25, lw=0)
        amplitudes.plot(speeds, curve.amplitudes[0] / MICRO, X, ls=style, lw=1.1, label=curve.direction.value)
        told = curve.phase_sigma[0] < 0.2
        lags = np.degrees(np.unwrap(-np.angle(curve.vectors[0, told])))
        phases.plot(speeds[told], lags, X, ls=style, lw=1.1, label=curve.direction.value)
        for resonance in curve.resonances(0)[:1] if style == "-" else ():
            text = f"{resonance.speed * RPM:.0f} r/min\nAF {resonance.amplification:.1f}"
            amplitudes.annotate(
                text, (resonance.speed * RPM / 1e3, resonance.amplitude / MICRO), (10.5, 17), fontsize=7
            )
    amplitudes.set(title="Bode of 1X, x, ± 2 σ", xlabel="speed, 1000 r/min", ylabel="amplitude, µm peak")
    amplitudes.legend()
    phases.set(title="Bode of 1X, x, where known to 0.2 rad", xlabel="speed, 1000 r/min", ylabel="phase lag, degrees")
    phases.legend()


def polar(axes: Axes, run: Run) -> None:
    curve = speed_curves(track_order(run.record, 1.0), 150.0 / RPM)[0]
    path = curve.vectors[0] / MICRO
    dots = axes.scatter(path.real, path.imag, c=curve.speeds * RPM / 1e3, s=7, cmap="viridis")
    axes.plot(0, 0, "k+")
    axes.figure.colorbar(dots, ax=axes, label="speed, 1000 r/min")
    axes.set(
        title="Polar of 1X, x, run-up", xlabel="in phase with the mark, µm", ylabel="quadrature, µm", aspect="equal"
    )


def poincare(axes: Axes, run: Run) -> None:
    for rpm, colour in ((10_000, GREY), (14_500, WHIRL)):
        section = poincare_section(run.at(rpm, 128), 0.15 * MICRO)
        axes.plot(*(section.points / MICRO), ".", color=colour, ms=4, label=f"{rpm:,} r/min: {section.pattern.value}")
    axes.set(title="Poincaré section", xlabel="X at the mark, µm", ylabel="Y at the mark, µm", aspect="equal")
    axes.legend(loc="upper center")
    axes.set(ylim=(-18, 26))


def bifurcations(axes: Axes, run: Run) -> None:
    up = int(np.argmax(run.record.times > 16.5))
    speeds, positions = bifurcation(run.record.part(0, up))
    axes.plot(speeds * RPM / 1e3, positions[0] / MICRO, ",", color=X)
    axes.set(title="Bifurcation diagram, run-up", xlabel="speed, 1000 r/min", ylabel="X at the mark, µm")


def below_one_x(axes: Axes, run: Run) -> None:
    up = int(np.argmax(run.record.times > 16.5))
    for track in subsynchronous_tracks(order_map(run.record.part(0, up))):
        label = f"{track.behaviour.value}: {track.order:.2f}X, {track.amplitudes.max() / MICRO:.1f} µm peak"
        axes.plot(
            track.speeds * RPM / 1e3, track.orders * track.speeds / (2 * np.pi), ".", color=WHIRL, ms=2, label=label
        )
        axes.axvline(track.onset_speed * RPM / 1e3, color=GREY, lw=0.8, ls="--")
        axes.axvline(track.lock_speed * RPM / 1e3, color=GREY, lw=0.8, ls=":")
    grid = np.array([8.0, 18.0])
    axes.plot(grid, 0.5 * grid * 1e3 / 60, "k", lw=0.8, label="0.5X")
    axes.set(title="Components below 1X", xlabel="speed, 1000 r/min", ylabel="frequency, Hz", xlim=(8, 18.5))
    axes.legend(loc="lower right")


def overall(axes: Axes, run: Run) -> None:
    watch, size = LimitWatch(LIMITS.peak_to_peak_alarm, LIMITS.hysteresis, hold=0.2), int(0.1 * RATE)
    blocks = run.displacement[:, : run.time.size // size * size].reshape(2, -1, size)
    peak_to_peak = (np.quantile(blocks, 0.999, axis=2) - np.quantile(blocks, 0.001, axis=2)).max(axis=0)
    times = (np.arange(peak_to_peak.size) + 0.5) * size / RATE
    states = [watch.update(value, Moment(0, time, np.nan)) for value, time in zip(peak_to_peak, times, strict=True)]
    axes.plot(times, peak_to_peak / MICRO, X, lw=1.0, label="larger of x and y")
    for limit, colour, name in ((50, "#e69f00", "alarm"), (80, "#cc0000", "danger")):
        axes.axhline(limit, color=colour, lw=0.9, label=name)
    latched = np.maximum.accumulate(states)
    since = times[np.argmax(latched)]
    axes.fill_between(times, 0, 100, where=latched.tolist(), color="#e69f00", alpha=0.12, lw=0, label="latched")
    axes.set(title=f"Overall, alarm since {since:.1f} s", xlabel="time, s", ylabel="µm peak-to-peak", ylim=(0, 95))
    axes.legend(ncols=2)


def envelopes(axes: Axes, run: Run) -> None:
    step, end = 16, int(16 * RATE)
    thin = run.displacement[0, : end // step * step].reshape(-1, step).mean(axis=1)
    times = (np.arange(thin.size) + 0.5) * step / RATE
    turns = run.angle.turns(times)
    good = np.isfinite(turns)
    slow = np.convolve(thin, np.ones(500) / 500, mode="same")
    found = order_envelopes((thin - slow)[good], 2 * np.pi * turns[good], RATE / step, (0.47, 1.0, 2.0), bandwidth=6.0)
    for index, colour in enumerate((WHIRL, X, Y)):
        axes.plot(
            times[good], np.abs(found.envelopes[index]) / MICRO, colour, lw=0.9, label=f"{found.orders[index]:g}X"
        )
    axes.set(title="Vold-Kalman envelopes, 6 Hz, x", xlabel="time, s", ylabel="amplitude, µm peak", ylim=(0, 30))
    axes.legend()


def run_out(axes: Axes, run: Run) -> None:
    degrees = np.arange(run.roll.waveform.shape[1]) * 360.0 / run.roll.waveform.shape[1]
    for row, colour in enumerate((X, Y)):
        axes.plot(degrees, run.roll.waveform[row] / MICRO, colour, lw=1.0, label="xy"[row])
    verdict = "good" if run.roll.is_good(CRITICAL / RPM) else "the shaft moved"
    text = f"{run.roll.revolutions} turns, ± {run.roll.sigma.max() / MICRO:.2f} µm, {verdict}"
    axes.set(title="Slow roll: run-out\n" + text, xlabel="angle from the mark, degrees", ylabel="µm")
    axes.legend()


def draw(path: Path) -> None:
    """Draw the gallery."""
    mpl.rcParams.update(
        {"font.size": 8, "axes.titlesize": 8.5, "legend.fontsize": 6.5, "axes.grid": True, "grid.alpha": 0.25}
    )
    run = simulated()
    figure = Figure(figsize=(19, 14.5), layout="constrained", dpi=100)
    axes = figure.subplots(4, 5).ravel()
    whirling = run.at(14_000)
    timebase(axes[0], run)
    orbit(axes[1], direct_orbit(whirling, 8), "Direct orbit, 14,000 r/min")
    one_x_orbit(axes[2], run)
    orbit(axes[3], orbit_without(whirling, (1.0,), revolutions=8), "Not-1X orbit")
    centre(axes[4], run)
    order_lines(axes[5], run)
    full_lines(axes[6], run)
    frequency_lines(axes[7], run)
    cascade(axes[8], run)
    waterfall(axes[9], run)
    bode(axes[10], axes[11], run)
    polar(axes[12], run)
    speed_frequency(axes[13], run)
    below_one_x(axes[14], run)
    poincare(axes[15], run)
    bifurcations(axes[16], run)
    envelopes(axes[17], run)
    overall(axes[18], run)
    run_out(axes[19], run)
    figure.savefig(path)
    with Image.open(path) as picture:
        picture.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))

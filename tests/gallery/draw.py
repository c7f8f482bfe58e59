"""Draw one picture with every kind of plot, from one simulated run.

python -m tests.gallery.draw docs/gallery.png
"""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from analysis.live.alarms import LimitMonitor
from analysis.resampling.angular_record import synchronous_average, synchronous_residual
from analysis.shaft.orbit import Orbit, centreline, direct_orbit, filtered_orbit, orbit_without
from analysis.shaft.overall import overall
from analysis.shaft.poincare import bifurcation_diagram, poincare_section
from analysis.signals.blocks import TimeInRun
from analysis.signals.header import Limits
from analysis.signals.standards import standard_limits
from analysis.signals.uncertainty import noise_floor_sigma
from analysis.signals.units import MICROMETRE, RPM
from analysis.spectra.frequency_spectrum import frequency_map, frequency_spectrum
from analysis.spectra.full_spectrum import full_cascade, full_spectrum
from analysis.spectra.order_map import order_map
from analysis.spectra.tacholess_speed import speed_from_ridge
from analysis.vectors.glitches import find_glitches
from analysis.vectors.order_track import track_order
from analysis.vectors.speed_curve import speed_curves
from analysis.vectors.vold_kalman import OrderEnvelopes, probe_envelopes
from analysis.whirl.tracks import subsynchronous_tracks
from tests.gallery.simulated_run import CRITICAL, RATE, Run, simulated

FloatArray = NDArray[np.float64]

LIMITS = Limits(50 * MICROMETRE, 80 * MICROMETRE, 100 * MICROMETRE, 2_000.0)
X, Y, WHIRL, GREY = "#0072b2", "#d55e00", "#cc2277", "0.55"


def timebase(axes: Axes, run: Run) -> None:
    window = run.samples(14_000, 0.03)
    shown = 1e3 * (run.time[window] - run.time[window.start])
    for row, (name, colour) in enumerate((("x", X), ("y", Y))):
        wave = run.displacement[row, window]
        axes.plot(shown, (wave - wave.mean()) / MICROMETRE, colour, lw=0.9, label=name)
    axes.plot(shown, 2 * run.tacho[window] - 45, GREY, lw=0.8, label="tacho, not to scale")
    axes.set(title="Time base, 14,000 r/min", xlabel="time, ms", ylabel="displacement, µm", ylim=(-50, 38))
    axes.legend(ncols=3, loc="upper left")


def orbit(axes: Axes, found: Orbit, title: str) -> None:
    for turn in range(found.motion.shape[1]):
        path = found.motion[:, turn] / MICROMETRE
        if turn + 1 < found.motion.shape[1]:
            path = np.column_stack([path, found.motion[:, turn + 1, 0] / MICROMETRE])
        axes.plot(path[0], path[1], X, lw=1.0)
    axes.plot(*(found.keyphasor_points / MICROMETRE), "o", color=Y, ms=4)
    axes.set(title=title, xlabel="X, µm", ylabel="Y, µm", aspect="equal")


def ellipse_orbit(axes: Axes, run: Run, order: float) -> None:
    found = filtered_orbit(run.at(14_000), (order,))
    orbit(axes, found, f"{order:g}X orbit, ellipse and mark")
    ellipse = found.ellipses[0]
    along = np.exp(1j * ellipse.tilt) / MICROMETRE
    for end in (ellipse.major * along, 1j * ellipse.minor * along):
        axes.plot([-end.real, end.real], [-end.imag, end.imag], GREY, lw=0.8, ls="--")
    sense = "forward" if ellipse.minor > 0 else "backward"
    major, minor, sigma = (size / MICROMETRE for size in (ellipse.major, abs(ellipse.minor), found.sigma))
    size = f"{major:.2f} x {minor:.2f} ± {sigma:.3f} µm peak"
    axes.set(title=f"{order:g}X orbit, {sense}\n{size}")


def orbit_timebase(axes: Axes, run: Run) -> None:
    found = orbit_without(run.at(14_000), (1.0,), revolutions=6)
    times = 1e3 * (found.times.ravel() - found.times[0, 0])
    for row, (name, colour) in enumerate((("X", X), ("Y", Y))):
        axes.plot(times, found.motion[row].ravel() / MICROMETRE, colour, lw=0.9, label=name)
        axes.plot(times[:: found.times.shape[1]], found.keyphasor_points[row] / MICROMETRE, "o", color=colour, ms=3)
    axes.set(title="Time base of the not-1X orbit", xlabel="time, ms", ylabel="displacement, µm", ylim=(-16, 21))
    axes.legend(ncols=2, loc="upper left")


def average(axes: Axes, run: Run) -> None:
    part = run.at(14_000)
    mean, rest = synchronous_average(part), synchronous_residual(part)
    degrees = np.arange(part.points) * 360.0 / part.points
    for turn in rest.waveform[0, 40:72]:
        axes.plot(degrees, turn / MICROMETRE, GREY, lw=0.4, alpha=0.5, label="_")
    axes.plot([], [], GREY, lw=0.6, label="rest of 32 turns")
    axes.plot(degrees, (mean.waveform[0] - mean.waveform[0].mean()) / MICROMETRE, X, lw=1.4, label="average")
    title = f"Average revolution, x, {mean.revolutions} turns, ± {mean.sigma[0] / MICROMETRE:.1f} µm"
    axes.set(title=title, xlabel="angle from the mark, degrees", ylabel="µm", ylim=(-19, 26))
    axes.legend(ncols=2, loc="upper left")


def speeds(axes: Axes, run: Run) -> None:
    axes.plot(run.frames.times, run.frames.speeds / RPM / 1e3, X, lw=1.2, label="tacho")
    step, rate = 32, RATE / 32
    thin = run.displacement[:, : run.time.size // step * step].reshape(2, -1, step).mean(axis=2)
    window = slice(int(4.0 * rate), int(16.0 * rate))
    ridge = speed_from_ridge(thin[:, window], rate, 3_000.0 * RPM, 20_000.0 * RPM)
    dots = axes.scatter(
        ridge.times + 4.0, ridge.speeds / RPM / 1e3, c=ridge.confidence, s=9, cmap="plasma", vmin=0, vmax=1, zorder=3
    )
    axes.figure.colorbar(dots, ax=axes, label="confidence of the ridge of 1X")
    jitter = f"jitter {1e6 * run.angle.jitter:.1f} µs"
    axes.set(title=f"Speed: tacho ({jitter}) and ridge", xlabel="time, s", ylabel="speed, 1000 r/min")
    axes.text(4.0, 0.3, "ridge unsure where whirl outgrows 1X", fontsize=6.5)
    axes.legend(loc="upper left")


def centre(axes: Axes, run: Run) -> None:
    line = centreline(run.raw, run.rest_displacement, LIMITS.clearance)
    dots = axes.scatter(
        line.positions[0] / MICROMETRE, line.positions[1] / MICROMETRE, c=line.speeds / RPM / 1e3, s=4, cmap="viridis"
    )
    axes.plot(*(line.circle() / MICROMETRE), "k", lw=1.0)
    axes.plot(0, 0, "k+", ms=6)
    axes.figure.colorbar(dots, ax=axes, label="speed, 1000 r/min")
    axes.set(title="Shaft centreline in its clearance", xlabel="X, µm", ylabel="Y, µm", aspect="equal")


def order_lines(axes: Axes, run: Run) -> None:
    part = order_map(run.at(14_000))
    floor = float(noise_floor_sigma(part.noise).mean())
    axes.semilogy(part.orders, part.amplitudes()[0].mean(axis=0) / MICROMETRE, X, lw=1.0, label="x")
    axes.semilogy(part.orders, part.amplitudes()[1].mean(axis=0) / MICROMETRE, Y, lw=1.0, label="y")
    axes.axhline(floor / MICROMETRE, color=GREY, lw=0.8, ls="--", label="1 σ of the floor")
    axes.set(
        title="Order spectrum, 14,000 r/min, Hann, 16 turns",
        xlabel="order",
        ylabel="amplitude, µm peak",
        ylim=(1e-3, 30),
    )
    axes.legend()


def full_lines(axes: Axes, run: Run) -> None:
    part = order_map(run.at(14_000))
    found = full_spectrum(part.orders, part.spectrum, part.pair, run.mismatch)
    axes.semilogy(found.axis, found.amplitudes.mean(axis=0) / MICROMETRE, X, lw=1.0)
    axes.axvline(0.0, color=GREY, lw=0.8)
    axes.set(title="Full spectrum, 14,000 r/min", xlabel="backward    order    forward", ylabel="amplitude, µm peak")
    axes.set(xlim=(-4, 4), ylim=(1e-3, 30))


def frequency_lines(axes: Axes, run: Run) -> None:
    window = slice(int(16 * RATE), int(18 * RATE))  # steady
    found = frequency_spectrum(run.displacement[:, window], RATE, resolution=2.0)
    for row, colour in enumerate((X, Y)):
        axes.semilogy(found.frequencies, found.amplitudes[row] / MICROMETRE, colour, lw=0.9, label="xy"[row])
    axes.set(title="Frequency spectrum, 18,000 r/min", xlabel="frequency, Hz", ylabel="amplitude, µm peak")
    axes.set(xlim=(0, 1500), ylim=(1e-3, 30))
    axes.legend()


def colours(axes: Axes, x: FloatArray, y: FloatArray, amplitude: FloatArray) -> None:
    shown = axes.pcolormesh(
        x, y, 20 * np.log10(np.maximum(amplitude / MICROMETRE, 1e-3)), vmin=-40, vmax=28, cmap="magma", rasterized=True
    )
    axes.figure.colorbar(shown, ax=axes, label="dB re 1 µm peak")


def cascade(axes: Axes, run: Run) -> None:
    speeds, rows = full_cascade(run.frames, 150.0 * RPM, run.mismatch)
    colours(axes, rows.axis, speeds / RPM / 1e3, rows.amplitudes)
    axes.set(title="Full cascade (against speed)", xlabel="backward    order    forward", ylabel="speed, 1000 r/min")
    axes.set(xlim=(-3, 3))


def waterfall(axes: Axes, run: Run) -> None:
    step = max(run.frames.times.size // 300, 1)
    amplitude = run.frames.amplitudes()[0, ::step]
    colours(axes, run.frames.orders, run.frames.times[::step], amplitude)
    axes.set(title="Waterfall (against time), x", xlabel="order", ylabel="time, s", xlim=(0, 4))


def speed_frequency(axes: Axes, run: Run) -> None:
    up = slice(0, int(16 * RATE))
    found = frequency_map(run.displacement[:, up], RATE, run.angle, resolution=4.0, highest=700.0)
    speeds, rows = found.cascade(100.0 * RPM)
    colours(axes, speeds / RPM / 1e3, found.frequencies, rows[0].T)
    axes.set(title="Frequency cascade, run-up, x", xlabel="speed, 1000 r/min", ylabel="frequency, Hz")


def frequency_waterfall(axes: Axes, run: Run) -> None:
    found = frequency_map(run.displacement, RATE, resolution=4.0, highest=700.0)
    colours(axes, found.frequencies, found.times, found.amplitudes[0])
    axes.set(title="Frequency waterfall (against time), x", xlabel="frequency, Hz", ylabel="time, s")


def bode(amplitudes: Axes, phases: Axes, run: Run) -> None:
    raw = speed_curves(track_order(run.raw, 1.0), 150.0 * RPM)[0]
    amplitudes.plot(raw.speeds / RPM / 1e3, raw.amplitudes[0] / MICROMETRE, GREY, lw=0.9, label="with run-out")
    both = zip(speed_curves(track_order(run.record, 1.0), 150.0 * RPM), ((X, "-"), (Y, "--")), strict=False)
    for curve, (colour, style) in both:
        speeds = curve.speeds / RPM / 1e3
        low, high = (curve.amplitudes[0] + k * curve.sigma[0] for k in (-2, 2))
        amplitudes.fill_between(speeds, low / MICROMETRE, high / MICROMETRE, color=colour, alpha=0.25, lw=0)
        amplitudes.plot(speeds, curve.amplitudes[0] / MICROMETRE, colour, ls=style, lw=1.1, label=curve.direction.value)
        is_known = curve.phase_sigma[0] < 0.2
        lags = np.degrees(np.unwrap(-np.angle(curve.vectors[0, is_known])))
        phases.plot(speeds[is_known], lags, colour, ls=style, lw=1.1, label=curve.direction.value)
        for resonance in curve.resonances(0)[:1] if style == "-" else ():
            text = f"{resonance.speed / RPM:.0f} r/min\nAF {resonance.amplification_factor:.1f}"
            amplitudes.annotate(
                text, (resonance.speed / RPM / 1e3, resonance.amplitude / MICROMETRE), (10.5, 17), fontsize=7
            )
    amplitudes.set(title="Bode of 1X, x, ± 2 σ", xlabel="speed, 1000 r/min", ylabel="amplitude, µm peak")
    amplitudes.legend()
    phases.set(title="Bode of 1X, x, where known to 0.2 rad", xlabel="speed, 1000 r/min", ylabel="phase lag, degrees")
    phases.legend()


def polar(axes: Axes, run: Run) -> None:
    curve = speed_curves(track_order(run.record, 1.0), 150.0 * RPM)[0]
    path = curve.vectors[0] / MICROMETRE
    reach = 5.0 * np.ceil(np.abs(path).max() / 5.0)
    circle = np.exp(2j * np.pi * np.arange(181) / 180)
    for radius in np.arange(5.0, reach + 1.0, 5.0):
        axes.plot(radius * circle.real, radius * circle.imag, color="0.85", lw=0.6)
        axes.text(0.0, radius, f"{radius:g}", fontsize=6, color="0.4", ha="center", va="center")
    for lag in range(0, 360, 30):  # lag increases against the rotation
        spoke = np.exp(-1j * np.radians(lag))
        axes.plot([0.0, reach * spoke.real], [0.0, reach * spoke.imag], color="0.85", lw=0.6)
        axes.text(1.1 * reach * spoke.real, 1.1 * reach * spoke.imag, f"{lag}°", fontsize=6.5, ha="center", va="center")
    dots = axes.scatter(path.real, path.imag, c=curve.speeds / RPM / 1e3, s=7, cmap="viridis", zorder=3)
    for rpm in (7_000, 7_500, 8_000, 8_500, 10_000, 18_000):
        near = path[np.argmin(np.abs(curve.speeds / RPM - rpm))]
        inward = near * (1.0 - 0.15 * reach / np.abs(near))
        axes.text(inward.real, inward.imag, f"{rpm:,}", fontsize=6.5, ha="center", va="center", zorder=4)
    axes.figure.colorbar(dots, ax=axes, label="speed, 1000 r/min")
    axes.set(title="Polar of 1X, x, run-up: µm peak and lag", aspect="equal")
    axes.set(xlim=(-1.2 * reach, 1.2 * reach), ylim=(-1.2 * reach, 1.2 * reach))
    axes.axis("off")


def poincare(axes: Axes, run: Run) -> None:
    for rpm, colour in ((10_000, GREY), (14_500, WHIRL)):
        section = poincare_section(run.at(rpm, 128), 0.15 * MICROMETRE)
        axes.plot(
            *(section.points / MICROMETRE), ".", color=colour, ms=4, label=f"{rpm:,} r/min: {section.pattern.value}"
        )
    axes.set(title="Poincaré section", xlabel="X at the mark, µm", ylabel="Y at the mark, µm", aspect="equal")
    axes.legend(loc="upper center")
    axes.set(ylim=(-18, 26))


def bifurcations(axes: Axes, run: Run) -> None:
    up = int(np.argmax(run.record.times > 16.5))
    speeds, positions = bifurcation_diagram(run.record.section(0, up))
    axes.plot(speeds / RPM / 1e3, positions[0] / MICROMETRE, ",", color=X)
    axes.set(title="Bifurcation diagram, run-up", xlabel="speed, 1000 r/min", ylabel="X at the mark, µm")


def below_one_x(axes: Axes, run: Run) -> None:
    up = int(np.argmax(run.record.times > 16.5))
    for track in subsynchronous_tracks(order_map(run.record.section(0, up))):
        label = f"{track.behaviour.value}: {track.order:.2f}X, {track.amplitudes.max() / MICROMETRE:.1f} µm peak"
        axes.plot(
            track.speeds / RPM / 1e3, track.orders * track.speeds / (2 * np.pi), ".", color=WHIRL, ms=2, label=label
        )
        axes.axvline(track.onset_speed / RPM / 1e3, color=GREY, lw=0.8, ls="--")
        axes.axvline(track.lock_speed / RPM / 1e3, color=GREY, lw=0.8, ls=":")
    grid = np.array([8.0, 18.0])
    axes.plot(grid, 0.5 * grid * 1e3 / 60, "k", lw=0.8, label="0.5X")
    axes.set(title="Components below 1X", xlabel="speed, 1000 r/min", ylabel="frequency, Hz", xlim=(8, 18.5))
    axes.legend(loc="lower right")


def overall_vibration(axes: Axes, run: Run) -> None:
    monitor = LimitMonitor(LIMITS.peak_to_peak_alarm, LIMITS.hysteresis, hold=0.2)
    found = overall(run.displacement, RATE, LIMITS.clearance)
    larger = found.peak_to_peak.max(axis=0)
    times = zip(larger, found.times, strict=True)
    states = [monitor.update(value, TimeInRun(0, time, np.nan)) for value, time in times]
    axes.plot(found.times, larger / MICROMETRE, X, lw=1.0, label="larger of x and y")
    for limit, colour, name in ((50, "#e69f00", "alarm"), (80, "#cc0000", "danger")):
        axes.axhline(limit, color=colour, lw=0.9, label=name)
    latched = np.maximum.accumulate(states)
    since = found.times[np.argmax(latched)]
    axes.fill_between(found.times, 0, 100, where=latched.tolist(), color="#e69f00", alpha=0.12, lw=0, label="latched")
    part = f"{100 * found.clearance_fraction.max():.0f} % of the clearance"
    axes.set(title=f"Overall, at most {part}; alarm since {since:.1f} s", xlabel="time, s")
    axes.set(ylabel="µm peak-to-peak", ylim=(0, 95))
    axes.legend(ncols=2)


def run_up_envelopes(run: Run) -> tuple[FloatArray, OrderEnvelopes]:
    """Return times, s, and envelopes of the run-up at probe x."""
    up = run.displacement[:, : int(16 * RATE)]
    times, (found, _) = probe_envelopes(up, RATE, run.angle, (0.47, 1.0, 2.0), bandwidth=6.0)
    return times, found


def envelopes(axes: Axes, times: FloatArray, found: OrderEnvelopes) -> None:
    for index, colour in enumerate((WHIRL, X, Y)):
        size = np.abs(found.envelopes[index])
        axes.plot(times, size / MICROMETRE, colour, lw=0.9, label=f"{found.orders[index]:g}X")
        low, high = size - 2 * found.sigma[index], size + 2 * found.sigma[index]
        axes.fill_between(times, low / MICROMETRE, high / MICROMETRE, color=colour, alpha=0.2, lw=0)
    axes.set(title="Vold-Kalman envelopes, 6 Hz, x, ± 2 σ", xlabel="time, s", ylabel="amplitude, µm peak")
    axes.set(ylim=(0, 30))
    axes.legend()


def order_waves(axes: Axes, times: FloatArray, found: OrderEnvelopes) -> None:
    window = (times > 12.63) & (times < 12.66)
    for index, colour in enumerate((WHIRL, X, Y)):
        wave = found.waveform(index)[window] / MICROMETRE
        axes.plot(1e3 * (times[window] - 12.63), wave, colour, lw=1.0, label=f"{found.orders[index]:g}X")
    axes.set(title="Waveforms of single orders, 14,000 r/min", xlabel="time, ms", ylabel="µm", ylim=(-15, 20))
    axes.legend(ncols=3, loc="upper left")


def run_out(axes: Axes, run: Run) -> None:
    degrees = np.arange(run.roll.waveform.shape[1]) * 360.0 / run.roll.waveform.shape[1]
    for row, colour in enumerate((X, Y)):
        axes.plot(degrees, run.roll.waveform[row] / MICROMETRE, colour, lw=1.0, label="xy"[row])
    verdict = "good" if run.roll.is_valid(CRITICAL * RPM) else "the shaft moved"
    text = f"{run.roll.revolutions} turns, ± {run.roll.sigma.max() / MICROMETRE:.2f} µm, {verdict}"
    axes.set(title="Slow roll: run-out\n" + text, xlabel="angle from the mark, degrees", ylabel="µm")
    axes.legend()


def glitches(axes: Axes, run: Run) -> None:
    found = find_glitches(run.displacement, RATE, run.angle)
    place = int(np.flatnonzero(found.repaired[0])[3])
    window = slice(place - 200, place + 200)
    shown = 1e3 * (run.time[window] - run.time[place])
    axes.plot(shown, run.displacement[0, window] / MICROMETRE, GREY, lw=0.8, label="as sampled")
    axes.plot(shown, found.displacement[0, window] / MICROMETRE, X, lw=1.1, label="bridged")
    counts = f"{found.count[0]} at x, {found.count[1]} at y, {sum(found.unrepaired)} left"
    axes.set(title=f"Glitches: {counts}", xlabel="time from a glitch, ms", ylabel="displacement, µm")
    axes.legend()


def standards(axes: Axes, run: Run) -> None:
    rpm = np.linspace(1_000, 60_000, 200)
    rows = [standard_limits(float(speed) * RPM) for speed in rpm]
    for column, style in enumerate(("-", "--", "-.", ":", (0, (1, 3)))):
        figure = rows[0][column]
        limits = np.array([row[column].limit for row in rows])
        axes.plot(rpm / 1e3, limits / MICROMETRE, GREY, ls=style, lw=1.0, label=f"{figure.standard}, {figure.name}")
    found = overall(run.displacement, RATE, LIMITS.clearance)
    at = np.interp(found.times, run.frames.times, run.frames.speeds) / RPM / 1e3
    axes.plot(at, found.peak_to_peak.max(axis=0) / MICROMETRE, X, lw=1.0, label="this run")
    axes.set(title="Standards, for information: none is for a turbocharger", xlabel="speed, 1000 r/min")
    axes.set(ylabel="µm peak-to-peak", ylim=(0, 125))
    axes.legend()


def draw(path: Path) -> None:
    """Draw the gallery into a PNG file."""
    mpl.rcParams.update(
        {"font.size": 8, "axes.titlesize": 8.5, "legend.fontsize": 6.5, "axes.grid": True, "grid.alpha": 0.25}
    )
    run = simulated()
    figure = Figure(figsize=(15.5, 24), layout="constrained", dpi=100)
    axes = iter(figure.subplots(7, 4).ravel())
    whirling = run.at(14_000)
    times, orders = run_up_envelopes(run)
    timebase(next(axes), run)
    speeds(next(axes), run)
    overall_vibration(next(axes), run)
    standards(next(axes), run)
    orbit(next(axes), direct_orbit(whirling, 8), "Direct orbit, 14,000 r/min")
    ellipse_orbit(next(axes), run, 1.0)
    ellipse_orbit(next(axes), run, 2.0)
    orbit(next(axes), orbit_without(whirling, (1.0,), revolutions=8), "Not-1X orbit")
    orbit_timebase(next(axes), run)
    average(next(axes), run)
    poincare(next(axes), run)
    centre(next(axes), run)
    order_lines(next(axes), run)
    full_lines(next(axes), run)
    waterfall(next(axes), run)
    cascade(next(axes), run)
    frequency_lines(next(axes), run)
    frequency_waterfall(next(axes), run)
    speed_frequency(next(axes), run)
    below_one_x(next(axes), run)
    bode(next(axes), next(axes), run)
    polar(next(axes), run)
    bifurcations(next(axes), run)
    envelopes(next(axes), times, orders)
    order_waves(next(axes), times, orders)
    run_out(next(axes), run)
    glitches(next(axes), run)
    figure.savefig(path)
    with Image.open(path) as picture:
        picture.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
            path, optimize=True
        )


if __name__ == "__main__":
    draw(Path(sys.argv[1]))

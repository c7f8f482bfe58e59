"""Order frames of the live analysis: resampling, spectrum, whirl components and orbit of the last whole revolutions."""

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.decimation import DecimationPyramid
from analysis.resampling.interpolation import HALF_WIDTH, interpolate
from analysis.signals.header import Acquisition, AnalysisSettings, Role
from analysis.signals.probes import ProbePair
from analysis.signals.snapshot import OrderFrame, RunOut, Whirl
from analysis.signals.uncertainty import mean_angle_sigma, noise_floor_sigma
from analysis.spectra.order_spectrum import order_spectrum, order_vectors
from analysis.spectra.windows import HANN, WINDOWS, Window
from analysis.tacho.edge_reader import MAX_TIMESTAMP_DELAY
from analysis.tacho.shaft_angle import SmoothAngle
from analysis.vectors.runout import RunOutEstimator
from analysis.whirl.components import find_whirls, noise_floor, quantile

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MIN_TURN_RATE = 1.0  # revolutions per second: no frame below 60 r/min
FLOOR_LINES = 6  # lines on either side of an order, beyond the main lobe, for the noise floor, as in `order_track`
SPARE_REVOLUTIONS = 4  # revolutions that the pyramid stores in addition to a frame
_PASSBAND_FRACTION = 0.2  # highest order over the angular samples per revolution


class OrderFrameBuilder:
    """Builds order frames from the samples of a decimation pyramid.

    The angular grid has enough points G per revolution (``points_per_revolution``, doubled as needed) that the highest
    order H lies below 0.2 G. The grid is read from the finest level of the pyramid without components above the order
    G - H, which the grid would fold onto H. So nothing folds into the spectrum, and H lies below 0.25 of the rate of
    that level, where filters and interpolation are accurate to 0.01 %.

    Parameters
    ----------
    acquisition : Acquisition
        Rates, multiplexer and probes.
    settings : AnalysisSettings
        Revolutions, points, orders and window.
    """

    def __init__(self, acquisition: Acquisition, settings: AnalysisSettings) -> None:
        if settings.revolutions < 4 or settings.points_per_revolution < 4 or settings.highest_order < 2.0:
            raise ValueError(
                f"settings: {settings.revolutions} revolutions of {settings.points_per_revolution} points to order "
                f"{settings.highest_order}, expected at least 4 revolutions of 4 points to order 2"
            )
        self._window = WINDOWS[settings.window]
        if settings.revolutions < self._window.min_revolutions:
            raise ValueError(
                f"settings: {settings.revolutions} revolutions with the window {settings.window}, expected at least "
                f"{self._window.min_revolutions}"
            )
        self._settings = settings
        self._rate = acquisition.rate
        self._late = round(MAX_TIMESTAMP_DELAY * acquisition.rate) if acquisition.tacho.reference == "counter" else 0
        rows = (acquisition.row(Role.PROBE_X), acquisition.row(Role.PROBE_Y))
        self._pair = ProbePair(acquisition.channels[rows[0]].angle, acquisition.channels[rows[1]].angle)
        self._skews = np.array(rows)[:, None] / acquisition.convert_rate
        self._stride = 1
        while settings.highest_order > _PASSBAND_FRACTION * settings.points_per_revolution * self._stride:
            self._stride *= 2
        self._points = settings.points_per_revolution * self._stride
        self._runout = RunOutEstimator(settings.runout)
        self._most_per_turn = 2.0 * (self._points - settings.highest_order)  # samples of the level, to avoid aliasing

    def new_pyramid(self, first: int) -> DecimationPyramid:
        """Return an empty pyramid for every speed, for samples from index ``first`` on."""
        turns = self._settings.revolutions + SPARE_REVOLUTIONS
        keep = int(turns * self._most_per_turn) + 8 * HALF_WIDTH
        return DecimationPyramid(2, self._level(MIN_TURN_RATE) + 1, keep, first, self._late)

    def _level(self, turn_rate: float) -> int:
        return max(int(np.ceil(np.log2(self._rate / (self._most_per_turn * turn_rate)))), 0)

    def build(
        self, pyramid: DecimationPyramid, angle: SmoothAngle, first_turn: int, last_turn: int
    ) -> OrderFrame | None:
        """Return the frame that ends at the last mark within the samples.

        Parameters
        ----------
        pyramid : DecimationPyramid
            Displacement towards the probes x and y, m.
        angle : SmoothAngle
            Time against revolutions, s.
        first_turn, last_turn : int
            Range of validity of the angle, revolutions.

        Returns
        -------
        OrderFrame or None
            None with too few samples or revolutions, or below the minimum speed.
        """
        revolutions = self._settings.revolutions
        for end in range(last_turn, max(last_turn - SPARE_REVOLUTIONS, first_turn + revolutions - 1), -1):
            begin = end - revolutions
            edges = angle.time(np.array([begin, begin + 0.5 * revolutions, end]))
            turn_rate = revolutions / float(edges[2] - edges[0])
            if not MIN_TURN_RATE <= turn_rate < self._rate:
                return None
            level = self._level(turn_rate)
            samples, first = pyramid.level(level)
            scale = self._rate / 2**level
            outside = (edges[[0, 2]] - self._skews) * scale - first  # channel k is sampled k / convert_rate later
            if outside.min() < HALF_WIDTH - 1:
                return None
            if outside.max() < samples.shape[1] - 1 - HALF_WIDTH:
                turns = begin + np.arange(revolutions * self._points) / self._points
                positions = (angle.time(turns) - self._skews) * scale - first
                if positions.min() < HALF_WIDTH - 1 or positions.max() >= samples.shape[1] - 1 - HALF_WIDTH:
                    return None
                return self._evaluate(interpolate(samples, positions), edges, angle.jitter)
        return None

    def _evaluate(self, waveform: FloatArray, edges: FloatArray, jitter: float) -> OrderFrame:
        settings = self._settings
        revolutions = settings.revolutions
        waveform = waveform - waveform.mean(axis=1, keepdims=True)
        orders, spectrum = order_spectrum(waveform, revolutions, self._window)
        wanted = int(np.searchsorted(orders, settings.highest_order, side="right"))
        orders, spectrum = orders[:wanted], spectrum[:, :wanted]
        noise = noise_floor(spectrum, revolutions, self._window)
        halves = np.diff(edges)
        speeds = np.pi * revolutions / halves  # mean of each half
        orbit = waveform[:, -min(settings.orbit_revolutions, revolutions) * self._points :: self._stride]
        orbit = orbit - orbit.mean(axis=1, keepdims=True)
        speed = float(2.0 * np.pi * revolutions / halves.sum())
        floors = [_floor_beside(spectrum, revolutions, order, noise, self._window) for order in (1, 2)]
        sigma = noise_floor_sigma(np.array(floors))
        multiples = order_vectors(spectrum, revolutions, int(settings.highest_order))
        runout = self._runout.update(speed, multiples, sigma)
        return OrderFrame(
            speed=speed,
            acceleration=float((speeds[1] - speeds[0]) / (0.5 * halves.sum())),
            orders=orders,
            spectrum=spectrum,
            vectors=multiples[:2],
            noise=noise,
            whirls=self._whirls(waveform, spectrum, noise, jitter * speed),
            orbit=self._pair.to_bench(orbit),
            sigma=sigma,
            angle_sigma=float(mean_angle_sigma(np.asarray(speed), jitter, revolutions, self._window.noise_bandwidth)),
            runout=runout,
            compensated_orbit=self._compensated_orbit(orbit, runout),
        )

    def _whirls(self, waveform: FloatArray, spectrum: ComplexArray, noise: float, scatter: float) -> tuple[Whirl, ...]:
        """Return the components below 1X, from the spectrum if it is a Hann spectrum, else from one for the search."""
        revolutions = self._settings.revolutions
        if self._window != HANN:
            spectrum = order_spectrum(waveform, revolutions)[1][:, : spectrum.shape[1]]
            noise = noise_floor(spectrum, revolutions)
        return find_whirls(spectrum, revolutions, noise, self._pair, scatter)

    def _compensated_orbit(self, orbit: FloatArray, runout: RunOut | None) -> FloatArray | None:
        """Return the orbit at the probes minus run-out, in bench axes; None where not requested or unknown."""
        if runout is None or not self._settings.runout.from_orbit:
            return None
        points = self._settings.points_per_revolution
        turns = orbit.shape[1] // points
        return self._pair.to_bench(orbit - np.tile(runout.waveform(points), (1, turns)))


def _floor_beside(spectrum: ComplexArray, revolutions: int, order: int, noise: float, window: Window) -> float:
    """Return the median amplitude of the lines beside a whole order, clear of the lobes of whole orders, m peak.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (2, n_orders)
        Spectrum of a frame.
    revolutions, order : int
        Revolutions in the frame, and the whole order.
    noise : float
        Median over all orders, m peak, used where a frame of few revolutions has no such line.
    window : Window
        Window of the spectrum.
    """
    side = len(window.side_lines)  # lines on either side that a component on a line reaches
    away = np.arange(window.main_lobe + 1, window.main_lobe + 1 + FLOOR_LINES)
    lines = order * revolutions + np.concatenate([-away, away])
    clear = np.abs((lines + revolutions // 2) % revolutions - revolutions // 2) > side
    lines = lines[clear & (lines > side) & (lines < spectrum.shape[1])]
    return quantile(np.abs(spectrum[:, lines]), 0.5) if lines.size else noise

"""Search for components below 1X in order spectra, the same for live frames and whole records."""

from dataclasses import dataclass

import numpy as np

from analysis.signals import BoolArray, ComplexArray, FloatArray
from analysis.signals.probes import ProbePair
from analysis.signals.snapshot import Whirl
from analysis.signals.uncertainty import noise_floor_sigma
from analysis.spectra.windows import HANN, Window

MIN_ORDER, MAX_ORDER = 0.08, 0.92  # orders searched
MAX_COMPONENTS = 4  # in one frame
MIN_TO_FLOOR = 5.0  # of a component to the noise floor
MIN_TO_1X = 0.005  # of a component to 1X: errors of the angle leave sidebands of 1X; at least this,
MIN_TO_1X_PER_RADIAN = 0.5  # plus this for each radian of scatter of the marks about the angle
MIN_TO_1X_NEARBY = 0.02  # of a component near 1X: sidebands of a 1X of changing amplitude
MIN_TO_STRONGER = 0.05  # below that it may be a residual of the stronger component
MIN_TO_STRONGER_NEARBY, NEARBY_LINES = 0.25, 4.0  # the same for a component within so many lines
_QUARTILE_TO_MEDIAN = 1.552  # of the Rayleigh distribution that the lines of noise have


def noise_floor(spectrum: ComplexArray, revolutions: int, window: Window = HANN) -> float:
    """Return the median amplitude of the lines clear of every whole order and of 0, m peak.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (n_probes, n_orders)
        From `analysis.spectra.order_map.order_spectrum`.
    revolutions : int
        Revolutions in its frame.
    window : Window
        Its window.

    Notes
    -----
    Noise lines have Rayleigh distributed amplitudes with a median of 1.1774 sigma: `noise_floor_sigma`.
    """
    between = spectrum[:, window.clear_lines(spectrum.shape[-1], revolutions)]
    return quantile(np.abs(between), 0.5) if between.size else 0.0


def quantile(values: FloatArray, part: float) -> float:
    """Return a quantile, 0 to below 1, by linear interpolation; the same as numpy's, but faster."""
    ranked = np.sort(values, axis=None)
    place = part * (ranked.size - 1)
    below = ranked[int(place)]
    return float(below + (place - int(place)) * (ranked[int(np.ceil(place))] - below))


def without_synchronous(spectrum: ComplexArray, revolutions: int) -> ComplexArray:
    """Return spectra up to 1X without 1X: its line and the two side lines of the Hann window subtracted.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (2, ..., n_orders)
        Hann spectra of ``revolutions`` whole revolutions, up to at least two lines above 1X.
    revolutions : int
        Revolutions in a frame.

    Notes
    -----
    A periodic Hann window has three lines, 1/2, -1/4 and -1/4 (F. Harris, Proc. IEEE 66, 1978).
    """
    rest = spectrum[..., : revolutions + HANN.main_lobe + 1].copy()
    line = spectrum[..., revolutions]
    rest[..., revolutions] = 0.0
    for away, side in enumerate(HANN.side_lines, 1):
        rest[..., revolutions - away] -= side * line
        rest[..., revolutions + away] -= side * line
    return rest


@dataclass(frozen=True, slots=True, eq=False)
class Components:
    """One component below 1X in each of several frames.

    Parameters
    ----------
    order : ndarray of float64, shape (n_frames,)
        Frequency over shaft frequency; NaN where none was found.
    order_sigma : ndarray of float64, shape (n_frames,)
        Standard deviation of the order.
    forward, backward : ndarray of float64, shape (n_frames,)
        Amplitudes of its circles, m peak.
    vectors : ndarray of complex128, shape (2, n_frames)
        At the probes x and y, m peak, referred to the begin of the frame.
    """

    order: FloatArray
    order_sigma: FloatArray
    forward: FloatArray
    backward: FloatArray
    vectors: ComplexArray


@dataclass(frozen=True, slots=True, eq=False)
class ComponentSearch:
    """Spectra of several frames, and the thresholds of the component search.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (2, n_frames, n_orders)
        Hann spectra of the frames at the probes x and y, m peak, up to at least two lines above 1X.
    revolutions : int
        Revolutions in a frame; at least 4.
    noise : ndarray of float64, shape (n_frames,)
        Noise floor, m peak, for the uncertainty of a component.
    floor : ndarray of float64, shape (n_frames,)
        Noise floor, or more where the lines below 1X are elevated, m peak; components must be 5 times above it.
    scatter : ndarray of float64, shape (n_frames,)
        Scatter of the tacho marks about the smooth angle, rad. It modulates 1X; smaller components are rejected.
    pair : ProbePair
        Directions of the probes.
    """

    spectrum: ComplexArray
    revolutions: int
    noise: FloatArray
    floor: FloatArray
    scatter: FloatArray
    pair: ProbePair

    def find(self, max_components: int = MAX_COMPONENTS) -> list[Components]:
        """Return the components, the strongest of each frame first.

        Parameters
        ----------
        max_components : int
            Maximum number in a frame.

        Notes
        -----
        1X is subtracted with its window lines. Then the strongest peak between 0.08X and 0.92X is interpolated between
        the lines and subtracted likewise, repeatedly. With A the line of the peak and B its larger neighbour, the
        component lies delta = (2 B - A) / (A + B) lines towards the neighbour, and its line is too small by the factor
        sinc(delta) / (1 - delta²) (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9; exact for one component in a
        periodic Hann window of many samples).
        """
        rest = without_synchronous(self.spectrum, self.revolutions)
        found: list[Components] = []
        while len(found) < max_components:
            component = self._strongest(rest, found)
            good = np.isfinite(component.order)
            if not good.any():
                break
            found.append(component)
            if len(found) < max_components:
                self._subtract(rest, component, good)
        return found

    def _strongest(self, rest: ComplexArray, stronger_components: list[Components]) -> Components:
        """Return the strongest remaining component of each frame."""
        n = self.revolutions
        size = np.sqrt(np.sum(rest.real**2 + rest.imag**2, axis=0))
        first, last = max(int(np.ceil(MIN_ORDER * n)), 2), int(MAX_ORDER * n)
        searched = size[:, first : last + 1]
        is_peak = (searched >= size[:, first - 1 : last]) & (searched > size[:, first + 1 : last + 2])
        line = first + np.argmax(np.where(is_peak, searched, -1.0), axis=1)
        frame = np.arange(size.shape[0])
        up = size[frame, line + 1] > size[frame, line - 1]
        peak, beside = size[frame, line], size[frame, np.where(up, line + 1, line - 1)]
        rule = HANN.interpolation
        # beyond half a line the peak would be the neighbour's
        delta = np.clip(np.where(up, 1.0, -1.0) * rule.offset(peak, beside), -0.5, 0.5)
        vectors = rest[:, frame, line] / rule.gain(delta) * np.exp(-1j * np.pi * delta)
        X, Y = self.pair.vectors_to_bench(vectors)
        forward, backward = 0.5 * np.abs(X + 1j * Y), 0.5 * np.abs(X - 1j * Y)
        order = (line + delta) / n
        good = is_peak.any(axis=1) & (forward + backward > self._threshold(order, stronger_components))
        return Components(
            order=np.where(good, order, np.nan),
            order_sigma=rule.offset_sigma(np.maximum(peak, 1e-300), beside, noise_floor_sigma(self.noise)) / n,
            forward=forward,
            backward=backward,
            vectors=vectors,
        )

    def _threshold(self, order: FloatArray, stronger_components: list[Components]) -> FloatArray:
        """Return the amplitude above which a component at an order is accepted, m peak."""
        n = self.revolutions
        synchronous = np.abs(self.spectrum[:, :, n]).max(axis=0)
        beside_1x = np.abs(order - 1.0) * n < NEARBY_LINES
        part = np.where(beside_1x, MIN_TO_1X_NEARBY, MIN_TO_1X) + MIN_TO_1X_PER_RADIAN * self.scatter
        bar = np.maximum(part * synchronous, MIN_TO_FLOOR * self.floor)
        for stronger in stronger_components:
            amplitude = np.where(np.isfinite(stronger.order), stronger.forward + stronger.backward, 0.0)
            near = np.abs(order - stronger.order) * n < NEARBY_LINES
            bar = np.maximum(bar, np.where(near, MIN_TO_STRONGER_NEARBY, MIN_TO_STRONGER) * amplitude)
        return np.asarray(bar, dtype=np.float64)

    def _subtract(self, rest: ComplexArray, component: Components, good: BoolArray) -> None:
        """Subtract a component with its window lines from the remaining spectrum, in place."""
        away: FloatArray = self.revolutions * np.where(good, component.order, 0.0)[:, None] - np.arange(rest.shape[2])
        skirt = HANN.response(away) * np.exp(1j * np.pi * away)
        rest -= np.where(good, component.vectors, 0.0)[:, :, None] * skirt


def find_whirls(
    spectrum: ComplexArray,
    revolutions: int,
    noise: float,
    pair: ProbePair,
    scatter: float = 0.0,
    max_components: int = MAX_COMPONENTS,
) -> tuple[Whirl, ...]:
    """Return the sub-synchronous components of one frame above the noise floor, the strongest first.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (2, n_orders)
        As for `ComponentSearch`, for one frame.
    revolutions : int
        Revolutions in the frame; at least 4.
    noise : float
        From `noise_floor`, m peak. The lower quartile of the searched lines can raise the floor, where air and speed
        fluctuation elevate them.
    pair : ProbePair
        Directions of the probes.
    scatter : float
        Scatter of the tacho marks about the smooth angle, rad.
    max_components : int
        Maximum number of components.

    Notes
    -----
    See `ComponentSearch.find`; the thresholds are a choice of this program. Physics of whirl and whip: A. Muszynska,
    J. Sound Vib. 110, 1986.
    """
    first, last = max(int(np.ceil(MIN_ORDER * revolutions)), 2), int(MAX_ORDER * revolutions)
    rest = np.abs(without_synchronous(spectrum, revolutions)[:, first : last + 1])
    floor = max(noise, _QUARTILE_TO_MEDIAN * quantile(rest, 0.25))
    search = ComponentSearch(
        spectrum[:, None], revolutions, np.array([noise]), np.array([floor]), np.array([scatter]), pair
    )
    sigma = float(noise_floor_sigma(np.asarray(noise)))
    return tuple(
        Whirl(
            order=float(found.order[0]),
            forward=float(found.forward[0]),
            backward=float(found.backward[0]),
            vectors=found.vectors[:, 0],
            order_sigma=float(found.order_sigma[0]),
            sigma=sigma,
        )
        for found in search.find(max_components)
    )


def find_whirl(spectrum: ComplexArray, revolutions: int, noise: float, pair: ProbePair) -> Whirl | None:
    """Return the strongest of `find_whirls`, or None."""
    return next(iter(find_whirls(spectrum, revolutions, noise, pair, max_components=1)), None)

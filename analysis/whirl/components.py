"""Components below 1X, between the lines of order spectra: the search that live frames and whole records share."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.probes import ProbePair
from analysis.signals.snapshot import Whirl
from analysis.signals.uncertainty import noise_floor_sigma, order_sigma

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MIN_ORDER, MAX_ORDER = 0.08, 0.92  # orders searched
MAX_COMPONENTS = 4  # in one frame
MIN_TO_FLOOR = 5.0  # times the floor
MIN_TO_1X = 0.005  # of 1X: what an imperfect angle leaves of it at least,
MIN_TO_1X_PER_RADIAN = 0.5  # and for each radian by which the marks scatter about the angle
MIN_TO_1X_NEARBY = 0.02  # of 1X within some lines of it: what a 1X that swells leaves beside it
MIN_TO_STRONGER = 0.05  # below it a component may be what the stronger one left
MIN_TO_STRONGER_NEARBY, NEARBY_LINES = 0.25, 4.0  # the same for one as near as this
_QUARTILE_TO_MEDIAN = 1.552  # of the Rayleigh distribution that the lines of noise have


def noise_floor(spectrum: ComplexArray, revolutions: int) -> float:
    """Return the median amplitude between the lines: two bins away from every whole order and from 0, m peak.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (n_probes, n_orders)
        From `analysis.spectra.order_spectrum.order_spectrum`.
    revolutions : int
        Revolutions in its frame.

    Notes
    -----
    The median of lines of noise, whose amplitudes are Rayleigh's, is 1.1774 sigma: `sigma_of_floor`.
    """
    bins = np.arange(spectrum.shape[-1])
    distance = np.abs(bins - revolutions * np.round(bins / revolutions))
    between = spectrum[:, distance > min(2, revolutions // 2 - 1)]
    return quantile(np.abs(between), 0.5) if between.size else 0.0


def quantile(values: FloatArray, part: float) -> float:
    """Return a quantile, 0 to below 1, of at least one value by linear interpolation, as numpy does, only sooner."""
    ranked = np.sort(values, axis=None)
    place = part * (ranked.size - 1)
    below = ranked[int(place)]
    return float(below + (place - int(place)) * (ranked[int(np.ceil(place))] - below))


def without_synchronous(spectrum: ComplexArray, revolutions: int) -> ComplexArray:
    """Return spectra up to 1X without it: its line and the two beside it that the Hann window gives it.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (2, ..., n_orders)
        Hann spectra of ``revolutions`` whole revolutions, to 1X and two lines beyond; those of higher orders reach
        no further down.
    revolutions : int
        Revolutions in a frame.

    Notes
    -----
    A periodic Hann window has three lines, 1/2, -1/4 and -1/4 (F. Harris, Proc. IEEE 66, 1978).
    """
    rest = spectrum[..., : revolutions + 3].copy()
    line = spectrum[..., revolutions]
    rest[..., revolutions] = 0.0
    rest[..., revolutions - 1] += 0.5 * line
    rest[..., revolutions + 1] += 0.5 * line
    return rest


@dataclass(frozen=True, slots=True, eq=False)
class Components:
    """One component below 1X in each of some frames.

    Parameters
    ----------
    order : ndarray of float64, shape (n_frames,)
        Frequency over the shaft's; NaN where nothing was found.
    order_sigma : ndarray of float64, shape (n_frames,)
        Standard deviation of the order.
    forward, backward : ndarray of float64, shape (n_frames,)
        Its circles, m peak.
    vectors : ndarray of complex128, shape (2, n_frames)
        At the probes x and y, m peak, referred to the frame's first mark.
    """

    order: FloatArray
    order_sigma: FloatArray
    forward: FloatArray
    backward: FloatArray
    vectors: ComplexArray


@dataclass(frozen=True, slots=True, eq=False)
class ComponentSearch:
    """Where components are looked for, and what is not believed.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (2, n_frames, n_orders)
        Hann spectra of the frames at the probes x and y, m peak, to 1X and two lines beyond.
    revolutions : int
        In a frame; at least 4.
    noise : ndarray of float64, shape (n_frames,)
        Between the lines, m peak: what a component is not surer than.
    floor : ndarray of float64, shape (n_frames,)
        That noise, or more where the lines below 1X are uneasy, m peak: a component stands 5 times above it.
    scatter : ndarray of float64, shape (n_frames,)
        Of the tacho's marks about the smooth angle, rad: it modulates 1X, and lines of so small a part of 1X are not
        believed.
    pair : ProbePair
        Directions of the probes.
    """

    spectrum: ComplexArray
    revolutions: int
    noise: FloatArray
    floor: FloatArray
    scatter: FloatArray
    pair: ProbePair

    def find(self, most: int = MAX_COMPONENTS) -> list[Components]:
        """Return the components, of each frame the strongest first.

        Parameters
        ----------
        most : int
            At most so many in a frame.

        Notes
        -----
        1X is taken out with its window's skirts; then the strongest peak between 0.08X and 0.92X is measured between
        the lines and taken out likewise, again and again. With A the line of the peak and B its larger neighbour, the
        component lies delta = (2 B - A) / (A + B) lines towards the neighbour, and the window shows it too small by
        sinc(delta) / (1 - delta²) (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9; exact for one component in a
        periodic Hann window of many samples).
        """
        rest = without_synchronous(self.spectrum, self.revolutions)
        found: list[Components] = []
        while len(found) < most:
            component = self._strongest(rest, found)
            good = np.isfinite(component.order)
            if not good.any():
                break
            found.append(component)
            if len(found) < most:
                self._subtract(rest, component, good)
        return found

    def _strongest(self, rest: ComplexArray, stronger_components: list[Components]) -> Components:
        """Return the strongest component that is left of each frame."""
        n = self.revolutions
        size = np.sqrt(np.sum(rest.real**2 + rest.imag**2, axis=0))
        first, last = max(int(np.ceil(MIN_ORDER * n)), 2), int(MAX_ORDER * n)
        searched = size[:, first : last + 1]
        is_peak = (searched >= size[:, first - 1 : last]) & (searched > size[:, first + 1 : last + 2])
        line = first + np.argmax(np.where(is_peak, searched, -1.0), axis=1)
        frame = np.arange(size.shape[0])
        up = size[frame, line + 1] > size[frame, line - 1]
        peak, beside = size[frame, line], size[frame, np.where(up, line + 1, line - 1)]
        total = np.maximum(peak + beside, 1e-300)
        delta = np.clip(np.where(up, 1.0, -1.0) * (2.0 * beside - peak) / total, -0.5, 0.5)  # further: the neighbour's
        gain = np.sinc(delta) / (1.0 - delta**2)
        vectors = rest[:, frame, line] / gain * np.exp(-1j * np.pi * delta)
        X, Y = self.pair.vectors_to_bench(vectors)
        forward, backward = 0.5 * np.abs(X + 1j * Y), 0.5 * np.abs(X - 1j * Y)
        order = (line + delta) / n
        good = is_peak.any(axis=1) & (forward + backward > self._threshold(order, stronger_components))
        return Components(
            order=np.where(good, order, np.nan),
            order_sigma=order_sigma(np.maximum(peak, 1e-300), beside, noise_floor_sigma(self.noise), n),
            forward=forward,
            backward=backward,
            vectors=vectors,
        )

    def _threshold(self, order: FloatArray, stronger_components: list[Components]) -> FloatArray:
        """Return the amplitude above which a component at an order is believed, m peak."""
        n = self.revolutions
        synchronous = np.abs(self.spectrum[:, :, n]).max(axis=0)
        beside_1x = np.abs(order - 1.0) * n < NEARBY_LINES
        part = np.where(beside_1x, MIN_TO_1X_NEARBY, MIN_TO_1X) + MIN_TO_1X_PER_RADIAN * self.scatter
        bar = np.maximum(part * synchronous, MIN_TO_FLOOR * self.floor)
        for stronger in stronger_components:
            held = np.where(np.isfinite(stronger.order), stronger.forward + stronger.backward, 0.0)
            near = np.abs(order - stronger.order) * n < NEARBY_LINES
            bar = np.maximum(bar, np.where(near, MIN_TO_STRONGER_NEARBY, MIN_TO_STRONGER) * held)
        return np.asarray(bar, dtype=np.float64)

    def _subtract(self, rest: ComplexArray, component: Components, good: NDArray[np.bool_]) -> None:
        """Take a component with its window's skirts out of what is left."""
        away = self.revolutions * np.where(good, component.order, 0.0)[:, None] - np.arange(rest.shape[2])
        skirt = np.sinc(away) + 0.5 * (np.sinc(away - 1.0) + np.sinc(away + 1.0))
        rest -= np.where(good, component.vectors, 0.0)[:, :, None] * (skirt * np.exp(1j * np.pi * away))


def find_whirls(
    spectrum: ComplexArray,
    revolutions: int,
    noise: float,
    pair: ProbePair,
    scatter: float = 0.0,
    most: int = MAX_COMPONENTS,
) -> tuple[Whirl, ...]:
    """Return the sub-synchronous components of one frame that stand above the floor, the strongest first.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (2, n_orders)
        As `Search` has it for many frames.
    revolutions : int
        Revolutions in the frame; at least 4.
    noise : float
        From `noise_floor`, m peak. The floor is also taken from the searched lines' lower quartile, where air and
        wandering speed raise it.
    pair : ProbePair
        Directions of the probes.
    scatter : float
        Of the tacho's marks about the smooth angle, rad.
    most : int
        At most so many.

    Notes
    -----
    `Search.components`; the bars are this program's own, what such components are in A. Muszynska, J. Sound Vib. 110,
    1986.
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
        for found in search.find(most)
    )


def find_whirl(spectrum: ComplexArray, revolutions: int, noise: float, pair: ProbePair) -> Whirl | None:
    """Return the strongest of `find_whirls`, or None."""
    return next(iter(find_whirls(spectrum, revolutions, noise, pair, most=1)), None)

"""Studies of the synchronous motion on the films: response over speed, and where it becomes unstable."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.errors import ModelError
from model.parameters import ModelParameters
from model.response import imbalance_response
from model.stability import SynchronousOrbit, synchronous_orbit
from model.studies.linear import SPEED_LABEL, supported
from model.studies.study import Plot, Series, Study, Style
from model.synchronous import SynchronousResponse, synchronous_response

FloatArray = NDArray[np.float64]

PRECISION = 1.0  # rad/s, of an onset


@dataclass(frozen=True, slots=True)
class Band:
    """Speeds at which the synchronous motion is unstable.

    Parameters
    ----------
    start, stop : float
        rad/s; the ends of the search where it is unstable there.
    whirl_order : float
        Frequency over the shaft's of what grows at the start.
    """

    start: float
    stop: float
    whirl_order: float


@dataclass(frozen=True, slots=True)
class Stability:
    """Growth of the least stable whirl over speed.

    Parameters
    ----------
    speeds, growth_rates, whirl_orders : ndarray of float64, shape (n,)
        rad/s, 1/s, over the shaft's speed; NaN where no synchronous motion was found.
    bands : tuple of Band
        Where it is unstable.
    """

    speeds: FloatArray
    growth_rates: FloatArray
    whirl_orders: FloatArray
    bands: tuple[Band, ...]


class _Growth:
    """Growth rate at a speed, each solution begun from the last one found."""

    def __init__(self, parameters: ModelParameters) -> None:
        self._parameters = parameters
        self._orbit: SynchronousOrbit | None = None
        self._circle: SynchronousResponse | None = None

    def at(self, speed: float) -> tuple[float, float]:
        """Return growth rate, 1/s, and whirl order; NaN where no motion is found."""
        try:
            if self._parameters.gravity > 0 or self._parameters.loads or self._parameters.bearing.static_load:
                self._orbit = synchronous_orbit(self._parameters, speed, self._orbit)
                return self._orbit.growth_rate, self._orbit.whirl_order
            self._circle = synchronous_response(self._parameters, speed, self._circle)
        except ModelError:
            self._orbit = self._circle = None
            return math.nan, math.nan
        return self._circle.growth_rate, self._circle.whirl_order


def stability(parameters: ModelParameters, speeds: FloatArray, precision: float = PRECISION) -> Stability:
    """Return where the synchronous motion loses its stability: by eigenvalues at each speed, then by bisection.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor; with weight or loads at rest by Floquet's multipliers, without them in the turning frame.
    speeds : ndarray of float64, shape (n,)
        Rising, rad/s: an unstable band between two of them is not seen.
    precision : float
        Of the ends of the bands, rad/s.

    Returns
    -------
    Stability
        Along the speeds, upwards.
    """
    speeds = np.asarray(speeds, np.float64)
    if speeds.ndim != 1 or speeds.size < 2 or not (speeds[0] > 0 and np.all(np.diff(speeds) > 0)):
        raise ValueError(f"speeds: {speeds}, rad/s, expected two or more, rising, above 0")
    growth = _Growth(parameters)
    found = np.array([growth.at(float(speed)) for speed in speeds])
    rates, orders = found[:, 0], found[:, 1]
    bands: list[Band] = []
    start: tuple[float, float] | None = (float(speeds[0]), float(orders[0])) if rates[0] > 0 else None
    for below, above in zip(range(speeds.size - 1), range(1, speeds.size), strict=True):
        if (rates[below] > 0) == (rates[above] > 0) or math.isnan(rates[below]) or math.isnan(rates[above]):
            continue
        edge = _bisect(_Growth(parameters), float(speeds[below]), float(speeds[above]), precision)
        if start is None:
            start = (edge, float(orders[above]))
        else:
            bands.append(Band(start[0], edge, start[1]))
            start = None
    if start is not None:
        bands.append(Band(start[0], float(speeds[-1]), start[1]))
    return Stability(speeds, rates, orders, tuple(bands))


def _bisect(growth: _Growth, low: float, high: float, precision: float) -> float:
    """Return the speed between the two at which the growth rate changes its sign."""
    is_unstable = growth.at(low)[0] > 0
    while high - low > precision:
        middle = (low + high) / 2
        if (growth.at(middle)[0] > 0) == is_unstable:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def onset_study(parameters: ModelParameters, speeds: FloatArray) -> Study:
    """Return growth rate over speed and the bands in which the synchronous motion is unstable.

    ModelError where no synchronous motion is found at any of the speeds.
    """
    found = stability(parameters, speeds)
    missing = int(np.count_nonzero(np.isnan(found.growth_rates)))
    extent = f"from {speeds[0]:,.0f} to {speeds[-1]:,.0f} rad/s"
    if missing == speeds.size:
        raise ModelError(f"synchronous motion: none found within the clearances at any of {missing} speeds {extent}")
    title = "Stability of the synchronous motion"
    remarks = tuple(
        f"unstable from {band.start:,.0f} to {band.stop:,.0f} rad/s, whirl at {band.whirl_order:.2f}X"
        for band in found.bands
    )
    left_out = (
        (f"left out: {missing} of {speeds.size} speeds, without motion within the clearances",) if missing else ()
    )
    zero = Series("", speeds, np.zeros(speeds.size), Style.REFERENCE)
    onsets = np.array([edge for band in found.bands for edge in (band.start, band.stop) if edge < speeds[-1]])
    marks = Series("onset or end", onsets, np.zeros(onsets.size), Style.MARKS)
    return Study(
        title,
        {
            "speed_rad_s": speeds,
            "speed_rpm": np.asarray(speeds * 30 / math.pi),
            "growth_rate_1_s": found.growth_rates,
            "whirl_order": found.whirl_orders,
        },
        (
            Plot(
                title,
                SPEED_LABEL,
                "Growth of the least stable whirl [1/s]",
                (Series("growth rate", speeds, found.growth_rates), zero, marks),
            ),
            Plot(
                "Its frequency",
                SPEED_LABEL,
                "Whirl over the shaft's speed [X]",
                (Series("", speeds, found.whirl_orders, Style.POINTS),),
            ),
        ),
        (*(remarks or (f"stable {extent}",)), *left_out),
    )


def response_study(
    parameters: ModelParameters, speeds: FloatArray, stiffness: float | None = None, station: int | None = None
) -> Study:
    """Return the 1X motion at a station over speed: on films and supports, upwards and downwards, or on springs.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor. On the films its weight is left out: the motion is a circle, or an ellipse where supports differ by
        direction.
    speeds : ndarray of float64, shape (n,)
        Rising, rad/s.
    stiffness : float, optional
        Of a spring at each journal instead of the films, N/m.
    station : int, optional
        That is looked at; the probes' where none is given.
    """
    if station is not None:
        parameters = replace(parameters, probe_station=station)
    columns: dict[str, FloatArray | tuple[str, ...]] = {"speed_rad_s": speeds}
    if stiffness is not None:
        moved = imbalance_response(supported(parameters, stiffness), parameters.imbalances, speeds)
        vectors = {f"on springs of {stiffness:.3g} N/m": moved[:, 0, parameters.probe_station - 1]}
        names: tuple[str, ...] = ("",)
    else:
        upwards = _circles(parameters, speeds)
        downwards = _circles(parameters, speeds[::-1])[::-1]
        vectors, names = {"run-up": upwards, "run-down": downwards}, ("up_", "down_")
    amplitude, phase = [], []
    for (label, vector), name in zip(vectors.items(), names, strict=True):
        peak = np.asarray(np.abs(vector) * 1e6)
        lag = np.asarray(np.degrees(-np.angle(vector)) % 360)
        columns[f"{name}amplitude_um_pk"] = peak
        columns[f"{name}lag_deg"] = lag
        style = Style.DASHED if name == "down_" else Style.LINE
        amplitude.append(Series(label, speeds, peak, style))
        phase.append(Series(label, speeds, _unbroken(lag), style))
    title = f"1X in X at station {parameters.probe_station}"
    return Study(
        title,
        columns,
        (
            Plot(title, SPEED_LABEL, "1X [µm peak]", tuple(amplitude), y_log=_is_wide(amplitude)),
            Plot("Phase", SPEED_LABEL, "Lag behind the mark [°]", tuple(phase), y_limits=(0.0, 360.0)),
        ),
    )


def _is_wide(series: list[Series]) -> bool:
    """Return whether values differ so much that only a logarithmic axis shows them."""
    seen = np.concatenate([one.y[np.isfinite(one.y)] for one in series])
    return bool(seen.size and seen.max() > 50 * seen.min() > 0)


def _circles(parameters: ModelParameters, speeds: FloatArray) -> NDArray[np.complex128]:
    weightless = replace(parameters, gravity=0.0)
    found, last = [], None
    for speed in speeds:
        try:
            last = synchronous_response(weightless, float(speed), last)
            found.append(complex(last.stations[0, parameters.probe_station - 1]))
        except ModelError:
            last = None
            found.append(complex(math.nan, math.nan))
    return np.array(found)


def _unbroken(lag: FloatArray) -> FloatArray:
    """Return the phase with a gap where it goes round from 360° to 0°."""
    broken = lag.copy()
    broken[1:][np.abs(np.diff(lag)) > 180] = np.nan
    return broken

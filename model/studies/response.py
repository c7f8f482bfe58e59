"""Study of the synchronous response: 1X over speed, on films, supports or springs."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.signals.units import MICROMETRE, phase_lag_degrees
from model.dynamics.synchronous import synchronous_response
from model.errors import NoSolutionError
from model.linear.response import imbalance_response
from model.rotor.parameters import ModelParameters
from model.studies.linear_studies import SPEED_LABEL, supported_system
from model.studies.study import Plot, Series, Study, Style

FloatArray = NDArray[np.float64]


def response_study(
    parameters: ModelParameters, speeds: FloatArray, stiffness: float | None = None, station: int | None = None
) -> Study:
    """Return 1X at a station over speed: run-up and run-down on films and supports, or linear on springs.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor. On films its weight is ignored: the motion is a circle, or an ellipse on anisotropic supports. A
        rotor without films responds linearly on its own supports.
    speeds : ndarray of float64, shape (n,)
        Rising, rad/s.
    stiffness : float, optional
        Of a spring at each journal in place of the films, N/m.
    station : int, optional
        Station evaluated; default the station of the probes.
    """
    if station is not None:
        parameters = replace(parameters, probe_station=station)
    columns: dict[str, FloatArray | tuple[str, ...]] = {"speed_rad_s": speeds}
    if stiffness is not None or parameters.bearing is None:
        on = "its own supports" if stiffness is None else f"springs of {stiffness:.3g} N/m"
        moved = imbalance_response(supported_system(parameters, stiffness), parameters.imbalances, speeds)
        vectors = {f"on {on}": moved[:, 0, parameters.probe_station - 1]}
        names: tuple[str, ...] = ("",)
    else:
        run_up = _forward_response(parameters, speeds)
        run_down = _forward_response(parameters, speeds[::-1])[::-1]
        vectors, names = {"run-up": run_up, "run-down": run_down}, ("up_", "down_")
    amplitude, phase = [], []
    for (label, vector), name in zip(vectors.items(), names, strict=True):
        peak = np.asarray(np.abs(vector) / MICROMETRE)
        lag = phase_lag_degrees(vector)
        columns[f"{name}amplitude_um_pk"] = peak
        columns[f"{name}lag_deg"] = lag
        style = Style.DASHED if name == "down_" else Style.LINE
        amplitude.append(Series(label, speeds, peak, style))
        phase.append(Series(label, speeds, _without_wraps(lag), style))
    title = f"1X in X at station {parameters.probe_station}"
    return Study(
        title,
        columns,
        (
            Plot(title, SPEED_LABEL, "1X [µm peak]", tuple(amplitude), y_log=_is_wide(amplitude)),
            Plot("Phase", SPEED_LABEL, "Phase lag [°]", tuple(phase), y_limits=(0.0, 360.0)),
        ),
    )


def _is_wide(series: list[Series]) -> bool:
    """Return whether the range of values needs a logarithmic axis."""
    values = np.concatenate([one.y[np.isfinite(one.y)] for one in series])
    return bool(values.size and values.max() > 50 * values.min() > 0)


def _forward_response(parameters: ModelParameters, speeds: FloatArray) -> NDArray[np.complex128]:
    weightless = replace(parameters, gravity=0.0)
    found, last = [], None
    for speed in speeds:
        try:
            last = synchronous_response(weightless, float(speed), last)
            found.append(complex(last.stations[0, parameters.probe_station - 1]))
        except NoSolutionError:
            last = None
            found.append(complex(math.nan, math.nan))
    return np.array(found)


def _without_wraps(lag: FloatArray) -> FloatArray:
    """Return the phase with a gap where it jumps between 360° and 0°."""
    gapped = lag.copy()
    gapped[1:][np.abs(np.diff(lag)) > 180] = np.nan
    return gapped

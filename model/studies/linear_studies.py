"""Studies of modes, Campbell diagram, critical speed map and synchronous response over speed."""

import math
from dataclasses import replace

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from analysis.signals.units import MICROMETRE, MILLIMETRE, phase_lag_degrees
from model.dynamics.synchronous import synchronous_response
from model.errors import NoSolutionError
from model.linear.campbell import campbell
from model.linear.linear_system import LinearSystem, linear_system, whirl_modes
from model.linear.modes import critical_speed_map, critical_speeds
from model.linear.response import imbalance_response
from model.rotor.parameters import ModelParameters
from model.rotor.rotor import Rotor
from model.rotor.supports import Support, SupportCoefficients
from model.studies.study import Plot, Series, Study, Style

SPEED_LABEL = "Speed of the shaft [rad/s]"
DEFAULT_STIFFNESS = 1e4  # N/m, as in Table 5.3 of the thesis
RIGID_TOLERANCE = 1e-6  # of the highest frequency: below it a mode is a rigid-body mode
MAX_DRAWN_MODES = 5  # modes
FREQUENCY_LABEL = "Natural frequency [Hz]"


def journal_springs(rotor: Rotor, stiffness: float) -> tuple[Support, ...]:
    """Return supports with equal springs, N/m, at the journals."""
    return tuple(Support(station, SupportCoefficients.isotropic(stiffness)) for station in rotor.journal_stations)


def supported_system(parameters: ModelParameters, stiffness: float | None) -> LinearSystem:
    """Return the rotor on its own supports and, with a stiffness, N/m, on springs in place of the films."""
    springs = () if stiffness is None else journal_springs(parameters.rotor, stiffness)
    return linear_system(parameters.rotor, (*parameters.supports, *springs))


def campbell_stiffness(parameters: ModelParameters) -> float | None:
    """Return the default spring stiffness of a Campbell diagram, N/m: None if the supports hold the rotor."""
    return None if supported_system(parameters, None).is_fully_supported else DEFAULT_STIFFNESS


def modes_study(parameters: ModelParameters, stiffness: float | None, speed: float, count: int = 10) -> Study:
    """Return frequencies and shapes of the lowest modes at a speed.

    Parameters
    ----------
    parameters : ModelParameters
        Rotor and supports.
    stiffness : float, optional
        Of an additional spring at each journal, in place of the films, N/m.
    speed : float
        Of the shaft, rad/s.
    count : int
        Number of modes.
    """
    system = supported_system(parameters, stiffness)
    modes = whirl_modes(system, [speed])[0]
    lowest = slice(0, min(count, modes.frequencies.size))
    frequencies = modes.frequencies[lowest] / (2 * math.pi)
    is_rigid = np.abs(modes.frequencies[lowest]) < RIGID_TOLERANCE * np.abs(modes.frequencies).max()
    frequencies = np.where(is_rigid, 0.0, frequencies)
    mean = modes.forward[lowest].mean(axis=1)
    names = tuple(_whirl_direction(float(one), is_rigid=bool(free)) for one, free in zip(mean, is_rigid, strict=True))
    # On undamped isotropic supports reverse modes have the shapes of forward ones: draw the forward ones only.
    is_drawn = ~is_rigid & ((frequencies > 0) | (not system.is_undamped_isotropic))
    series = []
    for number in np.flatnonzero(is_drawn)[:MAX_DRAWN_MODES]:
        plane = max(modes.shapes[number], key=lambda moved: float(np.abs(moved).max()))
        moved = np.real(plane * np.exp(-1j * np.angle(_largest(plane))))
        label = f"{abs(frequencies[number]):,.1f} Hz" + ("" if system.is_undamped_isotropic else f", {names[number]}")
        series.append(Series(label, parameters.rotor.positions / MILLIMETRE, np.asarray(moved)))
    held = "free" if stiffness is None and not parameters.supports else "supported"
    title = f"Modes of the {held} rotor at {speed:,.0f} rad/s"
    return Study(
        title,
        {
            "frequency_hz": np.asarray(frequencies),
            "growth_rate_1_s": modes.growth_rates[lowest],
            "whirl": names,
        },
        (Plot(title, "Position along the shaft [mm]", "Displacement, maximum 1", tuple(series), y_limits=(-1.1, 1.1)),),
    )


def _whirl_direction(forward: float, *, is_rigid: bool) -> str:
    if is_rigid:
        return "free"
    if abs(forward) < 0.005:
        return "in a line"
    return "forward" if forward > 0.99 else "reverse" if forward < -0.99 else f"mixed {forward:+.2f}"


def _largest(values: ComplexArray) -> complex:
    return complex(values[int(np.argmax(np.abs(values)))])


def campbell_study(
    parameters: ModelParameters, stiffness: float | None, speeds: FloatArray, count: int = 10, *, zoom: bool = True
) -> Study:
    """Return the Campbell diagram: tracked natural frequencies over speed, and critical speeds.

    Parameters
    ----------
    parameters : ModelParameters
        Rotor and supports.
    stiffness : float, optional
        Of an additional spring at each journal, in place of the films, N/m.
    speeds : ndarray of float64, shape (n,)
        Rising, rad/s.
    count : int
        Number of branches, forward and reverse together.
    zoom : bool
        Whether to add a plot up to the frequency of the shaft.
    """
    system = supported_system(parameters, stiffness)
    diagram = campbell(system, speeds, count)
    critical = critical_speeds(system, float(speeds[-1]))
    frequencies = diagram.frequencies / (2 * math.pi)
    columns: dict[str, FloatArray | tuple[str, ...]] = {"speed_rad_s": speeds}
    for number, branch in enumerate(frequencies, 1):
        columns[f"branch_{number}_hz"] = np.asarray(branch)
    held = "supports of the rotor" if stiffness is None else f"springs of {stiffness:.3g} N/m"
    title = f"Campbell diagram, {held}"
    crossings = np.array(sorted((*critical.forward, *critical.reverse)))
    lines = [
        Series(
            "forward" if first else "",
            speeds,
            np.where(branch >= 0, branch, np.nan),
        )
        for first, branch in _branches(frequencies, forward=True)
    ]
    lines += [
        Series("reverse (absolute value)" if first else "", speeds, np.where(branch < 0, -branch, np.nan), Style.DASHED)
        for first, branch in _branches(frequencies, forward=False)
    ]
    own = Series("n = Ω: frequency of the shaft", speeds, speeds / (2 * math.pi), Style.REFERENCE)
    marks = Series("critical speeds", crossings, crossings / (2 * math.pi), Style.MARKERS)
    highest = 1.03 * max(float(np.nanmax(np.abs(frequencies))), float(speeds[-1]) / (2 * math.pi))
    plots = [Plot(title, SPEED_LABEL, FREQUENCY_LABEL, (*lines, own, marks), y_limits=(0.0, highest))]
    reach = 1.05 * float(speeds[-1]) / (2 * math.pi)
    if zoom and float(np.nanmax(np.abs(frequencies))) > 2 * reach:
        below = f"{title}: up to the frequency of the shaft"
        plots.append(Plot(below, SPEED_LABEL, FREQUENCY_LABEL, (*lines, own, marks), y_limits=(0.0, reach)))
    remarks = (
        "critical speeds, rad/s: forward "
        + _listed_speeds(critical.forward)
        + "; reverse "
        + _listed_speeds(critical.reverse),
    )
    return Study(title, columns, tuple(plots), remarks)


def _branches(frequencies: FloatArray, *, forward: bool) -> list[tuple[bool, FloatArray]]:
    chosen = [branch for branch in frequencies if np.any((branch >= 0) == forward)]
    return [(number == 0, branch) for number, branch in enumerate(chosen)]


def _listed_speeds(speeds: tuple[float, ...]) -> str:
    return ", ".join(f"{speed:,.1f}" for speed in speeds) or "none"


def critical_study(parameters: ModelParameters, stiffnesses: FloatArray, highest: float) -> Study:
    """Return undamped critical speeds over the stiffness of equal springs at the journals.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    stiffnesses : ndarray of float64, shape (n,)
        Rising, N/m.
    highest : float
        Largest critical speed returned, rad/s.
    """
    speed_map = critical_speed_map(parameters.rotor, stiffnesses)
    columns: dict[str, FloatArray | tuple[str, ...]] = {"stiffness_n_m": stiffnesses}
    series = []
    for name, speeds, style in (
        ("forward", speed_map.forward, Style.LINE),
        ("reverse", speed_map.reverse, Style.DASHED),
    ):
        for number, branch in enumerate(speeds, 1):
            below = np.where(branch <= highest, branch, np.nan)
            if np.any(np.isfinite(below)):
                columns[f"{name}_{number}_rad_s"] = below
                series.append(Series(name if number == 1 else "", stiffnesses, below, style))
    title = "Undamped critical speeds over the stiffness of the bearings"
    plot = Plot(
        title,
        "Stiffness of each bearing [N/m]",
        "Critical speed [rad/s]",
        tuple(series),
        x_log=True,
        y_log=True,
        y_limits=(50.0, highest),
    )
    return Study(title, columns, (plot,))


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


def _forward_response(parameters: ModelParameters, speeds: FloatArray) -> ComplexArray:
    weightless = replace(parameters, gravity=0.0)
    amplitudes, last = [], None
    for speed in speeds:
        try:
            last = synchronous_response(weightless, float(speed), last)
            amplitudes.append(complex(last.stations[0, parameters.probe_station - 1]))
        except NoSolutionError:
            last = None
            amplitudes.append(complex(math.nan, math.nan))
    return np.array(amplitudes)


def _without_wraps(lag: FloatArray) -> FloatArray:
    """Return the phase with a gap where it jumps between 360° and 0°."""
    gapped = lag.copy()
    gapped[1:][np.abs(np.diff(lag)) > 180] = np.nan
    return gapped

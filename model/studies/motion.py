"""Study of the motion at one speed: orbit, order spectrum and Poincaré section at any station."""

from dataclasses import replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from analysis.signals.units import MICROMETRE, MILLIMETRE, phase_lag_degrees
from analysis.spectra.order_map import order_spectrum
from model.errors import ParameterError
from model.rotor.parameters import ModelParameters
from model.studies.run_up import MIN_AMPLITUDE, WHIRL_ORDER_RANGE
from model.studies.stepped_motion import STEPS_PER_TURN, WINDOW_HALF_WIDTH, SteppedMotion
from model.studies.study import Plot, Series, Study, Style

FloatArray = NDArray[np.float64]

MAX_ORDER = 4.0
ORBIT_TURNS = 8  # drawn and listed


class MotionTable(Enum):
    """Content of the table of the study."""

    STATIONS = "stations"
    ORBIT = "orbit"
    SPECTRUM = "spectrum"
    POINCARE = "poincare"


def motion_study(
    parameters: ModelParameters,
    speed: float,
    station: int | None = None,
    settle: int = 300,
    turns: int = 64,
    *,
    perturbation: float = 0.0,
    table: MotionTable = MotionTable.STATIONS,
) -> Study:
    """Return the settled motion at a speed, started from rest.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed : float
        rad/s, above 0.
    station : int, optional
        Station of plots and table; default the station of the probes.
    settle, turns : int
        Turns to settle, then turns evaluated.
    perturbation : float
        Size of the disturbance of an unstable motion, m: see `model.studies.stepped_motion`.
    table : MotionTable, optional
        Content of the table: all stations, or orbit, order spectrum or Poincaré section at one.

    Raises
    ------
    ParameterError
        If speed or station are invalid.
    WallContactError
        If the motion reaches a wall.
    """
    if not (np.isfinite(speed) and speed > 0):
        raise ParameterError(f"speed: {speed:g} rad/s, expected a finite value above 0")
    if station is not None:
        parameters = replace(parameters, probe_station=station)
    station = parameters.probe_station
    stepped = SteppedMotion(parameters, perturbation)
    stations = stepped.settle_at(speed, settle).record(turns).stations
    path, points = stations[station - 1] / MICROMETRE, stations[station - 1, :, ::STEPS_PER_TURN] / MICROMETRE
    orders, spectrum = _spectrum(path, turns)
    orbit = path[:, -min(turns, ORBIT_TURNS) * STEPS_PER_TURN :]
    columns: dict[str, FloatArray | tuple[str, ...]]
    if table is MotionTable.STATIONS:
        columns = _station_columns(stations, turns, parameters.rotor.positions)
    elif table is MotionTable.ORBIT:
        turned = np.arange(orbit.shape[1]) / STEPS_PER_TURN
        columns = {"turns": turned, "x_um": orbit[0], "y_um": orbit[1]}
    elif table is MotionTable.SPECTRUM:
        columns = {"order": orders, "x_um_pk": np.abs(spectrum[0]), "y_um_pk": np.abs(spectrum[1])}
    else:
        columns = {"turn": np.arange(float(turns)), "x_um": points[0], "y_um": points[1]}
    title = f"Station {station} at {speed:,.0f} rad/s"
    remark = f"settled for {stepped.turns_settled:,} turns"
    if perturbation:
        remark += (
            f"; growth rate of the least stable whirl of the synchronous motion {stepped.growth_rate:.3g} /s"
            f"{f', perturbed by {perturbation / MICROMETRE:g} µm' if stepped.growth_rate > 0 else ''}"
        )
    return Study(
        f"Motion, {title[0].lower()}{title[1:]}", columns, _plots(title, orbit, points, orders, spectrum), (remark,)
    )


def _spectrum(path: FloatArray, turns: int) -> tuple[FloatArray, NDArray[np.complex128]]:
    orders, spectrum = order_spectrum(path - path.mean(axis=-1, keepdims=True), turns)
    count = int(np.searchsorted(orders, MAX_ORDER, side="right"))
    return orders[:count], spectrum[..., :count]


def _station_columns(
    displacements: FloatArray, turns: int, positions: FloatArray
) -> dict[str, "FloatArray | tuple[str, ...]"]:
    """Return characteristic values of the motion at all stations."""
    orders, spectrum = _spectrum(displacements, turns)
    first = spectrum[:, :, int(np.argmin(np.abs(orders - 1)))]
    lowest, highest = (
        max(WHIRL_ORDER_RANGE[0], WINDOW_HALF_WIDTH / turns),
        min(WHIRL_ORDER_RANGE[1], 1 - WINDOW_HALF_WIDTH / turns),
    )
    below = (orders >= lowest) & (orders <= highest)
    strongest = np.argmax(np.abs(spectrum[:, 0, below]), axis=1)
    amplitude = np.take_along_axis(np.abs(spectrum[:, 0, below]), strongest[:, None], axis=1)[:, 0]
    return {
        "station": np.arange(1.0, positions.size + 1),
        "position_mm": positions / MILLIMETRE,
        "first_order_x_um_pk": np.abs(first[:, 0]) / MICROMETRE,
        "lag_x_deg": phase_lag_degrees(first[:, 0]),
        "first_order_y_um_pk": np.abs(first[:, 1]) / MICROMETRE,
        "lag_y_deg": phase_lag_degrees(first[:, 1]),
        "whirl_order": np.where(amplitude > MIN_AMPLITUDE, orders[below][strongest], np.nan),
        "whirl_x_um_pk": amplitude / MICROMETRE,
        "overall_x_um_pp": np.ptp(displacements[:, 0], axis=1) / MICROMETRE,
        "overall_y_um_pp": np.ptp(displacements[:, 1], axis=1) / MICROMETRE,
        "spread_x_um": np.ptp(displacements[:, 0, ::STEPS_PER_TURN], axis=1) / MICROMETRE,
        "mean_x_um": displacements[:, 0].mean(axis=1) / MICROMETRE,
        "mean_y_um": displacements[:, 1].mean(axis=1) / MICROMETRE,
    }


def _plots(
    title: str, orbit: FloatArray, points: FloatArray, orders: FloatArray, spectrum: NDArray[np.complex128]
) -> tuple[Plot, ...]:
    floor = 1e-3  # µm peak
    marks = Series("once a turn, at θ = 0", points[0], points[1], Style.POINTS)
    return (
        Plot(
            f"{title}: orbit and Poincaré section",
            "X [µm]",
            "Y [µm]",
            (Series("orbit", orbit[0], orbit[1]), marks),
            is_square=True,
        ),
        Plot(
            "Order spectrum",
            "Frequency over the shaft's speed [X]",
            "Amplitude [µm peak]",
            tuple(
                Series(name, orders, np.clip(np.abs(values), floor, None))
                for name, values in zip("XY", spectrum, strict=True)
            ),
            y_log=True,
        ),
        Plot("Poincaré section", "X at θ = 0 [µm]", "Y at θ = 0 [µm]", (marks,), is_square=True),
    )

"""A study of the motion at one speed: orbit, order spectrum and Poincaré's points at any station."""

from dataclasses import replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from analysis.spectra.order_spectrum import order_spectrum
from model.rotor.parameters import ModelParameters
from model.studies.run_up import MIN_AMPLITUDE
from model.studies.stepped_motion import STEPS_PER_TURN, SteppedMotion
from model.studies.study import Plot, Series, Study, Style

FloatArray = NDArray[np.float64]

MAX_ORDER = 4.0
ORBIT_TURNS = 8  # that are drawn and listed
SUB_SYNCHRONOUS = (0.05, 0.95)  # orders of a whirl, less what the window spreads the mean and 1X over
WINDOW_HALF_WIDTH = 2.5  # lines


class MotionTable(Enum):
    """What the table of the study lists."""

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
    seed: float = 0.0,
    table: MotionTable = MotionTable.STATIONS,
) -> Study:
    """Return the motion at a speed as it is once it has settled from rest.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed : float
        rad/s, above 0.
    station : int, optional
        That is drawn, and listed unless all are; the probes' where none is given.
    settle, turns : int
        Turns that are left out, then those that are looked at.
    seed : float
        How far the motion is disturbed where it is unstable, m: see `model.studies.stepped_motion`.
    table : MotionTable, optional
        What the table lists: all stations, or the orbit, order spectrum or Poincaré's points at one.

    Raises
    ------
    ValueError
        Where speed or station make no sense.
    WallContactError
        Where the motion reaches a wall.
    """
    if not (np.isfinite(speed) and speed > 0):
        raise ValueError(f"speed: {speed:g} rad/s, expected a finite value above 0")
    if station is not None:
        parameters = replace(parameters, probe_station=station)
    station = parameters.probe_station
    stepped = SteppedMotion(parameters, seed)
    whole = stepped.settle_at(speed, settle).record(turns).stations
    path, points = whole[station - 1] * 1e6, whole[station - 1, :, ::STEPS_PER_TURN] * 1e6
    orders, spectrum = _spectrum(path, turns)
    orbit = path[:, -min(turns, ORBIT_TURNS) * STEPS_PER_TURN :]
    columns: dict[str, FloatArray | tuple[str, ...]]
    if table is MotionTable.STATIONS:
        columns = _stations(whole, turns, parameters.rotor.positions)
    elif table is MotionTable.ORBIT:
        turned = np.arange(orbit.shape[1]) / STEPS_PER_TURN
        columns = {"turns": turned, "x_um": orbit[0], "y_um": orbit[1]}
    elif table is MotionTable.SPECTRUM:
        columns = {"order": orders, "x_um_pk": np.abs(spectrum[0]), "y_um_pk": np.abs(spectrum[1])}
    else:
        columns = {"turn": np.arange(float(turns)), "x_um": points[0], "y_um": points[1]}
    title = f"Station {station} at {speed:,.0f} rad/s"
    remark = f"settled for {stepped.turns_settled:,} turns"
    if seed:
        remark += (
            f"; the synchronous motion's least stable whirl grows at {stepped.growth_rate:.3g} /s"
            f"{f', seeded with {seed * 1e6:g} µm' if stepped.growth_rate > 0 else ''}"
        )
    return Study(
        f"Motion, {title[0].lower()}{title[1:]}", columns, _plots(title, orbit, points, orders, spectrum), (remark,)
    )


def _spectrum(path: FloatArray, turns: int) -> tuple[FloatArray, NDArray[np.complex128]]:
    orders, spectrum = order_spectrum(path - path.mean(axis=-1, keepdims=True), turns)
    kept = int(np.searchsorted(orders, MAX_ORDER, side="right"))
    return orders[:kept], spectrum[..., :kept]


def _stations(whole: FloatArray, turns: int, positions: FloatArray) -> dict[str, "FloatArray | tuple[str, ...]"]:
    """Return the motion of all stations in some numbers each."""
    orders, spectrum = _spectrum(whole, turns)
    first = spectrum[:, :, int(np.argmin(np.abs(orders - 1)))]
    lowest, highest = (
        max(SUB_SYNCHRONOUS[0], WINDOW_HALF_WIDTH / turns),
        min(SUB_SYNCHRONOUS[1], 1 - WINDOW_HALF_WIDTH / turns),
    )
    below = (orders >= lowest) & (orders <= highest)
    strongest = np.argmax(np.abs(spectrum[:, 0, below]), axis=1)
    amplitude = np.take_along_axis(np.abs(spectrum[:, 0, below]), strongest[:, None], axis=1)[:, 0]
    return {
        "station": np.arange(1.0, positions.size + 1),
        "position_mm": positions * 1e3,
        "first_order_x_um_pk": np.abs(first[:, 0]) * 1e6,
        "lag_x_deg": np.degrees(-np.angle(first[:, 0])) % 360,
        "first_order_y_um_pk": np.abs(first[:, 1]) * 1e6,
        "lag_y_deg": np.degrees(-np.angle(first[:, 1])) % 360,
        "whirl_order": np.where(amplitude > MIN_AMPLITUDE, orders[below][strongest], np.nan),
        "whirl_x_um_pk": amplitude * 1e6,
        "overall_x_um_pp": np.ptp(whole[:, 0], axis=1) * 1e6,
        "overall_y_um_pp": np.ptp(whole[:, 1], axis=1) * 1e6,
        "spread_x_um": np.ptp(whole[:, 0, ::STEPS_PER_TURN], axis=1) * 1e6,
        "mean_x_um": whole[:, 0].mean(axis=1) * 1e6,
        "mean_y_um": whole[:, 1].mean(axis=1) * 1e6,
    }


def _plots(
    title: str, orbit: FloatArray, points: FloatArray, orders: FloatArray, spectrum: NDArray[np.complex128]
) -> tuple[Plot, ...]:
    floor = 1e-3  # µm peak
    marks = Series("once a turn, at θ = 0", points[0], points[1], Style.POINTS)
    return (
        Plot(
            f"{title}: orbit and Poincaré's points",
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
        Plot("Poincaré's points", "X at θ = 0 [µm]", "Y at θ = 0 [µm]", (marks,), is_square=True),
    )

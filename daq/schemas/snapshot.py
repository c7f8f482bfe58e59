"""Schemas of the live curves: orbit and order spectrum, measured and predicted."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from analysis.signals.snapshot import OrderFrame
from daq.schemas.units import Number, Schema, finite, micrometres
from daq.session.live_update import LiveUpdate
from model.prediction.prediction_map import Prediction

Values = tuple[Number, ...]


class OrbitAndSpectrumSchema(Schema):
    """Orbit and order spectrum, measured or predicted."""

    orbit_x_um: Values = Field(
        description="Displacement in the bench's X (to the right) over the last whole revolutions, mean removed, µm",
        examples=[[15.2, 15.1, 14.9]],
    )
    orbit_y_um: Values = Field(
        description="Displacement in the bench's Y (up) at the same points, µm", examples=[[0.1, 1.6, 3.1]]
    )
    compensated_orbit_x_um: Values | None = Field(
        description="X minus run-out, µm; null without compensation or before the run-out is known",
        examples=[[14.2, 14.1, 13.9]],
    )
    compensated_orbit_y_um: Values | None = Field(
        description="Y minus run-out, µm; null likewise", examples=[[0.2, 1.5, 3.0]]
    )
    orders: Values = Field(description="Frequency over shaft frequency", examples=[[0.0, 0.0625, 0.125]])
    spectrum_peak_x_um: Values = Field(
        description="Amplitude at probe x by order, window of `[analysis]`, zero-to-peak, µm",
        examples=[[0.05, 0.04, 0.06]],
    )
    spectrum_peak_y_um: Values = Field(
        description="Amplitude at probe y by order, window of `[analysis]`, zero-to-peak, µm",
        examples=[[0.05, 0.05, 0.04]],
    )


class LiveCurvesSchema(Schema):
    """Latest orbit and order spectrum of the live run, measured and predicted."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    points_per_revolution: int = Field(
        description="Points of the orbit per revolution; the first of each lies at the keyphasor mark",
        examples=[64],
    )
    clearance_um: Number = Field(description="Radius of the clearance circle, µm", examples=[100.0])
    measured: OrbitAndSpectrumSchema | None = Field(
        description="Measured; null until there are enough whole revolutions"
    )
    predicted: OrbitAndSpectrumSchema | None = Field(description="Predicted; null where speed or prediction is unknown")


def live_curves_schema(update: LiveUpdate) -> LiveCurvesSchema:
    """Return the schema of the curves of a live update."""
    header, prediction = update.header, update.prediction
    measured = None if update.snapshot is None else update.snapshot.frame
    return LiveCurvesSchema(
        run=header.run,
        points_per_revolution=header.settings.points_per_revolution,
        clearance_um=micrometres(header.limits.clearance),
        measured=None if measured is None else _curves(measured),
        predicted=None if prediction is None else _curves(prediction),
    )


def _curves(source: OrderFrame | Prediction) -> OrbitAndSpectrumSchema:
    compensated = source.compensated_orbit if isinstance(source, OrderFrame) else None
    return OrbitAndSpectrumSchema(
        orbit_x_um=_micrometres(source.orbit[0]),
        orbit_y_um=_micrometres(source.orbit[1]),
        compensated_orbit_x_um=None if compensated is None else _micrometres(compensated[0]),
        compensated_orbit_y_um=None if compensated is None else _micrometres(compensated[1]),
        orders=tuple(finite(order) for order in source.orders.tolist()),
        spectrum_peak_x_um=_micrometres(np.abs(source.spectrum[0])),
        spectrum_peak_y_um=_micrometres(np.abs(source.spectrum[1])),
    )


def _micrometres(lengths: NDArray[np.float64]) -> Values:
    return tuple(micrometres(length) for length in lengths.tolist())

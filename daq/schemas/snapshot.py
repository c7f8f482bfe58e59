"""Schemas of one order frame: order spectrum, full spectrum and orbit, recorded or live, measured or predicted."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from analysis.signals.header import Role, RunHeader
from analysis.signals.probes import ProbePair
from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.spectra.full_spectrum import full_spectrum
from daq.schemas.units import Count, Number, Schema, finite, lags_degrees, micrometres
from daq.session.live_update import LiveUpdate
from model.prediction.prediction_map import Prediction

Values = tuple[Number, ...]


class OrderFrameSchema(Schema, of=(Snapshot, OrderFrame)):
    """Position of an order frame in the run."""

    segment: Count = Field(examples=[0])
    sample: Count = Field(examples=[32_230_000])
    time_s: float = Field(examples=[161.15])
    speed_rpm: Number = Field(examples=[11042.1])
    acceleration_rpm_per_s: Number = Field(examples=[48.5])


class OrderSpectrumSchema(Schema):
    """Order spectrum of a frame."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    frame: OrderFrameSchema
    orders: Values = Field(description="Frequency over shaft frequency", examples=[[0.0, 0.0625, 0.125]])
    amplitude_peak_x_um: Values = Field(
        description="At probe x by order, window of `[analysis]`, µm zero-to-peak", examples=[[0.05, 0.04, 0.06]]
    )
    amplitude_peak_y_um: Values = Field(
        description="At probe y by order, window of `[analysis]`, µm zero-to-peak", examples=[[0.05, 0.05, 0.04]]
    )
    lag_x_deg: Values = Field(description="Phase lag at probe x, 0 to 360 degrees", examples=[[12.0, 340.1, 77.5]])
    lag_y_deg: Values = Field(description="Phase lag at probe y, 0 to 360 degrees", examples=[[102.0, 70.1, 167.5]])
    noise_peak_um: Number = Field(description="Noise floor of the spectrum, µm zero-to-peak", examples=[0.05])


class FullSpectrumSchema(Schema):
    """Full spectrum of a frame: forward (positive orders) and backward (negative orders) components."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    frame: OrderFrameSchema
    orders: Values = Field(
        description="Frequency over shaft frequency; negative: against the rotation", examples=[[-1.0, 0.0, 1.0]]
    )
    amplitude_peak_um: Values = Field(description="Radius of the circular component, µm", examples=[[0.8, 0.1, 15.0]])
    uncertain: tuple[bool, ...] = Field(
        description="Whether the tolerance of the probes could produce this component from its counterpart",
        examples=[[True, False, False]],
    )


class OrbitSchema(Schema):
    """Orbit of a frame."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    frame: OrderFrameSchema
    points_per_revolution: Count = Field(
        description="Points per revolution; the first of each lies at the keyphasor mark", examples=[64]
    )
    orbit_x_um: Values = Field(
        description="Displacement in the bench's X (to the right), mean removed, µm", examples=[[15.2, 15.1, 14.9]]
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
    clearance_um: Number = Field(description="Radius of the clearance circle, µm", examples=[100.0])


def order_frame_schema(snapshot: Snapshot, frame: OrderFrame) -> OrderFrameSchema:
    """Return the schema of the position of a frame."""
    return OrderFrameSchema.of(snapshot, frame)


def order_spectrum_schema(header: RunHeader, snapshot: Snapshot, frame: OrderFrame) -> OrderSpectrumSchema:
    """Return the schema of the order spectrum of a frame."""
    x, y = np.abs(frame.spectrum)
    return OrderSpectrumSchema(
        run=header.run,
        frame=order_frame_schema(snapshot, frame),
        orders=tuple(finite(order) for order in frame.orders.tolist()),
        amplitude_peak_x_um=tuple(micrometres(value) for value in x.tolist()),
        amplitude_peak_y_um=tuple(micrometres(value) for value in y.tolist()),
        lag_x_deg=lags_degrees(frame.spectrum[0]),
        lag_y_deg=lags_degrees(frame.spectrum[1]),
        noise_peak_um=micrometres(frame.noise),
    )


def full_spectrum_schema(header: RunHeader, snapshot: Snapshot, frame: OrderFrame) -> FullSpectrumSchema:
    """Return the schema of the full spectrum of a frame."""
    channels = header.acquisition.channels
    x, y = (channels[header.acquisition.row(role)] for role in (Role.PROBE_X, Role.PROBE_Y))
    full = full_spectrum(frame.orders, frame.spectrum, ProbePair(x.angle, y.angle))
    forward, backward = np.abs(full.forward), np.abs(full.backward)
    doubtful = full.uncertain & (backward <= forward), full.uncertain & (forward <= backward)
    return FullSpectrumSchema(
        run=header.run,
        frame=order_frame_schema(snapshot, frame),
        orders=tuple(finite(order) for order in full.axis.tolist()),
        amplitude_peak_um=tuple(micrometres(value) for value in full.amplitudes.tolist()),
        uncertain=tuple(np.concatenate([doubtful[0][:0:-1], doubtful[1]]).tolist()),
    )


def orbit_schema(header: RunHeader, snapshot: Snapshot, frame: OrderFrame) -> OrbitSchema:
    """Return the schema of the orbit of a frame."""
    compensated = frame.compensated_orbit
    rows = (None, None) if compensated is None else tuple(tuple(map(micrometres, row)) for row in compensated.tolist())
    return OrbitSchema(
        run=header.run,
        frame=order_frame_schema(snapshot, frame),
        points_per_revolution=header.settings.points_per_revolution,
        orbit_x_um=tuple(micrometres(value) for value in frame.orbit[0].tolist()),
        orbit_y_um=tuple(micrometres(value) for value in frame.orbit[1].tolist()),
        compensated_orbit_x_um=rows[0],
        compensated_orbit_y_um=rows[1],
        clearance_um=micrometres(header.limits.clearance),
    )


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

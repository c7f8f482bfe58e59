"""What can be drawn of the shaft at this moment: its orbit and its order spectrum, the model's beside them."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from analysis.signals.snapshot import OrderFrame
from daq.schemas.document import Document
from daq.schemas.units import finite, micrometres
from daq.session.live_update import LiveFrame
from model.prediction.prediction import Prediction

Values = tuple[float | None, ...]


class CurvesDocument(Document):
    """Orbit and order spectrum, measured or predicted."""

    orbit_x_um: Values = Field(
        description="Displacement in the bench's X (to the right) over the last whole revolutions, mean removed, µm",
        examples=[[15.2, 15.1, 14.9]],
    )
    orbit_y_um: Values = Field(
        description="Displacement in the bench's Y (up) at the same points, µm", examples=[[0.1, 1.6, 3.1]]
    )
    compensated_orbit_x_um: Values | None = Field(
        description="The same in X less run-out, µm; null where that is not asked for or not known",
        examples=[[14.2, 14.1, 13.9]],
    )
    compensated_orbit_y_um: Values | None = Field(
        description="The same in Y less run-out, µm; null likewise", examples=[[0.2, 1.5, 3.0]]
    )
    orders: Values = Field(
        description="Axis of the spectrum: frequency over the shaft's", examples=[[0.0, 0.0625, 0.125]]
    )
    spectrum_peak_x_um: Values = Field(
        description="Amplitude at probe x by order, Hann window, zero-to-peak, µm", examples=[[0.05, 0.04, 0.06]]
    )
    spectrum_peak_y_um: Values = Field(
        description="Amplitude at probe y by order, Hann window, zero-to-peak, µm", examples=[[0.05, 0.05, 0.04]]
    )


class PictureDocument(Document):
    """The shaft's orbit and order spectrum at one moment."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    points_per_revolution: int = Field(
        description="Points of an orbit in a revolution; from the first on, every such point lies on the tacho's mark",
        examples=[64],
    )
    clearance_um: float | None = Field(
        description="Radius of the circle that the shaft can move in, µm", examples=[100.0]
    )
    measured: CurvesDocument | None = Field(description="Null until there are enough whole revolutions")
    predicted: CurvesDocument | None = Field(description="Null where speed or model are not known")


def picture_document(frame: LiveFrame) -> PictureDocument:
    """Return what can be drawn of one moment of a run as a document."""
    header, prediction = frame.header, frame.prediction
    measured = None if frame.snapshot is None else frame.snapshot.frame
    return PictureDocument(
        run=header.run,
        points_per_revolution=header.settings.points_per_revolution,
        clearance_um=micrometres(header.limits.clearance),
        measured=None if measured is None else _curves(measured),
        predicted=None if prediction is None else _curves(prediction),
    )


def _curves(source: OrderFrame | Prediction) -> CurvesDocument:
    compensated = source.compensated_orbit if isinstance(source, OrderFrame) else None
    return CurvesDocument(
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

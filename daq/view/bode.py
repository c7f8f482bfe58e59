"""Bode plot of measured and predicted 1X and 2X over speed."""

import math

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis.signals.blocks import RampDirection, RampStep, RampTracker
from analysis.signals.header import RunHeader
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from daq.colours import MEASURED_X, MEASURED_Y, MODEL, TEXT, Color
from daq.session.live_update import LiveUpdate
from daq.view.drawing import MODEL_DASH, AutoScale, Axis, Drawing, LivePlot, Plot, dimmed, stacked_axes

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

BODE_BOUNDS = ((-34.0, 320.0), (-15.0, 192.0))
_BINS = 250
_FONT_SIZE = 7.0
_DASH = 2.5  # length, of run-down lines


class BodePlot(LivePlot):
    """Bode plot of one run: run-up in solid lines, run-down dashed.

    The latest vector at each speed and ramp direction is shown. A reversal is detected with a delay; vectors since the
    reversal are then moved to the new direction.

    Parameters
    ----------
    header : RunHeader
        Header with the highest speed.
    """

    def __init__(self, header: RunHeader) -> None:
        self._top = header.limits.speed / RPM
        self._speeds = (np.arange(_BINS) + 0.5) * self._top / _BINS
        self._ramp = RampTracker()
        self._measured = {direction: _no_vectors() for direction in RampDirection}
        self._since = _no_vectors()  # the extreme speed of the ramp
        self._predicted = _no_vectors()
        self._scale = AutoScale(minimum=2.0, patience=3)
        self._compensated = False  # whether some vectors are compensated for run-out

    def add(self, update: LiveUpdate) -> None:
        """Add the vectors of the order frame and of the prediction."""
        frame, prediction = update.order_frame, update.prediction
        if frame is not None and math.isfinite(frame.speed):
            if self._ramp.update(frame.speed) is not RampStep.WITHIN:
                self._measured[self._ramp.direction] = self._in_direction(self._ramp.direction)
                self._since = _no_vectors()
            self._store(frame.speed, frame.motion, self._since)
            self._compensated = self._compensated or frame.runout is not None
        if prediction is not None and math.isfinite(prediction.speed):
            self._store(prediction.speed, prediction.vectors, self._predicted)

    def _store(self, speed: float, vectors: ComplexArray, into: ComplexArray) -> None:
        if 0.0 <= speed / RPM < self._top and np.isfinite(vectors).all():
            into[int(speed / RPM / self._top * _BINS)] = vectors / MICROMETRE

    def _in_direction(self, direction: RampDirection) -> ComplexArray:
        """Return the measured vectors of a ramp direction by speed."""
        settled = self._measured[direction]
        return (
            settled
            if direction is not self._ramp.direction
            else np.where(np.isfinite(self._since), self._since, settled)
        )

    def follow(self, update: LiveUpdate) -> tuple[float, bool, bool]:  # noqa: ARG002 - all vectors were added before
        """Update the scale; return its end, µm, whether vectors are compensated, and whether there is a run-down."""
        drawn = np.stack([*self._measured.values(), self._since, self._predicted])
        self._scale.follow(float(np.nan_to_num(np.abs(drawn)).max()))
        return self._scale.end, self._compensated, self._has_run_down

    @property
    def _has_run_down(self) -> bool:
        return bool(np.isfinite(self._in_direction(RampDirection.RUN_DOWN)).any())

    def axes(self) -> Drawing:
        """Return axes and legend."""
        amplitude, lag = self._plots()
        which = "compensated, 2X dim" if self._compensated else "1X bright, 2X dim"
        drawing = stacked_axes(amplitude, lag, ("model", MODEL), ("y", MEASURED_Y), ("x", MEASURED_X), (which, TEXT))
        if self._has_run_down:
            lag.draw_legend(drawing, ("run-up solid, run-down dashed", TEXT))
        return drawing

    def layers(self, update: LiveUpdate) -> dict[str, Drawing | rr.Image]:  # noqa: ARG002 - all vectors were added before
        """Return the predicted and the measured curves."""
        model, measured = Drawing(), Drawing()
        self._lines(model, self._predicted, (MODEL, dimmed(MODEL, 0.75)), 2.2, MODEL_DASH)
        for direction, dash in ((RampDirection.RUN_DOWN, _DASH), (RampDirection.RUN_UP, 0.0)):
            self._lines(measured, self._in_direction(direction), (MEASURED_X, MEASURED_Y), 1.7, dash)
        return {"model": model, "measured": measured}

    def _lines(
        self, drawing: Drawing, vectors: ComplexArray, colors: tuple[Color, Color], width: float, dash: float = 0.0
    ) -> None:
        amplitude, lag = self._plots()
        known = np.flatnonzero(np.isfinite(vectors[:, 0, 0].real))
        gaps = np.flatnonzero(np.diff(known) > 8) + 1  # smaller gaps are joined
        for stretch in np.split(known, gaps):
            for order, share in ((1, 0.5), (0, 1.0)):
                for probe, color in enumerate(colors):
                    vector = vectors[stretch, order, probe]
                    speeds = self._speeds[stretch]
                    lines = [amplitude.place(speeds, np.abs(vector))]
                    if order == 0:
                        lines.append(lag.place(*_broken_at_wrap(speeds, phase_lag_degrees(vector))))
                    for line in lines:
                        drawing.line(line, dimmed(color, share), width, dash)

    def _plots(self) -> tuple[Plot, Plot]:
        speed = Axis(0.0, self._top, "speed, r/min", ticks=8)
        amplitude = Axis(0.0, self._scale.end, "amplitude, µm peak", ticks=3)
        lag = Axis(0.0, 360.0, "1X phase lag, °", step=90.0)
        upper = Plot(0.0, 0.0, 300.0, 76.0, speed, amplitude, font_size=_FONT_SIZE)
        return upper, Plot(0.0, 98.0, 300.0, 64.0, speed, lag, font_size=_FONT_SIZE)


def _no_vectors() -> ComplexArray:
    return np.full((_BINS, 2, 2), np.nan, dtype=np.complex128)


def _broken_at_wrap(speeds: FloatArray, lag: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a curve broken where the lag wraps from 360° to 0°."""
    jumps = np.flatnonzero(np.abs(np.diff(lag)) > 180.0) + 1
    return np.insert(speeds, jumps, np.nan), np.insert(lag, jumps, np.nan)

"""The waterfall: the order spectra of the last minute against time, the predicted whirl drawn over them."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
import rerun as rr

from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from analysis.spectra.waterfall import Waterfall
from daq.session.live_update import PlacedMark
from daq.view.axes import Axis
from daq.view.colour_map import LETTERS, ROWS, map_axes, map_picture, map_plot
from daq.view.drawing import Drawing
from daq.view.flags import draw_level
from daq.view.palette import MODEL
from model.prediction.prediction import Prediction

_SPAN = 60.0  # s


class WaterfallPlot:
    """Collects the spectra of the last minute and draws them, the newest at the top.

    Parameters
    ----------
    header : RunHeader
        Gives the spectra's orders.
    """

    def __init__(self, header: RunHeader) -> None:
        self._plot = map_plot(Axis(-_SPAN, 0.0, "time before now, s", ticks=6))
        self._waterfall = Waterfall(header.settings, ROWS, _SPAN)
        self._predicted: deque[tuple[float, float]] = deque(maxlen=4 * ROWS)  # time in the run, s, and order

    def add(self, snapshot: Snapshot, prediction: Prediction | None, elapsed: float) -> None:
        """Take what there is to say at a time ``elapsed``, s, of the run."""
        self._waterfall.snapshot(snapshot)
        whirls = prediction is not None and prediction.whirl_amplitude > 0.0
        self._predicted.append((elapsed, prediction.whirl_order if prediction is not None and whirls else math.nan))

    def axes(self) -> Drawing:
        """Return frame, numbers, and the scale of the colours."""
        return map_axes(self._plot)

    def picture(self) -> rr.Image:
        """Return the colours."""
        return map_picture(self._waterfall.orders, self._waterfall.amplitudes)

    def lines(self, elapsed: float, marks: Sequence[PlacedMark] = ()) -> Drawing:
        """Return the predicted whirl of the last minute, and its marks."""
        drawing = Drawing()
        recent = np.array([(order, time - elapsed) for time, order in self._predicted if time >= elapsed - _SPAN])
        if recent.size:
            drawing.line(self._plot.place(recent[:, 0], recent[:, 1]), MODEL, 0.9)
            if math.isfinite(recent[-1, 0]):
                at = self._plot.place(recent[-1:, 0], recent[-1:, 1])[0]
                drawing.text("model", (float(at[0]) + 2.0, float(at[1]) + 1.5 * LETTERS), LETTERS, MODEL)
        for mark in marks:
            if elapsed - _SPAN <= mark.elapsed <= elapsed:
                draw_level(drawing, self._plot, mark.elapsed - elapsed, mark)
        return drawing

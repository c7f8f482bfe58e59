"""Order spectra as colours in a plot with axes: what waterfall and cascade have in common."""

import math

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from daq.view.axes import Axis, Plot
from daq.view.drawing import Anchor, Drawing
from daq.view.palette import CLEARANCE, QUIET, dimmed, shades

FloatArray = NDArray[np.float64]

HIGHEST_ORDER = 2.5
FAINTEST, BRIGHTEST = 0.1, 50.0  # µm peak: the ends of the colours, which are logarithmic
COLUMNS, ROWS = 150, 100
LETTERS = 3.9
BOUNDS = ((-24.0, 172.0), (-12.0, 118.0))
_MICRO = 1e6
_ORDERS = (np.arange(COLUMNS) + 0.5) * HIGHEST_ORDER / COLUMNS


def map_plot(upright: Axis) -> Plot:
    """Return the plot over orders with this upright axis; one dot of its picture is one unit of the plane."""
    return Plot(0.0, 0.0, float(COLUMNS), float(ROWS), Axis(0.0, HIGHEST_ORDER, "order, X"), upright, letters=LETTERS)


def map_axes(plot: Plot) -> Drawing:
    """Return frame, numbers, lines at 0.5X, 1X and 2X, and the scale of the colours."""
    drawing = Drawing()
    plot.draw_frame(drawing, grid=False)
    for order in (0.5, 1.0, 2.0):
        drawing.line(plot.place([order, order], [plot.y.low, plot.y.high]), dimmed(CLEARANCE, 0.35), 0.25, 1.5)
    drawing.text("colour: µm peak", (float(COLUMNS), -0.8 * LETTERS), LETTERS, QUIET, Anchor.RIGHT)
    left, steps = COLUMNS + 4.5, 40
    for step, (red, green, blue) in enumerate(shades(np.linspace(0.0, 1.0, steps))):
        bottom = ROWS * (1.0 - step / steps)
        drawing.line([(left, bottom), (left, bottom - ROWS / steps)], (int(red), int(green), int(blue), 255), 3.0)
    for value in (0.1, 1.0, 10.0, 50.0):
        bottom = ROWS * (1.0 - math.log(value / FAINTEST) / math.log(BRIGHTEST / FAINTEST))
        drawing.text(f"{value:g}", (left + 3.5, bottom + 0.5 * LETTERS), LETTERS, QUIET)
    return drawing


def map_picture(orders: FloatArray, amplitudes: FloatArray) -> rr.Image:
    """Return amplitudes of shape (`ROWS`, n_orders), m peak, the lowest row first, as colours."""
    level = np.stack([np.interp(_ORDERS, orders, row) for row in amplitudes]) * _MICRO
    with np.errstate(divide="ignore"):
        level = np.log(level / FAINTEST) / math.log(BRIGHTEST / FAINTEST)
    return rr.Image(np.ascontiguousarray(shades(level)[::-1]), color_model="RGB")

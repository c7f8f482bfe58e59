"""`rig predict`: predicted vibration at the probes over speed."""

import argparse
import math
from pathlib import Path

import numpy as np

from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from daq.cli.arguments import AddCommand, show_examples, speed
from daq.cli.progress import TerminalOutput
from daq.cli.terminal import print_json
from daq.config.loader import load_rig
from daq.config.rig import Rig, model_parameters
from daq.errors import RigError, UsageError
from daq.schemas.live import predicted_vibration_schema
from daq.session.predictor import PREDICTION_TIMEOUT, Predictors
from model.errors import ModelError
from model.prediction.prediction_map import Prediction, PredictionMap, refine

_SPEED_STEP = 1000 * RPM  # rad/s between the rows of the table


def run(args: argparse.Namespace) -> int:
    """Compute or load the prediction and print it; return the exit code."""
    console = TerminalOutput()
    rig = load_rig(Path(args.config))
    with Predictors() as predictors:
        predictor = predictors.for_rig(rig)
        predictor.wait(PREDICTION_TIMEOUT, lambda state: console.progress(f"model {state}"))
        console.clear()
        found = predictor.map
        if found is None:
            raise RigError(f"no prediction: {predictor.state}")
    if args.quiet:
        return 0
    predictions = _over_speed(found) if args.speed_rpm is None else [_at_speed(rig, found, args.speed_rpm * RPM)]
    if args.json:
        print_json([predicted_vibration_schema(prediction) for prediction in predictions])
    else:
        print(_TABLE_HEADER)
        for prediction in predictions:
            print(_row(prediction))
    return 0


def _over_speed(found: PredictionMap) -> list[Prediction]:
    lowest, highest = float(found.speeds[0]), float(found.speeds[-1])
    first = math.ceil(lowest / _SPEED_STEP - 1e-9) * _SPEED_STEP
    return [found.at(min(speed, highest)) for speed in np.arange(first, highest * (1 + 1e-9), _SPEED_STEP)]


def _at_speed(rig: Rig, found: PredictionMap, speed: float) -> Prediction:
    """Return the settled prediction at a speed, rad/s."""
    lowest, highest = float(found.speeds[0]), float(found.speeds[-1])
    if not lowest <= speed <= highest:
        raise UsageError(
            f"--speed {speed / RPM:g}: expected {lowest / RPM:,.0f} to {highest / RPM:,.0f} r/min, "
            "up to limits.speed_rpm"
        )
    try:
        *_, settled = refine(model_parameters(rig.config), speed, found, rig.settings)
    except ModelError as error:
        raise RigError(f"no prediction at {speed / RPM:g} r/min: {error}") from error
    return settled


_TABLE_HEADER = "   r/min  1X x µm∠lag  1X y µm∠lag   below 1X µm     overall µm pp  growth 1/s"


def _row(prediction: Prediction) -> str:
    """Return a row of the table: peak amplitudes, and overall vibration of x and y."""
    x, y = (f"{abs(v) / MICROMETRE:.2f}∠{phase_lag_degrees(v):.0f}°" for v in prediction.vectors[0])
    whirl = (
        f"{prediction.whirl_order:.2f}X {prediction.whirl_amplitude / MICROMETRE:6.1f}"
        if prediction.whirl_amplitude > 0
        else "none"
    )
    overall = " / ".join(f"{value / MICROMETRE:5.1f}" for value in prediction.peak_to_peak)
    speed = f"{prediction.speed / RPM:8,.0f}"
    return f"{speed}  {x:>11}  {y:>11}   {whirl:12}   {overall:>13}  {prediction.growth_rate:+10.1f}"


def add_commands(add: AddCommand) -> None:
    """Add `rig predict` to the command line."""
    command = add("predict", run)
    command.add_argument("config", metavar="RIG.TOML", help="rig file")
    command.add_argument("--speed", dest="speed_rpm", type=speed, metavar="RPM", help="only the settled motion there")
    command.add_argument("--json", action="store_true", help="print JSON")
    command.add_argument("--quiet", action="store_true", help="only compute and cache it, for later runs")
    show_examples(command, "rig predict rigs/bench.toml --speed 11000")

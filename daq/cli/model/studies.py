"""`rig model` with its studies, and `rig predict`."""

import argparse
import math
from collections.abc import Callable
from contextlib import closing
from functools import partial
from typing import Any

import numpy as np

from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from daq.cli.arguments import (
    AddCommand,
    add_json,
    add_rig_file,
    non_negative,
    positive,
    positive_integer,
    speed,
)
from daq.cli.model.arguments import (
    add_model_file,
    number_range,
    parameters_of,
    plot_file,
    rising_range,
    save,
    show_study,
)
from daq.cli.model.sweep import add_sweep
from daq.cli.model.thesis import add_thesis
from daq.cli.terminal import TerminalOutput, print_json, print_output, text_table
from daq.config.loader import load_rig
from daq.config.rig import Rig, model_parameters
from daq.errors import RigError, UsageError
from daq.schemas.live import predicted_vibration_schema
from daq.session.predictor import PREDICTION_TIMEOUT, Predictors
from model.errors import ModelError
from model.films.finite_film import Grid
from model.films.lubrication import Lubrication, nominal_lubrication, thesis_like_lubrication
from model.prediction.prediction_map import Prediction, PredictionMap, refine
from model.rotor.parameters import ModelParameters
from model.studies.films import film_study, lubrication_study
from model.studies.linear_studies import (
    DEFAULT_STIFFNESS,
    campbell_stiffness,
    campbell_study,
    critical_study,
    modes_study,
    response_study,
)
from model.studies.motion import DEFAULT_PERTURBATION, MotionTable, motion_study
from model.studies.onset import onset_study
from model.studies.run_up import RunUp, bifurcation_study, run_up, waterfall_study
from model.studies.study import Study

Compute = Callable[[ModelParameters, argparse.Namespace], Study]
AddStudy = Callable[..., None]
"""Adds a study; takes its name, its function, its description and its options."""

Option = tuple[str, dict[str, Any]]
"""An option's name, and the settings that `add_argument` takes."""

_SPEED_STEP = 1000 * RPM  # rad/s between the rows of the prediction
_EPILOG = """\
RANGE is FIRST:LAST:COUNT (FIRST:LAST:COUNT:log for equal ratios), or values
separated by commas. RIG.TOML may be a rotor file; the default is the GJ90C of
the thesis. Every study prints a table; --json prints it as JSON, -o FILE.svg,
.png or .pdf draws it.
"""


def add_commands(add: AddCommand) -> None:
    """Add `rig model` with its studies, and `rig predict`, to the command line."""
    command = add(
        "predict", run_predict, add_rig_file, add_json, examples=["rig predict rigs/bench.toml --speed 11000"]
    )
    command.add_argument("--speed", dest="speed_rpm", type=speed, metavar="RPM", help="only the settled motion there")
    command.add_argument("--quiet", action="store_true", help="only compute and cache it, for later runs")

    parser = add("model", _run_study)
    parser.epilog, parser.formatter_class = _EPILOG, argparse.RawDescriptionHelpFormatter
    studies = parser.add_subparsers(dest="study", required=True, metavar="STUDY")

    def study(name: str, compute: Compute, text: str, *options: Option) -> None:
        command = studies.add_parser(name, help=text, description=text, allow_abbrev=False)
        add_model_file(command)
        add_json(command)
        command.add_argument("-o", "--output", type=plot_file, metavar="FILE.svg|.png|.pdf", help="draw the plots")
        for option, settings in options:
            command.add_argument(option, **settings)
        command.set_defaults(compute=compute)

    _add_linear(study)
    _add_nonlinear(study)
    _add_static_films(study)
    add_sweep(studies)
    add_thesis(studies)


def _run_study(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """Compute, draw and print a study; return the exit code."""
    study: Study = args.compute(parameters_of(args.config), args)
    if args.output is not None:
        save(study.plots, args.output)
    show_study(study, as_json=args.json)
    return 0


def _add_linear(study: AddStudy) -> None:
    study(
        "modes",
        lambda p, args: modes_study(p, args.stiffness_n_m, args.speed_rad_s, args.count),
        "Natural frequencies and mode shapes, free or on springs.",
        _stiffness("free, or on the rotor's own supports"),
        _speed(0.0, non_negative),
        _whole_number("--count", 10, "number of modes"),
    )
    study(
        "campbell",
        _campbell,
        "Campbell diagram: natural frequencies over speed, and critical speeds.",
        _stiffness(f"none if the supports hold the rotor, otherwise {DEFAULT_STIFFNESS:g}"),
        _speeds("0:8000:81", number_range),
        _whole_number("--count", 10, "number of branches, forward and reverse"),
    )
    study(
        "critical",
        lambda p, args: critical_study(p, args.stiffness_n_m, args.max_speed_rad_s),
        "Critical speed map: undamped critical speeds over the stiffness of the bearings.",
        _option(
            "--stiffness-n-m",
            type=rising_range,
            default="1e3:1e10:71:log",
            metavar="RANGE",
            help="of each bearing (default: %(default)s)",
        ),
        _option(
            "--max-speed-rad-s", type=positive, default=2e5, metavar="SPEED", help="largest speed (default: 200000)"
        ),
    )
    study(
        "response",
        lambda p, args: response_study(p, args.speeds_rad_s, args.stiffness_n_m, args.station),
        "1X over speed: run-up and run-down on the films, or linear on springs.",
        _stiffness("on the films"),
        _speeds("100:4000:79"),
        _STATION,
    )


def _add_nonlinear(study: AddStudy) -> None:
    study(
        "onset",
        lambda p, args: onset_study(p, args.speeds_rad_s),
        "Onset of oil whirl: growth rate of each film's whirl over speed, unstable bands.",
        _speeds("100:4000:79"),
    )
    study(
        "waterfall",
        partial(_run_up_study, waterfall_study),
        "Waterfall: spectra over speed of a run-up in time, settled at each speed.",
        _speeds("100:2500:97"),
        *_motion_options(100),
    )
    study(
        "bifurcation",
        partial(_run_up_study, bifurcation_study),
        "Bifurcation diagram: positions once per turn over speed of a run-up in time.",
        _speeds("100:2500:97"),
        *_motion_options(100),
    )
    study(
        "motion",
        _motion,
        "Motion at one speed: table of all stations, or orbit, spectrum, Poincaré section.",
        _speed(1000.0),
        *_motion_options(300),
        _option(
            "--show",
            choices=[one.value for one in MotionTable],
            default=MotionTable.STATIONS.value,
            help="content of the table (default: stations)",
        ),
    )


def _add_static_films(study: AddStudy) -> None:
    study(
        "lubrication",
        _lubrication,
        "Equilibrium of journal and ring over speed, cavities and oil flow.",
        _speeds("1000:6000:51"),
        _option("--load-n", type=positive, default=10.0, help="on the journal (default: 10)"),
        _option("--inlet-bar", type=positive, default=1.0, help="oil inlet pressure (default: 1)"),
        _option(
            "--bearing",
            choices=("rig", "table-3.1", "thesis-like"),
            default="rig",
            help="that of the rig; Table 3.1; Table 3.1 calibrated to chapter 3 (default: rig)",
        ),
    )
    study(
        "film",
        lambda p, args: film_study(p.floating_ring, args.film, args.speed_rad_s, args.eccentricity, Grid()),
        "Static film by three models (short, finite, long), and its eight coefficients.",
        _option("--film", choices=("inner", "outer"), default="inner", help="(default: inner)"),
        _speed(1000.0),
        _option(
            "--eccentricity", type=number_range, default="0.05:0.9:18", metavar="RANGE", help="(default: %(default)s)"
        ),
    )


def _option(name: str, **settings: Any) -> Option:
    """Return an option with the settings that `add_argument` takes."""
    return name, settings


_STATION = _option(
    "--station", type=positive_integer, metavar="N", help="station evaluated (default: that of the probes)"
)


def _stiffness(default: str) -> Option:
    return _option("--stiffness-n-m", type=positive, help=f"of a spring at each journal (default: {default})")


def _speed(default: float, kind: Callable[[str], float] = positive) -> Option:
    return _option(
        "--speed-rad-s", type=kind, default=default, metavar="SPEED", help="of the shaft (default: %(default)g)"
    )


def _speeds(default: str, kind: Callable[[str], object] = rising_range) -> Option:
    return _option(
        "--speeds-rad-s",
        type=kind,
        default=default,
        metavar="RANGE",
        help=f"FIRST:LAST:COUNT, rad/s (default: {default})",
    )


def _whole_number(name: str, default: int, text: str) -> Option:
    return _option(name, type=positive_integer, default=default, help=f"{text} (default: {default})")


def _motion_options(settle: int) -> tuple[Option, ...]:
    return (
        _STATION,
        _whole_number("--settle", settle, "turns to settle at a speed"),
        _whole_number("--turns", 64, "turns evaluated"),
        _option(
            "--perturbation-um",
            type=non_negative,
            default=DEFAULT_PERTURBATION / MICROMETRE,
            help="perturbation of an unstable motion along each film's whirl (default: %(default)g; 0: none)",
        ),
    )


def _campbell(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    stiffness = campbell_stiffness(parameters) if args.stiffness_n_m is None else args.stiffness_n_m
    return campbell_study(parameters, stiffness, args.speeds_rad_s, args.count)


def _run_up_study(
    plotted: Callable[[RunUp, str], Study], parameters: ModelParameters, args: argparse.Namespace
) -> Study:
    station = parameters.probe_station if args.station is None else args.station
    perturbation = args.perturbation_um * MICROMETRE
    computed = run_up(
        parameters, args.speeds_rad_s, args.settle, _turns(args), station=args.station, perturbation=perturbation
    )
    return plotted(computed, f"station {station}")


def _motion(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    perturbation, table = args.perturbation_um * MICROMETRE, MotionTable(args.show)
    return motion_study(
        parameters, args.speed_rad_s, args.station, args.settle, _turns(args), perturbation=perturbation, table=table
    )


def _turns(args: argparse.Namespace) -> int:
    if args.turns < 8:
        raise UsageError(f"--turns {args.turns}: expected 8 or more, to resolve orders")
    return int(args.turns)


def _lubrication(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    lubrication = {
        "rig": lambda: Lubrication(parameters.floating_ring),
        "table-3.1": nominal_lubrication,
        "thesis-like": thesis_like_lubrication,
    }[args.bearing]()
    return lubrication_study(lubrication, args.load_n, args.inlet_bar * 1e5, args.speeds_rad_s)


def run_predict(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Compute or load the prediction and print it; return the exit code."""
    rig = load_rig(args.config)
    with closing(Predictors()) as predictors:
        predictor = predictors.for_rig(rig)
        predictor.wait(PREDICTION_TIMEOUT, lambda state: console.progress(f"model {state}"))
        console.done()
        computed = predictor.map
        if computed is None:
            raise RigError(f"no prediction: {predictor.state}")
    if args.quiet:
        return 0
    predictions = _over_speed(computed) if args.speed_rpm is None else [_at_speed(rig, computed, args.speed_rpm * RPM)]
    if args.json:
        print_json([predicted_vibration_schema(prediction) for prediction in predictions])
    else:
        headings = ("r/min", "1X x µm∠lag", "1X y µm∠lag", "below 1X µm", "overall µm pp", "growth 1/s")
        print_output(text_table(headings, map(_prediction_row, predictions)))
    return 0


def _over_speed(prediction_map: PredictionMap) -> list[Prediction]:
    lowest, highest = float(prediction_map.speeds[0]), float(prediction_map.speeds[-1])
    first = math.ceil(lowest / _SPEED_STEP - 1e-9) * _SPEED_STEP
    return [prediction_map.at(min(speed, highest)) for speed in np.arange(first, highest * (1 + 1e-9), _SPEED_STEP)]


def _at_speed(rig: Rig, prediction_map: PredictionMap, speed: float) -> Prediction:
    """Return the settled prediction at a speed, rad/s."""
    lowest, highest = float(prediction_map.speeds[0]), float(prediction_map.speeds[-1])
    if not lowest <= speed <= highest:
        raise UsageError(
            f"--speed {speed / RPM:g}: expected {lowest / RPM:,.0f} to {highest / RPM:,.0f} r/min, "
            "up to limits.speed_rpm"
        )
    try:
        *_, settled = refine(model_parameters(rig.config), speed, prediction_map, rig.settings)
    except ModelError as error:
        raise RigError(f"no prediction at {speed / RPM:g} r/min: {error}") from error
    return settled


def _prediction_row(prediction: Prediction) -> tuple[str, ...]:
    """Return a row of the table: peak amplitudes, and overall vibration of x and y."""
    whirl = f"{prediction.whirl_order:.2f}X {prediction.whirl_amplitude / MICROMETRE:6.1f}"
    return (
        f"{prediction.speed / RPM:,.0f}",
        *(f"{abs(v) / MICROMETRE:.2f}∠{phase_lag_degrees(v):.0f}°" for v in prediction.vectors[0]),
        whirl if prediction.whirl_amplitude > 0 else "none",
        " / ".join(f"{value / MICROMETRE:5.1f}" for value in prediction.peak_to_peak),
        f"{prediction.growth_rate:+.1f}",
    )

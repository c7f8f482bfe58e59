"""`rig model`: its subcommands, with the arguments of the studies."""

import argparse
from collections.abc import Callable

import numpy as np

from analysis.signals.units import MICROMETRE
from daq.cli.arguments import AddCommand
from daq.cli.model.arguments import (
    model_errors,
    non_negative,
    number_range,
    parameters_of,
    positive,
    positive_integer,
    rising_range,
)
from daq.cli.model.output import add_output, check_output, show_study
from daq.cli.model.sweep import add_sweep
from daq.cli.model.thesis import add_thesis
from daq.errors import UsageError
from model.films.finite_film import Grid
from model.films.lubrication import Lubrication, nominal_lubrication, thesis_like_lubrication
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

AddParser = Callable[[str, str], argparse.ArgumentParser]
Compute = Callable[[ModelParameters, argparse.Namespace], Study]


_EPILOG = """\
RANGE is FIRST:LAST:COUNT (FIRST:LAST:COUNT:log for equal ratios), or values
separated by commas. RIG.TOML may be a rotor file; the default is the GJ90C of
the thesis. Every study prints a table; --json prints it as JSON, -o FILE.svg,
.png or .pdf draws it.
"""


def add_commands(add_command: AddCommand) -> None:
    """Add `rig model` with its studies to the command line."""
    parser = add_command("model", lambda _: UsageError.exit_code)
    parser.epilog = _EPILOG
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    studies = parser.add_subparsers(dest="study", required=True, metavar="STUDY")

    def add(name: str, text: str) -> argparse.ArgumentParser:
        return studies.add_parser(name, help=text, description=text, allow_abbrev=False)

    add_studies(add)
    add_sweep(add)
    add_thesis(add)


def add_studies(add: AddParser) -> None:
    """Add the subcommands of all studies; ``add`` takes name and description."""

    def study(name: str, compute: Compute, text: str) -> argparse.ArgumentParser:
        command = add(name, text)
        add_output(command)
        command.set_defaults(run=lambda args: _run(compute, args))
        return command

    _add_linear(study)
    _add_nonlinear(study)
    _add_static_films(study)


Add = Callable[[str, Compute, str], argparse.ArgumentParser]


def _run(compute: Compute, args: argparse.Namespace) -> int:
    check_output(args)
    parameters = parameters_of(args.config)
    with model_errors():
        study = compute(parameters, args)
    return show_study(study, args)


def _add_linear(study: Add) -> None:
    command = study("modes", _modes, "Natural frequencies and mode shapes, free or on springs.")
    supports = command.add_mutually_exclusive_group()
    _add_stiffness(supports, "free, or on the rotor's own supports")
    command.add_argument(
        "--speed-rad-s", type=non_negative, default=0.0, metavar="SPEED", help="of the shaft (default: 0)"
    )
    command.add_argument("--count", type=positive_integer, default=10, help="number of modes (default: 10)")

    command = study("campbell", _campbell, "Campbell diagram: natural frequencies over speed, and critical speeds.")
    _add_stiffness(command, f"none if the supports hold the rotor, otherwise {DEFAULT_STIFFNESS:g}")
    _add_speeds(command, "0:8000:81", "rad/s", kind=number_range)
    command.add_argument(
        "--count", type=positive_integer, default=10, help="number of branches, forward and reverse (default: 10)"
    )

    command = study(
        "critical", _critical, "Critical speed map: undamped critical speeds over the stiffness of the bearings."
    )
    command.add_argument(
        "--stiffness-n-m",
        type=rising_range,
        default="1e3:1e10:71:log",
        metavar="RANGE",
        help="of each bearing (default: %(default)s)",
    )
    command.add_argument(
        "--max-speed-rad-s", type=positive, default=2e5, metavar="SPEED", help="largest speed (default: 200000)"
    )

    command = study("response", _response, "1X over speed: run-up and run-down on the films, or linear on springs.")
    _add_stiffness(command, "on the films")
    _add_speeds(command, "100:4000:79", "rad/s")
    _add_station(command)


def _add_nonlinear(study: Add) -> None:
    command = study("onset", _onset, "Onset of oil whirl: growth rate of each film's whirl over speed, unstable bands.")
    _add_speeds(command, "100:4000:79", "rad/s")
    for name, compute, text in (
        ("waterfall", _waterfall, "Waterfall: spectra over speed of a run-up in time, settled at each speed."),
        ("bifurcation", _bifurcation, "Bifurcation diagram: positions once per turn over speed of a run-up in time."),
    ):
        command = study(name, compute, text)
        _add_speeds(command, "100:2500:97", "rad/s")
        _add_motion_arguments(command, 100)

    command = study(
        "motion", _motion, "Motion at one speed: table of all stations, or orbit, spectrum, Poincaré section."
    )
    command.add_argument("--speed-rad-s", type=positive, default=1000.0, metavar="SPEED", help="(default: 1000)")
    _add_motion_arguments(command, 300)
    command.add_argument(
        "--show",
        choices=[one.value for one in MotionTable],
        default=MotionTable.STATIONS.value,
        help="content of the table (default: stations)",
    )


def _add_motion_arguments(command: argparse.ArgumentParser, settle: int) -> None:
    _add_station(command)
    command.add_argument(
        "--settle", type=positive_integer, default=settle, help=f"turns to settle at a speed (default: {settle})"
    )
    command.add_argument("--turns", type=positive_integer, default=64, help="turns evaluated (default: 64)")
    command.add_argument(
        "--perturbation-um",
        type=non_negative,
        default=DEFAULT_PERTURBATION / MICROMETRE,
        help="perturbation of an unstable motion along each film's whirl (default: %(default)g; 0: none)",
    )


def _add_station(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--station", type=positive_integer, metavar="N", help="station evaluated (default: that of the probes)"
    )


def _add_static_films(study: Add) -> None:
    command = study("lubrication", _lubrication, "Equilibrium of journal and ring over speed, cavities and oil flow.")
    _add_speeds(command, "1000:6000:51", "rad/s")
    command.add_argument("--load-n", type=positive, default=10.0, help="on the journal (default: 10)")
    command.add_argument("--inlet-bar", type=positive, default=1.0, help="oil inlet pressure (default: 1)")
    command.add_argument(
        "--bearing",
        choices=("rig", "table-3.1", "thesis-like"),
        default="rig",
        help="that of the rig; Table 3.1; Table 3.1 calibrated to chapter 3 (default: rig)",
    )

    command = study("film", _film, "Static film by three models (short, finite, long), and its eight coefficients.")
    command.add_argument("--film", choices=("inner", "outer"), default="inner", help="(default: inner)")
    command.add_argument("--speed-rad-s", type=positive, default=1000.0, metavar="SPEED", help="(default: 1000)")
    command.add_argument(
        "--eccentricity", type=number_range, default="0.05:0.9:18", metavar="RANGE", help="(default: %(default)s)"
    )


def _add_stiffness(command: "argparse._ActionsContainer", default: str) -> None:
    command.add_argument("--stiffness-n-m", type=positive, help=f"of a spring at each journal (default: {default})")


def _add_speeds(
    command: argparse.ArgumentParser, default: str, unit: str, kind: Callable[[str], object] = rising_range
) -> None:
    command.add_argument(
        "--speeds-rad-s",
        type=kind,
        default=default,
        metavar="RANGE",
        help=f"FIRST:LAST:COUNT, {unit} (default: {default})",
    )


def _modes(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    return modes_study(parameters, args.stiffness_n_m, args.speed_rad_s, args.count)


def _campbell(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    stiffness = campbell_stiffness(parameters) if args.stiffness_n_m is None else args.stiffness_n_m
    return campbell_study(parameters, stiffness, args.speeds_rad_s, args.count)


def _critical(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    return critical_study(parameters, args.stiffness_n_m, args.max_speed_rad_s)


def _response(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    return response_study(parameters, args.speeds_rad_s, args.stiffness_n_m, args.station)


def _onset(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    return onset_study(parameters, args.speeds_rad_s)


def _waterfall(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    return waterfall_study(_run_up(parameters, args), f"station {_station(parameters, args)}")


def _bifurcation(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    return bifurcation_study(_run_up(parameters, args), f"station {_station(parameters, args)}")


def _run_up(parameters: ModelParameters, args: argparse.Namespace) -> RunUp:
    perturbation, station = args.perturbation_um * MICROMETRE, args.station
    return run_up(parameters, args.speeds_rad_s, args.settle, _turns(args), station=station, perturbation=perturbation)


def _station(parameters: ModelParameters, args: argparse.Namespace) -> int:
    return parameters.probe_station if args.station is None else int(args.station)


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


def _film(parameters: ModelParameters, args: argparse.Namespace) -> Study:
    ratios = np.asarray(args.eccentricity)
    return film_study(parameters.floating_ring, args.film, args.speed_rad_s, ratios, Grid())

"""The studies: `rig model modes`, `campbell`, `critical`, `response`, `onset`, `motion` and films."""

import argparse
from collections.abc import Callable

import numpy as np

from daq.cli.model.arguments import counting, model_errors, not_negative, parameters_of, positive, rising, values
from daq.cli.model.output import add_output, check_output, show
from daq.errors import UsageError
from model.films.grid import Grid
from model.films.lubrication import Lubrication, nominal, thesis_like
from model.rotor.parameters import ModelParameters
from model.studies.films import film_study, lubrication_study
from model.studies.linear import SOFT, campbell_stiffness, campbell_study, critical_study, modes_study
from model.studies.motion import Shown, motion_study
from model.studies.onset import onset_study
from model.studies.run_up import RunUp, bifurcation_study, run_up, waterfall_study
from model.studies.stepped_motion import SEED
from model.studies.study import Study
from model.studies.synchronous import response_study

AddKind = Callable[[str, str], argparse.ArgumentParser]
Compute = Callable[[ModelParameters, argparse.Namespace], Study]


def add_studies(add: AddKind) -> None:
    """Add the studies with `add`, which takes name and description."""

    def study(name: str, compute: Compute, text: str) -> argparse.ArgumentParser:
        command = add(name, text)
        add_output(command)
        command.set_defaults(run=lambda chosen: _run(compute, chosen))
        return command

    _add_linear(study)
    _add_films_in_motion(study)
    _add_films_at_rest(study)


Add = Callable[[str, Compute, str], argparse.ArgumentParser]


def _run(compute: Compute, chosen: argparse.Namespace) -> int:
    check_output(chosen)
    parameters = parameters_of(chosen.config)
    with model_errors():
        study = compute(parameters, chosen)
    return show(study, chosen)


def _add_linear(study: Add) -> None:
    command = study("modes", _modes, "Natural frequencies and mode shapes, free or on springs.")
    held = command.add_mutually_exclusive_group()
    _add_stiffness(held, "free, or on the rotor's own supports")
    command.add_argument("--speed", type=not_negative, default=0.0, metavar="RAD_S", help="of the shaft (default: 0)")
    command.add_argument("--count", type=counting, default=10, help="how many modes (default: 10)")

    command = study("campbell", _campbell, "Natural frequencies over speed, each mode followed, and critical speeds.")
    _add_stiffness(command, f"none, on supports that hold the rotor, else {SOFT:g}")
    _add_speeds(command, "0:8000:81", "rad/s", kind=values)
    command.add_argument("--count", type=counting, default=10, help="how many branches, both senses (default: 10)")

    command = study("critical", _critical, "Undamped critical speeds over the stiffness of the bearings.")
    command.add_argument(
        "--stiffness-n-m",
        type=rising,
        default="1e3:1e10:71:log",
        metavar="RANGE",
        help="of each bearing (default: %(default)s)",
    )
    command.add_argument("--highest", type=positive, default=2e5, metavar="RAD_S", help="(default: 200000)")

    command = study("response", _response, "1X over speed, run-up and run-down on the films, or linear on springs.")
    _add_stiffness(command, "on the films")
    _add_speeds(command, "100:4000:79", "rad/s")
    _add_station(command)


def _add_films_in_motion(study: Add) -> None:
    command = study("onset", _onset, "Where the films let go: growth of the least stable whirl, ends by bisection.")
    _add_speeds(command, "100:4000:79", "rad/s")
    for name, compute, text in (
        ("waterfall", _waterfall, "Spectra over speed, of a run-up in time with settling at each speed."),
        ("bifurcation", _bifurcation, "Positions once a turn over speed, of a run-up in time."),
    ):
        command = study(name, compute, text)
        _add_speeds(command, "100:2500:97", "rad/s")
        _add_looking(command, 100)

    command = study(
        "motion", _motion, "The motion at one speed: all stations; orbit, spectrum, Poincaré's points at one."
    )
    command.add_argument("--speed", type=positive, default=1000.0, metavar="RAD_S", help="of the shaft (default: 1000)")
    _add_looking(command, 300)
    command.add_argument(
        "--show",
        choices=[one.value for one in Shown],
        default=Shown.STATIONS.value,
        help="what the table lists (default: stations)",
    )


def _add_looking(command: argparse.ArgumentParser, settle: int) -> None:
    _add_station(command)
    command.add_argument("--settle", type=counting, default=settle, help=f"turns at a speed first (default: {settle})")
    command.add_argument("--turns", type=counting, default=64, help="turns looked at (default: 64)")
    command.add_argument(
        "--seed-um",
        type=not_negative,
        default=SEED * 1e6,
        help="how far an unstable motion is moved along each film's whirl (default: %(default)g; 0: not at all)",
    )


def _add_station(command: argparse.ArgumentParser) -> None:
    command.add_argument("--station", type=counting, metavar="N", help="that is looked at (default: the probes')")


def _add_films_at_rest(study: Add) -> None:
    command = study("lubrication", _lubrication, "Journal and ring at rest over speed, their cavities and oil flow.")
    _add_speeds(command, "1000:6000:51", "rad/s")
    command.add_argument("--load-n", type=positive, default=10.0, help="on the journal (default: 10)")
    command.add_argument("--inlet-bar", type=positive, default=1.0, help="pressure of the oil (default: 1)")
    command.add_argument(
        "--bearing",
        choices=("rig", "table-3.1", "thesis-like"),
        default="rig",
        help="the rig's; Table 3.1; the latter calibrated to the numbers of chapter 3 (default: rig)",
    )

    command = study("film", _film, "One film at rest by three models: short, of its length, long; 8 coefficients.")
    command.add_argument("--which", choices=("inner", "outer"), default="inner", help="(default: inner)")
    command.add_argument("--speed", type=positive, default=1000.0, metavar="RAD_S", help="of the shaft (default: 1000)")
    command.add_argument(
        "--eccentricity", type=values, default="0.05:0.9:18", metavar="RANGE", help="(default: %(default)s)"
    )


def _add_stiffness(command: "argparse._ActionsContainer", otherwise: str) -> None:
    command.add_argument("--stiffness-n-m", type=positive, help=f"of a spring at each journal (default: {otherwise})")


def _add_speeds(
    command: argparse.ArgumentParser, default: str, unit: str, kind: Callable[[str], object] = rising
) -> None:
    command.add_argument(
        "--speeds", type=kind, default=default, metavar="RANGE", help=f"FIRST:LAST:COUNT, {unit} (default: {default})"
    )


def _modes(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    return modes_study(parameters, chosen.stiffness_n_m, chosen.speed, chosen.count)


def _campbell(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    stiffness = campbell_stiffness(parameters) if chosen.stiffness_n_m is None else chosen.stiffness_n_m
    return campbell_study(parameters, stiffness, chosen.speeds, chosen.count)


def _critical(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    return critical_study(parameters, chosen.stiffness_n_m, chosen.highest)


def _response(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    return response_study(parameters, chosen.speeds, chosen.stiffness_n_m, chosen.station)


def _onset(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    return onset_study(parameters, chosen.speeds)


def _waterfall(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    return waterfall_study(_run_up(parameters, chosen), f"station {_station(parameters, chosen)}")


def _bifurcation(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    return bifurcation_study(_run_up(parameters, chosen), f"station {_station(parameters, chosen)}")


def _run_up(parameters: ModelParameters, chosen: argparse.Namespace) -> RunUp:
    seed, station = chosen.seed_um * 1e-6, chosen.station
    return run_up(parameters, chosen.speeds, chosen.settle, _turns(chosen), station=station, seed=seed)


def _station(parameters: ModelParameters, chosen: argparse.Namespace) -> int:
    return parameters.probe_station if chosen.station is None else int(chosen.station)


def _motion(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    seed, shown = chosen.seed_um * 1e-6, Shown(chosen.show)
    return motion_study(parameters, chosen.speed, chosen.station, chosen.settle, _turns(chosen), seed=seed, shown=shown)


def _turns(chosen: argparse.Namespace) -> int:
    if chosen.turns < 8:
        raise UsageError(f"--turns {chosen.turns}: expected 8 or more, else orders cannot be told apart")
    return int(chosen.turns)


def _lubrication(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    lubrication = {
        "rig": lambda: Lubrication(parameters.floating_ring),
        "table-3.1": nominal,
        "thesis-like": thesis_like,
    }[chosen.bearing]()
    return lubrication_study(lubrication, chosen.load_n, chosen.inlet_bar * 1e5, chosen.speeds)


def _film(parameters: ModelParameters, chosen: argparse.Namespace) -> Study:
    ratios = np.asarray(chosen.eccentricity)
    return film_study(parameters.floating_ring, chosen.which, chosen.speed, ratios, Grid())

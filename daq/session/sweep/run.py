"""Running a sweep: the points that are not known yet, in portions, each kept as soon as it is done."""

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from daq.session.sweep.store import SweepStore
from daq.session.sweep.workers import Workers
from model.rotor.parameters import ModelParameters
from model.studies.sweep_quantities import QUANTITIES, SweepPoint, SweepResult, compute_points, variable_names

KEEP_INTERVAL = 2.0  # s between two parts
PORTIONS = 200  # into which a sweep is cut, so that progress and resuming are fine enough
LARGEST_PORTION = 50  # points


def grid(
    parameters: ModelParameters, quantity: str, vary: Mapping[str, Sequence[float]], most: int = 10_000_000
) -> list[SweepPoint]:
    """Return the points of all combinations, the last name varying fastest.

    Parameters
    ----------
    parameters : ModelParameters
        What stays.
    quantity : str
        Of `QUANTITIES`.
    vary : mapping of str to sequence of float
        Values of each name.
    most : int
        Points that are accepted.

    Raises
    ------
    ValueError
        Where a name or the quantity is unknown, the rotor has no films for it, or the points are too many.
    """
    names = variable_names(quantity, parameters)
    for name in vary:
        if name not in names:
            raise ValueError(f"vary {name}: unknown, expected one of {', '.join(names)}")
    count = 1
    for values in vary.values():
        count *= len(values)
    if count > most:
        raise ValueError(f"sweep: {count:,} points, expected at most {most:,}")
    combinations = itertools.product(*([(name, float(value)) for value in values] for name, values in vary.items()))
    return [SweepPoint(parameters, quantity, combination) for combination in combinations]


def run_sweep(
    points: Sequence[SweepPoint], workers: Workers, file: Path, on_progress: Callable[[int, int], None]
) -> list[SweepResult]:
    """Compute what is not known of a sweep, and write all of it.

    Parameters
    ----------
    points : sequence of SweepPoint
        Of one quantity, one or more, with the same names varied.
    workers : Workers
        Who computes them.
    file : Path
        ``.parquet``; what it, or a stopped sweep beside it, already holds of these points is not computed again.
    on_progress : callable
        Told the number of points done and of all.

    Returns
    -------
    list of SweepResult
        In the order of the points.
    """
    store = SweepStore(file, QUANTITIES[points[0].quantity].results)
    keys = [point.key() for point in points]
    found = store.known(keys)
    missing = list({key: point for key, point in zip(keys, points, strict=True) if key not in found}.values())
    size = max(1, min(LARGEST_PORTION, len(missing) // PORTIONS))
    portions = [tuple(missing[first : first + size]) for first in range(0, len(missing), size)]
    fresh: list[SweepResult] = []
    kept_at = time.monotonic()
    on_progress(len(found), len(points))
    try:
        for _, outcomes in workers.run(compute_points, portions):
            fresh += outcomes
            found |= {outcome.key: outcome for outcome in outcomes}
            on_progress(len(found), len(points))
            if time.monotonic() - kept_at >= KEEP_INTERVAL:
                store.keep(fresh)
                fresh, kept_at = [], time.monotonic()
    finally:
        store.keep(fresh)
    ordered = [found[key] for key in keys]
    names = [name for name, _ in points[0].values]
    values = {name: [dict(point.values)[name] for point in points] for name in names}
    store.finish(values, ordered)
    return ordered

"""Parameter sweeps: the grid of points, and their computation in chunks with resumable storage."""

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from daq.errors import UsageError
from daq.session.sweep.store import SweepStore
from daq.session.sweep.workers import Workers
from model.rotor.parameters import ModelParameters
from model.studies.sweep_quantities import QUANTITIES, SweepPoint, SweepResult, compute_points, variable_names

SAVE_INTERVAL = 2.0  # s between two parts on disk
MIN_CHUNKS = 200  # of a sweep, for fine-grained progress and resuming
MAX_CHUNK_SIZE = 50  # points


def grid(
    parameters: ModelParameters, quantity: str, vary: Mapping[str, Sequence[float]], max_points: int = 10_000_000
) -> list[SweepPoint]:
    """Return the points of all combinations of parameter values, the last name varying fastest.

    Parameters
    ----------
    parameters : ModelParameters
        The fixed parameters.
    quantity : str
        A key of `QUANTITIES`.
    vary : mapping of str to sequence of float
        Values of each varied parameter, by name.
    max_points : int
        Maximum number of points.

    Raises
    ------
    ParameterError
        The quantity is unknown, or the rotor lacks the films for it.
    UsageError
        A name is unknown, or there are too many points.
    """
    names = variable_names(quantity, parameters)
    for name in vary:
        if name not in names:
            raise UsageError(f"vary {name}: unknown, expected one of {', '.join(names)}")
    count = 1
    for values in vary.values():
        count *= len(values)
    if count > max_points:
        raise UsageError(f"sweep: {count:,} points, expected at most {max_points:,}")
    combinations = itertools.product(*([(name, float(value)) for value in values] for name, values in vary.items()))
    return [SweepPoint(parameters, quantity, combination) for combination in combinations]


def run_sweep(
    points: Sequence[SweepPoint], workers: Workers, file: Path, on_progress: Callable[[int, int], None]
) -> list[SweepResult]:
    """Compute the points of a sweep that are not stored yet, and write all results.

    Parameters
    ----------
    points : sequence of SweepPoint
        At least one; all of one quantity, with the same names varied.
    workers : Workers
        Local processes or a cluster.
    file : Path
        ``.parquet``; results in it, or in parts of a stopped sweep next to it, are not computed again.
    on_progress : callable
        Receives the number of points done and the total.

    Returns
    -------
    list of SweepResult
        In the order of the points.
    """
    store = SweepStore(file, QUANTITIES[points[0].quantity].results)
    keys = [point.key() for point in points]
    found = store.load(keys)
    missing = list({key: point for key, point in zip(keys, points, strict=True) if key not in found}.values())
    size = max(1, min(MAX_CHUNK_SIZE, len(missing) // MIN_CHUNKS))
    chunks = [tuple(missing[first : first + size]) for first in range(0, len(missing), size)]
    fresh: list[SweepResult] = []
    saved_at = time.monotonic()
    on_progress(len(found), len(points))
    try:
        for _, outcomes in workers.run(compute_points, chunks):
            fresh += outcomes
            found |= {outcome.key: outcome for outcome in outcomes}
            on_progress(len(found), len(points))
            if time.monotonic() - saved_at >= SAVE_INTERVAL:
                store.save_part(fresh)
                fresh, saved_at = [], time.monotonic()
    finally:
        store.save_part(fresh)
    ordered = [found[key] for key in keys]
    names = [name for name, _ in points[0].values]
    values = {name: [dict(point.values)[name] for point in points] for name in names}
    store.finish(values, ordered)
    return ordered

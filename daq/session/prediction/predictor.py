"""Predictions for a run: from a cached map, a map computed in a child process, or computed at the exact speed."""

import multiprocessing
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import AnalysisSettings, Limits, RunHeader
from daq.config.loader import read_recorded_config
from daq.config.rig import Rig, model_parameters
from daq.session.prediction.map_cache import cache_folder, load_or_compute_map, map_file, read_map
from daq.session.prediction.refiner import Refiner
from daq.session.processes import JOIN_TIMEOUT, end_process, leave_signals_to_parent, lower_priority, start_process
from model.errors import ModelError
from model.prediction.prediction_map import (
    Prediction,
    PredictionMap,
    compute_prediction_map,
    default_map_speeds,
    prediction_map_key,
)
from model.rotor.parameters import ModelParameters

FloatArray = NDArray[np.float64]

PREDICTION_TIMEOUT = 120.0  # s without progress after which a computation is given up
WAIT_INTERVAL = 0.2  # s of one wait, short so that Ctrl-C works on all platforms


@dataclass(frozen=True, slots=True)
class _Progress:
    done: int
    total: int


@dataclass(frozen=True, slots=True)
class _Failure:
    reason: str


_Report = _Progress | _Failure | dict[str, NDArray[np.generic]]


class Predictor:
    """The model's predictions over speed for one rotor, available as soon as they are computed.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    settings : AnalysisSettings
        Settings of the measurement.
    speeds : ndarray of float64, shape (n,)
        Speeds of the map, increasing, rad/s.
    folder : Path, optional
        Folder of the cached maps; default `$RIG_CACHE`, else the user's cache.

    Notes
    -----
    A child process at low priority computes a map that is not in the cache, and writes it there. A damaged file is
    replaced. When the speed stays constant, a `Refiner` computes the prediction at exactly that speed. Close the
    predictor, or use it in a with-statement.
    """

    def __init__(
        self,
        parameters: ModelParameters,
        settings: AnalysisSettings,
        speeds: FloatArray,
        folder: Path | None = None,
    ) -> None:
        folder = cache_folder() if folder is None else folder
        self._parameters, self._settings = parameters, settings
        self._refiner: Refiner | None = None
        self._starting = threading.Lock()  # so that only one refiner is started
        self._file = map_file(folder, prediction_map_key(parameters, speeds, settings))
        self._percent = 0
        self._failure = ""
        self._is_closed = False
        self._changed = threading.Condition()
        self._process: BaseProcess | None = None
        self._map, self._cache_error = read_map(self._file)
        self._finished = self._map is not None
        if not self._finished:
            context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
            reports, theirs = context.Pipe(duplex=False)
            self._process = context.Process(
                target=_compute, args=(theirs, parameters, speeds, settings, self._file), name="prediction", daemon=True
            )
            start_process(self._process)
            theirs.close()
            self._thread = threading.Thread(target=self._listen, args=(reports,), name="prediction", daemon=True)
            self._thread.start()

    @property
    def state(self) -> str:
        """State for display: "ready", "ready, not exact: <reason>", "off: <reason>" or "computing 34 %"."""
        if self._map is not None:
            reason = self._refiner.failure if self._refiner is not None else ""
            return f"ready, not exact: {reason}" if reason else "ready"
        return f"off: {self._failure}" if self._failure else f"computing {self._percent} %"

    @property
    def cache_error(self) -> str:
        """Error message of a damaged cache file; empty for none."""
        return self._cache_error

    @property
    def map(self) -> PredictionMap | None:
        """The whole map; None until it is ready."""
        return self._map

    def at(self, speed: float) -> Prediction | None:
        """Return the prediction at a speed, rad/s, without waiting: exact where available, else from the map.

        None where the map is not ready or ends before the speed.
        """
        prediction_map = self.map
        if prediction_map is None or not prediction_map.speeds[0] <= speed <= prediction_map.speeds[-1]:
            return None
        with self._starting:
            if self._refiner is None and not self._is_closed:
                self._refiner = Refiner(self._parameters, self._settings, prediction_map)
        exact = None if self._refiner is None else self._refiner.at(speed)
        return prediction_map.at(speed) if exact is None else exact

    def wait(self, timeout: float, on_progress: Callable[[str], None] | None = None) -> PredictionMap | None:
        """Wait for the map.

        Parameters
        ----------
        timeout : float
            Maximum time without a change of state, s.
        on_progress : callable, optional
            Receives the error message of a damaged cache file first, then the state whenever it changes.

        Returns
        -------
        PredictionMap or None
            None where there is none, or the timeout has passed.
        """
        reported, since = "", time.monotonic()
        if on_progress is not None and self._cache_error:
            on_progress(self._cache_error)
        while True:
            state = self.state
            if state != reported:
                reported, since = state, time.monotonic()
                if on_progress is not None:
                    on_progress(state)
            with self._changed:
                if self.state != reported:
                    continue
                if self._finished or time.monotonic() - since >= timeout:
                    return self._map
                self._changed.wait(min(WAIT_INTERVAL, timeout))

    def close(self) -> None:
        """End the computations and join their processes."""
        with self._starting:
            self._is_closed = True
        if self._refiner is not None:
            self._refiner.close()
        process, self._process = self._process, None
        if process is None:
            return
        if not self._finished:
            self._finish(failure="stopped")
        end_process(process)
        self._thread.join(JOIN_TIMEOUT)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _listen(self, reports: Connection) -> None:
        """Receive the reports of the process; runs in a thread, since a report may stop arriving half-way."""
        with reports:
            while not self._finished:
                try:
                    report: _Report = reports.recv()
                except (EOFError, OSError):
                    report = _Failure("the computation ended without a result")
                if isinstance(report, _Progress):
                    with self._changed:
                        self._percent = 100 * report.done // report.total
                        self._changed.notify_all()
                elif isinstance(report, _Failure):
                    self._finish(failure=report.reason)
                else:
                    self._finish(PredictionMap.from_arrays(report))

    def _finish(self, found: PredictionMap | None = None, failure: str = "") -> None:
        """Store the result of the computation; only the first call counts."""
        with self._changed:
            if not self._finished:
                self._map, self._failure, self._finished = found, failure, True
                self._changed.notify_all()


class Predictors:
    """Predictors by rotor parameters, each created on first use and closed with the others."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._by_key: dict[str, Predictor] = {}

    def for_rig(self, rig: Rig) -> Predictor:
        """Return the predictor for a rig."""
        return self._predictor(model_parameters(rig.config), rig.settings, rig.limits)

    def for_run(self, header: RunHeader) -> Predictor:
        """Return the predictor for the rig of a run, with the configuration recorded in it."""
        config = read_recorded_config(header.config_toml, f"configuration of run {header.run}")
        return self._predictor(model_parameters(config), header.settings, header.limits)

    def prediction_for(self, header: RunHeader, speed: float) -> Prediction | None:
        """Return the prediction from the map of a run's rig at a speed, rad/s; None while the map is not ready.

        Raises
        ------
        ParameterError
            The speed is outside the map.
        """
        prediction_map = self.for_run(header).map
        return None if prediction_map is None else prediction_map.at(speed)

    def _predictor(self, parameters: ModelParameters, settings: AnalysisSettings, limits: Limits) -> Predictor:
        speeds = default_map_speeds(limits.speed)
        key = prediction_map_key(parameters, speeds, settings)
        with self._lock:
            if key not in self._by_key:
                self._by_key[key] = Predictor(parameters, settings, speeds)
            return self._by_key[key]

    def close(self) -> None:
        """Close all predictors."""
        with self._lock:
            for predictor in self._by_key.values():
                predictor.close()
            self._by_key.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()


def _compute(
    reports: Connection, parameters: ModelParameters, speeds: FloatArray, settings: AnalysisSettings, file: Path
) -> None:
    """Load or compute a map and send it; entry point of the child process."""
    leave_signals_to_parent()
    lower_priority()
    with suppress(BrokenPipeError):  # the parent has closed the pipe
        try:
            prediction_map = load_or_compute_map(
                file,
                partial(compute_prediction_map, parameters, speeds, settings),
                lambda done, total: reports.send(_Progress(done, total)),
            )
        except ModelError as error:
            reports.send(_Failure(str(error)))
            return
        reports.send(prediction_map.to_arrays())

"""Predictions for a run: from a cached map, computed in a child process, or computed at exactly the steady speed."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from analysis.signals import FloatArray
from analysis.signals.header import AnalysisSettings, Limits, RunHeader
from daq.config.loader import read_recorded_config
from daq.config.rig import Rig, model_parameters
from daq.session.prediction_maps import load_or_compute, map_file, read_map
from daq.session.processes import JOIN_TIMEOUT, WorkerProcess, WorkerStoppedError, WorkerTimeoutError
from model.errors import ModelError
from model.prediction.prediction_map import (
    Prediction,
    PredictionMap,
    default_map_speeds,
    prediction_map_key,
    refine,
)
from model.rotor.parameters import ModelParameters

logger = logging.getLogger(__name__)

PREDICTION_TIMEOUT = 120.0  # s without progress after which a computation is given up
WAIT_INTERVAL = 0.2  # s of one wait, short so that Ctrl-C works on all platforms
STEADY_TOLERANCE = 2e-3  # relative change of a steady speed between calls; cold air is steady to 0.2 % RMS
RECOMPUTE_TOLERANCE = 1e-3  # relative distance of the last prediction's speed above which another is computed
DISPLAY_TOLERANCE = 5e-3  # relative distance up to which the last prediction is returned
MAP_NICENESS, REFINER_NICENESS = 5, 10  # below the acquisition and the live view
ANSWER_TIMEOUT = 120.0  # s for one result, which includes compilation on a new machine


class Refiner:
    """Computes predictions at the latest steady speed, one after the other, without blocking the caller.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    settings : AnalysisSettings
        Settings of the measurement.
    prediction_map : PredictionMap
        The map whose motions are the initial states.
    answer_timeout : float
        Time for one result, s, after which the process is given up.

    Attributes
    ----------
    failure : str
        Why there is no prediction at the exact speed; empty where there is one, or may be.

    Notes
    -----
    The process starts at the first steady speed. Each request returns one intermediate prediction, so that a new speed
    waits for one integration step at most. Close the refiner.
    """

    def __init__(
        self,
        parameters: ModelParameters,
        settings: AnalysisSettings,
        prediction_map: PredictionMap,
        answer_timeout: float = ANSWER_TIMEOUT,
    ) -> None:
        self._model = (parameters, settings, prediction_map)
        self._answer_timeout = answer_timeout
        self._changed = threading.Condition()
        self._last_speed = 0.0  # rad/s, of the last call of `at`
        self._requested: float | None = None  # rad/s, whose prediction is to be computed or refined
        self._failed_speed = 0.0  # rad/s, where the model has no solution
        self._exact: Prediction | None = None
        self.failure = ""
        self._is_closing = False
        self._worker = WorkerProcess(REFINER_NICENESS)
        self._thread = threading.Thread(target=self._work, name="refiner", daemon=True)
        self._thread.start()

    def at(self, speed: float) -> Prediction | None:
        """Return the prediction at a speed, rad/s, or very near to it, without waiting; None where there is none.

        Two consecutive calls with the same speed, within ``STEADY_TOLERANCE``, request its computation.
        """
        with self._changed:
            is_steady, self._last_speed = _is_within(STEADY_TOLERANCE, speed, self._last_speed), speed
            exact = self._exact
            handled = (self._failed_speed, self._requested or 0.0, 0.0 if exact is None else exact.speed)
            if is_steady and not any(_is_within(RECOMPUTE_TOLERANCE, speed, other) for other in handled):
                self._requested = speed
                self._changed.notify()
            return exact if exact is not None and _is_within(DISPLAY_TOLERANCE, speed, exact.speed) else None

    def close(self) -> None:
        """End the computation and join thread and process."""
        with self._changed:
            self._is_closing = True
            self._changed.notify()
        self._worker.close()
        self._thread.join(2 * JOIN_TIMEOUT)

    def _work(self) -> None:
        """Request predictions, one after the other; body of the thread."""
        while (speed := self._wait_for_request()) is not None:
            try:
                prediction = self._worker.run(_next_prediction, speed, *self._model, time_limit=self._answer_timeout)
            except WorkerTimeoutError:
                self.failure = f"the process that computes it has not answered for {self._answer_timeout:g} s"
                return
            except WorkerStoppedError as error:
                self.failure = f"the process that computes it ended ({error})"
                return
            except ModelError as error:
                self._store(speed, None, str(error))
            except Exception as error:
                self.failure = f"the process that computes it failed ({type(error).__name__})"
                logger.exception("the computation of a prediction failed")
                return
            else:
                self._store(speed, prediction)

    def _wait_for_request(self) -> float | None:
        with self._changed:
            self._changed.wait_for(lambda: self._is_closing or self._requested is not None)
            return None if self._is_closing else self._requested

    def _store(self, speed: float, prediction: Prediction | None, failure: str = "") -> None:
        """Store the next prediction at a speed; None where the last one has converged, or the model has failed."""
        with self._changed:
            if prediction is not None:
                self._exact, self.failure = prediction, ""
                return
            if failure:
                self._failed_speed, self.failure = speed, failure
            if self._requested == speed:
                self._requested = None


def _is_within(tolerance: float, speed: float, other: float) -> bool:
    return abs(speed - other) <= tolerance * speed


_refinements: dict[float, Iterator[Prediction]] = {}
"""Intermediate predictions at the last requested speed, in the worker process."""


def _next_prediction(
    speed: float, parameters: ModelParameters, settings: AnalysisSettings, prediction_map: PredictionMap
) -> Prediction | None:
    """Return the next intermediate prediction at a speed, rad/s; None where the last one has converged."""
    if speed not in _refinements:
        _refinements.clear()
        _refinements[speed] = refine(parameters, speed, prediction_map, settings)
    return next(_refinements[speed], None)


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
    in_worker : bool
        Whether this process is a worker, which cannot start processes: it computes the map in a thread.

    Attributes
    ----------
    map : PredictionMap or None
        The whole map; None until it is ready.
    cache_error : str
        Error message of a damaged cache file; empty for none.

    Notes
    -----
    A child process at low priority computes a map that is not in the cache, and writes it there. A damaged file is
    replaced. When the speed stays constant, a `Refiner` computes the prediction at exactly that speed. Close the
    predictor.
    """

    def __init__(
        self,
        parameters: ModelParameters,
        settings: AnalysisSettings,
        speeds: FloatArray,
        folder: Path | None = None,
        *,
        in_worker: bool = False,
    ) -> None:
        self._parameters, self._settings = parameters, settings
        self._refiner: Refiner | None = None
        self._starting = threading.Lock()  # so that only one refiner is started
        self._file = map_file(parameters, speeds, settings, folder)
        self._percent = 0
        self._failure = ""
        self._is_closed = False
        self._changed = threading.Condition()
        self._in_worker = in_worker
        self._worker = WorkerProcess(MAP_NICENESS)
        self.map, self.cache_error = read_map(self._file)
        self._thread = threading.Thread(target=self._compute, args=(speeds,), name="prediction", daemon=True)
        if self.map is None:
            self._thread.start()

    @property
    def state(self) -> str:
        """State for display: "ready", "ready, not exact: <reason>", "off: <reason>" or "computing 34 %"."""
        if self.map is not None:
            reason = self._refiner.failure if self._refiner is not None else ""
            return f"ready, not exact: {reason}" if reason else "ready"
        return f"off: {self._failure}" if self._failure else f"computing {self._percent} %"

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

    def wait(self, timeout: float, on_progress: Callable[[str], None] = lambda _state: None) -> PredictionMap | None:
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
        if self.cache_error:
            on_progress(self.cache_error)
        while True:
            state = self.state
            if state != reported:
                reported, since = state, time.monotonic()
                on_progress(state)
            with self._changed:
                if self.state != reported:
                    continue
                if self.map is not None or self._failure or time.monotonic() - since >= timeout:
                    return self.map
                self._changed.wait(min(WAIT_INTERVAL, timeout))

    def close(self) -> None:
        """End the computations and join their processes."""
        with self._starting:
            self._is_closed = True
        if self._refiner is not None:
            self._refiner.close()
        self._finish(failure="stopped")
        self._worker.close()
        if self._thread.ident is not None:
            self._thread.join(JOIN_TIMEOUT)

    def _compute(self, speeds: FloatArray) -> None:
        """Compute the map; body of the thread."""
        arguments = (self._file, self._parameters, speeds, self._settings)
        try:
            if self._in_worker:
                self._finish(load_or_compute(self._set_progress, *arguments))
            else:
                self._finish(self._worker.run(load_or_compute, *arguments, on_progress=self._set_progress))
        except ModelError as error:
            self._finish(failure=str(error))
        except WorkerStoppedError:
            self._finish(failure="the computation ended without a result")
        except Exception:
            self._finish(failure="the computation ended without a result")
            logger.exception("the computation of the prediction map failed")
        self._worker.close()

    def _set_progress(self, done: int, total: int) -> None:
        with self._changed:
            self._percent = 100 * done // total
            self._changed.notify_all()

    def _finish(self, prediction_map: PredictionMap | None = None, failure: str = "") -> None:
        """Store the result of the computation; only the first call counts."""
        with self._changed:
            if self.map is None and not self._failure:
                self.map, self._failure = prediction_map, failure
                self._changed.notify_all()


class Predictors:
    """Predictors by rotor parameters, each created on first use and closed with the others.

    Parameters
    ----------
    in_worker : bool
        Whether this process is a worker, see `Predictor`.
    """

    def __init__(self, *, in_worker: bool = False) -> None:
        self._in_worker = in_worker
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
                self._by_key[key] = Predictor(parameters, settings, speeds, in_worker=self._in_worker)
            return self._by_key[key]

    def close(self) -> None:
        """Close all predictors."""
        with self._lock:
            for predictor in self._by_key.values():
                predictor.close()
            self._by_key.clear()

"""Prediction at exactly the speed at which the shaft turns steadily, computed by a child process at low priority."""

import multiprocessing
import threading
from collections.abc import Iterator
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from analysis.signals.header import AnalysisSettings
from daq.session.processes import JOIN_TIMEOUT, end_process, leave_signals_to_parent, lower_priority, start_process
from model.errors import ModelError
from model.prediction.prediction_map import Prediction, PredictionMap, refine
from model.rotor.parameters import ModelParameters

STEADY_TOLERANCE = 2e-3  # relative change of a steady speed between calls; cold air is steady to 0.2 % RMS
RECOMPUTE_TOLERANCE = 1e-3  # relative distance of the last prediction's speed above which another is computed
DISPLAY_TOLERANCE = 5e-3  # relative distance up to which the last prediction is returned
NICENESS = 10  # below the acquisition and the live view
ANSWER_TIMEOUT = 120.0  # s for one result, which includes compilation on a new machine

# an intermediate prediction, an error message, or None where the last prediction has converged
_Answer = Prediction | str | None


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

    Notes
    -----
    The process starts at the first steady speed. It gets one request at a time and returns one intermediate prediction
    for it, so that a new speed waits for one integration step at most. Close the refiner.
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
        self._failure = ""
        self._is_closing = False
        self._process: BaseProcess | None = None
        self._thread = threading.Thread(target=self._work, name="refiner", daemon=True)
        self._thread.start()

    @property
    def failure(self) -> str:
        """Why there is no prediction at the exact speed; empty where there is one, or may be."""
        return self._failure

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
            process = self._process
        if process is not None:
            end_process(process)  # ends the thread's wait for an answer as well
        self._thread.join(2 * JOIN_TIMEOUT)

    def _work(self) -> None:
        """Start the process at the first requested speed and send it requests; body of the thread."""
        if self._wait_for_request() is None:
            return
        context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
        pipe, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs,), name="rig-refiner", daemon=True)
        with pipe:
            try:
                with theirs:
                    start_process(process)
                if not self._register(process):
                    pipe.send(self._model)
                    while (speed := self._wait_for_request()) is not None:
                        pipe.send(speed)
                        self._store(speed, self._receive(pipe))
            except TimeoutError as error:
                self._failure = str(error)
            except (EOFError, OSError) as error:
                self._failure = f"the process that computes it ended ({type(error).__name__})"
        if process.pid is not None:
            end_process(process)
        self._process = None

    def _register(self, process: BaseProcess) -> bool:
        """Register the process for `close`; return whether `close` has been called."""
        with self._changed:
            self._process = process
            return self._is_closing

    def _receive(self, pipe: Connection) -> _Answer:
        """Return the next answer of the process; TimeoutError where none arrives."""
        if not pipe.poll(self._answer_timeout):
            raise TimeoutError(f"the process that computes it has not answered for {self._answer_timeout:g} s")
        answer: _Answer = pipe.recv()
        return answer

    def _wait_for_request(self) -> float | None:
        with self._changed:
            self._changed.wait_for(lambda: self._is_closing or self._requested is not None)
            return None if self._is_closing else self._requested

    def _store(self, speed: float, answer: _Answer) -> None:
        with self._changed:
            if isinstance(answer, Prediction):
                self._exact, self._failure = answer, ""
                return
            if isinstance(answer, str):
                self._failed_speed, self._failure = speed, answer
            if self._requested == speed:
                self._requested = None


def _is_within(tolerance: float, speed: float, other: float) -> bool:
    return abs(speed - other) <= tolerance * speed


def _serve(pipe: Connection) -> None:
    """Answer each requested speed with the next intermediate prediction; entry point of the process."""
    leave_signals_to_parent()
    lower_priority(NICENESS)
    try:
        parameters, settings, prediction_map = pipe.recv()
        speed: float | None = None
        while True:
            requested: float = pipe.recv()
            if requested != speed:
                speed, predictions = requested, refine(parameters, requested, prediction_map, settings)
            pipe.send(_next_answer(predictions))
    except (EOFError, OSError):
        return


def _next_answer(predictions: Iterator[Prediction]) -> _Answer:
    try:
        return next(predictions, None)
    except ModelError as error:
        return str(error)

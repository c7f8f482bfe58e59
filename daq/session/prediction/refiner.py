"""The prediction at exactly the speed at which the shaft stays, computed beside by a process that gives way."""

import multiprocessing
import threading
from collections.abc import Iterator
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from analysis.signals.header import AnalysisSettings
from daq.session.processes import JOIN_TIMEOUT, end_process, leave_signals_to_parent, lower_priority, start_process
from model.errors import ModelError
from model.prediction.live_prediction import refine
from model.prediction.prediction_map import Prediction, PredictionMap
from model.rotor.parameters import ModelParameters

STAYS = 2e-3  # of the speed: what it may change from call to call where it stays; cold air is steady to 0.2 % rms
RENEWED = 1e-3  # of the speed: further off than this, another prediction is computed
SHOWN = 5e-3  # of the speed: up to here the last one is the best there is
STEPS = 10  # of priority below the acquisition and the live view
PATIENCE = 120.0  # s for a look, which compiles on a fresh machine; who takes longer stands still

_Answer = Prediction | str | None  # a look, why there is none, or that the last one was settled


class Refiner:
    """Computes one prediction after the other at the speed that was asked for last; nobody waits for it.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    settings : AnalysisSettings
        The measurement's.
    prediction_map : PredictionMap
        From whose motions it begins.
    patience : float
        How long a look may take before it is given up, s.

    Notes
    -----
    The process is started when a speed has first stayed, and asked for one look at a time, so that a new speed never
    waits longer than for a look. Close it.
    """

    def __init__(
        self,
        parameters: ModelParameters,
        settings: AnalysisSettings,
        prediction_map: PredictionMap,
        patience: float = PATIENCE,
    ) -> None:
        self._model = (parameters, settings, prediction_map)
        self._patience = patience
        self._changed = threading.Condition()
        self._asked = 0.0  # rad/s, at the last call
        self._wanted: float | None = None  # rad/s, where more can be said
        self._hopeless = 0.0  # rad/s, where there is none
        self._exact: Prediction | None = None
        self._remark = ""
        self._is_closing = False
        self._process: BaseProcess | None = None
        self._thread = threading.Thread(target=self._work, name="refiner", daemon=True)
        self._thread.start()

    @property
    def remark(self) -> str:
        """Why there is no prediction at the exact speed; empty where there is or may be one."""
        return self._remark

    def at(self, speed: float) -> Prediction | None:
        """Return the prediction at a speed, rad/s, or very near to it, at once; None where there is none yet.

        A speed at which this is called twice running is one that stays, and is computed.
        """
        with self._changed:
            stays, self._asked = _is_within(STAYS, speed, self._asked), speed
            exact = self._exact
            known = (self._hopeless, self._wanted or 0.0, 0.0 if exact is None else exact.speed)
            if stays and not any(_is_within(RENEWED, speed, other) for other in known):
                self._wanted = speed
                self._changed.notify()
            return exact if exact is not None and _is_within(SHOWN, speed, exact.speed) else None

    def close(self) -> None:
        """End the computation and join thread and process."""
        with self._changed:
            self._is_closing = True
            self._changed.notify()
            process = self._process
        if process is not None:
            end_process(process)  # whatever the thread waits for of it comes to an end as well
        self._thread.join(2 * JOIN_TIMEOUT)

    def _work(self) -> None:
        """Wait for a speed, then have the process compute as long as there is one; the body of the thread."""
        if self._next() is None:
            return
        context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
        pipe, theirs = context.Pipe()
        process = context.Process(target=_answer, args=(theirs,), name="rig-refiner", daemon=True)
        with pipe:
            try:
                with theirs:
                    start_process(process)
                if not self._watch(process):
                    pipe.send(self._model)
                    while (speed := self._next()) is not None:
                        pipe.send(speed)
                        self._take(speed, self._answered(pipe))
            except TimeoutError as error:
                self._remark = str(error)
            except (EOFError, OSError) as error:
                self._remark = f"the process that computes it went away ({type(error).__name__})"
        if process.pid is not None:
            end_process(process)
        self._process = None

    def _watch(self, process: BaseProcess) -> bool:
        """Let `close` end this process; return whether it has been called already."""
        with self._changed:
            self._process = process
            return self._is_closing

    def _answered(self, pipe: Connection) -> _Answer:
        """Return the answer of the process; TimeoutError where none comes."""
        if not pipe.poll(self._patience):
            raise TimeoutError(f"the process that computes it has not answered for {self._patience:g} s")
        answer: _Answer = pipe.recv()
        return answer

    def _next(self) -> float | None:
        with self._changed:
            self._changed.wait_for(lambda: self._is_closing or self._wanted is not None)
            return None if self._is_closing else self._wanted

    def _take(self, speed: float, answer: _Answer) -> None:
        with self._changed:
            if isinstance(answer, Prediction):
                self._exact, self._remark = answer, ""
                return
            if isinstance(answer, str):
                self._hopeless, self._remark = speed, answer
            if self._wanted == speed:
                self._wanted = None


def _is_within(part: float, speed: float, other: float) -> bool:
    return abs(speed - other) <= part * speed


def _answer(pipe: Connection) -> None:
    """Answer speeds with looks until nobody asks any more; the body of the process."""
    leave_signals_to_parent()
    lower_priority(STEPS)
    try:
        parameters, settings, prediction_map = pipe.recv()
        speed: float | None = None
        while True:
            asked: float = pipe.recv()
            if asked != speed:
                speed, looks = asked, refine(parameters, asked, prediction_map, settings)
            pipe.send(_look(looks))
    except (EOFError, OSError):
        return


def _look(looks: Iterator[Prediction]) -> _Answer:
    try:
        return next(looks, None)
    except (ModelError, ValueError) as error:
        return str(error)

"""The prediction beside a run: a map, read or computed beside, and the exact speed; nobody ever waits for it."""

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
from daq.config.rig import Rig
from daq.config.rotor import model_parameters
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

PREDICTION_TIMEOUT = 120.0  # s between two words of a computation before it is given up
PORTION = 0.2  # s of waiting at a time, so that Ctrl-C works everywhere


@dataclass(frozen=True, slots=True)
class _Progress:
    done: int
    total: int


@dataclass(frozen=True, slots=True)
class _Failure:
    reason: str


_Report = _Progress | _Failure | dict[str, NDArray[np.generic]]


class Predictor:
    """Gives the model's prediction at a speed as soon as there is one.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    settings : AnalysisSettings
        The measurement's.
    speeds : ndarray of float64, shape (n,)
        Of the map, rising, rad/s.
    folder : Path, optional
        Where maps are kept; without it `$RIG_CACHE`, else the user's cache.

    Notes
    -----
    A map that is not in the cache is computed in another process at low priority, which keeps it there as well. A file
    that cannot be read is computed anew and replaced. Where a speed is asked for that stays, the prediction at exactly
    that speed is computed beside (`Refiner`). Close it, or use it in a with-statement.
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
        self._starting = threading.Lock()  # it, once
        self._file = map_file(folder, prediction_map_key(parameters, speeds, settings))
        self._percent = 0
        self._off = ""
        self._is_closed = False
        self._changed = threading.Condition()
        self._process: BaseProcess | None = None
        self._map, self._remark = read_map(self._file)
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
        """Whether there is a prediction: "ready", "ready, not exact: " or "off: " and why, or "computing 34 %"."""
        if self._map is not None:
            why = self._refiner.remark if self._refiner is not None else ""
            return f"ready, not exact: {why}" if why else "ready"
        return f"off: {self._off}" if self._off else f"computing {self._percent} %"

    @property
    def remark(self) -> str:
        """What was wrong with the cached map, if anything; empty where all is well."""
        return self._remark

    @property
    def map(self) -> PredictionMap | None:
        """The whole map; None until it is ready."""
        return self._map

    def at(self, speed: float) -> Prediction | None:
        """Return the prediction at a speed, rad/s, at once: exact where that is known, else from the map.

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
            Longest to wait between two reports, s.
        on_progress : callable, optional
            Told the state whenever it changes, and first what was wrong with the cached map, if anything.

        Returns
        -------
        PredictionMap or None
            None where there is none, or nothing new was reported in time.
        """
        told, since = "", time.monotonic()
        if on_progress is not None and self._remark:
            on_progress(self._remark)
        while True:
            state = self.state
            if state != told:
                told, since = state, time.monotonic()
                if on_progress is not None:
                    on_progress(state)
            with self._changed:
                if self.state != told:
                    continue
                if self._finished or time.monotonic() - since >= timeout:
                    return self._map
                self._changed.wait(min(PORTION, timeout))

    def close(self) -> None:
        """End the computations, if they still run, and join them."""
        with self._starting:
            self._is_closed = True
        if self._refiner is not None:
            self._refiner.close()
        process, self._process = self._process, None
        if process is None:
            return
        if not self._finished:
            self._finish(off="stopped")
        end_process(process)
        self._thread.join(JOIN_TIMEOUT)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _listen(self, reports: Connection) -> None:
        """Take what the process says, as far as it comes; the body of a thread, for a word may stop in its midst."""
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
                    self._finish(off=report.reason)
                else:
                    self._finish(PredictionMap.from_arrays(report))

    def _finish(self, found: PredictionMap | None = None, off: str = "") -> None:
        """Keep what came of the computation; the first word on that counts."""
        with self._changed:
            if not self._finished:
                self._map, self._off, self._finished = found, off, True
                self._changed.notify_all()


class Predictors:
    """Predictors by what they compute; each is started when it is first asked for and lives until `close`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._by_key: dict[str, Predictor] = {}

    def for_rig(self, rig: Rig) -> Predictor:
        """Return the predictor for a rig."""
        return self._for(model_parameters(rig.config), rig.settings, rig.limits)

    def for_run(self, header: RunHeader) -> Predictor:
        """Return the predictor for the rig of a run, as its configuration was then."""
        config = read_recorded_config(header.config_toml, f"configuration of run {header.run}")
        return self._for(model_parameters(config), header.settings, header.limits)

    def prediction_for(self, header: RunHeader, speed: float) -> Prediction | None:
        """Return what the model says of a run's rig at a speed, rad/s, at once.

        Raises
        ------
        ValueError
            The speed lies outside the rig's map.
        """
        known = self.for_run(header).map
        return None if known is None else known.at(speed)

    def _for(self, parameters: ModelParameters, settings: AnalysisSettings, limits: Limits) -> Predictor:
        speeds = default_map_speeds(limits.speed)
        key = prediction_map_key(parameters, speeds, settings)
        with self._lock:
            if key not in self._by_key:
                self._by_key[key] = Predictor(parameters, settings, speeds)
            return self._by_key[key]

    def close(self) -> None:
        """End them all."""
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
    """Compute, keep and send a map, or send that of another process: the body of the process."""
    leave_signals_to_parent()
    lower_priority()
    with suppress(BrokenPipeError):  # nobody listens any more
        try:
            prediction_map = load_or_compute_map(
                file,
                partial(compute_prediction_map, parameters, speeds, settings),
                lambda done, total: reports.send(_Progress(done, total)),
            )
        except (ModelError, ValueError) as error:
            reports.send(_Failure(str(error)))
            return
        reports.send(prediction_map.to_arrays())

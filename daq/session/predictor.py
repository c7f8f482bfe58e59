"""The prediction beside a run: read from the cache, or computed in a process of its own; nobody ever waits for it."""

import multiprocessing
import os
import signal
import sys
import threading
import time
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import NamedTemporaryFile
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from analysis.run import AnalysisSettings
from daq.session.priority import give_way
from model.errors import ModelError
from model.parameters import ModelParameters
from model.prediction import Prediction
from model.prediction_map import PredictionMap, compute_prediction_map, model_key

FloatArray = NDArray[np.float64]

JOIN_TIME = 2.0  # s
PORTION = 0.2  # s of waiting at a time, so that closing need not wait long


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
    that cannot be read is computed anew and replaced. Close it, or use it in a with-statement.
    """

    def __init__(
        self,
        parameters: ModelParameters,
        settings: AnalysisSettings,
        speeds: FloatArray,
        folder: Path | None = None,
    ) -> None:
        folder = cache_folder() if folder is None else folder
        self._file = folder / f"prediction-{model_key(parameters, speeds, settings)}.npz"
        self._percent = 0
        self._off = ""
        self._finished = False
        self._listening = threading.Lock()  # view, service and session may all ask
        self._process: multiprocessing.process.BaseProcess | None = None
        self._map, self._remark = _read(self._file)
        if self._map is None:
            context = multiprocessing.get_context("spawn")
            self._reports, theirs = context.Pipe(duplex=False)
            self._process = context.Process(
                target=_compute, args=(theirs, parameters, speeds, settings, self._file), name="prediction", daemon=True
            )
            self._process.start()
            theirs.close()

    @property
    def state(self) -> str:
        """Whether there is a prediction: "ready", "computing 34 %", or "off: " and why."""
        self._listen(0.0)
        if self._map is not None:
            return "ready"
        return f"off: {self._off}" if self._off else f"computing {self._percent} %"

    @property
    def remark(self) -> str:
        """What was wrong with the cached map, if anything; empty where all is well."""
        return self._remark

    @property
    def map(self) -> PredictionMap | None:
        """The whole map; None until it is ready."""
        self._listen(0.0)
        return self._map

    def at(self, speed: float) -> Prediction | None:
        """Return the prediction at a speed, rad/s, at once; None where the map is not ready or ends before it."""
        prediction_map = self.map
        if prediction_map is None or not prediction_map.speeds[0] <= speed <= prediction_map.speeds[-1]:
            return None
        return prediction_map.at(speed)

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
            if self._process is None or self._finished or time.monotonic() - since >= timeout:
                return self._map
            self._listen(min(PORTION, timeout))

    def close(self) -> None:
        """End the computation, if it still runs, and join it."""
        with self._listening:
            process, self._process = self._process, None
            if process is None:
                return
            if not self._finished:
                self._off = "stopped"
                process.terminate()
            process.join(JOIN_TIME)
            if process.exitcode is None:
                process.kill()
                process.join()
            process.close()
            self._reports.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _listen(self, timeout: float) -> None:
        """Take what the process has said, waiting for the first word."""
        if not self._listening.acquire(blocking=timeout > 0, timeout=timeout or -1):
            return
        try:
            while self._process is not None and not self._finished and self._reports.poll(timeout):
                self._take()
                timeout = 0.0
        finally:
            self._listening.release()

    def _take(self) -> None:
        try:
            report: _Report = self._reports.recv()
        except (EOFError, OSError):
            report = _Failure("the computation ended without a result")
        if isinstance(report, _Progress):
            self._percent = 100 * report.done // report.total
            return
        if isinstance(report, _Failure):
            self._off = report.reason
        else:
            self._map = PredictionMap.from_arrays(report)
        self._finished = True


def cache_folder() -> Path:
    """Return where maps are kept: `$RIG_CACHE`, else a folder in the user's cache, as the platform has it."""
    chosen = os.environ.get("RIG_CACHE", "")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "rig" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "rig"
    return Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache") / "rig"


def _read(file: Path) -> tuple[PredictionMap | None, str]:
    """Return the map in a file, or None, and what is wrong with the file if it is there."""
    try:
        with file.open("rb") as content, np.load(content, allow_pickle=False) as arrays:
            return PredictionMap.from_arrays(dict(arrays)), ""
    except FileNotFoundError:
        return None, ""
    except (OSError, EOFError, ValueError, TypeError, NotImplementedError, zipfile.BadZipFile, zlib.error) as error:
        return None, f"{file}: no readable prediction ({error}); it is computed anew"


def _write(file: Path, prediction_map: PredictionMap) -> None:
    """Keep a map: whole or not at all."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with NamedTemporaryFile(dir=file.parent, suffix=".part", delete=False) as part:
        try:
            np.savez(part, **prediction_map.to_arrays())  # type: ignore[arg-type]  # the stub takes names for an option
            part.close()
            Path(part.name).replace(file)
        except OSError:
            part.close()
            Path(part.name).unlink(missing_ok=True)
            raise


def _compute(
    reports: Connection, parameters: ModelParameters, speeds: FloatArray, settings: AnalysisSettings, file: Path
) -> None:
    """Compute, keep and send a map: the body of the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this process
    give_way()
    with suppress(BrokenPipeError):  # nobody listens any more
        try:
            prediction_map = compute_prediction_map(
                parameters, speeds, settings, lambda done, total: reports.send(_Progress(done, total))
            )
        except (ModelError, ValueError) as error:
            reports.send(_Failure(str(error)))
            return
        with suppress(OSError):  # a full or read-only disk: the map is sent all the same, and computed again next time
            _write(file, prediction_map)
        reports.send(prediction_map.to_arrays())

"""Cache of prediction maps on disk, shared by all programs of the user: one process computes, the others wait."""

import os
import sys
import time
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from analysis.signals.header import AnalysisSettings, Limits, RunHeader
from daq.config.loader import read_recorded_config
from daq.config.rig import model_parameters
from daq.session.file_lock import FileLock
from model.errors import ModelError
from model.prediction.prediction_map import (
    PredictionMap,
    compute_prediction_map,
    default_map_speeds,
    prediction_map_key,
)
from model.rotor.parameters import ModelParameters
from recordings.file_operations import atomic_write

OnProgress: TypeAlias = Callable[[int, int], None]
"""Receives the number of speeds done and the total."""
POLL_INTERVAL: Final = 0.2  # s between reads of another process's progress
STALL_TIMEOUT: Final = 60.0  # s without progress after which another process is no longer waited for


def cache_folder() -> Path:
    """Return the folder of the maps: `$RIG_CACHE`, else a folder in the platform's user cache."""
    chosen = os.environ.get("RIG_CACHE", "")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "rig" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "rig"
    return Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache") / "rig"


def map_file(folder: Path, key: str) -> Path:
    """Return the file of a map by its key from `prediction_map_key`."""
    return folder / f"prediction-{key}.npz"


def read_map(file: Path) -> tuple[PredictionMap | None, str]:
    """Return the map in a file, None for none, and an error message where the file is damaged."""
    try:
        with file.open("rb") as content, np.load(content, allow_pickle=False) as arrays:
            return PredictionMap.from_arrays(dict(arrays)), ""
    except FileNotFoundError:
        return None, ""
    except (OSError, EOFError, ValueError, TypeError, NotImplementedError, zipfile.BadZipFile, zlib.error) as error:
        return None, f"{file}: no readable prediction ({error}); it is computed again"


def write_map(file: Path, prediction_map: PredictionMap) -> None:
    """Write a map atomically."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(file) as temporary, temporary.open("wb") as part:
        np.savez(part, **prediction_map.to_arrays())  # type: ignore[arg-type]  # the stub takes names for an option


def load_or_compute_map(
    file: Path,
    compute: Callable[[OnProgress], PredictionMap],
    on_progress: OnProgress,
    stall_timeout: float = STALL_TIMEOUT,
) -> PredictionMap:
    """Return the map in a file; where there is none, compute and write it, or wait for the process that does.

    Parameters
    ----------
    file : Path
        File of the map.
    compute : callable
        Computes the map and reports its progress.
    on_progress : callable
        Receives the progress, of this or the other process.
    stall_timeout : float
        Time without progress after which the other process is no longer waited for, s.

    Raises
    ------
    ModelError, ValueError
        The motion cannot be computed.
    """
    with FileLock(file.with_suffix(".lock")) as lock:
        with suppress(OSError):  # a full or read-only disk, on which the map cannot be written either
            file.parent.mkdir(parents=True, exist_ok=True)
        _wait_for_lock(lock, on_progress, stall_timeout)
        cached, _ = read_map(file)
        if cached is not None:
            return cached

        def report(done: int, total: int) -> None:
            lock.write_progress(f"{done} {total}")
            on_progress(done, total)

        computed = compute(report)
        with suppress(OSError):  # as above: the next process computes it again
            write_map(file, computed)
        return computed


def _wait_for_lock(lock: FileLock, on_progress: OnProgress, stall_timeout: float) -> None:
    """Return when the lock is held, when it cannot be created, or when its holder makes no progress."""
    last, since = "", time.monotonic()
    while not _acquire_if_possible(lock) and time.monotonic() - since < stall_timeout:
        text = lock.read_progress()
        if text != last:
            last, since = text, time.monotonic()
            done, _, total = text.partition(" ")
            if done.isdecimal() and total.isdecimal():
                on_progress(int(done), int(total))
        time.sleep(POLL_INTERVAL)


def _acquire_if_possible(lock: FileLock) -> bool:
    """Acquire a lock; return whether no other process is to be waited for."""
    try:
        return lock.try_acquire()
    except OSError:  # the disk is full or read-only: no process can hold it
        return True


class CachedPredictionMap:
    """The prediction map of a rig, read from the cache or computed in this process.

    For jobs, which have a process of their own. `Predictor` computes in a child process instead.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    settings : AnalysisSettings
        Settings of the measurement.
    limits : Limits
        Limits of the rig; the map ends at its maximum speed.
    """

    def __init__(self, parameters: ModelParameters, settings: AnalysisSettings, limits: Limits) -> None:
        self._parameters = parameters
        self._settings = settings
        self._speeds = default_map_speeds(limits.speed)
        self._file = map_file(cache_folder(), prediction_map_key(parameters, self._speeds, settings))
        self._map, _ = read_map(self._file)

    @property
    def map(self) -> PredictionMap | None:
        """The map; None until it is computed."""
        return self._map

    def load_or_compute(self, on_progress: OnProgress) -> PredictionMap:
        """Return the map; where the cache lacks it, compute and store it, or wait for the process that does.

        Parameters
        ----------
        on_progress : callable
            Receives the number of speeds done and the total.

        Raises
        ------
        ModelError
            The motion cannot be computed.
        """
        if self._map is None:
            self._map = load_or_compute_map(
                self._file, partial(compute_prediction_map, self._parameters, self._speeds, self._settings), on_progress
            )
        return self._map

    def wait(self, _timeout: float, on_progress: Callable[[str], None]) -> PredictionMap | None:
        """Load or compute the map, with the interface of `Predictor.wait`; None where the model has no solution."""
        with suppress(ModelError):
            return self.load_or_compute(lambda done, total: on_progress(f"computing {100 * done // total} %"))
        return None


class CachedPredictionMaps:
    """Cached prediction maps by run."""

    def __init__(self) -> None:
        self._by_run: dict[str, CachedPredictionMap] = {}

    def for_run(self, header: RunHeader) -> CachedPredictionMap:
        """Return the map for the rig of a run, with the configuration recorded in it."""
        if header.run not in self._by_run:
            config = read_recorded_config(header.config_toml, f"configuration of run {header.run}")
            self._by_run[header.run] = CachedPredictionMap(model_parameters(config), header.settings, header.limits)
        return self._by_run[header.run]

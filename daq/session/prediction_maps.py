"""Cache of prediction maps on disk, shared by all programs of the user: one process computes, the others wait."""

import os
import time
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
from filelock import FileLock, Timeout
from platformdirs import user_cache_path

from analysis.signals import FloatArray
from analysis.signals.header import AnalysisSettings
from model.prediction.prediction_map import (
    PredictionMap,
    compute_prediction_map,
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
    return Path(os.environ.get("RIG_CACHE") or user_cache_path("rig", appauthor=False))


def map_file(
    parameters: ModelParameters, speeds: FloatArray, settings: AnalysisSettings, folder: Path | None = None
) -> Path:
    """Return the file of a rotor's map at these speeds, rad/s; in `cache_folder` unless another is given."""
    return (folder or cache_folder()) / f"prediction-{prediction_map_key(parameters, speeds, settings)}.npz"


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
    lock, progress_file = FileLock(file.with_suffix(".lock")), file.with_suffix(".progress")
    with suppress(OSError):  # a full or read-only disk, on which the map cannot be written either
        file.parent.mkdir(parents=True, exist_ok=True)
    _wait_for_lock(lock, progress_file, on_progress, stall_timeout)
    cached, _ = read_map(file)
    if cached is not None:
        lock.release()
        return cached

    def report(done: int, total: int) -> None:
        if lock.is_locked:
            with suppress(OSError):  # as above
                progress_file.write_text(f"{done} {total}", encoding="ascii")
        on_progress(done, total)

    try:
        computed = compute(report)
        with suppress(OSError):  # as above: the next process computes it again
            write_map(file, computed)
        return computed
    finally:
        if lock.is_locked:
            with suppress(OSError):
                progress_file.unlink()
            lock.release()


def _wait_for_lock(lock: FileLock, progress_file: Path, on_progress: OnProgress, stall_timeout: float) -> None:
    """Return when the lock is held, when it cannot be created, or when its holder makes no progress."""
    last, since = "", time.monotonic()
    while time.monotonic() - since < stall_timeout:
        try:
            lock.acquire(blocking=False)
        except Timeout:
            text = _read_progress(progress_file)
        except OSError:  # the disk is full or read-only: no process can hold it
            return
        else:
            return
        if text != last:
            last, since = text, time.monotonic()
            done, _, total = text.partition(" ")
            if done.isdecimal() and total.isdecimal():
                on_progress(int(done), int(total))
        time.sleep(POLL_INTERVAL)


def _read_progress(progress_file: Path) -> str:
    """Return the progress last written by the holder of the lock; empty for none."""
    try:
        return progress_file.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError):
        return ""


def load_or_compute(
    on_progress: OnProgress, file: Path, parameters: ModelParameters, speeds: FloatArray, settings: AnalysisSettings
) -> PredictionMap:
    """Return the map in a file; where there is none, compute and write it, as `load_or_compute_map` does."""
    return load_or_compute_map(file, partial(compute_prediction_map, parameters, speeds, settings), on_progress)

"""The model's maps for work that has a process of its own: from the cache, or computed in this very process.

The model's maps on disk, where every program of this user finds them again.
"""

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
from daq.config.rotor import model_parameters
from daq.session.prediction.file_lock import FileLock
from model.errors import ModelError
from model.prediction.prediction_map import (
    PredictionMap,
    compute_prediction_map,
    default_map_speeds,
    prediction_map_key,
)
from model.rotor.parameters import ModelParameters
from recordings.atomic_file import atomic_write

Told: TypeAlias = Callable[[int, int], None]
"""Told the number of speeds done and of all."""
LOOK: Final = 0.2  # s between two looks at what another process does
STILL: Final = 60.0  # s without a word after which a process that computes is not waited for any longer


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


def map_file(folder: Path, key: str) -> Path:
    """Return the file of the map with a key of `prediction_map_key`."""
    return folder / f"prediction-{key}.npz"


def read_map(file: Path) -> tuple[PredictionMap | None, str]:
    """Return the map in a file, or None, and what is wrong with the file if it is there."""
    try:
        with file.open("rb") as content, np.load(content, allow_pickle=False) as arrays:
            return PredictionMap.from_arrays(dict(arrays)), ""
    except FileNotFoundError:
        return None, ""
    except (OSError, EOFError, ValueError, TypeError, NotImplementedError, zipfile.BadZipFile, zlib.error) as error:
        return None, f"{file}: no readable prediction ({error}); it is computed anew"


def write_map(file: Path, prediction_map: PredictionMap) -> None:
    """Keep a map: whole or not at all."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(file) as temporary, temporary.open("wb") as part:
        np.savez(part, **prediction_map.to_arrays())  # type: ignore[arg-type]  # the stub takes names for an option


def load_or_compute_map(
    file: Path, compute: Callable[[Told], PredictionMap], told: Told, still: float = STILL
) -> PredictionMap:
    """Return the map that is kept in a file, or compute and keep it; of several that want it one computes.

    Parameters
    ----------
    file : Path
        Of the map.
    compute : callable
        Computes it, and tells how far it is.
    told : callable
        Told how far it is, whoever computes.
    still : float
        Time without a word after which whoever computes is not waited for any longer, s.

    Raises
    ------
    ModelError, ValueError
        The motion cannot be computed.
    """
    with FileLock(file.with_suffix(".claim")) as claim:
        with suppress(OSError):  # a full or read-only disk, on which no map can be kept either
            file.parent.mkdir(parents=True, exist_ok=True)
        _await(claim, told, still)
        kept, _ = read_map(file)
        if kept is not None:
            return kept

        def tell(done: int, total: int) -> None:
            claim.say(f"{done} {total}")
            told(done, total)

        computed = compute(tell)
        with suppress(OSError):  # as above: it is computed again next time
            write_map(file, computed)
        return computed


def _await(claim: FileLock, told: Told, still: float) -> None:
    """Return when the claim is held, when there can be none, or when whoever holds it stands still."""
    last, since = "", time.monotonic()
    while not _is_free(claim) and time.monotonic() - since < still:
        word = claim.heard()
        if word != last:
            last, since = word, time.monotonic()
            done, _, total = word.partition(" ")
            if done.isdecimal() and total.isdecimal():
                told(int(done), int(total))
        time.sleep(LOOK)


def _is_free(claim: FileLock) -> bool:
    """Take a claim; return whether there is nobody to be waited for."""
    try:
        return claim.take()
    except OSError:  # as above: nobody can hold it
        return True


class CachedPredictionMap:
    """One rig's map.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    settings : AnalysisSettings
        The measurement's.
    limits : Limits
        The rig's; the map goes up to its speed.
    """

    def __init__(self, parameters: ModelParameters, settings: AnalysisSettings, limits: Limits) -> None:
        self._parameters = parameters
        self._settings = settings
        self._speeds = default_map_speeds(limits.speed)
        self._file = map_file(cache_folder(), prediction_map_key(parameters, self._speeds, settings))
        self._map, _ = read_map(self._file)

    @property
    def map(self) -> PredictionMap | None:
        """The map; None until it was computed."""
        return self._map

    def computed(self, on_progress: Callable[[int, int], None]) -> PredictionMap:
        """Return the map, computed and kept where it has not been; where another process does so, wait for that.

        Parameters
        ----------
        on_progress : callable
            Told the number of speeds done and of all.

        Raises
        ------
        ModelError, ValueError
            The motion cannot be computed.
        """
        if self._map is None:
            self._map = load_or_compute_map(
                self._file, partial(compute_prediction_map, self._parameters, self._speeds, self._settings), on_progress
            )
        return self._map

    def wait(self, _patience: float, on_progress: Callable[[str], None]) -> PredictionMap | None:
        """Compute the map here, as `Predictor.wait` waits for it; None where the model gives none."""
        with suppress(ModelError, ValueError):
            return self.computed(lambda done, total: on_progress(f"computing {100 * done // total} %"))
        return None


class CachedPredictionMaps:
    """Maps by the rigs of runs."""

    def __init__(self) -> None:
        self._by_run: dict[str, CachedPredictionMap] = {}

    def for_run(self, header: RunHeader) -> CachedPredictionMap:
        """Return the map for the rig of a run, as its configuration was then."""
        if header.run not in self._by_run:
            config = read_recorded_config(header.config_toml, f"configuration of run {header.run}")
            self._by_run[header.run] = CachedPredictionMap(model_parameters(config), header.settings, header.limits)
        return self._by_run[header.run]

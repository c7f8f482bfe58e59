"""The model's maps on disk, where every program of this user finds them again."""

import os
import sys
import time
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from daq.session.prediction.file_lock import Claim
from model.prediction.prediction_map import PredictionMap
from recordings.atomic_file import draft_of

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
    """Return the file of the map with a key of `model_key`."""
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
    with draft_of(file) as draft, draft.open("wb") as part:
        np.savez(part, **prediction_map.to_arrays())  # type: ignore[arg-type]  # the stub takes names for an option


def kept_or_computed(
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
    with Claim(file.with_suffix(".claim")) as claim:
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


def _await(claim: Claim, told: Told, still: float) -> None:
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


def _is_free(claim: Claim) -> bool:
    """Take a claim; return whether there is nobody to be waited for."""
    try:
        return claim.take()
    except OSError:  # as above: nobody can hold it
        return True

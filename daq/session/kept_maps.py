"""The model's maps on disk, where every program of this user finds them again."""

import os
import sys
import zipfile
import zlib
from pathlib import Path
from tempfile import NamedTemporaryFile

import numpy as np

from model.prediction_map import PredictionMap


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
    with NamedTemporaryFile(dir=file.parent, suffix=".part", delete=False) as part:
        try:
            np.savez(part, **prediction_map.to_arrays())  # type: ignore[arg-type]  # the stub takes names for an option
            part.close()
            Path(part.name).replace(file)
        except OSError:
            part.close()
            Path(part.name).unlink(missing_ok=True)
            raise

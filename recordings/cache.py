"""Documents computed from runs, kept beside them as long as the runs do not change."""

import json
import os
import re
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

FOLDER = ".rig"
NAME = re.compile(r"[a-z][a-z0-9_-]{0,63}")


class DocumentCache:
    """JSON documents in a hidden folder, each valid only for the size and the time of change of the run's file.

    Nothing depends on it: where it cannot be written or read, documents are computed again.

    Parameters
    ----------
    folder : Path
        The data folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER

    def load(self, run: Path, name: str) -> dict[str, Any] | None:
        """Return a document of a run, or None where there is none for the file as it is now."""
        try:
            kept = json.loads(self._path(run, name).read_text(encoding="utf-8"))
            if kept["of"] != _fingerprint(run):
                return None
            document = kept["document"]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return document if isinstance(document, dict) else None

    def store(self, run: Path, name: str, document: dict[str, Any]) -> None:
        """Keep a document of a run in place of the one before; a folder that cannot be written is no fault."""
        path = self._path(run, name)
        with suppress(OSError):
            text = json.dumps({"of": _fingerprint(run), "document": document})
            self._folder.mkdir(exist_ok=True)
            handle, draft = tempfile.mkstemp(dir=self._folder, prefix=f"{path.stem}.", suffix=".part")
            try:
                with os.fdopen(handle, "w", encoding="utf-8") as file:
                    file.write(text)
                Path(draft).replace(path)
            finally:
                Path(draft).unlink(missing_ok=True)

    def _path(self, run: Path, name: str) -> Path:
        if not NAME.fullmatch(name):
            raise ValueError(f"document: {name!r}, expected a name of small letters, digits, - and _")
        return self._folder / f"{run.stem}.{name}.json"


def _fingerprint(run: Path) -> dict[str, int]:
    """Return what changes when a file does."""
    status = run.stat()
    return {"bytes": status.st_size, "changed_ns": status.st_mtime_ns}

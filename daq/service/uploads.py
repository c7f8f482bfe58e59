"""Files of other programs that were sent in, kept until they are imported: no name of theirs reaches the disk."""

import secrets
import shutil
import threading
import time
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Final

from recordings.exchange.formats import IMPORTS

MOST_KEPT: Final = 16
MOST_BYTES: Final = 2 * 1024**3  # of one file
MOST_LETTERS: Final = 200
KEPT_FOR: Final = 3600.0  # s
ABANDONED: Final = 24 * 3600.0  # s: what is so old is of a service that was ended by force


class UploadNotFoundError(LookupError):
    """There is no such upload."""


class UploadsFullError(RuntimeError):
    """Too many are kept."""


@dataclass(frozen=True, slots=True)
class Upload:
    """A file that was sent in.

    Parameters
    ----------
    id : str
        Its id, which cannot be guessed.
    name : str
        What its sender calls it.
    path : Path
        Where it lies; only the suffix is of its name.
    size : int
        Bytes.
    sent, forgotten : float
        Wall clock when it was there and when it is deleted, s since 1970.
    """

    id: str
    name: str
    path: Path
    size: int
    sent: float
    forgotten: float


def require_name(name: str) -> None:
    """Raise ValueError where a file cannot be called so: a plain name of a format that can be imported."""
    if not name.isprintable() or not 0 < len(name) <= MOST_LETTERS or set(name) & set("/\\:"):
        raise ValueError(f"name {name[:60]!r}: expected a file's name without its folders")
    if PurePath(name).suffix.lower() not in IMPORTS:
        raise ValueError(f"name {name[-60:]!r}: expected one that ends with {', '.join(IMPORTS)}")


class Uploads:
    """Keeps uploads for a while; may be used from any thread.

    Parameters
    ----------
    folder : Path
        The data folder; they lie in `.rig/uploads`.
    kept_for : float
        How long, s.
    """

    def __init__(self, folder: Path, kept_for: float = KEPT_FOR) -> None:
        self._kept_for = kept_for
        self._folder = folder / ".rig" / "uploads"
        self._lock = threading.Lock()
        self._uploads: dict[str, Upload] = {}  # in the order in which they came

    def place(self, name: str) -> Path:
        """Return where a file of a name is to be written.

        Raises
        ------
        ValueError
            It cannot be called so.
        UploadsFullError
            Too many are kept.
        """
        require_name(name)
        with self._lock:
            self._tidy()
            if len(self._uploads) >= MOST_KEPT:
                raise UploadsFullError(f"{len(self._uploads)} uploads are kept already")
        return self._folder / secrets.token_hex(8) / f"upload{PurePath(name).suffix.lower()}"

    def add(self, name: str, path: Path, size: int) -> Upload:
        """Keep a file that was written where `place` said, and return it; UploadsFullError where too many are kept."""
        now = time.time()
        upload = Upload(path.parent.name, name, path, size, now, now + self._kept_for)
        with self._lock:
            if len(self._uploads) >= MOST_KEPT:
                _discard(path.parent)
                raise UploadsFullError(f"{len(self._uploads)} uploads are kept already")
            self._uploads[upload.id] = upload
        return upload

    def all(self) -> tuple[Upload, ...]:
        """Return all uploads, the one sent last first."""
        with self._lock:
            self._tidy()
            return tuple(reversed(self._uploads.values()))

    def upload(self, upload_id: str) -> Upload:
        """Return an upload; UploadNotFoundError where there is none."""
        with self._lock:
            self._tidy()
            return self._known(upload_id)

    def remove(self, upload_id: str) -> Upload:
        """Delete an upload and return it."""
        with self._lock:
            upload = self._known(upload_id)
            self._drop(upload)
        return upload

    def close(self) -> None:
        """Leave nothing behind."""
        with self._lock:
            for upload in tuple(self._uploads.values()):
                self._drop(upload)

    def _known(self, upload_id: str) -> Upload:
        if upload_id not in self._uploads:
            raise UploadNotFoundError(f"upload {upload_id[:40]!r}: there is none of this id")
        return self._uploads[upload_id]

    def _tidy(self) -> None:
        """Forget what is too old, and throw away what services that were ended by force have left."""
        now = time.time()
        for upload in tuple(self._uploads.values()):
            if now >= upload.forgotten:
                self._drop(upload)
        for folder in self._folder.glob("*"):
            try:
                is_old = now - folder.stat().st_mtime > ABANDONED
            except OSError:  # another service has been faster
                continue
            if is_old and folder.name not in self._uploads:
                _discard(folder)

    def _drop(self, upload: Upload) -> None:
        del self._uploads[upload.id]
        _discard(upload.path.parent)


def _discard(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)

"""Errors of the recordings package.

RecordingError
├── NotFoundError       no run of this id or name
├── DamagedError        the file is truncated, empty or not MCAP
│   └── MessageError    the bytes of a message are not what its type requires
├── UnknownFormatError  the file is no run, or of a format version that this program does not read
├── StorageError        the folder is missing, read-only or full
│   └── RunExistsError  a run of this id exists already
├── AnnotationError     a remark or tag is too long or malformed
└── ForeignFormatError  a file of another format cannot be read or written, or lacks a requested column or stretch
"""


class RecordingError(Exception):
    """Base class; the message names the file and what was expected."""


class NotFoundError(RecordingError):
    """No run of this id or name exists."""


class DamagedError(RecordingError):
    """The file is not a complete recording."""


class MessageError(DamagedError):
    """The bytes of a message are not what its type requires."""


class UnknownFormatError(RecordingError):
    """The file is no run, or of a format version that this program does not read."""


class StorageError(RecordingError):
    """A file or folder cannot be read or written."""


class RunExistsError(StorageError):
    """A run of this id exists already."""


class AnnotationError(RecordingError):
    """A remark or tag is too long or malformed."""


class ForeignFormatError(RecordingError):
    """A file of another format cannot be read or written, or lacks a requested column or stretch."""

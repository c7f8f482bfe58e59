"""What can be wrong with a recording or the folder it lies in.

RecordingError
├── NotFoundError       there is no such run
├── DamagedError        cut short, empty, not MCAP
├── UnknownFormatError  written by a version that is not known here
├── StorageError        the folder is missing, read-only or full
│   └── RunExistsError  a run of this id exists already
└── ForeignFormatError  a file of another program cannot be read or written, or lacks what was asked for
"""


class RecordingError(Exception):
    """Anything wrong with a recording; the message names the file and what was expected."""


class NotFoundError(RecordingError):
    """There is no such run."""


class DamagedError(RecordingError):
    """The file is not a whole recording."""


class UnknownFormatError(RecordingError):
    """The file was written in a format version that is not known here."""


class StorageError(RecordingError):
    """Nothing can be written there."""


class RunExistsError(StorageError):
    """A run of this id exists already."""


class ForeignFormatError(RecordingError):
    """A file of another program cannot be read or written, or lacks what was asked for."""

"""What tells whether two runs were measured with the same calibrations."""

import hashlib
import json

from analysis.signals.header import Acquisition
from recordings.mcap.header import calibration_document


def calibration_identity(acquisition: Acquisition) -> str:
    """Return what is equal for equal calibrations of the probes, and only then: hexadecimal digits."""
    documents = {
        channel.name: calibration_document(channel.calibration)
        for channel in acquisition.channels
        if channel.calibration is not None
    }
    return hashlib.sha256(json.dumps(documents, sort_keys=True).encode()).hexdigest()[:16]

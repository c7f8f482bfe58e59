"""The simulated rig, and its independent random streams: a run does not depend on the block size of its reader."""

from enum import IntEnum

import numpy as np


class StreamPurpose(IntEnum):
    """Purpose of a random stream."""

    SPEED = 1
    PHASES = 2
    PROBE_NOISE = 3
    GLITCHES = 4
    TACHO_JITTER = 5
    TACHO_NOISE = 6
    WIRING = 7
    WIRING_NOISE = 8
    CONTACT = 9


def random_stream(seed: int, purpose: StreamPurpose, *index: int) -> np.random.Generator:
    """Return the random generator of one purpose and one fixed portion of the run.

    Parameters
    ----------
    seed : int
        Seed of the run, not negative.
    purpose : StreamPurpose
        Purpose of the stream.
    *index : int
        Channel, portion: numbers, not negative, that distinguish the streams of one purpose.
    """
    return np.random.default_rng((seed, int(purpose), *index))

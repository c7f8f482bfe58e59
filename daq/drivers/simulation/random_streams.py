"""Random draws of the simulated rig: each from its own seed, so that a run does not depend on how it is read."""

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a stream of draws is for."""

    SPEED = 1
    PHASES = 2
    PROBE_NOISE = 3
    GLITCHES = 4
    TACHO_JITTER = 5
    TACHO_NOISE = 6
    WIRING = 7
    WIRING_NOISE = 8


def draws(seed: int, purpose: Purpose, *index: int) -> np.random.Generator:
    """Return the generator for one purpose and one fixed portion of the run.

    Parameters
    ----------
    seed : int
        Of the whole run, not negative.
    purpose : Purpose
        What is drawn.
    *index : int
        Channel, portion: whatever tells this stream from others of its purpose; not negative.
    """
    return np.random.default_rng((seed, int(purpose), *index))

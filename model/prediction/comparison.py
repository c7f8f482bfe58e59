"""How far a run agrees with the model: 1X over speed, and where the oil films let go."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.live.summary import RunSummary
from analysis.whirl.findings import WhirlFinding
from model.prediction.prediction_map import PredictionMap

FloatArray = NDArray[np.float64]

AMPLITUDE_TOLERANCE = 0.25  # |ln ratio| up to which measured and predicted 1X are said to agree: 28 % more, 22 % less
PHASE_TOLERANCE = math.radians(30)
MIN_AMPLITUDE = 0.2e-6  # m peak: a smaller 1X than this, measured or predicted, is not compared
ORDER_TOLERANCE = 0.1  # orders within which neighbouring speeds, or measured and predicted, show the same whirl


@dataclass(frozen=True, slots=True)
class SynchronousAgreement:
    """Measured against predicted 1X.

    Ratios are measured over predicted amplitude; phase differences are measured minus predicted lag, rad, positive
    where the measurement lags more. Both probes count alike.

    Parameters
    ----------
    speeds : int
        Number of measured speeds within the map that are compared.
    median_ratio, worst_ratio : float
        Median ratio, and the one furthest from 1 on a logarithmic scale.
    worst_ratio_speed : float
        Where that was, rad/s.
    median_phase, worst_phase : float
        Median phase difference, and the largest in size, rad.
    worst_phase_speed : float
        Where that was, rad/s.
    agrees_to : float
        Speed, rad/s, up to which, from the lowest compared, every ratio is within exp(±0.25) and every phase
        difference within 30°; NaN where the lowest already is not.
    within_ratio, within_phase : float
        Up to there, largest |ratio - 1|, and largest size of phase difference, rad; NaN where ``agrees_to`` is.
    """

    speeds: int
    median_ratio: float
    worst_ratio: float
    worst_ratio_speed: float
    median_phase: float
    worst_phase: float
    worst_phase_speed: float
    agrees_to: float
    within_ratio: float
    within_phase: float


@dataclass(frozen=True, slots=True)
class PredictedWhirl:
    """A range of speed in which the model shows one sub-synchronous component as the strongest.

    Parameters
    ----------
    order : float
        Its frequency over the shaft's at the onset.
    onset, end : float
        First and last speed of the range, rad/s.
    amplitude : float
        Its largest half major axis, m peak.
    """

    order: float
    onset: float
    end: float
    amplitude: float


@dataclass(frozen=True, slots=True)
class WhirlAgreement:
    """Predicted and measured whirl of one rank: the first to come with rising speed, the second, and so on.

    Parameters
    ----------
    predicted : PredictedWhirl or None
        None where the model shows fewer whirls than the run within the speeds of the map.
    measured : WhirlFinding or None
        None where the run showed fewer.
    was_reached : bool
        Whether the run came to the predicted onset at all; true where nothing is predicted.
    """

    predicted: PredictedWhirl | None
    measured: WhirlFinding | None
    was_reached: bool

    @property
    def onset_ratio(self) -> float:
        """Measured over predicted onset speed; NaN where one of them is missing."""
        if self.predicted is None or self.measured is None:
            return math.nan
        return self.measured.begin.speed / self.predicted.onset


@dataclass(frozen=True, slots=True)
class Agreement:
    """A run against the model.

    Parameters
    ----------
    synchronous : SynchronousAgreement or None
        None where no measured speed can be compared.
    whirls : tuple of WhirlAgreement
        In rising order of onset.
    instability_onset : float
        Lowest speed from which the model's synchronous motion is unstable, rad/s; NaN where it never is in the map.
    """

    synchronous: SynchronousAgreement | None
    whirls: tuple[WhirlAgreement, ...]
    instability_onset: float


def compare(summary: RunSummary, prediction_map: PredictionMap) -> Agreement:
    """Lay a run's summary beside the model's predictions.

    Parameters
    ----------
    summary : RunSummary
        The run.
    prediction_map : PredictionMap
        The model over speed.

    Returns
    -------
    Agreement
        1X over the measured speeds, and the whirls matched by their rank in speed.
    """
    return Agreement(
        synchronous=_synchronous(summary, prediction_map),
        whirls=_whirls(summary, prediction_map),
        instability_onset=instability_onset(prediction_map),
    )


def instability_onset(prediction_map: PredictionMap) -> float:
    """Return the lowest speed at which the synchronous motion turns unstable, rad/s; NaN where it stays stable."""
    growth, speeds = prediction_map.growth_rate, prediction_map.speeds
    unstable = np.flatnonzero(growth > 0)
    if not unstable.size:
        return math.nan
    first = int(unstable[0])
    if first == 0 or not growth[first - 1] <= 0:
        return float(speeds[first])
    part = growth[first - 1] / (growth[first - 1] - growth[first])
    return float(speeds[first - 1] + part * (speeds[first] - speeds[first - 1]))


def predicted_whirls(prediction_map: PredictionMap) -> tuple[PredictedWhirl, ...]:
    """Return the ranges of speed in which the model shows one and the same whirl, in rising order of onset."""
    found: list[list[int]] = []
    orders = prediction_map.whirl_order
    for place in np.flatnonzero(np.isfinite(orders)):
        for places in found:
            if abs(orders[place] - orders[places[-1]]) < ORDER_TOLERANCE:
                places.append(int(place))
                break
        else:
            found.append([int(place)])
    return tuple(
        PredictedWhirl(
            order=float(orders[places[0]]),
            onset=float(prediction_map.speeds[places[0]]),
            end=float(prediction_map.speeds[places[-1]]),
            amplitude=float(prediction_map.whirl_amplitude[places].max()),
        )
        for places in found
    )


def _synchronous(summary: RunSummary, prediction_map: PredictionMap) -> SynchronousAgreement | None:
    lowest, highest = prediction_map.speeds[0], prediction_map.speeds[-1]
    speeds, ratios = [], []
    for row in sorted(summary.rows, key=lambda row: row.speed):
        if not lowest <= row.speed <= highest:
            continue
        measured, predicted = row.motion[0], prediction_map.at(row.speed).vectors[0]
        if min(np.abs(measured).min(), np.abs(predicted).min()) >= MIN_AMPLITUDE:
            speeds.append(row.speed)
            ratios.append(measured / predicted)
    if not speeds:
        return None
    ratio = np.array(ratios)
    amplitude = np.abs(ratio)
    off = np.max(np.abs(np.log(amplitude)), axis=1)
    lag = -np.angle(ratio)
    late = np.max(np.abs(lag), axis=1)
    worst_ratio, worst_phase = int(np.argmax(off)), int(np.argmax(late))
    misses = np.flatnonzero((off > AMPLITUDE_TOLERANCE) | (late > PHASE_TOLERANCE))
    agreeing = int(misses[0]) if misses.size else len(speeds)
    return SynchronousAgreement(
        speeds=len(speeds),
        median_ratio=float(np.median(amplitude)),
        worst_ratio=float(amplitude[worst_ratio, int(np.argmax(np.abs(np.log(amplitude[worst_ratio]))))]),
        worst_ratio_speed=float(speeds[worst_ratio]),
        median_phase=float(np.median(lag)),
        worst_phase=float(lag[worst_phase, int(np.argmax(np.abs(lag[worst_phase])))]),
        worst_phase_speed=float(speeds[worst_phase]),
        agrees_to=float(speeds[agreeing - 1]) if agreeing else math.nan,
        within_ratio=float(np.max(np.abs(amplitude[:agreeing] - 1))) if agreeing else math.nan,
        within_phase=float(np.max(late[:agreeing])) if agreeing else math.nan,
    )


def _whirls(summary: RunSummary, prediction_map: PredictionMap) -> tuple[WhirlAgreement, ...]:
    predicted = predicted_whirls(prediction_map)
    measured = _measured_whirls(summary)
    both = []
    for rank in range(max(len(predicted), len(measured))):
        expected = predicted[rank] if rank < len(predicted) else None
        seen = measured[rank] if rank < len(measured) else None
        reached = expected is None or summary.highest_speed >= expected.onset
        both.append(WhirlAgreement(expected, seen, reached))
    return tuple(both)


def _measured_whirls(summary: RunSummary) -> list[WhirlFinding]:
    """Return each forward whirl once, as it began at its lowest speed, in rising order of that speed."""
    known = [one for one in summary.whirls if one.is_forward and math.isfinite(one.begin.speed)]
    kept: list[WhirlFinding] = []
    for one in sorted(known, key=lambda one: one.begin.speed):
        if all(abs(one.order - other.order) >= ORDER_TOLERANCE for other in kept):
            kept.append(one)
    return kept

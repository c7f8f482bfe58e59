"""Comparison of a run with the model: 1X over speed, and onset of oil whirl."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from analysis.live.summary import RunSummary
from analysis.signals.units import ANGLE, NUMBER, PEAK, SPEED
from analysis.whirl.findings import WhirlFinding

if TYPE_CHECKING:  # imports the compiled model, for which schemas need not wait
    from model.prediction.prediction_map import PredictionMap

AMPLITUDE_TOLERANCE = 0.25  # of |ln ratio| between measured and predicted 1X: 28 % more, 22 % less
PHASE_TOLERANCE = math.radians(30)
MIN_AMPLITUDE = 0.2e-6  # m peak: smaller 1X, measured or predicted, is not compared
ORDER_TOLERANCE = 0.1  # orders: closer components at neighbouring speeds are the same whirl


@dataclass(frozen=True, slots=True)
class SynchronousAgreement:
    """Agreement of measured and predicted 1X.

    Ratios are measured over predicted amplitude; phase differences are measured minus predicted lag, rad, positive if
    the measurement lags more. Both probes have equal weight.
    """

    speeds: Annotated[int, NUMBER.of("Number of measured speeds compared")]
    median_ratio: Annotated[float, NUMBER.of("Median of measured over predicted amplitude", "median_amplitude_ratio")]
    worst_ratio: Annotated[
        float, NUMBER.of("The ratio furthest from 1 on a logarithmic scale", "worst_amplitude_ratio")
    ]
    worst_ratio_speed: Annotated[float, SPEED.of("Speed of that ratio", "worst_amplitude_at")]
    median_phase: Annotated[
        float,
        ANGLE.of(
            "Median of measured minus predicted lag; positive where the measurement lags more", "median_lag_difference"
        ),
    ]
    worst_phase: Annotated[float, ANGLE.of("The difference with the largest magnitude", "worst_lag_difference")]
    worst_phase_speed: Annotated[float, SPEED.of("Speed of that difference", "worst_lag_at")]
    agrees_to: Annotated[
        float,
        SPEED.of(
            "Speed up to which, from the lowest compared, every amplitude agrees within a factor of 1.28 and every "
            "lag within 30°; unknown where the lowest speed already does not"
        ),
    ]
    within_ratio: Annotated[
        float, NUMBER.of("Largest distance of a ratio from 1 up to that speed", "within_amplitude_ratio")
    ]
    within_phase: Annotated[
        float, ANGLE.of("Largest magnitude of a lag difference up to that speed", "within_lag_difference")
    ]


@dataclass(frozen=True, slots=True)
class PredictedWhirl:
    """A speed range in which one sub-synchronous component is the strongest in the model.

    Parameters
    ----------
    onset, end : float
        First and last speed of the range, rad/s.
    """

    order: Annotated[
        float, NUMBER.of("Predicted order at onset; unknown where no such whirl is predicted", "predicted_order")
    ]
    onset: Annotated[float, SPEED.of("Predicted onset speed; unknown likewise", "predicted_onset")]
    end: float
    amplitude: Annotated[
        float,
        PEAK.of(
            "Largest predicted amplitude, half the major axis of the ellipse; unknown likewise",
            "predicted_largest_peak",
        ),
    ]


@dataclass(frozen=True, slots=True)
class WhirlAgreement:
    """Predicted and measured whirl of one rank, by rising onset speed.

    Parameters
    ----------
    predicted : PredictedWhirl or None
        None if the model shows fewer whirls than the run within the map.
    measured : WhirlFinding or None
        None if the run shows fewer whirls.
    """

    predicted: PredictedWhirl | None
    measured: WhirlFinding | None
    was_reached: Annotated[
        bool, NUMBER.of("Whether the run reached the predicted onset speed; true where no whirl is predicted")
    ]

    @property
    def onset_ratio(
        self,
    ) -> Annotated[float, NUMBER.of("Measured over predicted onset speed; unknown where one of them is missing")]:
        """Measured over predicted onset speed; NaN if one of both is missing."""
        if self.predicted is None or self.measured is None:
            return math.nan
        return self.measured.onset.speed / self.predicted.onset


@dataclass(frozen=True, slots=True)
class Agreement:
    """Agreement of a run with the model."""

    synchronous: Annotated[
        SynchronousAgreement | None, NUMBER.of("1X over speed; unknown where no measured speed can be compared")
    ]
    whirls: Annotated[tuple[WhirlAgreement, ...], NUMBER.of("Whirls below 1X, by rising onset speed")]
    instability_onset: Annotated[
        float, SPEED.of("Lowest speed at which the predicted 1X motion is unstable; unknown where it is always stable")
    ]


def compare(summary: RunSummary, prediction_map: "PredictionMap") -> Agreement:
    """Compare the summary of a run with the predictions of the model.

    Parameters
    ----------
    summary : RunSummary
        Summary of the run.
    prediction_map : PredictionMap
        Predictions over speed.

    Returns
    -------
    Agreement
        1X over the measured speeds, and whirls matched by their rank in speed.
    """
    return Agreement(
        synchronous=_synchronous(summary, prediction_map),
        whirls=_whirls(summary, prediction_map),
        instability_onset=instability_onset(prediction_map),
    )


def instability_onset(prediction_map: "PredictionMap") -> float:
    """Return the lowest speed at which the synchronous motion becomes unstable, rad/s; NaN if it is stable."""
    growth, speeds = prediction_map.growth_rate, prediction_map.speeds
    unstable = np.flatnonzero(growth > 0)
    if not unstable.size:
        return math.nan
    first = int(unstable[0])
    if first == 0 or not growth[first - 1] <= 0:
        return float(speeds[first])
    part = growth[first - 1] / (growth[first - 1] - growth[first])
    return float(speeds[first - 1] + part * (speeds[first] - speeds[first - 1]))


def predicted_whirls(prediction_map: "PredictionMap") -> tuple[PredictedWhirl, ...]:
    """Return the speed ranges of each whirl of the model, by rising onset speed."""
    found: list[list[int]] = []
    orders = prediction_map.whirl_order
    for index in np.flatnonzero(np.isfinite(orders)):
        for indices in found:
            if abs(orders[index] - orders[indices[-1]]) < ORDER_TOLERANCE:
                indices.append(int(index))
                break
        else:
            found.append([int(index)])
    return tuple(
        PredictedWhirl(
            order=float(orders[indices[0]]),
            onset=float(prediction_map.speeds[indices[0]]),
            end=float(prediction_map.speeds[indices[-1]]),
            amplitude=float(prediction_map.whirl_amplitude[indices].max()),
        )
        for indices in found
    )


def _synchronous(summary: RunSummary, prediction_map: "PredictionMap") -> SynchronousAgreement | None:
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
    log_ratio = np.max(np.abs(np.log(amplitude)), axis=1)
    lag = -np.angle(ratio)
    phase_error = np.max(np.abs(lag), axis=1)
    worst_ratio, worst_phase = int(np.argmax(log_ratio)), int(np.argmax(phase_error))
    disagreeing = np.flatnonzero((log_ratio > AMPLITUDE_TOLERANCE) | (phase_error > PHASE_TOLERANCE))
    agreeing = int(disagreeing[0]) if disagreeing.size else len(speeds)
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
        within_phase=float(np.max(phase_error[:agreeing])) if agreeing else math.nan,
    )


def _whirls(summary: RunSummary, prediction_map: "PredictionMap") -> tuple[WhirlAgreement, ...]:
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
    """Return each forward whirl once, at its lowest onset speed, by rising onset speed."""
    known = [one for one in summary.whirls if one.is_forward and math.isfinite(one.onset.speed)]
    distinct: list[WhirlFinding] = []
    for one in sorted(known, key=lambda one: one.onset.speed):
        if all(abs(one.order - other.order) >= ORDER_TOLERANCE for other in distinct):
            distinct.append(one)
    return distinct

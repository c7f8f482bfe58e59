"""Components below 1X over a run: onset, end, and whether the frequency follows the speed (whirl) or not (whip)."""

from itertools import cycle

import numpy as np

from analysis.signals.units import MICROMETRE, RPM
from analysis.spectra.order_map import order_map
from analysis.whirl.tracks import SubsynchronousTrack, subsynchronous_tracks
from daq.reports.analysis_result import AnalysisResult
from daq.reports.columns import columns
from daq.reports.errors import translated_errors
from daq.reports.kinds.prepared_record import record_over_interval
from daq.reports.parameters import SubSynchronousQuery
from daq.reports.plots.layouts import DISTINCT_COLOURS
from daq.reports.plots.panel import Curve, Panel, Style
from daq.reports.run_samples import RunSamples

GUIDE_ORDERS = (0.5, 1.0)
HIGHEST_ORDER = 2.0  # needed by the search


def analyse_sub_synchronous(run: RunSamples, query: SubSynchronousQuery) -> AnalysisResult:
    """Return the components below 1X in order of onset."""
    prepared = record_over_interval(run, query, HIGHEST_ORDER)
    run.report_progress("computing")
    with translated_errors(f"run {run.header.run}"):
        tracks = subsynchronous_tracks(
            order_map(prepared.record, revolutions=query.revolutions, highest_order=HIGHEST_ORDER)
        )
    title = f"{run.header.run} · components below 1X{prepared.title_suffix} · {prepared.position}"
    return AnalysisResult(
        title=title,
        columns=columns(**_table(tracks)),
        panels=_panels(
            title, tracks, float(prepared.record.speeds.min()) / RPM, float(prepared.record.speeds.max()) / RPM
        ),
        scalars=prepared.scalars,
        remarks=prepared.remarks if tracks else ("no component above the noise", *prepared.remarks),
        representative_rows=np.arange(len(tracks)),
    )


def _table(tracks: tuple[SubsynchronousTrack, ...]) -> dict[str, np.ndarray]:
    largest = [int(np.argmax(track.amplitudes)) for track in tracks]
    numbers: dict[str, list[float]] = {
        "component": [float(k) for k in range(1, len(tracks) + 1)],
        "order": [track.order for track in tracks],
        "order_sigma": [float(track.order_sigma[at]) for track, at in zip(tracks, largest, strict=True)],
        "onset_rpm": [track.onset_speed / RPM for track in tracks],
        "end_rpm": [track.end_speed / RPM for track in tracks],
        "begin_s": [float(track.times[0]) for track in tracks],
        "end_s": [float(track.times[-1]) for track in tracks],
        "largest_peak_um": [
            float(track.amplitudes[at]) / MICROMETRE for track, at in zip(tracks, largest, strict=True)
        ],
        "sigma_peak_um": [
            float(track.sigma[at]) * np.sqrt(2.0) / MICROMETRE for track, at in zip(tracks, largest, strict=True)
        ],
        "largest_at_rpm": [float(track.speeds[at]) / RPM for track, at in zip(tracks, largest, strict=True)],
        "exponent": [track.exponent for track in tracks],
        "exponent_sigma": [track.exponent_sigma for track in tracks],
        "lock_rpm": [track.lock_speed / RPM for track in tracks],
    }
    texts = {
        "direction": ["forward" if track.is_forward else "backward" for track in tracks],
        "behaviour": [track.behaviour.value for track in tracks],
    }
    return {
        **{name: np.array(row, dtype=np.float64) for name, row in numbers.items()},
        **{name: np.array(row, dtype=np.str_) for name, row in texts.items()},
    }


def _panels(title: str, tracks: tuple[SubsynchronousTrack, ...], slowest: float, fastest: float) -> tuple[Panel, ...]:
    frequency, size = [], []
    for number, track in zip(cycle(DISTINCT_COLOURS), tracks, strict=False):
        arrow = "▲" if track.end_speed >= track.onset_speed else "▼"
        name = f"{track.order:.2f}X {track.behaviour.value} {arrow}"
        speeds = (track.speeds / RPM).tolist()
        hertz = (track.orders * track.speeds / (2.0 * np.pi)).tolist()
        frequency.append(Curve(name, speeds, hertz, colour=number))
        size.append(Curve(name, speeds, (track.amplitudes / MICROMETRE).tolist(), colour=number))
    ends = [slowest, fastest]
    guides = [
        Curve(f"{order:g}X", ends, [order * speed / 60.0 for speed in ends], Style.GUIDE) for order in GUIDE_ORDERS
    ]
    caption = "; ".join(_description(track) for track in tracks[:2]) or "no component above the noise"
    return (
        Panel(title, "speed, r/min", "frequency, Hz", (*frequency, *guides), caption),
        Panel(
            "half the major axis", "speed, r/min", "amplitude, µm zero-to-peak", tuple(size), x_range=(slowest, fastest)
        ),
    )


def _description(track: SubsynchronousTrack) -> str:
    exponent = (
        "" if np.isnan(track.exponent) else f", frequency ∝ speed^({track.exponent:.2f} ± {track.exponent_sigma:.2g})"
    )
    return f"{track.order:.2f}X from {track.onset_speed / RPM:,.0f} r/min{exponent}"

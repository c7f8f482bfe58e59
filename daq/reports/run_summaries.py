"""What runs were, as documents: read once, then kept beside the recordings."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Protocol

from pydantic import ValidationError

from analysis.live.delivery import DeliveryStatistics
from analysis.live.summary import RunSummary
from analysis.signals.header import Calibration, RunHeader
from daq.schemas.events import marker_schema
from daq.schemas.summary import SummarySchema, summary_schema
from daq.session.offline import corrected_header, summarise
from daq.session.prediction.predictor import PREDICTION_TIMEOUT
from model.prediction.comparison import compare
from model.prediction.prediction_map import PredictionMap
from recordings.catalogue.catalogue import Catalogue
from recordings.mcap.markers import Marker
from recordings.mcap.reader import RunReader

KEPT_AS = "summary"

ProgressCallback = Callable[[str, float | None], None]
"""Told what goes on, and the part of it that is done, 0 to 1, where that is known."""


class Mapped(Protocol):
    """The model's map of one rig."""

    @property
    def map(self) -> PredictionMap | None:
        """The map; None as long as there is none."""
        ...

    def wait(self, patience: float, on_progress: Callable[[str], None]) -> PredictionMap | None:
        """Return the map when it is there, or None."""
        ...


class Maps(Protocol):
    """The model's maps."""

    def for_run(self, header: RunHeader) -> Mapped:
        """Return the map of the rig of a run."""
        ...


class Summaries:
    """Summaries of the runs of a data folder, with how the model agrees.

    Parameters
    ----------
    catalogue : Catalogue
        The data folder.
    maps : Maps
        The model's.
    read : callable or None
        Sums up the run of a file for whoever asks over REST; None does it here.
    """

    def __init__(self, catalogue: Catalogue, maps: Maps, read: Callable[[Path], RunSummary] | None = None) -> None:
        self._catalogue = catalogue
        self._maps = maps
        self._read = read

    def summary(self, run_id: str) -> SummarySchema:
        """Return a run's summary; the agreement is null as long as the model's map is being computed.

        Raises
        ------
        RecordingError
            There is no such run, or its file cannot be read.
        """
        return self._kept(run_id) or self._made(run_id, None)

    def summary_with_agreement(self, run_id: str, waiting: ProgressCallback) -> SummarySchema:
        """Return a run's summary with the agreement, however long the model takes; `waiting` is told what goes on."""
        return self._kept(run_id) or self._made(run_id, waiting)

    def recalibrated_summary(
        self, run_id: str, calibrations: Mapping[str, Calibration], waiting: ProgressCallback
    ) -> SummarySchema:
        """Return the summary that a run has with other calibrations, by probe; its kept summary stays as it is.

        Raises
        ------
        UsageError
            The run has no probe of a name.
        RecordingError
            There is no such run, or its file cannot be read.
        """
        with RunReader(self._catalogue.path(run_id)) as reader:
            header, delivery = corrected_header(reader.header, calibrations), reader.delivery
            markers = reader.markers()
            predictor = self._maps.for_run(header)
            summary = summarise(reader, partial(waiting, f"analysing {run_id} anew"), header)
        predictor.wait(PREDICTION_TIMEOUT, lambda state: waiting(f"model {state}", None))
        return self.document(summary, header, delivery, markers)

    def document(
        self, summary: RunSummary, header: RunHeader, delivery: DeliveryStatistics, markers: tuple[Marker, ...] = ()
    ) -> SummarySchema:
        """Return a summary with how it agrees with the model of the run's rig, null where its map is not ready."""
        prediction_map = self._maps.for_run(header).map
        agreement = None if prediction_map is None else compare(summary, prediction_map)
        rate = header.acquisition.rate
        return summary_schema(summary, agreement, delivery, tuple(marker_schema(marker, rate) for marker in markers))

    def _kept(self, run_id: str) -> SummarySchema | None:
        document = self._catalogue.load_cached(run_id, KEPT_AS)
        if document is None:
            return None
        try:
            return SummarySchema.model_validate(document)
        except ValidationError:  # kept by another version of the program
            return None

    def _made(self, run_id: str, waiting: ProgressCallback | None) -> SummarySchema:
        with RunReader(self._catalogue.path(run_id)) as reader:
            header, is_complete, delivery = reader.header, reader.is_complete, reader.delivery
            markers = reader.markers()
            told = None if waiting is None else partial(waiting, f"reading {run_id}")
            predictor = self._maps.for_run(header)
            summary = self._read(reader.path) if self._read is not None and waiting is None else summarise(reader, told)
        if waiting is not None:
            predictor.wait(PREDICTION_TIMEOUT, lambda state: waiting(f"model {state}", None))
        document = self.document(summary, header, delivery, markers)
        if is_complete and predictor.map is not None:
            self._catalogue.store_cached(run_id, KEPT_AS, document.model_dump(mode="json"))
        return document

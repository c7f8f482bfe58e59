"""Summaries of recorded runs with the agreement of the model, cached in the catalogue."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from pydantic import ValidationError

from analysis.live.summary import RunSummary
from analysis.signals.blocks import DeliveryStatistics
from analysis.signals.header import Calibration, RunHeader
from daq.reports.analysis_result import ProgressCallback
from daq.schemas.events import marker_schema
from daq.schemas.summary import SummarySchema, summary_schema
from daq.session.offline import corrected_header, summarise
from daq.session.predictor import PREDICTION_TIMEOUT, Predictors
from model.prediction.comparison import compare
from recordings.catalogue.catalogue import Catalogue
from recordings.mcap.reader import RunReader
from recordings.mcap.results import Marker

CACHE_KEY = "summary"


class Summaries:
    """Summaries of the runs of a data folder, with the agreement of the model.

    Parameters
    ----------
    catalogue : Catalogue
        Catalogue of the data folder.
    predictors : Predictors
        Prediction maps of the rigs.
    read : callable or None
        Summarises the run of a file, used where no progress is reported; None: `summarise`.
    """

    def __init__(
        self, catalogue: Catalogue, predictors: Predictors, read: Callable[[Path], RunSummary] | None = None
    ) -> None:
        self._catalogue = catalogue
        self._predictors = predictors
        self._read = read

    def summary(self, run_id: str) -> SummarySchema:
        """Return a run's summary; the agreement is null while the prediction map is being computed.

        Raises
        ------
        RecordingError
            The run does not exist, or its file cannot be read.
        """
        return self._cached(run_id) or self._computed(run_id, None)

    def summary_with_agreement(self, run_id: str, on_progress: ProgressCallback) -> SummarySchema:
        """Return a run's summary with the agreement, after waiting for the prediction map."""
        return self._cached(run_id) or self._computed(run_id, on_progress)

    def recalibrated_summary(
        self, run_id: str, calibrations: Mapping[str, Calibration], on_progress: ProgressCallback
    ) -> SummarySchema:
        """Return a run's summary with other calibrations, by probe; the cached summary stays unchanged.

        Raises
        ------
        UsageError
            The run has no probe of this name.
        RecordingError
            The run does not exist, or its file cannot be read.
        """
        with RunReader(self._catalogue.path(run_id)) as reader:
            header, delivery = corrected_header(reader.header, calibrations), reader.delivery
            markers = reader.markers()
            predictor = self._predictors.for_run(header)
            summary = summarise(reader, partial(on_progress, f"analysing {run_id} again"), header)
        predictor.wait(PREDICTION_TIMEOUT, lambda state: on_progress(f"model {state}", None))
        return self.with_agreement(summary, header, delivery, markers)

    def with_agreement(
        self, summary: RunSummary, header: RunHeader, delivery: DeliveryStatistics, markers: tuple[Marker, ...] = ()
    ) -> SummarySchema:
        """Return the schema of a summary with the agreement of the model, null where the map is not ready."""
        prediction_map = self._predictors.for_run(header).map
        agreement = None if prediction_map is None else compare(summary, prediction_map)
        rate = header.acquisition.rate
        return summary_schema(summary, agreement, delivery, tuple(marker_schema(marker, rate) for marker in markers))

    def _cached(self, run_id: str) -> SummarySchema | None:
        content = self._catalogue.load_cached(run_id, CACHE_KEY)
        if content is None:
            return None
        try:
            return SummarySchema.model_validate(content)
        except ValidationError:  # cached by another version
            return None

    def _computed(self, run_id: str, on_progress: ProgressCallback | None) -> SummarySchema:
        with RunReader(self._catalogue.path(run_id)) as reader:
            header, is_complete, delivery = reader.header, reader.is_complete, reader.delivery
            markers = reader.markers()
            report = None if on_progress is None else partial(on_progress, f"reading {run_id}")
            predictor = self._predictors.for_run(header)
            summary = (
                self._read(reader.path) if self._read is not None and on_progress is None else summarise(reader, report)
            )
        if on_progress is not None:
            predictor.wait(PREDICTION_TIMEOUT, lambda state: on_progress(f"model {state}", None))
        schema = self.with_agreement(summary, header, delivery, markers)
        if is_complete and predictor.map is not None:
            self._catalogue.store_cached(run_id, CACHE_KEY, schema.model_dump(mode="json"))
        return schema

"""A service over a data folder with a recording of the simulated card, and a client for it."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import httpx

from analysis.signals.header import RunHeader
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.reports.run_summaries import Summaries
from daq.service.app import create_app
from daq.service.jobs.queue import JobQueue
from daq.service.results_reader import ResultsReader
from daq.service.server import ServiceServer
from daq.service.state import ServiceState
from daq.session.predictor import Predictors
from daq.session.recording.recorder import RecordingRequest, run_header
from daq.session.run import RunManager
from model.errors import ParameterError
from model.prediction.prediction_map import Prediction
from recordings.catalogue.catalogue import Catalogue
from recordings.mcap.writer import write_run
from tests.daq.support.live_updates import make_prediction
from tests.daq.support.service_fakes import FakeLive

RUN = "2026-11-24T09-12-07-test-rig"
API = "/api/v1"
MAX_MODEL_RPM = 20_000.0  # r/min, end of the model's map


def record_run(rig: Rig, folder: Path, run: str = RUN) -> Path:
    """Record a simulated run with its results into a folder; return its file."""
    path = folder / f"{run}.mcap"
    request = RecordingRequest(rig, run, 1_795_000_000_000_000_000, "first light", "rig test", path, None)
    with closing(open_source(rig)) as source:
        write_run(path, run_header(request, source), source.blocks(), {})
    return path


class ReadyModel(Predictors):
    """A model with predictions up to 20,000 r/min."""

    def prediction_for(self, header: RunHeader, speed: float) -> Prediction | None:
        if speed * 30 / 3.141592653589793 > MAX_MODEL_RPM:
            raise ParameterError(f"speed: {speed:g} rad/s, expected less")
        return make_prediction(speed, header.settings)


class DefectiveModel(Predictors):
    """A model with a defect of its own: a ValueError that no request and no recording causes."""

    def prediction_for(self, header: RunHeader, speed: float) -> Prediction | None:
        raise ValueError(f"secret inside {header.run} at {speed:g}")


@dataclass
class RecordedBench:
    """A data folder, the service over it, and a client."""

    folder: Path
    live: FakeLive
    client: httpx.Client
    close: Callable[[], None]

    def get(self, tail: str, headers: dict[str, str] | None = None, /, **parameters: str | float) -> httpx.Response:
        """Send a GET request below the path of the recorded run."""
        return self.client.get(f"{API}/runs/{RUN}{tail}", params=parameters, headers=headers)


def open_recorded_bench(
    folder: Path,
    *,
    host: str = "127.0.0.1",
    token: str | None = None,
    origins: tuple[str, ...] = (),
    run_manager: RunManager | None = None,
    job_limit: float = 600.0,
    request_limit: float = 100.0,
    model: Predictors | None = None,
) -> RecordedBench:
    """Start a service over a folder at a free local port, with the access rules of a service bound to ``host``."""
    catalogue, live, predictors = Catalogue(folder), FakeLive(), Predictors()
    results = ResultsReader(model or ReadyModel(), time_limit=request_limit)
    jobs = JobQueue(Catalogue(folder), time_limit=job_limit)
    state = ServiceState(catalogue, live, Summaries(catalogue, predictors, results.summary), results, jobs, run_manager)
    app = create_app(state, host=host, token=token, cors_origins=origins)
    server = ServiceServer(app, closing=state.closing)
    server.start()
    client = httpx.Client(base_url=server.url, timeout=120.0)

    def close() -> None:
        client.close()
        server.close()
        jobs.close()
        results.close()
        predictors.close()

    return RecordedBench(folder, live, client, close)

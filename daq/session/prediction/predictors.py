"""The predictions for recorded runs: one predictor for every set of parameters that their rigs ask for."""

import threading
from types import TracebackType
from typing import Self

from analysis.signals.header import AnalysisSettings, Limits, RunHeader
from daq.config.loader import read_recorded_config
from daq.config.rig import Rig
from daq.config.rotor import model_parameters
from daq.session.prediction.predictor import Predictor
from model.prediction.prediction_map import Prediction, default_map_speeds, prediction_map_key
from model.rotor.parameters import ModelParameters

PATIENCE = 120.0  # s between two words of a computation before it is given up


class Predictors:
    """Predictors by what they compute; each is started when it is first asked for and lives until `close`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._by_key: dict[str, Predictor] = {}

    def for_rig(self, rig: Rig) -> Predictor:
        """Return the predictor for a rig."""
        return self._for(model_parameters(rig.config), rig.settings, rig.limits)

    def for_run(self, header: RunHeader) -> Predictor:
        """Return the predictor for the rig of a run, as its configuration was then."""
        config = read_recorded_config(header.config_toml, f"configuration of run {header.run}")
        return self._for(model_parameters(config), header.settings, header.limits)

    def prediction_for(self, header: RunHeader, speed: float) -> Prediction | None:
        """Return what the model says of a run's rig at a speed, rad/s, at once.

        Raises
        ------
        ValueError
            The speed lies outside the rig's map.
        """
        known = self.for_run(header).map
        return None if known is None else known.at(speed)

    def _for(self, parameters: ModelParameters, settings: AnalysisSettings, limits: Limits) -> Predictor:
        speeds = default_map_speeds(limits.speed)
        key = prediction_map_key(parameters, speeds, settings)
        with self._lock:
            if key not in self._by_key:
                self._by_key[key] = Predictor(parameters, settings, speeds)
            return self._by_key[key]

    def close(self) -> None:
        """End them all."""
        with self._lock:
            for predictor in self._by_key.values():
                predictor.close()
            self._by_key.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()

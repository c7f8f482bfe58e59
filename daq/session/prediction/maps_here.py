"""The model's maps for work that has a process of its own: from the cache, or computed in this very process."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial

from analysis.signals.header import AnalysisSettings, Limits, RunHeader
from daq.config.load import read_config
from daq.config.rotor import configured_rotor
from daq.session.prediction.kept_maps import cache_folder, kept_or_computed, map_file, read_map
from model.errors import ModelError
from model.prediction.prediction_map import PredictionMap, compute_prediction_map, default_speeds, model_key
from model.rotor.parameters import ModelParameters


class MapHere:
    """One rig's map.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    settings : AnalysisSettings
        The measurement's.
    limits : Limits
        The rig's; the map goes up to its speed.
    """

    def __init__(self, parameters: ModelParameters, settings: AnalysisSettings, limits: Limits) -> None:
        self._parameters = parameters
        self._settings = settings
        self._speeds = default_speeds(limits.speed)
        self._file = map_file(cache_folder(), model_key(parameters, self._speeds, settings))
        self._map, _ = read_map(self._file)

    @property
    def map(self) -> PredictionMap | None:
        """The map; None until it was computed."""
        return self._map

    def computed(self, on_progress: Callable[[int, int], None]) -> PredictionMap:
        """Return the map, computed and kept where it has not been; where another process does so, wait for that.

        Parameters
        ----------
        on_progress : callable
            Told the number of speeds done and of all.

        Raises
        ------
        ModelError, ValueError
            The motion cannot be computed.
        """
        if self._map is None:
            self._map = kept_or_computed(
                self._file, partial(compute_prediction_map, self._parameters, self._speeds, self._settings), on_progress
            )
        return self._map

    def wait(self, _patience: float, on_progress: Callable[[str], None]) -> PredictionMap | None:
        """Compute the map here, as `Predictor.wait` waits for it; None where the model gives none."""
        with suppress(ModelError, ValueError):
            return self.computed(lambda done, total: on_progress(f"computing {100 * done // total} %"))
        return None


class MapsHere:
    """Maps by the rigs of runs."""

    def __init__(self) -> None:
        self._by_run: dict[str, MapHere] = {}

    def of(self, header: RunHeader) -> MapHere:
        """Return the map for the rig of a run, as its configuration was then."""
        if header.run not in self._by_run:
            config = read_config(header.config_toml, f"configuration of run {header.run}")
            self._by_run[header.run] = MapHere(configured_rotor(config), header.settings, header.limits)
        return self._by_run[header.run]

"""Import job: converts an uploaded file of another program into a run."""

from pathlib import Path

from analysis.signals.header import RunHeader
from daq.config.calibration import to_calibration
from daq.config.loader import parse_rig, read_recorded_config
from daq.config.rig import Rig
from daq.config.toml_files import to_toml
from daq.errors import ConfigError
from daq.schemas.runs import run_schema
from daq.service.jobs.execution import fraction_reporter, write_json
from daq.service.jobs.queue import CatalogueLocation, Progress, ReportProgress, Task
from daq.service.schemas.uploads import ImportRequest, RigFromToml
from daq.service.uploads import Upload
from daq.session.import_run import IMPORTED_BACKEND, ForeignFile, require_mapping_fits, write_imported_run
from daq.session.offline import with_reference_runout
from recordings.catalogue.catalogue import SUFFIX, Catalogue
from recordings.errors import ForeignFormatError

MAPPING = "mapping"


def import_task(request: ImportRequest, upload: Upload, rig: Rig, location: CatalogueLocation) -> Task:
    """Return the task of an import request; ConfigError if the mapping lacks a channel of the rig."""
    columns = request.mapping.model_dump(mode="json", exclude_none=True)
    foreign = ForeignFile(
        upload.path, upload.name, request.mapping, MAPPING, to_toml({"rig": rig.config.rig, **columns})
    )
    require_mapping_fits(foreign, rig)
    return Task(request.kind, f"import of {upload.name}", "", import_job, (location, foreign, rig), "run.json")


def import_job(
    report: ReportProgress, target: Path, location: CatalogueLocation, foreign: ForeignFile, rig: Rig
) -> None:
    """Convert a file into a run and write the run's schema."""
    report(Progress("reading"))
    catalogue = location.catalogue()
    try:
        rig = with_reference_runout(_check_runout_source(rig, catalogue), catalogue.folder)
        run, _ = write_imported_run(
            foreign, rig, catalogue, target.parent, fraction_reporter(report, "writing and analysing")
        )
    except ForeignFormatError as error:
        raise ForeignFormatError(str(error).replace(str(foreign.path), foreign.name)) from error
    write_json(target, run_schema(catalogue.run(run)))


def rig_of_run(header: RunHeader) -> Rig:
    """Return the rig of a run with its configuration and calibrations at the time of recording.

    Raises
    ------
    ConfigError
        The run was imported. If its samples were displacements, its calibrations are not those of the rig.
    """
    name = f"run {header.run}"
    if header.acquisition.device.backend == IMPORTED_BACKEND:
        raise ConfigError(name, ["was imported: expected a recorded run, or the rig as TOML"])
    channels = header.acquisition.channels
    calibrations = {channel.name: channel.calibration for channel in channels if channel.calibration is not None}
    return Rig(Path(name), read_recorded_config(header.config_toml, name), calibrations)


def rig_from_toml(text: RigFromToml) -> Rig:
    """Return the rig of a TOML text; ConfigError if it is invalid."""
    calibrations = {name: to_calibration(record, f"calibrations.{name}") for name, record in text.calibrations.items()}
    return parse_rig(text.toml, calibrations, "toml")


def _check_runout_source(rig: Rig, catalogue: Catalogue) -> Rig:
    """Return the rig unchanged if its run-out comes from no run or one of the data folder, never from a path."""
    name = rig.config.runout.from_run
    if name.endswith(SUFFIX):
        raise ConfigError("runout.from_run", [f"{name!r}: expected the id of a run, not a file"])
    if name:
        catalogue.path(name)
    return rig

"""Another program's file made into a run, as a job."""

from pathlib import Path

from analysis.signals.header import RunHeader
from daq.config.calibration import to_calibration
from daq.config.loader import parse_rig, read_recorded_config
from daq.config.rig import Rig
from daq.config.toml_files import to_toml
from daq.errors import ConfigError
from daq.schemas.runs import run_schema
from daq.service.jobs.execution import parts_told
from daq.service.jobs.queue import CatalogueLocation, Progress, ReportProgress, Task
from daq.service.schemas.importing import ImportRequest, RigFromToml
from daq.service.uploads import Upload
from daq.session.import_run import IMPORTED_BACKEND, ForeignFile, require_mapping_fits, write_imported_run
from daq.session.runout_reference import with_reference_runout
from recordings.catalogue.catalogue import SUFFIX, Catalogue
from recordings.errors import ForeignFormatError

MAPPING = "mapping"


def import_task(request: ImportRequest, upload: Upload, rig: Rig, location: CatalogueLocation) -> Task:
    """Return what an order is to do; ConfigError where the mapping does not give what the rig needs."""
    columns = request.mapping.model_dump(mode="json", exclude_none=True)
    foreign = ForeignFile(
        upload.path, upload.name, request.mapping, MAPPING, to_toml({"rig": rig.config.rig, **columns})
    )
    require_mapping_fits(foreign, rig)
    return Task(request.kind, f"import of {upload.name}", "", import_upload, (location, foreign, rig), "run.json")


def import_upload(
    tell: ReportProgress, target: Path, location: CatalogueLocation, foreign: ForeignFile, rig: Rig
) -> None:
    """Make a file into a run and tell which."""
    tell(Progress("reading"))
    catalogue = location.catalogue()
    try:
        rig = with_reference_runout(_without_paths(rig, catalogue), catalogue.folder)
        run, _ = write_imported_run(foreign, rig, catalogue, target.parent, parts_told(tell, "writing and analysing"))
    except ForeignFormatError as error:
        raise ForeignFormatError(str(error).replace(str(foreign.path), foreign.name)) from error
    target.write_text(run_schema(catalogue.run(run)).model_dump_json(), encoding="utf-8")


def rig_of_run(header: RunHeader) -> Rig:
    """Return the rig of a run as it was then.

    Raises
    ------
    ConfigError
        The run was imported: where its samples were displacements already, its calibrations are none of the rig's.
    """
    name = f"run {header.run}"
    if header.acquisition.device.backend == IMPORTED_BACKEND:
        raise ConfigError(name, ["was imported itself: expected a run that was recorded, or the rig in text"])
    channels = header.acquisition.channels
    calibrations = {channel.name: channel.calibration for channel in channels if channel.calibration is not None}
    return Rig(Path(name), read_recorded_config(header.config_toml, name), calibrations, header.config_toml)


def rig_of_text(text: RigFromToml) -> Rig:
    """Return the rig in a text; ConfigError where it is wrong."""
    given = {name: to_calibration(record, f"calibrations.{name}") for name, record in text.calibrations.items()}
    return parse_rig(text.toml, given, "toml")


def _without_paths(rig: Rig, catalogue: Catalogue) -> Rig:
    """Return a rig whose run-out is of no run or of one of the data folder: no path of a request reaches the disk."""
    name = rig.config.runout.from_run
    if name.endswith(SUFFIX):
        raise ConfigError("runout.from_run", [f"{name!r}: expected the id of a run, no file"])
    if name:
        catalogue.path(name)
    return rig

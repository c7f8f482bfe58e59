"""Search criteria for runs, and their SQL condition."""

from dataclasses import dataclass

from sqlalchemy import ColumnElement, and_, exists, or_

from analysis.signals.units import RPM
from recordings.catalogue.tables import FINDING, MARKER, RUN, TAG


@dataclass(frozen=True, slots=True)
class Search:
    """Search criteria; a run must meet all that are given.

    Only runs that are indexed with their summary have speeds and findings.

    Parameters
    ----------
    started_from_ns, started_before_ns : int or None
        Start of the run, ns since 1970: from, and before.
    speed_low, speed_high : float or None
        The run reached a speed within this range, rad/s.
    text : str
        Words that must all occur in id, rig, note, remark or markers, in any case.
    tags : tuple of str
        Tags that the run must all have.
    onset_below : float or None
        A sub-synchronous component began below this speed, rad/s.
    is_complete : bool or None
        Whether the run was finished properly.
    rig : str
        Name of the rig.
    serial : str
        Serial number of the device.
    calibration : str
        `calibration_identity` of the probes' calibrations, or its first digits.
    """

    started_from_ns: int | None = None
    started_before_ns: int | None = None
    speed_low: float | None = None
    speed_high: float | None = None
    text: str = ""
    tags: tuple[str, ...] = ()
    onset_below: float | None = None
    is_complete: bool | None = None
    rig: str = ""
    serial: str = ""
    calibration: str = ""


def search_condition(search: Search) -> ColumnElement[bool]:
    """Return the criteria as an SQL condition on a row of the run table."""
    terms: list[ColumnElement[bool]] = [RUN.c.id == RUN.c.id]
    if search.started_from_ns is not None:
        terms.append(RUN.c.started_ns >= search.started_from_ns)
    if search.started_before_ns is not None:
        terms.append(RUN.c.started_ns < search.started_before_ns)
    if search.speed_low is not None:
        terms.append(RUN.c.highest_speed_rpm >= search.speed_low / RPM)
    if search.speed_high is not None:
        terms.append(RUN.c.lowest_speed_rpm <= search.speed_high / RPM)
    if search.is_complete is not None:
        terms.append(RUN.c.is_complete == search.is_complete)
    terms += [column == name for column, name in ((RUN.c.rig, search.rig), (RUN.c.serial, search.serial)) if name]
    if search.calibration:
        terms.append(RUN.c.calibration.startswith(search.calibration, autoescape=True))
    text_columns = (RUN.c.id, RUN.c.rig, RUN.c.note, RUN.c.remark)
    for word in search.text.split():
        in_markers = exists().where(
            MARKER.c.folder == RUN.c.folder, MARKER.c.id == RUN.c.id, MARKER.c.text.icontains(word, autoescape=True)
        )
        terms.append(or_(in_markers, *(column.icontains(word, autoescape=True) for column in text_columns)))
    terms += [
        exists().where(TAG.c.folder == RUN.c.folder, TAG.c.id == RUN.c.id, TAG.c.tag == tag) for tag in search.tags
    ]
    if search.onset_below is not None:
        onset = FINDING.c.onset_rpm < search.onset_below / RPM
        terms.append(exists().where(FINDING.c.folder == RUN.c.folder, FINDING.c.id == RUN.c.id, onset))
    return and_(*terms)

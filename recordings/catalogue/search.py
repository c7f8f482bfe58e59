"""Questions to the catalogue."""

import math
from dataclasses import dataclass

from sqlalchemy import ColumnElement, and_, exists, or_

from recordings.catalogue.tables import FINDING, MARK, RUN, TAG

RPM = 2 * math.pi / 60


@dataclass(frozen=True, slots=True)
class Search:
    """What runs are wanted; all that is given must hold.

    Speeds and findings are known of runs that have been indexed with their summary.

    Parameters
    ----------
    started_from_ns, started_before_ns : int or None
        When the run began, ns since 1970.
    speed_low, speed_high : float or None
        The run went through some speed of this range, rad/s.
    text : str
        Words that all stand somewhere in id, rig, note, remark or a marker, whatever their case.
    tags : tuple of str
        Tags that it all has.
    onset_below : float or None
        A sub-synchronous component began below this speed, rad/s.
    is_complete : bool or None
        Whether the run was finished properly.
    rig : str
        Name of the rig.
    serial : str
        Serial number of the device.
    calibration : str
        Identity of the probes' calibrations (`recordings.catalogue.entry`), or its first digits.
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


def condition(search: Search) -> ColumnElement[bool]:
    """Return the search as a condition on a row of the table of runs."""
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
    searched = (RUN.c.id, RUN.c.rig, RUN.c.note, RUN.c.remark)
    for word in search.text.split():
        named = exists().where(
            MARK.c.folder == RUN.c.folder, MARK.c.id == RUN.c.id, MARK.c.text.icontains(word, autoescape=True)
        )
        terms.append(or_(named, *(column.icontains(word, autoescape=True) for column in searched)))
    terms += [
        exists().where(TAG.c.folder == RUN.c.folder, TAG.c.id == RUN.c.id, TAG.c.tag == tag) for tag in search.tags
    ]
    if search.onset_below is not None:
        onset = FINDING.c.onset_rpm < search.onset_below / RPM
        terms.append(exists().where(FINDING.c.folder == RUN.c.folder, FINDING.c.id == RUN.c.id, onset))
    return and_(*terms)

"""Headers survive a round trip through JSON; invalid JSON is reported with its key."""

import json
import math
from copy import deepcopy
from dataclasses import replace
from typing import Any

import pytest

from analysis.signals.header import RunHeader, RunOutSettings, WindowName
from recordings.errors import DamagedError
from recordings.mcap.header import header_from_json, to_json


def test_header_survives_a_json_round_trip_bit_for_bit(header: RunHeader) -> None:
    text = json.dumps(to_json(header), allow_nan=False)
    assert header_from_json(json.loads(text)) == header


def test_header_of_an_older_file_has_no_target_and_operator(header: RunHeader) -> None:
    document = to_json(header)
    calibration = document["acquisition"]["channels"][0]["calibration"]
    assert calibration.pop("target") == "42CrMo4, diameter 10 mm"
    assert calibration.pop("operator") == "M. Curie"
    old = header_from_json(document).acquisition.channels[0].calibration
    assert old is not None
    assert (old.target, old.operator) == ("", "")


def test_open_gap_windows_are_read_as_infinite(header: RunHeader) -> None:
    tacho = header_from_json(to_json(header)).acquisition.channels[2]
    assert (tacho.gap_low, tacho.gap_high) == (-math.inf, math.inf)


def test_numeric_keys_have_a_unit_suffix(header: RunHeader) -> None:
    document = to_json(header)
    units = ("_s", "_m", "_v", "_hz", "_rad", "_ns", "_rad_per_s", "_to_k")
    fractions = {"mark_fraction", "hysteresis_fraction"}
    plain = {"revolutions", "points_per_revolution", "highest_order", "orbit_revolutions"} | fractions
    counts = {"pulses_per_revolution", "buffer_samples"}

    def check(part: Any) -> None:
        for key, value in part.items():
            if isinstance(value, dict):
                check(value)
            elif isinstance(value, list) and (not value or isinstance(value[0], dict)):
                for entry in value:
                    check(entry)
            elif isinstance(value, int | float | list) and not isinstance(value, bool):
                assert key.endswith(units) or key in plain | counts, key

    check(document)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (
            ("analysis", "window"),
            "kaiser",
            r"header\.analysis\.window: 'kaiser', expected one of hann, flat top, uniform",
        ),
        (("run",), 3, r"header\.run: 3, expected a string"),
        (("started_ns",), 1.5, r"header\.started_ns: 1\.5, expected an integer"),
        (("acquisition", "rate_hz"), "fast", r"header\.acquisition\.rate_hz: 'fast', expected a number"),
        (("acquisition", "channels"), {}, r"header\.acquisition\.channels: \{\}, expected a list"),
        (("acquisition", "channels", 1, "role"), "z", r"channels\[1\]\.role: 'z', expected one of probe_x, probe_y"),
        (("acquisition", "device", "simulated"), 0, r"device\.simulated: 0, expected true or false"),
        (("acquisition", "tacho"), [], r"header\.acquisition\.tacho: \[\], expected an object"),
        (("limits", "clearance_m"), True, r"header\.limits\.clearance_m: True, expected a number"),
    ],
)
def test_invalid_value_is_reported_with_its_key(
    header: RunHeader, path: tuple[str | int, ...], value: object, message: str
) -> None:
    document = deepcopy(to_json(header))
    part: Any = document
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    with pytest.raises(DamagedError, match=message):
        header_from_json(document)


def test_missing_key_is_reported(header: RunHeader) -> None:
    document = to_json(header)
    del document["acquisition"]["tacho"]["edge"]
    with pytest.raises(DamagedError, match=r"header\.acquisition\.tacho: edge is missing"):
        header_from_json(document)


def test_headers_with_different_notes_are_unequal(header: RunHeader) -> None:
    other = replace(header, note="warm")
    assert header_from_json(to_json(other)) == other != header


def test_run_out_survives_a_round_trip_bit_for_bit(header: RunHeader) -> None:
    vectors = ((1, 1e-6 / 3 + 1e-7j, -1e-6j / 7), (3, 1e-7 + 0j, complex(-0.0, 1e-8 / 3)))
    runout = RunOutSettings(60.0, vectors, (1e-8 / 3, 0.0), "run 2026-11-20T08-00-00-gj90c", from_orbit=True)
    original = replace(header, settings=replace(header.settings, runout=runout))
    assert header_from_json(json.loads(json.dumps(to_json(original)))) == original


def test_window_survives_a_round_trip_and_hann_is_not_written(header: RunHeader) -> None:
    assert "window" not in to_json(header)["analysis"]
    original = replace(header, settings=replace(header.settings, window=WindowName.FLAT_TOP))
    document = json.loads(json.dumps(to_json(original)))
    assert document["analysis"]["window"] == "flat top"
    assert header_from_json(document) == original


def test_monitored_limits_survive_a_round_trip_and_others_are_not_written(header: RunHeader) -> None:
    limits = replace(header.limits, order_1x_alarm=1e-4 / 3, below_1x_danger=2e-5 / 7, speed_danger=6283.185307179586)
    original = replace(header, limits=limits)
    document = json.loads(json.dumps(to_json(original)))
    assert header_from_json(document) == original
    assert "order_1x_peak_danger_m" not in document["limits"]
    assert document["limits"]["speed_danger_rad_per_s"] == 6283.185307179586


def test_header_of_an_older_file_has_no_run_out_and_default_alarms(header: RunHeader) -> None:
    document = to_json(replace(header, limits=replace(header.limits, hold=3.0)))
    del document["analysis"]["runout"]
    for key in ("hysteresis_fraction", "hold_s", "latch"):
        del document["limits"][key]
    read = header_from_json(document)
    assert not read.settings.runout.is_enabled
    assert (read.limits.hysteresis, read.limits.hold, read.limits.latch) == (0.05, 1.0, True)

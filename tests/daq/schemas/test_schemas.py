"""Schemas: units, phase lag, null for unknown values, valid JSON."""

import importlib
import json
import math
import pkgutil
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Literal, get_origin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, ValidationError
from pydantic.fields import FieldInfo

from analysis.live.summary import ProbeSummary, RunSummary
from analysis.signals import FloatArray
from analysis.signals.snapshot import OVERALL, Snapshot, Whirl
from analysis.signals.units import MICROMETRE, PEAK_TO_PEAK, RPM, SPEED, phase_lag_degrees, readings
from analysis.vectors.speed_curve import SpeedRow
from daq import schemas
from daq.schemas.events import AcknowledgeRequest
from daq.schemas.live import MeasurementSchema, live_schema
from daq.schemas.runs import RunSchema, run_schema
from daq.schemas.summary import ProbeSummarySchema, SpeedRowSchema, SummarySchema, summary_schema
from daq.schemas.units import Number, Schema, finite, lag_degrees, micrometres, rpm, utc_time
from daq.schemas.vibration import OverallRangeQuery
from daq.session.live_update import LiveUpdate
from recordings.catalogue.entry import RunEntry
from tests.daq.support.live_updates import make_live_updates
from tests.daq.support.service_fakes import make_agreement, make_entries, make_summary

UPDATE = make_live_updates(200)[150]
ANY = st.floats(allow_nan=True, allow_infinity=True)


def strict(text: str) -> object:
    """What JSON says; a NaN or an infinity is none."""

    def refuse(word: str) -> object:
        raise ValueError(word)

    return json.loads(text, parse_constant=refuse)


def test_units_convert_from_si() -> None:
    assert micrometres(12.34567e-6) == 12.3457
    assert rpm(1000.0 * RPM) == 1000.0
    assert utc_time(1_795_511_527_250_000_999).isoformat() == "2026-11-24T09:12:07.250000+00:00"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_units_convert_non_finite_values_to_none(value: float) -> None:
    assert (finite(value), micrometres(value), rpm(value), lag_degrees(complex(value, 1.0))) == (None,) * 4


@pytest.mark.parametrize(("angle", "lag"), [(-90.0, 90.0), (90.0, 270.0), (0.0, 0.0), (180.0, 180.0), (1e-9, 0.0)])
def test_lag_is_minus_the_argument_from_0_up_to_360(angle: float, lag: float) -> None:
    assert lag_degrees(np.exp(1j * math.radians(angle))) == pytest.approx(lag)


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_lag_never_reaches_360(real: float, imaginary: float) -> None:
    lag = lag_degrees(complex(real, imaginary))
    assert lag is None or 0.0 <= lag < 360.0


@pytest.mark.parametrize("content", [[{}], "text", 1, True, None])
def test_schema_without_fields_refuses_json_that_is_no_object(content: object) -> None:
    with pytest.raises(ValidationError):
        AcknowledgeRequest.model_validate(content)


def test_zero_vector_has_no_lag() -> None:
    assert lag_degrees(0j) is None


def test_live_schema_converts_measurement_to_field_units() -> None:
    snapshot = UPDATE.snapshot
    assert snapshot is not None
    assert snapshot.frame is not None
    measured = live_schema(UPDATE).measured
    assert measured is not None
    assert measured.order_1x is not None
    vector = snapshot.frame.vectors[0, 1]
    assert measured.speed_rpm == pytest.approx(snapshot.speed / RPM, abs=1e-4)
    assert measured.order_1x.amplitude_peak_y_um == pytest.approx(abs(vector) / MICROMETRE, abs=1e-4)
    assert measured.order_1x.lag_y_deg == pytest.approx(phase_lag_degrees(vector), abs=1e-4)
    assert measured.peak_to_peak_x_um == pytest.approx(snapshot.peak_to_peak[0] / MICROMETRE, abs=1e-4)
    assert measured.probe_x.gap_v == 5.1


def test_live_schema_contains_whirl_frequency_amplitude_and_direction() -> None:
    snapshot = UPDATE.snapshot
    assert snapshot is not None
    assert snapshot.frame is not None
    backward = Whirl(0.5, 1e-6, 3e-6, np.zeros(2, dtype=np.complex128))
    update = replace(
        UPDATE, snapshot=replace(snapshot, frame=replace(snapshot.frame, whirls=(backward,), speed=6000.0 * RPM))
    )
    measured = live_schema(update).measured
    assert measured is not None
    assert measured.whirl is not None
    assert measured.whirl.frequency_hz == pytest.approx(50.0)
    assert measured.whirl.amplitude_peak_um == pytest.approx(4.0)
    assert measured.whirl.direction == "backward"


def test_live_schema_before_first_result_has_null_measurement() -> None:
    document = live_schema(LiveUpdate(UPDATE.header, UPDATE.status))
    assert document.measured is None
    assert document.predicted is None
    assert document.status.samples == UPDATE.status.samples


@given(ANY, ANY, ANY, ANY)
def test_live_schema_is_valid_json_for_any_numbers(speed: float, level: float, real: float, order: float) -> None:
    snapshot, prediction = UPDATE.snapshot, UPDATE.prediction
    assert snapshot is not None
    assert snapshot.frame is not None
    assert prediction is not None
    vectors = np.array([[complex(real, level), complex(level, real)]] * 2)
    whirl = Whirl(order, level, real, vectors[0])
    update = LiveUpdate(
        UPDATE.header,
        replace(UPDATE.status, backlog=level, disk_left=speed),
        replace(
            snapshot,
            speed=speed,
            gap_volts=np.array([level, real]),
            overall=np.array([[real, level]] * len(OVERALL.rows)),
            frame=replace(snapshot.frame, speed=speed, vectors=vectors, whirls=(whirl,), noise=level),
        ),
        replace(prediction, speed=speed, vectors=vectors, whirl_order=order, whirl_amplitude=level, growth_rate=real),
    )
    with np.errstate(over="ignore", invalid="ignore"):
        document = live_schema(update)
    assert strict(document.model_dump_json()) == document.model_dump(mode="json")


def test_summary_schema_has_null_for_unknown_values_and_is_valid_json() -> None:
    document = summary_schema(make_summary())
    assert document.highest_speed_rpm is None
    assert document.probes[1].gap_mean_v is None
    assert document.probes[1].largest_at is None
    assert document.tacho is not None
    assert document.tacho.jitter_us is None
    assert document.by_speed[0].whirl_order is None
    assert document.by_speed[0].whirl_peak_um is None
    assert document.by_speed[0].order_2x.amplitude_peak_y_um is None
    assert strict(document.model_dump_json()) == document.model_dump(mode="json")


def test_summary_schema_contains_agreement_with_model() -> None:
    agreement = summary_schema(make_summary(), make_agreement()).agreement
    assert agreement is not None
    assert agreement.synchronous is not None
    assert agreement.synchronous.agrees_to_rpm == pytest.approx(14_000.0)
    assert agreement.synchronous.worst_lag_difference_deg == pytest.approx(-24.0)
    seen, missed = agreement.whirls
    assert (seen.predicted_order, seen.measured_order) == (0.7, 0.49)
    assert seen.onset_ratio == pytest.approx(10_980.0 / 9500.0, abs=1e-4)
    assert (missed.was_reached, missed.measured_onset_rpm, missed.onset_ratio) == (False, None, None)
    assert agreement.instability_onset_rpm is None


def test_summary_schema_without_prediction_has_no_agreement() -> None:
    assert summary_schema(make_summary()).agreement is None


def test_summary_schema_round_trips_through_json() -> None:
    document = summary_schema(make_summary(), make_agreement())
    assert type(document).model_validate_json(document.model_dump_json()) == document
    assert type(document).model_validate(document.model_dump(mode="json")) == document


def test_summary_schema_flags_lost_samples_as_lower_bound() -> None:
    document = summary_schema(make_summary())
    assert (document.is_gap_free, document.lost_samples, document.lost_is_exact) == (False, 2000, False)
    assert document.segments[0].end_reason == "overrun"
    assert document.segments[0].detail == "driver code -200279"


def test_run_schema_of_unreadable_file_has_fault_and_null_values() -> None:
    document = run_schema(make_entries()[-1])
    assert document.fault
    assert {document.rig, document.note, document.device, document.duration_s, document.samples} == {None}


SCHEMAS = [importlib.import_module(module.name) for module in pkgutil.iter_modules(schemas.__path__, "daq.schemas.")]
UNITS = {"rpm": "r/min", "um": "µm", "deg": "degrees", "s": "s", "us": "µs", "hz": "Hz", "v": "V", "ppm": "ppm"}


def all_fields(base: type[Schema] = Schema) -> Iterator[tuple[str, FieldInfo]]:
    """Names with class, and fields, of all schemas."""
    for schema in base.__subclasses__():
        for name, field in schema.model_fields.items():
            yield f"{schema.__name__}.{name}", field
        yield from all_fields(schema)


@pytest.mark.parametrize(("name", "field"), dict(all_fields()).items())
def test_field_has_a_description_with_the_unit_of_its_suffix(name: str, field: FieldInfo) -> None:
    is_choice_or_part = get_origin(field.annotation) is Literal or "Schema" in str(field.annotation)
    assert field.description or is_choice_or_part
    suffix = name.rpartition("_")[2]
    if suffix in UNITS and not name.endswith("rad_s"):
        assert re.search(rf"(?<!\w){re.escape(UNITS[suffix])}(?!\w)", field.description or "")


@dataclass(frozen=True)
class Measured:
    """A result."""

    fastest: Annotated[float, SPEED.of("Highest speed; unknown at rest", "highest_speed")]
    levels: Annotated[FloatArray, PEAK_TO_PEAK.of("Overall vibration", at_probes=True)]
    samples: int = 3


class MeasuredSchema(Schema, of=(Measured,)):
    """Its schema."""

    highest_speed_rpm: Number = Field(examples=[1000.0])
    levels_x_um: Number = Field()
    levels_y_um: Number = Field()
    samples: int = Field(description="Samples")


class PartsSchema(Schema):
    """A schema of results."""

    parts: tuple[MeasuredSchema, ...] = Field(description="Results")


def test_schema_takes_unit_conversion_and_description_of_a_field_from_its_quantity() -> None:
    measured = Measured(1000.0 * RPM, np.array([2e-6, math.nan]))
    schema = MeasuredSchema.of(measured)
    assert schema.model_dump() == {"highest_speed_rpm": 1000.0, "levels_x_um": 2.0, "levels_y_um": None, "samples": 3}
    assert PartsSchema.of(parts=(measured,)).parts == (schema,)
    assert PartsSchema.model_validate_json(PartsSchema(parts=(schema,)).model_dump_json()).parts == (schema,)
    described = {name: field.description for name, field in MeasuredSchema.model_fields.items()}
    assert described["highest_speed_rpm"] == "Highest speed, r/min; unknown at rest"
    assert described["levels_y_um"] == "Overall vibration at probe y, µm peak-to-peak"


def test_fields_of_a_missing_result_are_null() -> None:
    assert MeasuredSchema.of(None, samples=0).highest_speed_rpm is None


def test_schema_with_a_second_description_of_a_quantity_is_refused() -> None:
    with pytest.raises(TypeError, match="highest_speed_rpm"):

        class _Twice(Schema, of=(Measured,)):
            highest_speed_rpm: Number = Field(description="Highest speed, r/min")


@pytest.mark.parametrize(
    ("result", "schema"),
    [(Snapshot, MeasurementSchema), (RunSummary, SummarySchema), (ProbeSummary, ProbeSummarySchema),
     (SpeedRow, SpeedRowSchema), (RunEntry, RunSchema)],
)  # fmt: skip
def test_every_measure_of_overall_vibration_has_a_field(result: type, schema: type[Schema]) -> None:
    names = {name for name, reading in readings(result).items() if reading.attribute.endswith(("overall", "largest"))}
    assert len(names) >= len(OVERALL.rows)
    assert names <= set(schema.described)


def test_every_measure_of_overall_vibration_can_be_searched() -> None:
    names = {f"{row.name}_{end}_{row.suffix}" for row in OVERALL.rows for end in ("from", "to")}
    assert names <= set(OverallRangeQuery.model_fields)


def test_rms_that_was_not_recorded_is_null() -> None:
    assert UPDATE.snapshot is not None
    overall = UPDATE.snapshot.overall.copy()
    overall[1] = math.nan
    measured = live_schema(replace(UPDATE, snapshot=replace(UPDATE.snapshot, overall=overall))).measured
    assert measured is not None
    assert measured.rms_x_um is None
    assert measured.peak_to_peak_x_um is not None

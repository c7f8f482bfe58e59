"""The categories of the driver's codes, compared with nidaqmx's own list."""

import re

import pytest
from nidaqmx.error_codes import DAQmxErrors

from daq.drivers.ni.error_codes import (
    ABSENT_CODES,
    BUSY_CODES,
    OTHER_CODES,
    OVERRUN_CODES,
    device_fault,
    driver_text,
    operator_message,
)
from daq.errors import DeviceFault

OVERRUNS = (
    r"INPUT_FIFO_OVERFLOW(_\d)?|ACQ_STOPPED_.*|SAMPLES_NO_LONGER_AVAILABLE|AI_OVERRUN|ADC_OVERRUN|.*_OVERWRITTEN.*"
)
ABSENT = (
    r"DEV_ABSENT_OR_UNAVAILABLE.*|DEVICE_REMOVED|DEV_CANNOT_BE_ACCESSED|INVALID_DEVICE_ID|HW_UNEXPECTEDLY_POWERED.*"
)
OF_OUTPUTS_OR_RECORDS = {"CO_PREV_DA_QMX_WRITE_SETTINGS_OVERWRITTEN", "RECORD_OVERWRITTEN", "TIME_STAMP_OVERWRITTEN"}


def named(pattern: str) -> set[int]:
    return {
        code.value
        for code in DAQmxErrors
        if re.fullmatch(pattern, code.name) and code.name not in OF_OUTPUTS_OR_RECORDS
    }


def test_overrun_codes_contain_all_input_overruns_of_the_drivers_list() -> None:
    assert named(OVERRUNS) <= set(OVERRUN_CODES)


def test_absent_codes_contain_all_missing_device_codes_of_the_drivers_list() -> None:
    assert named(ABSENT) <= set(ABSENT_CODES)


def test_each_code_is_in_the_drivers_list_and_has_one_meaning() -> None:
    tables = (OVERRUN_CODES, ABSENT_CODES, BUSY_CODES, OTHER_CODES)
    codes = [code for table in tables for code in table]
    assert len(codes) == len(set(codes))
    assert set(codes) <= {code.value for code in DAQmxErrors}


@pytest.mark.parametrize(
    ("code", "fault"),
    [
        (-200077, DeviceFault.REJECTED),
        (-200332, DeviceFault.REJECTED),
        (-200324, DeviceFault.MISSING),
        (-200194, DeviceFault.MISSING),
        (-50103, DeviceFault.BUSY),
        (-200284, DeviceFault.TIMEOUT),
        (-200088, DeviceFault.OTHER),
        (-200279, DeviceFault.OTHER),
        (-50405, DeviceFault.OTHER),
    ],
)
def test_code_has_its_fault_category(code: int, fault: DeviceFault) -> None:
    assert device_fault(code, known=True) is fault


def test_driver_text_contains_the_details_without_task_and_code() -> None:
    text = (
        "Requested value is not a supported value\nfor this property.\n\nProperty: DAQmx_SampClk_Rate\n"
        "Requested Value:  400.0e3\nMaximum Value:  333.3e3\n\nTask Name: rig-Dev1\n\nStatus Code: -200077\n"
    )
    sentence = "Requested value is not a supported value for this property."
    about = "Property: DAQmx_SampClk_Rate, Requested Value: 400.0e3, Maximum Value: 333.3e3"
    assert driver_text(text) == f"{sentence} ({about})"
    assert operator_message(-200077, text) == f"the driver reports: {sentence} ({about})"
    assert driver_text("") == ""

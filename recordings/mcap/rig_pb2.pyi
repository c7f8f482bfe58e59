from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Codec(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    CODEC_UNSPECIFIED: _ClassVar[Codec]
    CODEC_INT16: _ClassVar[Codec]
    CODEC_DELTA_SHUFFLE: _ClassVar[Codec]
CODEC_UNSPECIFIED: Codec
CODEC_INT16: Codec
CODEC_DELTA_SHUFFLE: Codec

class SampleBlock(_message.Message):
    __slots__ = ("segment", "first_sample", "channels", "samples", "codec", "codes", "host_time_ns", "backlog")
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    FIRST_SAMPLE_FIELD_NUMBER: _ClassVar[int]
    CHANNELS_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    CODEC_FIELD_NUMBER: _ClassVar[int]
    CODES_FIELD_NUMBER: _ClassVar[int]
    HOST_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    BACKLOG_FIELD_NUMBER: _ClassVar[int]
    segment: int
    first_sample: int
    channels: int
    samples: int
    codec: Codec
    codes: bytes
    host_time_ns: int
    backlog: int
    def __init__(self, segment: _Optional[int] = ..., first_sample: _Optional[int] = ..., channels: _Optional[int] = ..., samples: _Optional[int] = ..., codec: _Optional[_Union[Codec, str]] = ..., codes: _Optional[bytes] = ..., host_time_ns: _Optional[int] = ..., backlog: _Optional[int] = ...) -> None: ...

class SegmentEnd(_message.Message):
    __slots__ = ("segment", "samples", "reason", "lost", "lost_is_exact", "detail")
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    LOST_IS_EXACT_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    segment: int
    samples: int
    reason: str
    lost: int
    lost_is_exact: bool
    detail: str
    def __init__(self, segment: _Optional[int] = ..., samples: _Optional[int] = ..., reason: _Optional[str] = ..., lost: _Optional[int] = ..., lost_is_exact: _Optional[bool] = ..., detail: _Optional[str] = ...) -> None: ...

class Features(_message.Message):
    __slots__ = ("segment", "sample", "time_s", "speed_rpm", "speed_rad_per_s", "tacho_state", "tacho_pulses", "tacho_filled", "tacho_rejected", "tacho_jitter_s", "gap_x_v", "gap_y_v", "gap_x_ok", "gap_y_ok", "peak_to_peak_x_um", "peak_to_peak_y_um", "peak_to_peak_x_m", "peak_to_peak_y_m", "clipped", "has_order_frame", "x_1x_um", "x_1x_lag_deg", "y_1x_um", "y_1x_lag_deg", "x_2x_um", "x_2x_lag_deg", "y_2x_um", "y_2x_lag_deg", "whirl_order", "whirl_um", "whirl_is_forward", "noise_um", "beyond_calibration", "rms_x_um", "rms_y_um", "rms_x_m", "rms_y_m", "sigma_1x_um", "sigma_2x_um", "x_1x_lag_sigma_deg", "y_1x_lag_sigma_deg", "whirl_sigma_um", "whirls", "x_1x_compensated_um", "x_1x_compensated_lag_deg", "y_1x_compensated_um", "y_1x_compensated_lag_deg", "tacho_mark_is_arbitrary", "counter")
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_FIELD_NUMBER: _ClassVar[int]
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    SPEED_RPM_FIELD_NUMBER: _ClassVar[int]
    SPEED_RAD_PER_S_FIELD_NUMBER: _ClassVar[int]
    TACHO_STATE_FIELD_NUMBER: _ClassVar[int]
    TACHO_PULSES_FIELD_NUMBER: _ClassVar[int]
    TACHO_FILLED_FIELD_NUMBER: _ClassVar[int]
    TACHO_REJECTED_FIELD_NUMBER: _ClassVar[int]
    TACHO_JITTER_S_FIELD_NUMBER: _ClassVar[int]
    GAP_X_V_FIELD_NUMBER: _ClassVar[int]
    GAP_Y_V_FIELD_NUMBER: _ClassVar[int]
    GAP_X_OK_FIELD_NUMBER: _ClassVar[int]
    GAP_Y_OK_FIELD_NUMBER: _ClassVar[int]
    PEAK_TO_PEAK_X_UM_FIELD_NUMBER: _ClassVar[int]
    PEAK_TO_PEAK_Y_UM_FIELD_NUMBER: _ClassVar[int]
    PEAK_TO_PEAK_X_M_FIELD_NUMBER: _ClassVar[int]
    PEAK_TO_PEAK_Y_M_FIELD_NUMBER: _ClassVar[int]
    CLIPPED_FIELD_NUMBER: _ClassVar[int]
    HAS_ORDER_FRAME_FIELD_NUMBER: _ClassVar[int]
    X_1X_UM_FIELD_NUMBER: _ClassVar[int]
    X_1X_LAG_DEG_FIELD_NUMBER: _ClassVar[int]
    Y_1X_UM_FIELD_NUMBER: _ClassVar[int]
    Y_1X_LAG_DEG_FIELD_NUMBER: _ClassVar[int]
    X_2X_UM_FIELD_NUMBER: _ClassVar[int]
    X_2X_LAG_DEG_FIELD_NUMBER: _ClassVar[int]
    Y_2X_UM_FIELD_NUMBER: _ClassVar[int]
    Y_2X_LAG_DEG_FIELD_NUMBER: _ClassVar[int]
    WHIRL_ORDER_FIELD_NUMBER: _ClassVar[int]
    WHIRL_UM_FIELD_NUMBER: _ClassVar[int]
    WHIRL_IS_FORWARD_FIELD_NUMBER: _ClassVar[int]
    NOISE_UM_FIELD_NUMBER: _ClassVar[int]
    BEYOND_CALIBRATION_FIELD_NUMBER: _ClassVar[int]
    RMS_X_UM_FIELD_NUMBER: _ClassVar[int]
    RMS_Y_UM_FIELD_NUMBER: _ClassVar[int]
    RMS_X_M_FIELD_NUMBER: _ClassVar[int]
    RMS_Y_M_FIELD_NUMBER: _ClassVar[int]
    SIGMA_1X_UM_FIELD_NUMBER: _ClassVar[int]
    SIGMA_2X_UM_FIELD_NUMBER: _ClassVar[int]
    X_1X_LAG_SIGMA_DEG_FIELD_NUMBER: _ClassVar[int]
    Y_1X_LAG_SIGMA_DEG_FIELD_NUMBER: _ClassVar[int]
    WHIRL_SIGMA_UM_FIELD_NUMBER: _ClassVar[int]
    WHIRLS_FIELD_NUMBER: _ClassVar[int]
    X_1X_COMPENSATED_UM_FIELD_NUMBER: _ClassVar[int]
    X_1X_COMPENSATED_LAG_DEG_FIELD_NUMBER: _ClassVar[int]
    Y_1X_COMPENSATED_UM_FIELD_NUMBER: _ClassVar[int]
    Y_1X_COMPENSATED_LAG_DEG_FIELD_NUMBER: _ClassVar[int]
    TACHO_MARK_IS_ARBITRARY_FIELD_NUMBER: _ClassVar[int]
    COUNTER_FIELD_NUMBER: _ClassVar[int]
    segment: int
    sample: int
    time_s: float
    speed_rpm: float
    speed_rad_per_s: float
    tacho_state: str
    tacho_pulses: int
    tacho_filled: int
    tacho_rejected: int
    tacho_jitter_s: float
    gap_x_v: float
    gap_y_v: float
    gap_x_ok: bool
    gap_y_ok: bool
    peak_to_peak_x_um: float
    peak_to_peak_y_um: float
    peak_to_peak_x_m: float
    peak_to_peak_y_m: float
    clipped: _containers.RepeatedScalarFieldContainer[int]
    has_order_frame: bool
    x_1x_um: float
    x_1x_lag_deg: float
    y_1x_um: float
    y_1x_lag_deg: float
    x_2x_um: float
    x_2x_lag_deg: float
    y_2x_um: float
    y_2x_lag_deg: float
    whirl_order: float
    whirl_um: float
    whirl_is_forward: bool
    noise_um: float
    beyond_calibration: _containers.RepeatedScalarFieldContainer[int]
    rms_x_um: float
    rms_y_um: float
    rms_x_m: float
    rms_y_m: float
    sigma_1x_um: float
    sigma_2x_um: float
    x_1x_lag_sigma_deg: float
    y_1x_lag_sigma_deg: float
    whirl_sigma_um: float
    whirls: int
    x_1x_compensated_um: float
    x_1x_compensated_lag_deg: float
    y_1x_compensated_um: float
    y_1x_compensated_lag_deg: float
    tacho_mark_is_arbitrary: bool
    counter: CounterCheck
    def __init__(self, segment: _Optional[int] = ..., sample: _Optional[int] = ..., time_s: _Optional[float] = ..., speed_rpm: _Optional[float] = ..., speed_rad_per_s: _Optional[float] = ..., tacho_state: _Optional[str] = ..., tacho_pulses: _Optional[int] = ..., tacho_filled: _Optional[int] = ..., tacho_rejected: _Optional[int] = ..., tacho_jitter_s: _Optional[float] = ..., gap_x_v: _Optional[float] = ..., gap_y_v: _Optional[float] = ..., gap_x_ok: _Optional[bool] = ..., gap_y_ok: _Optional[bool] = ..., peak_to_peak_x_um: _Optional[float] = ..., peak_to_peak_y_um: _Optional[float] = ..., peak_to_peak_x_m: _Optional[float] = ..., peak_to_peak_y_m: _Optional[float] = ..., clipped: _Optional[_Iterable[int]] = ..., has_order_frame: _Optional[bool] = ..., x_1x_um: _Optional[float] = ..., x_1x_lag_deg: _Optional[float] = ..., y_1x_um: _Optional[float] = ..., y_1x_lag_deg: _Optional[float] = ..., x_2x_um: _Optional[float] = ..., x_2x_lag_deg: _Optional[float] = ..., y_2x_um: _Optional[float] = ..., y_2x_lag_deg: _Optional[float] = ..., whirl_order: _Optional[float] = ..., whirl_um: _Optional[float] = ..., whirl_is_forward: _Optional[bool] = ..., noise_um: _Optional[float] = ..., beyond_calibration: _Optional[_Iterable[int]] = ..., rms_x_um: _Optional[float] = ..., rms_y_um: _Optional[float] = ..., rms_x_m: _Optional[float] = ..., rms_y_m: _Optional[float] = ..., sigma_1x_um: _Optional[float] = ..., sigma_2x_um: _Optional[float] = ..., x_1x_lag_sigma_deg: _Optional[float] = ..., y_1x_lag_sigma_deg: _Optional[float] = ..., whirl_sigma_um: _Optional[float] = ..., whirls: _Optional[int] = ..., x_1x_compensated_um: _Optional[float] = ..., x_1x_compensated_lag_deg: _Optional[float] = ..., y_1x_compensated_um: _Optional[float] = ..., y_1x_compensated_lag_deg: _Optional[float] = ..., tacho_mark_is_arbitrary: _Optional[bool] = ..., counter: _Optional[_Union[CounterCheck, _Mapping]] = ...) -> None: ...

class CounterCheck(_message.Message):
    __slots__ = ("is_working", "compared", "missing", "extra", "apart", "mean_s", "largest_s", "recent", "recent_odd")
    IS_WORKING_FIELD_NUMBER: _ClassVar[int]
    COMPARED_FIELD_NUMBER: _ClassVar[int]
    MISSING_FIELD_NUMBER: _ClassVar[int]
    EXTRA_FIELD_NUMBER: _ClassVar[int]
    APART_FIELD_NUMBER: _ClassVar[int]
    MEAN_S_FIELD_NUMBER: _ClassVar[int]
    LARGEST_S_FIELD_NUMBER: _ClassVar[int]
    RECENT_FIELD_NUMBER: _ClassVar[int]
    RECENT_ODD_FIELD_NUMBER: _ClassVar[int]
    is_working: bool
    compared: int
    missing: int
    extra: int
    apart: int
    mean_s: float
    largest_s: float
    recent: int
    recent_odd: int
    def __init__(self, is_working: _Optional[bool] = ..., compared: _Optional[int] = ..., missing: _Optional[int] = ..., extra: _Optional[int] = ..., apart: _Optional[int] = ..., mean_s: _Optional[float] = ..., largest_s: _Optional[float] = ..., recent: _Optional[int] = ..., recent_odd: _Optional[int] = ...) -> None: ...

class Vector(_message.Message):
    __slots__ = ("real_m", "imag_m")
    REAL_M_FIELD_NUMBER: _ClassVar[int]
    IMAG_M_FIELD_NUMBER: _ClassVar[int]
    real_m: float
    imag_m: float
    def __init__(self, real_m: _Optional[float] = ..., imag_m: _Optional[float] = ...) -> None: ...

class Whirl(_message.Message):
    __slots__ = ("order", "forward_m", "backward_m", "x", "y", "order_sigma", "sigma_m")
    ORDER_FIELD_NUMBER: _ClassVar[int]
    FORWARD_M_FIELD_NUMBER: _ClassVar[int]
    BACKWARD_M_FIELD_NUMBER: _ClassVar[int]
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    ORDER_SIGMA_FIELD_NUMBER: _ClassVar[int]
    SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    order: float
    forward_m: float
    backward_m: float
    x: Vector
    y: Vector
    order_sigma: float
    sigma_m: float
    def __init__(self, order: _Optional[float] = ..., forward_m: _Optional[float] = ..., backward_m: _Optional[float] = ..., x: _Optional[_Union[Vector, _Mapping]] = ..., y: _Optional[_Union[Vector, _Mapping]] = ..., order_sigma: _Optional[float] = ..., sigma_m: _Optional[float] = ...) -> None: ...

class RunOut(_message.Message):
    __slots__ = ("x", "y", "sigma_1x_m", "sigma_2x_m")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    SIGMA_1X_M_FIELD_NUMBER: _ClassVar[int]
    SIGMA_2X_M_FIELD_NUMBER: _ClassVar[int]
    x: _containers.RepeatedCompositeFieldContainer[Vector]
    y: _containers.RepeatedCompositeFieldContainer[Vector]
    sigma_1x_m: float
    sigma_2x_m: float
    def __init__(self, x: _Optional[_Iterable[_Union[Vector, _Mapping]]] = ..., y: _Optional[_Iterable[_Union[Vector, _Mapping]]] = ..., sigma_1x_m: _Optional[float] = ..., sigma_2x_m: _Optional[float] = ...) -> None: ...

class OrderFrame(_message.Message):
    __slots__ = ("segment", "sample", "time_s", "speed_rad_per_s", "acceleration_rad_per_s2", "orders", "spectrum_x_real_m", "spectrum_x_imag_m", "spectrum_y_real_m", "spectrum_y_imag_m", "x_1x", "y_1x", "x_2x", "y_2x", "noise_m", "whirl", "orbit_x_m", "orbit_y_m", "weaker_whirls", "sigma_1x_m", "sigma_2x_m", "angle_sigma_rad", "runout", "compensated_orbit_x_m", "compensated_orbit_y_m", "spectrum_x_um", "spectrum_y_um", "orbit_x_um", "orbit_y_um")
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_FIELD_NUMBER: _ClassVar[int]
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    SPEED_RAD_PER_S_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_RAD_PER_S2_FIELD_NUMBER: _ClassVar[int]
    ORDERS_FIELD_NUMBER: _ClassVar[int]
    SPECTRUM_X_REAL_M_FIELD_NUMBER: _ClassVar[int]
    SPECTRUM_X_IMAG_M_FIELD_NUMBER: _ClassVar[int]
    SPECTRUM_Y_REAL_M_FIELD_NUMBER: _ClassVar[int]
    SPECTRUM_Y_IMAG_M_FIELD_NUMBER: _ClassVar[int]
    X_1X_FIELD_NUMBER: _ClassVar[int]
    Y_1X_FIELD_NUMBER: _ClassVar[int]
    X_2X_FIELD_NUMBER: _ClassVar[int]
    Y_2X_FIELD_NUMBER: _ClassVar[int]
    NOISE_M_FIELD_NUMBER: _ClassVar[int]
    WHIRL_FIELD_NUMBER: _ClassVar[int]
    ORBIT_X_M_FIELD_NUMBER: _ClassVar[int]
    ORBIT_Y_M_FIELD_NUMBER: _ClassVar[int]
    WEAKER_WHIRLS_FIELD_NUMBER: _ClassVar[int]
    SIGMA_1X_M_FIELD_NUMBER: _ClassVar[int]
    SIGMA_2X_M_FIELD_NUMBER: _ClassVar[int]
    ANGLE_SIGMA_RAD_FIELD_NUMBER: _ClassVar[int]
    RUNOUT_FIELD_NUMBER: _ClassVar[int]
    COMPENSATED_ORBIT_X_M_FIELD_NUMBER: _ClassVar[int]
    COMPENSATED_ORBIT_Y_M_FIELD_NUMBER: _ClassVar[int]
    SPECTRUM_X_UM_FIELD_NUMBER: _ClassVar[int]
    SPECTRUM_Y_UM_FIELD_NUMBER: _ClassVar[int]
    ORBIT_X_UM_FIELD_NUMBER: _ClassVar[int]
    ORBIT_Y_UM_FIELD_NUMBER: _ClassVar[int]
    segment: int
    sample: int
    time_s: float
    speed_rad_per_s: float
    acceleration_rad_per_s2: float
    orders: _containers.RepeatedScalarFieldContainer[float]
    spectrum_x_real_m: _containers.RepeatedScalarFieldContainer[float]
    spectrum_x_imag_m: _containers.RepeatedScalarFieldContainer[float]
    spectrum_y_real_m: _containers.RepeatedScalarFieldContainer[float]
    spectrum_y_imag_m: _containers.RepeatedScalarFieldContainer[float]
    x_1x: Vector
    y_1x: Vector
    x_2x: Vector
    y_2x: Vector
    noise_m: float
    whirl: Whirl
    orbit_x_m: _containers.RepeatedScalarFieldContainer[float]
    orbit_y_m: _containers.RepeatedScalarFieldContainer[float]
    weaker_whirls: _containers.RepeatedCompositeFieldContainer[Whirl]
    sigma_1x_m: float
    sigma_2x_m: float
    angle_sigma_rad: float
    runout: RunOut
    compensated_orbit_x_m: _containers.RepeatedScalarFieldContainer[float]
    compensated_orbit_y_m: _containers.RepeatedScalarFieldContainer[float]
    spectrum_x_um: _containers.RepeatedScalarFieldContainer[float]
    spectrum_y_um: _containers.RepeatedScalarFieldContainer[float]
    orbit_x_um: _containers.RepeatedScalarFieldContainer[float]
    orbit_y_um: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, segment: _Optional[int] = ..., sample: _Optional[int] = ..., time_s: _Optional[float] = ..., speed_rad_per_s: _Optional[float] = ..., acceleration_rad_per_s2: _Optional[float] = ..., orders: _Optional[_Iterable[float]] = ..., spectrum_x_real_m: _Optional[_Iterable[float]] = ..., spectrum_x_imag_m: _Optional[_Iterable[float]] = ..., spectrum_y_real_m: _Optional[_Iterable[float]] = ..., spectrum_y_imag_m: _Optional[_Iterable[float]] = ..., x_1x: _Optional[_Union[Vector, _Mapping]] = ..., y_1x: _Optional[_Union[Vector, _Mapping]] = ..., x_2x: _Optional[_Union[Vector, _Mapping]] = ..., y_2x: _Optional[_Union[Vector, _Mapping]] = ..., noise_m: _Optional[float] = ..., whirl: _Optional[_Union[Whirl, _Mapping]] = ..., orbit_x_m: _Optional[_Iterable[float]] = ..., orbit_y_m: _Optional[_Iterable[float]] = ..., weaker_whirls: _Optional[_Iterable[_Union[Whirl, _Mapping]]] = ..., sigma_1x_m: _Optional[float] = ..., sigma_2x_m: _Optional[float] = ..., angle_sigma_rad: _Optional[float] = ..., runout: _Optional[_Union[RunOut, _Mapping]] = ..., compensated_orbit_x_m: _Optional[_Iterable[float]] = ..., compensated_orbit_y_m: _Optional[_Iterable[float]] = ..., spectrum_x_um: _Optional[_Iterable[float]] = ..., spectrum_y_um: _Optional[_Iterable[float]] = ..., orbit_x_um: _Optional[_Iterable[float]] = ..., orbit_y_um: _Optional[_Iterable[float]] = ...) -> None: ...

class Mark(_message.Message):
    __slots__ = ("segment", "sample", "time_s", "text", "host_time_ns", "kind")
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_FIELD_NUMBER: _ClassVar[int]
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    HOST_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    segment: int
    sample: int
    time_s: float
    text: str
    host_time_ns: int
    kind: str
    def __init__(self, segment: _Optional[int] = ..., sample: _Optional[int] = ..., time_s: _Optional[float] = ..., text: _Optional[str] = ..., host_time_ns: _Optional[int] = ..., kind: _Optional[str] = ...) -> None: ...

class Pulses(_message.Message):
    __slots__ = ("segment", "first_sample", "first_pulse", "ticks", "has_failed")
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    FIRST_SAMPLE_FIELD_NUMBER: _ClassVar[int]
    FIRST_PULSE_FIELD_NUMBER: _ClassVar[int]
    TICKS_FIELD_NUMBER: _ClassVar[int]
    HAS_FAILED_FIELD_NUMBER: _ClassVar[int]
    segment: int
    first_sample: int
    first_pulse: int
    ticks: _containers.RepeatedScalarFieldContainer[int]
    has_failed: bool
    def __init__(self, segment: _Optional[int] = ..., first_sample: _Optional[int] = ..., first_pulse: _Optional[int] = ..., ticks: _Optional[_Iterable[int]] = ..., has_failed: _Optional[bool] = ...) -> None: ...

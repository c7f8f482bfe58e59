"""Schemas of a recorded run's results that are no analysis: findings, trend, samples, prediction and comparison."""

from pydantic import Field

from daq.schemas.live import PredictedVibrationSchema
from daq.schemas.summary import SpeedRowSchema, SubSynchronousSchema
from daq.schemas.units import Count, Number, Schema

Values = tuple[Number, ...]


class WhirlFindingsSchema(Schema):
    """Components found below 1X."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    sub_synchronous: tuple[SubSynchronousSchema, ...] = Field(
        description="Components below 1X in order of onset, as in the summary"
    )


class TrendSchema(Schema):
    """Trend over time in columns; each entry holds the minimum and maximum of several results."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    results_per_entry: Count = Field(description="Maximum number of results in one entry", examples=[1])
    segment: tuple[int, ...] = Field(description="Gap-free stretch of the run, from 0", examples=[[0, 0]])
    time_s: Values = Field(description="Sample time in the segment of the last result, s", examples=[[0.1, 0.2]])
    speed_min_rpm: Values = Field(description="Shaft speed, r/min", examples=[[6000.1, 6001.5]])
    speed_max_rpm: Values = Field(description="Shaft speed, r/min", examples=[[6000.1, 6001.5]])
    peak_to_peak_min_x_um: Values = Field(description="Overall at probe x, µm peak-to-peak", examples=[[20.1, 20.4]])
    peak_to_peak_max_x_um: Values = Field(description="Overall at probe x, µm peak-to-peak", examples=[[20.1, 20.4]])
    peak_to_peak_min_y_um: Values = Field(description="Overall at probe y, µm peak-to-peak", examples=[[19.9, 20.2]])
    peak_to_peak_max_y_um: Values = Field(description="Overall at probe y, µm peak-to-peak", examples=[[19.9, 20.2]])
    order_1x_min_x_um: Values = Field(description="1X at probe x, µm zero-to-peak", examples=[[9.8, 9.9]])
    order_1x_max_x_um: Values = Field(description="1X at probe x, µm zero-to-peak", examples=[[9.8, 9.9]])
    order_1x_min_y_um: Values = Field(description="1X at probe y, µm zero-to-peak", examples=[[9.7, 9.8]])
    order_1x_max_y_um: Values = Field(description="1X at probe y, µm zero-to-peak", examples=[[9.7, 9.8]])
    order_1x_lag_x_deg: Values = Field(
        description="Phase lag of 1X at probe x in the last result, 0 to 360 degrees", examples=[[47.3, 47.1]]
    )
    order_1x_lag_y_deg: Values = Field(
        description="Phase lag of 1X at probe y in the last result, 0 to 360 degrees", examples=[[136.9, 137.0]]
    )
    whirl_order: Values = Field(
        description="Order of the largest component below 1X; null without one above the noise", examples=[[None, 0.49]]
    )
    whirl_peak_um: Values = Field(
        description="Amplitude of it, half the major axis of the ellipse, µm zero-to-peak; null likewise",
        examples=[[None, 12.1]],
    )


class ChannelSamplesSchema(Schema):
    """Samples of one channel."""

    name: str = Field(description="Name of the channel", examples=["x"])
    unit: str = Field(description="µm towards the probe (minus the gap), V or code", examples=["µm"])
    values: Values = Field(description="One value per sample", examples=[[-402.1, -402.3]])


class SamplesSchema(Schema):
    """Consecutive samples of all channels."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    segment: Count = Field(description="Gap-free stretch of the run, from 0", examples=[0])
    first_sample: Count = Field(description="Index of the first sample in the segment", examples=[20_000])
    samples: Count = Field(description="Number of samples per channel", examples=[2])
    rate_hz: float = Field(description="Samples per channel and second, Hz", examples=[200_000.0])
    channels: tuple[ChannelSamplesSchema, ...] = Field(description="Channels in sampling order")


class PredictionSchema(Schema):
    """Prediction for the run's rig at a speed."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    predicted: PredictedVibrationSchema


class ComparisonSchema(Schema):
    """Measurement at a speed compared with the prediction."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    measured: SpeedRowSchema = Field(description="Nearest speed bin")
    predicted: PredictedVibrationSchema = Field(description="Prediction at the mean speed of that bin")
    amplitude_ratio_x: Number = Field(
        description="Measured (minus run-out where known) over predicted 1X at probe x; null without prediction",
        examples=[0.97],
    )
    amplitude_ratio_y: Number = Field(
        description="Measured (minus run-out where known) over predicted 1X at probe y; null without prediction",
        examples=[1.02],
    )
    lag_difference_x_deg: Number = Field(
        description="Measured minus predicted lag of 1X at probe x, -180 to 180 degrees", examples=[3.2]
    )
    lag_difference_y_deg: Number = Field(
        description="Measured minus predicted lag of 1X at probe y, -180 to 180 degrees", examples=[-4.1]
    )

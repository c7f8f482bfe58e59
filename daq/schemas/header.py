"""What a run's header says: which device delivered it and what was watched.

What was taken off as run-out, and where that is known from.
"""

from pydantic import Field

from analysis.signals.header import Channel, Device, Limits, Role, RunOutSettings
from analysis.signals.snapshot import RunOut
from daq.schemas.units import Schema, degrees, micrometres, rpm
from daq.schemas.vibration import ProbeVectorsSchema, probe_vectors_schema


class DeviceSchema(Schema):
    """What delivered the samples."""

    backend: str = Field(description="The driver behind it", examples=["nidaqmx"])
    product: str = Field(description="Product name as the device gives it", examples=["USB-6251"])
    serial: str = Field(description="Serial number as printed on it", examples=["1A2B3C"])
    simulated: bool = Field(description="Whether it is simulated: no real shaft turned", examples=[False])


class ChannelSchema(Schema):
    """An input and what is wired to it."""

    name: str = Field(description="The operator's name for it", examples=["x"])
    role: Role = Field(description="What it measures", examples=["probe_x"])
    angle_deg: float | None = Field(
        description="Where a probe sits, degrees from +X (right), positive with the rotation; null for the tacho",
        examples=[45.0],
    )


class LimitsSchema(Schema):
    """What the operator must not pass, and the room there is."""

    peak_to_peak_alarm_um: float | None = Field(
        description="Overall vibration that raises the alarm, µm peak-to-peak", examples=[80.0]
    )
    peak_to_peak_danger_um: float | None = Field(
        description="Overall vibration at which the run must end, µm peak-to-peak", examples=[95.0]
    )
    clearance_um: float | None = Field(
        description="Radius of the circle that the shaft can move in, µm", examples=[100.0]
    )
    speed_rpm: float | None = Field(description="Highest speed of the rig, r/min", examples=[20_000.0])
    order_1x_peak_alarm_um: float | None = Field(
        description="1X at either probe, as measured, that raises the alarm, µm peak; null: not watched",
        examples=[30.0],
    )
    order_1x_peak_danger_um: float | None = Field(description="The same for danger, µm peak", examples=[40.0])
    below_1x_peak_alarm_um: float | None = Field(
        description="Amplitudes of all components below 1X at either probe, added, that raise the alarm, µm peak; "
        "null: not watched",
        examples=[20.0],
    )
    below_1x_peak_danger_um: float | None = Field(description="The same for danger, µm peak", examples=[35.0])
    speed_alarm_rpm: float | None = Field(
        description="Speed that raises the alarm, r/min; null: not watched", examples=[18_000.0]
    )
    speed_danger_rpm: float | None = Field(description="The same for danger, r/min", examples=[19_500.0])


def channel_schema(channel: Channel) -> ChannelSchema:
    """Return a channel as a document."""
    angle = None if channel.role is Role.TACHO else degrees(channel.angle)
    return ChannelSchema(name=channel.name, role=channel.role, angle_deg=angle)


def device_schema(device: Device) -> DeviceSchema:
    """Return a device as a document."""
    return DeviceSchema(
        backend=device.backend, product=device.product, serial=device.serial, simulated=device.simulated
    )


def limits_schema(limits: Limits) -> LimitsSchema:
    """Return limits as a document."""
    return LimitsSchema(
        peak_to_peak_alarm_um=micrometres(limits.peak_to_peak_alarm),
        peak_to_peak_danger_um=micrometres(limits.peak_to_peak_danger),
        clearance_um=micrometres(limits.clearance),
        speed_rpm=rpm(limits.speed),
        order_1x_peak_alarm_um=micrometres(limits.order_1x_alarm),
        order_1x_peak_danger_um=micrometres(limits.order_1x_danger),
        below_1x_peak_alarm_um=micrometres(limits.below_1x_alarm),
        below_1x_peak_danger_um=micrometres(limits.below_1x_danger),
        speed_alarm_rpm=rpm(limits.speed_alarm),
        speed_danger_rpm=rpm(limits.speed_danger),
    )


class RunOutSchema(Schema):
    """What the probes see of the surface; what is called compensated is less by it, all else is as measured."""

    source: str = Field(description="Where it is known from", examples=["slow roll of this run", "rig.toml"])
    slow_roll_rpm: float | None = Field(
        description="Speed up to which the run tells it, r/min; null where it was known before", examples=[600.0]
    )
    is_known: bool = Field(description="Whether it is known: a slow roll must come first", examples=[True])
    from_orbit: bool = Field(description="Whether it is taken off the orbit too", examples=[False])
    order_1x: ProbeVectorsSchema | None = Field(description="The run-out at running speed; null until it is known")
    order_2x: ProbeVectorsSchema | None = Field(description="The run-out at twice running speed; null likewise")


def runout_schema(settings: RunOutSettings, runout: RunOut | None) -> RunOutSchema | None:
    """Return what is taken off as a document; None where nothing is to be."""
    if not settings.is_enabled:
        return None
    told_by_run = settings.slow_roll_speed > 0.0
    return RunOutSchema(
        source="slow roll of this run" if told_by_run else settings.source,
        slow_roll_rpm=rpm(settings.slow_roll_speed) if told_by_run else None,
        is_known=runout is not None,
        from_orbit=settings.from_orbit,
        order_1x=None if runout is None else probe_vectors_schema(runout.vectors[0].tolist()),
        order_2x=None if runout is None else probe_vectors_schema(runout.vectors[1].tolist()),
    )

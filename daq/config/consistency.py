"""Consistency of rig.toml: whether its keys agree with each other, with the sensors and with the card."""

import math
from collections import Counter
from collections.abc import Iterator

from analysis.signals.header import Role
from analysis.signals.units import MILLISECOND
from analysis.spectra.windows import WINDOWS
from daq.config.devices import DEVICES, HIGH_LEVEL, LOW_LEVEL, DeviceSpec
from daq.config.rig import model_parameters
from daq.config.schema import SPEED, TIME, Backend, ChannelSection, RigConfig, TachoSection, parse_condition
from daq.config.toml_files import Fault
from model.errors import ParameterError
from model.rotor.tables import TableError

CARD_KEY = "device.product"
BLOCKS_IN_BUFFER = 4
MIN_PROBE_ANGLE = 10.0  # degrees between the probes' axes
ORDER_KEYS = ("analysis.highest_order", "limits.speed_rpm")
MARK_KEYS = ("tacho.mark_fraction", "tacho.response_time_s", "tacho.pulses_per_revolution")
MIN_SPLIT_MINUTES, MIN_SPLIT_GB = 0.01, 0.001
MIN_PHASE_SAMPLES = 4  # of the tacho in the shorter of light and dark

WRAP_MARGIN = 10.0  # s of a wrap reserved for a late stamp and a long block


def cross_field_faults(config: RigConfig) -> Iterator[Fault]:
    """Yield the contradictions between the keys of a configuration."""
    yield from _roles(config)
    yield from _channel_names(config)
    yield from _probe_angles(config)
    for number, channel in enumerate(config.channel):
        yield from _channel(channel, f"channel[{number}]")
    yield from _timing(config)
    yield from _tacho(config)
    yield from _limits(config)
    yield from _runout(config)
    yield from _model(config)
    yield from _storage(config)
    yield from trigger_faults(config)
    warn, fail = config.preflight.hum_warn_um, config.preflight.hum_fail_um
    if warn > fail:
        yield _fault("preflight.hum_warn_um", warn, f"at most hum_fail_um = {fail:g}", "preflight.hum_fail_um")
    if config.device.backend is Backend.SIMULATED:
        yield from _simulation(config)


def card_faults(config: RigConfig) -> Iterator[Fault]:
    """Yield the contradictions between a configuration and the limits of its card."""
    product = config.device.product
    if product not in DEVICES:
        expected = f"one of {', '.join(DEVICES)}, the cards whose limits are known"
        yield _fault(CARD_KEY, f'"{product}"', expected)
        return
    card = DEVICES[product]
    yield from _inputs(config, card)
    yield from _aggregate_rate(config, card)
    yield from _counter(config, card)


def _fault(key: str, value: float | str, expected: str, *others: str) -> Fault:
    shown = f"{value:g}" if isinstance(value, float) else f"{value}"
    return Fault((key, *others), f"{key} = {shown}: expected {expected}")


def _roles(config: RigConfig) -> Iterator[Fault]:
    roles = Counter(channel.role for channel in config.channel)
    for role in Role:
        if roles[role] != 1:
            text = f"channel: {roles[role]} channels have the role {role.value}, expected exactly one"
            yield Fault(("channel", "channel.role"), text)
    last = len(config.channel) - 1
    for number, channel in enumerate(config.channel):
        if channel.role is Role.TACHO and number != last:
            key = f"channel[{number}].role"
            text = "the tacho as the last channel, so that its steep edges settle before the next probe is sampled"
            yield _fault(key, channel.role.value, text, "channel")


def _channel_names(config: RigConfig) -> Iterator[Fault]:
    names: dict[str, int] = {}
    for number, channel in enumerate(config.channel):
        if channel.name in names:
            key = f"channel[{number}].name"
            yield _fault(key, channel.name, f"a unique name, channel[{names[channel.name]}] has this one")
        names.setdefault(channel.name, number)


def _inputs(config: RigConfig, card: DeviceSpec) -> Iterator[Fault]:
    """Yield the channels whose input or range the card lacks or another channel uses."""
    inputs: dict[int, str] = {}
    for number, channel in enumerate(config.channel):
        key = f"channel[{number}]"
        if channel.range_v not in card.input_ranges:
            ranges = ", ".join(f"{volts:g}" for volts in card.input_ranges)
            expected = f"one of {ranges}, the ranges of the {card.product}"
            yield _fault(f"{key}.range_v", channel.range_v, expected, CARD_KEY)
        positive = int(channel.physical.removeprefix("ai"))
        differential = channel.terminal == "differential"
        available = card.differential_inputs if differential else card.single_ended_inputs
        if positive >= available:
            yield _fault(
                f"{key}.physical", channel.physical, f"ai0 to ai{available - 1} for a {channel.terminal} input"
            )
            continue
        for used in [positive, positive + card.differential_inputs] if differential else [positive]:
            if used in inputs:
                free = f"a free input, {inputs[used]} uses ai{used}"
                yield _fault(f"{key}.physical", channel.physical, free, "channel.terminal")
                break
            inputs[used] = key


def _aggregate_rate(config: RigConfig, card: DeviceSpec) -> Iterator[Fault]:
    rate, channels = config.timing.rate_hz, len(config.channel)
    aggregate = card.max_total_rate(channels)
    if rate * channels > aggregate:
        expected = f"at most {math.floor(aggregate / channels)}: the {card.product} shares {aggregate:,.0f} Hz among "
        yield _fault("timing.rate_hz", rate, f"{expected}{channels} channels", CARD_KEY)


def _probe_angles(config: RigConfig) -> Iterator[Fault]:
    probes = [(number, c) for number, c in enumerate(config.channel) if c.role is not Role.TACHO]
    if len(probes) != 2:
        return
    (_, first), (number, second) = probes
    apart = math.degrees(math.asin(abs(math.sin(math.radians(second.angle_deg - first.angle_deg)))))
    if apart < MIN_PROBE_ANGLE:
        expected = f"at least {MIN_PROBE_ANGLE:g} degrees from the line of {first.name!r} at {first.angle_deg:g}"
        yield _fault(f"channel[{number}].angle_deg", second.angle_deg, expected, "channel.angle_deg", "channel.role")


def _channel(channel: ChannelSection, key: str) -> Iterator[Fault]:
    if channel.role is Role.TACHO:
        if channel.calibration:
            yield _fault(f"{key}.calibration", f'"{channel.calibration}"', "none for a tacho", f"{key}.role")
        return
    if not channel.calibration:
        yield Fault((f"{key}.calibration", f"{key}.role"), f"{key}.calibration: missing, expected a file for a probe")
    low, high = channel.gap_window_v
    shown = f"[{low:g}, {high:g}]"
    if low >= high:
        yield _fault(f"{key}.gap_window_v", shown, "the lower voltage first")
    elif low < -channel.range_v or high > channel.range_v:
        expected = f"voltages within the range of ±{channel.range_v:g} V"
        yield _fault(f"{key}.gap_window_v", shown, expected, f"{key}.range_v")


def _timing(config: RigConfig) -> Iterator[Fault]:
    timing = config.timing
    needed = 2 * config.analysis.highest_order * config.limits.speed_rpm / 60
    if timing.rate_hz <= needed:
        order = f"order {config.analysis.highest_order:g} at {config.limits.speed_rpm:g} r/min"
        yield _fault(
            "timing.rate_hz", timing.rate_hz, f"more than {needed:.0f}: twice the frequency of {order}", *ORDER_KEYS
        )
    if timing.block_s * BLOCKS_IN_BUFFER > timing.buffer_s:
        expected = f"at most a quarter of buffer_s = {timing.buffer_s:g}"
        yield _fault("timing.block_s", timing.block_s, expected, "timing.buffer_s")
    if timing.block_s * timing.rate_hz < 1:
        yield _fault("timing.block_s", timing.block_s, "at least one sample", "timing.rate_hz")
    points = config.analysis.points_per_revolution
    if config.analysis.highest_order >= points / 2:
        expected = f"less than half of points_per_revolution = {points}"
        key = "analysis.highest_order"
        yield _fault(key, config.analysis.highest_order, expected, "analysis.points_per_revolution")
    needed = WINDOWS[config.analysis.window].min_revolutions
    if config.analysis.revolutions < needed:
        expected = f"at least {needed} for the window {config.analysis.window}"
        yield _fault("analysis.revolutions", config.analysis.revolutions, expected, "analysis.window")


def _tacho(config: RigConfig) -> Iterator[Fault]:
    tacho = config.tacho
    low, high = tacho.threshold_v - tacho.hysteresis_v / 2, tacho.threshold_v + tacho.hysteresis_v / 2
    switching = f"both switching levels, {low:g} and {high:g} V,"
    for number, channel in enumerate(config.channel):
        if channel.role is Role.TACHO and not (-channel.range_v < low and high < channel.range_v):
            expected = f"{switching} within the range of ±{channel.range_v:g} V"
            keys = ("tacho.hysteresis_v", f"channel[{number}].range_v")
            yield _fault("tacho.threshold_v", tacho.threshold_v, expected, *keys)
    for key, speed in _planned_speeds(config):
        if speed > (highest := _max_tacho_speed(tacho)) * (1 + 1e-9):
            expected = (
                f"at most {highest:.0f}: light and dark must both last the tacho's response time of "
                f"{tacho.response_time_s / MILLISECOND:g} ms, "
                f"with a mark over {tacho.mark_fraction * 100:g} % of the turn"
            )
            yield _fault(key, speed, expected, *MARK_KEYS)
    shorter = min(tacho.mark_fraction, 1 - tacho.mark_fraction)
    pulses = config.limits.speed_rpm / 60 * tacho.pulses_per_revolution
    if shorter * config.timing.rate_hz < MIN_PHASE_SAMPLES * pulses:
        minimum = MIN_PHASE_SAMPLES * pulses / shorter
        expected = f"at least {minimum:.0f}: {MIN_PHASE_SAMPLES} samples of the tacho's light and dark at full speed"
        yield _fault("timing.rate_hz", config.timing.rate_hz, expected, "limits.speed_rpm", *MARK_KEYS)


def _planned_speeds(config: RigConfig) -> Iterator[tuple[str, float]]:
    """Yield key and value, r/min, of all speeds that the tacho must be able to follow."""
    yield "limits.speed_rpm", config.limits.speed_rpm
    if config.device.backend is Backend.SIMULATED:
        for number, point in enumerate(config.simulation.profile):
            yield f"simulation.profile[{number}].speed_rpm", point.speed_rpm


def _max_tacho_speed(tacho: TachoSection) -> float:
    """Return the highest speed, r/min, at which light and dark both last the sensor's response time."""
    if tacho.response_time_s == 0:
        return math.inf
    shorter = min(tacho.mark_fraction, 1 - tacho.mark_fraction)
    return shorter / tacho.response_time_s * 60 / tacho.pulses_per_revolution


def _counter(config: RigConfig, card: DeviceSpec) -> Iterator[Fault]:
    """Yield the errors in `[tacho.counter]`."""
    section, timing = config.tacho.counter, config.timing
    if section is None:
        return
    key = "tacho.counter"
    if section.counter not in card.counter_names:
        expected = f"one of {', '.join(card.counter_names)}, the counters of the {card.product}"
        yield _fault(f"{key}.counter", f'"{section.counter}"', expected, CARD_KEY)
    if int(section.terminal.removeprefix("PFI")) >= card.pfi_inputs:
        expected = f"PFI0 to PFI{card.pfi_inputs - 1}, the input lines of the {card.product}"
        yield _fault(f"{key}.terminal", f'"{section.terminal}"', expected, CARD_KEY)
    timebase = section.timebase_hz or card.fastest_counter_timebase
    if timebase not in card.counter_timebases:
        rates = ", ".join(f"{rate:.0f}" for rate in card.counter_timebases)
        yield _fault(f"{key}.timebase_hz", timebase, f"one of {rates}, the clocks of the {card.product}", CARD_KEY)
        return
    wrap = card.counter_wrap / timebase
    if timing.buffer_s > wrap - WRAP_MARGIN:
        expected = f"at most {wrap - WRAP_MARGIN:.1f}: a {card.counter_width}-bit count wraps every {wrap:.1f} s"
        yield _fault("timing.buffer_s", f"{timing.buffer_s:g}", expected, f"{key}.timebase_hz")
    bench = config.simulation
    if config.device.backend is Backend.SIMULATED and not (
        bench.tacho_low_v <= LOW_LEVEL and bench.tacho_high_v >= HIGH_LEVEL
    ):
        expected = f"at least {HIGH_LEVEL:g}, and tacho_low_v at most {LOW_LEVEL:g}: the levels of {section.terminal}"
        yield _fault("simulation.tacho_high_v", f"{bench.tacho_high_v:g}", expected, "simulation.tacho_low_v", key)


def _limits(config: RigConfig) -> Iterator[Fault]:
    limits = config.limits
    alarm, danger = limits.peak_to_peak_alarm_um, limits.peak_to_peak_danger_um
    if alarm > danger:
        expected = f"at most peak_to_peak_danger_um = {danger:g}"
        yield _fault("limits.peak_to_peak_alarm_um", alarm, expected, "limits.peak_to_peak_danger_um")
    if danger > 2 * limits.clearance_um:
        expected = f"at most {2 * limits.clearance_um:g}, twice clearance_um: the shaft cannot move further"
        yield _fault("limits.peak_to_peak_danger_um", danger, expected, "limits.clearance_um")
    for name, unit, maximum, reason in (
        ("order_1x_peak", "um", limits.clearance_um, "clearance_um: the shaft cannot move further"),
        ("below_1x_peak", "um", limits.clearance_um, "clearance_um: the shaft cannot move further"),
        ("speed", "rpm", limits.speed_rpm, "speed_rpm: the highest speed of the rig"),
    ):
        alarm_key, danger_key = f"{name}_alarm_{unit}", f"{name}_danger_{unit}"
        alarm, danger = getattr(limits, alarm_key), getattr(limits, danger_key)
        if alarm > danger > 0:
            yield _fault(f"limits.{alarm_key}", alarm, f"at most {danger_key} = {danger:g}", f"limits.{danger_key}")
        for key, limit in ((alarm_key, alarm), (danger_key, danger)):
            if limit > maximum:
                yield _fault(f"limits.{key}", limit, f"at most {maximum:g}, {reason}", f"limits.{reason.split(':')[0]}")


def _runout(config: RigConfig) -> Iterator[Fault]:
    """Yield the contradictions in `[runout]`."""
    runout = config.runout
    if runout.vector and (runout.slow_roll_rpm or runout.from_run):
        text = "runout.vector: expected none with slow_roll_rpm or from_run: both give the run-out"
        yield Fault(("runout.vector", "runout.slow_roll_rpm", "runout.from_run"), text)
    if runout.from_run and not runout.slow_roll_rpm:
        text = f'runout.from_run = "{runout.from_run}": expected slow_roll_rpm too, the speed of its slow roll'
        yield Fault(("runout.from_run", "runout.slow_roll_rpm"), text)
    marks = config.tacho.pulses_per_revolution
    if (runout.vector or runout.slow_roll_rpm) and marks != 1:
        text = f"tacho.pulses_per_revolution = {marks}: expected 1 with [runout], whose phases need one mark"
        yield Fault(("tacho.pulses_per_revolution", "runout"), text)
    seen: set[int] = set()
    for number, vector in enumerate(runout.vector):
        key = f"runout.vector[{number}].order"
        if vector.order in seen:
            yield Fault((key,), f"{key} = {vector.order}: expected each order once")
        elif vector.order > config.analysis.highest_order:
            highest = config.analysis.highest_order
            expected = f"at most analysis.highest_order = {highest:g}"
            yield Fault((key, "analysis.highest_order"), f"{key} = {vector.order}: expected {expected}")
        seen.add(vector.order)


def _storage(config: RigConfig) -> Iterator[Fault]:
    storage = config.storage
    for key, value, minimum in (
        ("split_minutes", storage.split_minutes, MIN_SPLIT_MINUTES),
        ("split_gb", storage.split_gb, MIN_SPLIT_GB),
    ):
        if 0 < value < minimum:
            yield _fault(f"storage.{key}", value, f"0 for never, or at least {minimum:g}: each part is a separate file")


def trigger_faults(config: RigConfig) -> Iterator[Fault]:
    """Yield the errors in `[trigger]`."""
    ranges = {channel.name: channel.range_v for channel in config.channel}
    names = [SPEED, TIME, *ranges]
    for key, text in (("trigger.start", config.trigger.start), ("trigger.stop", config.trigger.stop)):
        condition = parse_condition(text)
        if condition is None:
            continue
        if condition.quantity not in names:
            yield _fault(key, f'"{text}"', f"a condition on one of {', '.join(names)}", "channel.name")
        elif abs(condition.value) >= (maximum := ranges.get(condition.quantity, math.inf)):
            yield _fault(key, f'"{text}"', f"a voltage within the range of ±{maximum:g} V", "channel.range_v")
    trigger = config.trigger
    if trigger.events != 1 and not (trigger.start.strip() and trigger.stop.strip()):
        expected = "1 without both start and stop: several events need both conditions"
        yield _fault("trigger.events", f"{trigger.events}", expected, "trigger.start", "trigger.stop")


def _model(config: RigConfig) -> Iterator[Fault]:
    """Yield the errors that the rotor model finds in its parameters."""
    try:
        model_parameters(config)
    except TableError as error:
        file = f'model.rotor = "{config.model.rotor}"' if config.model.rotor else "rotor"
        for fault in error.faults:
            yield Fault(("rotor", "model.rotor"), f"{file}: {fault}")
    except ParameterError as error:
        yield Fault(tuple(f"model.{name}" for name in type(config.model).model_fields), f"model: {error}")


def _simulation(config: RigConfig) -> Iterator[Fault]:
    bench, tacho = config.simulation, config.tacho
    if len(bench.profile) < 2 or bench.profile[0].time_s != 0:
        text = "simulation.profile: expected at least two points, the first at time_s = 0"
        yield Fault(("simulation.profile", "simulation.profile.time_s"), text)
    for number, (earlier, later) in enumerate(zip(bench.profile, bench.profile[1:], strict=False), start=1):
        if later.time_s <= earlier.time_s:
            key = f"simulation.profile[{number}].time_s"
            before = f"simulation.profile[{number - 1}].time_s"
            yield _fault(key, later.time_s, f"more than {earlier.time_s:g}, the time before it", before)
    for number, whirl in enumerate(bench.whirl):
        if whirl.end_rpm <= whirl.onset_rpm:
            key = f"simulation.whirl[{number}]"
            expected = f"more than onset_rpm = {whirl.onset_rpm:g}"
            yield _fault(f"{key}.end_rpm", whirl.end_rpm, expected, f"{key}.onset_rpm")
    low, high = tacho.threshold_v - tacho.hysteresis_v / 2, tacho.threshold_v + tacho.hysteresis_v / 2
    if not (bench.tacho_low_v < low and high < bench.tacho_high_v):
        expected = f"more than {high:g}, and tacho_low_v less than {low:g}: the tacho's switching levels"
        keys = ("simulation.tacho_low_v", "tacho.threshold_v", "tacho.hysteresis_v")
        yield _fault("simulation.tacho_high_v", bench.tacho_high_v, expected, *keys)

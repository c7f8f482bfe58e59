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
from daq.config.toml_files import ConfigIssue
from model.errors import ParameterError
from model.rotor.tables import TableError

CARD_KEY = "device.product"
BLOCKS_IN_BUFFER = 4
MIN_PROBE_ANGLE = 10.0  # degrees between the probes' axes
ORDER_KEYS = ("analysis.highest_order", "limits.speed_rpm")
MARK_KEYS = ("tacho.mark_fraction", "tacho.response_time_s", "tacho.pulses_per_revolution")
MIN_SPLIT_MINUTES, MIN_SPLIT_GB = 0.01, 0.001
MIN_PHASE_SAMPLES = 4  # of the tacho in the shorter of light and dark

WRAP_MARGIN = 10.0  # s of a wrap reserved for a late timestamp and a long block


def consistency_issues(config: RigConfig) -> Iterator[ConfigIssue]:
    """Yield the contradictions between the keys of a configuration."""
    yield from _roles(config)
    yield from _probe_angles(config)
    names: dict[str, int] = {}
    for number, channel in enumerate(config.channel):
        other = names.setdefault(channel.name, number)
        key = f"channel[{number}]"
        yield from _require(
            other == number, f"{key}.name", channel.name, f"a unique name, channel[{other}] has this one"
        )
        yield from _channel(channel, key)
    yield from _timing(config)
    yield from _tacho(config)
    yield from _limits(config)
    yield from _runout(config)
    yield from _model(config)
    for name, value, minimum in (
        ("split_minutes", config.storage.split_minutes, MIN_SPLIT_MINUTES),
        ("split_gb", config.storage.split_gb, MIN_SPLIT_GB),
    ):
        expected = f"0 for never, or at least {minimum:g}: each part is a separate file"
        yield from _require(value == 0 or value >= minimum, f"storage.{name}", value, expected)
    yield from trigger_issues(config)
    warn, fail = config.preflight.hum_warn_um, config.preflight.hum_fail_um
    expected = f"at most hum_fail_um = {fail:g}"
    yield from _require(warn <= fail, "preflight.hum_warn_um", warn, expected, "preflight.hum_fail_um")
    if config.device.backend is Backend.SIMULATED:
        yield from _simulation(config)


def card_issues(config: RigConfig) -> Iterator[ConfigIssue]:
    """Yield the contradictions between a configuration and the limits of its card."""
    product = config.device.product
    if product not in DEVICES:
        expected = f"one of {', '.join(DEVICES)}, the cards whose limits are known"
        yield from _require(False, CARD_KEY, f'"{product}"', expected)
        return
    card = DEVICES[product]
    yield from _inputs(config, card)
    rate, channels = config.timing.rate_hz, len(config.channel)
    aggregate = card.max_total_rate(channels)
    expected = f"at most {math.floor(aggregate / channels)}: the {product} shares {aggregate:,.0f} Hz among "
    within = rate * channels <= aggregate
    yield from _require(within, "timing.rate_hz", rate, f"{expected}{channels} channels", CARD_KEY)
    yield from _counter(config, card)


def _require(
    is_met: bool,  # noqa: FBT001 - a condition, as in an assertion
    key: str,
    value: float | str,
    expected: str,
    *others: str,
) -> Iterator[ConfigIssue]:
    """Yield an issue unless a requirement on a key's value is met; `others` are the further keys that it depends on."""
    if not is_met:
        shown = f"{value:g}" if isinstance(value, float) else f"{value}"
        yield ConfigIssue((key, *others), f"{key} = {shown}: expected {expected}")


def _roles(config: RigConfig) -> Iterator[ConfigIssue]:
    roles = Counter(channel.role for channel in config.channel)
    for role in Role:
        if roles[role] != 1:
            text = f"channel: {roles[role]} channels have the role {role.value}, expected exactly one"
            yield ConfigIssue(("channel", "channel.role"), text)
    for number, channel in enumerate(config.channel[:-1]):
        expected = "the tacho as the last channel, so that its steep edges settle before the next probe is sampled"
        is_probe = channel.role is not Role.TACHO
        yield from _require(is_probe, f"channel[{number}].role", channel.role.value, expected, "channel")


def _inputs(config: RigConfig, card: DeviceSpec) -> Iterator[ConfigIssue]:
    """Yield the channels whose input or range the card lacks or another channel uses."""
    inputs: dict[int, str] = {}
    for number, channel in enumerate(config.channel):
        key = f"channel[{number}]"
        ranges = ", ".join(f"{volts:g}" for volts in card.input_ranges)
        expected = f"one of {ranges}, the ranges of the {card.product}"
        yield from _require(channel.range_v in card.input_ranges, f"{key}.range_v", channel.range_v, expected, CARD_KEY)
        positive = int(channel.physical.removeprefix("ai"))
        differential = channel.terminal == "differential"
        available = card.differential_inputs if differential else card.single_ended_inputs
        expected = f"ai0 to ai{available - 1} for a {channel.terminal} input"
        yield from _require(positive < available, f"{key}.physical", channel.physical, expected)
        if positive >= available:
            continue
        for used in [positive, positive + card.differential_inputs] if differential else [positive]:
            if used in inputs:
                free = f"a free input, {inputs[used]} uses ai{used}"
                yield from _require(False, f"{key}.physical", channel.physical, free, "channel.terminal")
                break
            inputs[used] = key


def _probe_angles(config: RigConfig) -> Iterator[ConfigIssue]:
    probes = [(number, c) for number, c in enumerate(config.channel) if c.role is not Role.TACHO]
    if len(probes) != 2:
        return
    (_, first), (number, second) = probes
    apart = math.degrees(math.asin(abs(math.sin(math.radians(second.angle_deg - first.angle_deg)))))
    expected = f"at least {MIN_PROBE_ANGLE:g} degrees from the line of {first.name!r} at {first.angle_deg:g}"
    keys = ("channel.angle_deg", "channel.role")
    yield from _require(apart >= MIN_PROBE_ANGLE, f"channel[{number}].angle_deg", second.angle_deg, expected, *keys)


def _channel(channel: ChannelSection, key: str) -> Iterator[ConfigIssue]:
    file = channel.calibration
    if channel.role is Role.TACHO:
        yield from _require(not file, f"{key}.calibration", f'"{file}"', "none for a tacho", f"{key}.role")
        return
    if not file:
        text = f"{key}.calibration: missing, expected a file for a probe"
        yield ConfigIssue((f"{key}.calibration", f"{key}.role"), text)
    low, high = channel.gap_window_v
    window, shown = f"{key}.gap_window_v", f"[{low:g}, {high:g}]"
    yield from _require(low < high, window, shown, "the lower voltage first")
    within = low >= high or (low >= -channel.range_v and high <= channel.range_v)
    expected = f"voltages within the range of ±{channel.range_v:g} V"
    yield from _require(within, window, shown, expected, f"{key}.range_v")


def _timing(config: RigConfig) -> Iterator[ConfigIssue]:
    timing, analysis = config.timing, config.analysis
    rate, block = timing.rate_hz, timing.block_s
    needed = 2 * analysis.highest_order * config.limits.speed_rpm / 60
    order = f"order {analysis.highest_order:g} at {config.limits.speed_rpm:g} r/min"
    expected = f"more than {needed:.0f}: twice the frequency of {order}"
    yield from _require(rate > needed, "timing.rate_hz", rate, expected, *ORDER_KEYS)
    expected = f"at most a quarter of buffer_s = {timing.buffer_s:g}"
    fits = block * BLOCKS_IN_BUFFER <= timing.buffer_s
    yield from _require(fits, "timing.block_s", block, expected, "timing.buffer_s")
    yield from _require(block * rate >= 1, "timing.block_s", block, "at least one sample", "timing.rate_hz")
    highest, points = analysis.highest_order, analysis.points_per_revolution
    expected, other = f"less than half of points_per_revolution = {points}", "analysis.points_per_revolution"
    yield from _require(highest < points / 2, "analysis.highest_order", highest, expected, other)
    revolutions, minimum = analysis.revolutions, WINDOWS[analysis.window].min_revolutions
    expected = f"at least {minimum} for the window {analysis.window}"
    yield from _require(revolutions >= minimum, "analysis.revolutions", revolutions, expected, "analysis.window")


def _tacho(config: RigConfig) -> Iterator[ConfigIssue]:
    tacho, rate = config.tacho, config.timing.rate_hz
    low, high = tacho.threshold_v - tacho.hysteresis_v / 2, tacho.threshold_v + tacho.hysteresis_v / 2
    for number, channel in enumerate(config.channel):
        within = channel.role is not Role.TACHO or (-channel.range_v < low and high < channel.range_v)
        expected = f"both switching levels, {low:g} and {high:g} V, within the range of ±{channel.range_v:g} V"
        keys = ("tacho.hysteresis_v", f"channel[{number}].range_v")
        yield from _require(within, "tacho.threshold_v", tacho.threshold_v, expected, *keys)
    highest = _max_tacho_speed(tacho)
    for key, speed in _planned_speeds(config):
        expected = (
            f"at most {highest:.0f}: light and dark must both last the tacho's response time of "
            f"{tacho.response_time_s / MILLISECOND:g} ms, "
            f"with a mark over {tacho.mark_fraction * 100:g} % of the turn"
        )
        yield from _require(speed <= highest * (1 + 1e-9), key, speed, expected, *MARK_KEYS)
    pulse_rate = config.limits.speed_rpm / 60 * tacho.pulses_per_revolution
    minimum = MIN_PHASE_SAMPLES * pulse_rate / min(tacho.mark_fraction, 1 - tacho.mark_fraction)
    expected = f"at least {minimum:.0f}: {MIN_PHASE_SAMPLES} samples of the tacho's light and dark at full speed"
    yield from _require(rate >= minimum, "timing.rate_hz", rate, expected, "limits.speed_rpm", *MARK_KEYS)


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


def _counter(config: RigConfig, card: DeviceSpec) -> Iterator[ConfigIssue]:
    """Yield the errors in `[tacho.counter]`."""
    section, timing, key = config.tacho.counter, config.timing, "tacho.counter"
    if section is None:
        return
    expected = f"one of {', '.join(card.counter_names)}, the counters of the {card.product}"
    known = section.counter in card.counter_names
    yield from _require(known, f"{key}.counter", f'"{section.counter}"', expected, CARD_KEY)
    expected = f"PFI0 to PFI{card.pfi_inputs - 1}, the input lines of the {card.product}"
    known = int(section.terminal.removeprefix("PFI")) < card.pfi_inputs
    yield from _require(known, f"{key}.terminal", f'"{section.terminal}"', expected, CARD_KEY)
    timebase = section.timebase_hz or card.fastest_counter_timebase
    rates = ", ".join(f"{rate:.0f}" for rate in card.counter_timebases)
    expected, known = f"one of {rates}, the clocks of the {card.product}", timebase in card.counter_timebases
    yield from _require(known, f"{key}.timebase_hz", timebase, expected, CARD_KEY)
    if not known:
        return
    wrap = card.counter_wrap / timebase
    expected = f"at most {wrap - WRAP_MARGIN:.1f}: a {card.counter_width}-bit count wraps every {wrap:.1f} s"
    fits = timing.buffer_s <= wrap - WRAP_MARGIN
    yield from _require(fits, "timing.buffer_s", timing.buffer_s, expected, f"{key}.timebase_hz")
    bench = config.simulation
    if config.device.backend is Backend.SIMULATED:
        switches = bench.tacho_low_v <= LOW_LEVEL and bench.tacho_high_v >= HIGH_LEVEL
        levels = f"tacho_low_v at most {LOW_LEVEL:g}: the levels of {section.terminal}"
        expected, other = f"at least {HIGH_LEVEL:g}, and {levels}", "simulation.tacho_low_v"
        yield from _require(switches, "simulation.tacho_high_v", bench.tacho_high_v, expected, other, key)


def _limits(config: RigConfig) -> Iterator[ConfigIssue]:
    limits, table = config.limits, "limits"
    alarm, danger, clearance = limits.peak_to_peak_alarm_um, limits.peak_to_peak_danger_um, limits.clearance_um
    alarm_key, danger_key = f"{table}.peak_to_peak_alarm_um", f"{table}.peak_to_peak_danger_um"
    yield from _require(alarm <= danger, alarm_key, alarm, f"at most peak_to_peak_danger_um = {danger:g}", danger_key)
    expected = f"at most {2 * clearance:g}, twice clearance_um: the shaft cannot move further"
    yield from _require(danger <= 2 * clearance, danger_key, danger, expected, f"{table}.clearance_um")
    for name, unit, maximum, maximum_key, reason in (
        ("order_1x_peak", "um", clearance, "clearance_um", "the shaft cannot move further"),
        ("below_1x_peak", "um", clearance, "clearance_um", "the shaft cannot move further"),
        ("speed", "rpm", limits.speed_rpm, "speed_rpm", "the highest speed of the rig"),
    ):
        alarm_key, danger_key = f"{name}_alarm_{unit}", f"{name}_danger_{unit}"
        alarm, danger = getattr(limits, alarm_key), getattr(limits, danger_key)
        rises = danger == 0 or alarm <= danger
        expected = f"at most {danger_key} = {danger:g}"
        yield from _require(rises, f"{table}.{alarm_key}", alarm, expected, f"{table}.{danger_key}")
        expected = f"at most {maximum:g}, {maximum_key}: {reason}"
        for key, limit in ((alarm_key, alarm), (danger_key, danger)):
            yield from _require(limit <= maximum, f"{table}.{key}", limit, expected, f"{table}.{maximum_key}")


def _runout(config: RigConfig) -> Iterator[ConfigIssue]:
    """Yield the contradictions in `[runout]`."""
    runout, highest = config.runout, config.analysis.highest_order
    if runout.vector and (runout.slow_roll_rpm or runout.from_run):
        text = "runout.vector: expected none with slow_roll_rpm or from_run: both give the run-out"
        yield ConfigIssue(("runout.vector", "runout.slow_roll_rpm", "runout.from_run"), text)
    expected, known = "slow_roll_rpm too, the speed of its slow roll", not runout.from_run or runout.slow_roll_rpm > 0
    yield from _require(known, "runout.from_run", f'"{runout.from_run}"', expected, "runout.slow_roll_rpm")
    marks = config.tacho.pulses_per_revolution
    one_mark = marks == 1 or not (runout.vector or runout.slow_roll_rpm)
    expected = "1 with [runout], whose phases need one mark"
    yield from _require(one_mark, "tacho.pulses_per_revolution", marks, expected, "runout")
    seen: set[int] = set()
    for number, vector in enumerate(runout.vector):
        key, order = f"runout.vector[{number}].order", vector.order
        is_new, expected = order not in seen, f"at most analysis.highest_order = {highest:g}"
        yield from _require(is_new, key, order, "each order once")
        yield from _require(not is_new or order <= highest, key, order, expected, "analysis.highest_order")
        seen.add(order)


def trigger_issues(config: RigConfig) -> Iterator[ConfigIssue]:
    """Yield the errors in `[trigger]`."""
    trigger = config.trigger
    ranges = {SPEED: math.inf, TIME: math.inf} | {channel.name: channel.range_v for channel in config.channel}
    for key, text in (("trigger.start", trigger.start), ("trigger.stop", trigger.stop)):
        condition = parse_condition(text)
        if condition is None:
            continue
        known, shown = condition.quantity in ranges, f'"{text}"'
        yield from _require(known, key, shown, f"a condition on one of {', '.join(ranges)}", "channel.name")
        maximum = ranges.get(condition.quantity, math.inf)
        expected = f"a voltage within the range of ±{maximum:g} V"
        yield from _require(abs(condition.value) < maximum, key, shown, expected, "channel.range_v")
    both = bool(trigger.start.strip() and trigger.stop.strip())
    expected = "1 without both start and stop: several events need both conditions"
    keys = ("trigger.start", "trigger.stop")
    yield from _require(trigger.events == 1 or both, "trigger.events", trigger.events, expected, *keys)


def _model(config: RigConfig) -> Iterator[ConfigIssue]:
    """Yield the errors that the rotor model finds in its parameters."""
    try:
        model_parameters(config)
    except TableError as error:
        file = f'model.rotor = "{config.model.rotor}"' if config.model.rotor else "rotor"
        for fault in error.faults:
            yield ConfigIssue(("rotor", "model.rotor"), f"{file}: {fault}")
    except ParameterError as error:
        yield ConfigIssue(tuple(f"model.{name}" for name in type(config.model).model_fields), f"model: {error}")


def _simulation(config: RigConfig) -> Iterator[ConfigIssue]:
    bench, tacho = config.simulation, config.tacho
    if len(bench.profile) < 2 or bench.profile[0].time_s != 0:
        text = "simulation.profile: expected at least two points, the first at time_s = 0"
        yield ConfigIssue(("simulation.profile", "simulation.profile.time_s"), text)
    for number, (earlier, later) in enumerate(zip(bench.profile, bench.profile[1:], strict=False), start=1):
        key, before = (f"simulation.profile[{each}].time_s" for each in (number, number - 1))
        expected = f"more than {earlier.time_s:g}, the time before it"
        yield from _require(later.time_s > earlier.time_s, key, later.time_s, expected, before)
    for number, whirl in enumerate(bench.whirl):
        key, expected = f"simulation.whirl[{number}]", f"more than onset_rpm = {whirl.onset_rpm:g}"
        rises = whirl.end_rpm > whirl.onset_rpm
        yield from _require(rises, f"{key}.end_rpm", whirl.end_rpm, expected, f"{key}.onset_rpm")
    low, high = tacho.threshold_v - tacho.hysteresis_v / 2, tacho.threshold_v + tacho.hysteresis_v / 2
    expected = f"more than {high:g}, and tacho_low_v less than {low:g}: the tacho's switching levels"
    keys = ("simulation.tacho_low_v", "tacho.threshold_v", "tacho.hysteresis_v")
    switches = bench.tacho_low_v < low and high < bench.tacho_high_v
    yield from _require(switches, "simulation.tacho_high_v", bench.tacho_high_v, expected, *keys)

// Shows the live values of a run on the page.

import { element, elements } from "./elements.js";
import { formatClock, formatCount, formatDuration, formatFixed, formatInteger, formatLag, formatMicrometres, formatOrder, formatSigma, isKnown } from "./format.js";


function write(id, text) {
  const node = element(id);
  if (node.textContent !== text) node.textContent = text;
}

function toggleClass(id, name, on) {
  element(id).classList.toggle(name, Boolean(on));
}

function banner(id, text, danger = false) {
  const node = element(id);
  if (text) write(id, text);
  node.classList.toggle("danger", danger);
  node.hidden = !text;
}

export function drawLive(live) {
  document.body.dataset.state = live.status.state;
  const alarmPrefix = live.status.latched_severity === "normal" ? "" : `▲ ${live.status.latched_severity.toUpperCase()} · `;
  document.title = `${alarmPrefix}${live.status.state} · ${live.rig}`;
  document.body.dataset.run = ["finished", "failed"].includes(live.status.state) ? "" : live.run;
  element("marker-form").hidden = !["recording", "degraded", "interrupted", "armed"].includes(live.status.state);
  element("stop").hidden = element("marker-form").hidden && live.status.state !== "replaying";
  write("state", live.status.state);
  write("clock", formatClock(live.status.elapsed_s));
  write("run", live.run);
  const device = live.device;
  const serial = device.serial ? ` (serial ${device.serial})` : "";
  write("device", `${live.rig} · ${device.product}${serial}${device.simulated ? " · simulated: no shaft turns" : ""}`);
  drawSpeed(live);
  drawOverall(live);
  drawRunningSpeed(live);
  drawWhirl(live);
  drawStatus(live);
  drawQuality(live);
  drawBanners(live);
}

export function drawIdle() {
  document.body.dataset.state = "idle";
  document.body.dataset.run = "";
  document.title = "Rig · no run";
  element("marker-form").hidden = true;
  element("stop").hidden = true;
  write("state", "no run");
  write("quality", "");
  write("clock", "–:––");
  write("run", "No run in progress");
  write("device", "rig record RIG.TOML starts a run; recorded runs are below");
  for (const node of elements("#values b, #status dd")) node.textContent = "–";
  for (const node of elements("#values .size, #values td span, #values .trend, #values .note, #values .verdict")) {
    if (node.id) node.textContent = "";
  }
  for (const node of elements(".gauge i")) node.style.setProperty("--fill", "0%");
  for (const node of elements("#status div")) node.classList.remove("bad", "poor");
  write("clearance", "");
  for (const tile of elements(".tile")) delete tile.dataset.severity;
  element("alarms").hidden = true;
  banner("trouble", "");
}

function fill(id, value, fullScale) {
  const share = isKnown(value) && fullScale > 0 ? Math.min(100, (100 * value) / fullScale) : 0;
  for (const node of elements("i", element(id))) node.style.setProperty("--fill", `${share}%`);
}

const highestSeverity = (alarms) => (alarms.some((alarm) => alarm.severity === "danger") ? "danger" : alarms.length ? "alarm" : "normal");

// Colours a tile by the alarms of its quantity and names the highest severity; empty if the quantity has no limits.
function showSeverity(tile, verdict, quantity, alarms, hasLimits) {
  const own = alarms.filter((alarm) => alarm.quantity === quantity);
  const shownSeverity = highestSeverity(own);
  const activeSeverity = highestSeverity(own.filter((alarm) => !alarm.end));
  element(tile).dataset.severity = shownSeverity;
  write(verdict, hasLimits ? `${shownSeverity.toUpperCase()}${shownSeverity === activeSeverity ? "" : " LATCHED"}` : "");
}

// Marks alarm and danger levels on a gauge; a missing level lies outside it.
function markLimits(id, fullScale, levels) {
  element(id).querySelectorAll("s").forEach((node, k) => {
    node.style.setProperty("--at", isKnown(levels[k]) ? `${(100 * levels[k]) / fullScale}%` : "200%");
  });
}

function limitsText(alarm, danger, format) {
  const levels = [["alarm", alarm], ["danger", danger]].filter(([, level]) => isKnown(level));
  return levels.map(([name, level]) => `${name} ${format(level)}`).join(" · ");
}

function drawSpeed({ measured, limits, status }) {
  const speed = measured?.speed_rpm;
  write("speed", formatInteger(speed));
  const change = measured?.acceleration_rpm_per_s ?? 0;
  const steady = Math.abs(change) <= 0.002 * (speed ?? Infinity);
  write("trend", !isKnown(speed) || steady ? "" : change > 0 ? "▲" : "▼");
  fill("speed-gauge", speed, limits.speed_rpm);
  markLimits("speed-gauge", limits.speed_rpm, [limits.speed_alarm_rpm, limits.speed_danger_rpm]);
  const tacho = measured?.tacho.state ?? "no result yet";
  const source = measured?.tacho.counter ? ` by ${measured.tacho.reference}` : "";
  const levels = limitsText(limits.speed_alarm_rpm, limits.speed_danger_rpm, formatInteger);
  write("tacho", `tacho ${tacho}${source} · ${levels || `limit ${formatInteger(limits.speed_rpm)}`} r/min`);
  showSeverity("speed-tile", "speed-verdict", "speed", status.alarms, levels);
}

function drawOverall({ measured, predicted, limits, status }) {
  const fullScale = 1.15 * limits.peak_to_peak_danger_um;
  for (const probe of ["x", "y"]) {
    const value = measured?.[`peak_to_peak_${probe}_um`];
    write(`pp-${probe}`, formatMicrometres(value));
    fill(`pp-${probe}-gauge`, value, fullScale);
    markLimits(`pp-${probe}-gauge`, fullScale, [limits.peak_to_peak_alarm_um, limits.peak_to_peak_danger_um]);
  }
  const part = measured?.peak_to_peak_clearance_fraction;
  write("clearance", isKnown(part) ? ` · ${formatFixed(100 * part, 0)} % of clearance` : "");
  showSeverity("overall", "verdict", "overall", status.alarms, true);
  const levels = limitsText(limits.peak_to_peak_alarm_um, limits.peak_to_peak_danger_um, formatMicrometres);
  const rms = ["x", "y"].filter((probe) => isKnown(measured?.[`rms_${probe}_um`])).map((probe) => `${probe} ${formatMicrometres(measured[`rms_${probe}_um`])}`);
  write("limits", [levels, rms.length && `RMS ${rms.join(" ")}`].filter(Boolean).join(" · "));
  const model = predicted && `· model x ${formatMicrometres(predicted.peak_to_peak_x_um)} y ${formatMicrometres(predicted.peak_to_peak_y_um)}`;
  write("pp-model", model ?? "");
}

function drawRunningSpeed({ measured, predicted, runout, limits, status }) {
  const raw = measured?.order_1x;
  const compensated = measured?.order_1x_compensated;
  const shown = compensated ?? raw;
  for (const probe of ["x", "y"]) {
    for (const [source, suffix] of [[shown, ""], [predicted?.order_1x, "-model"]]) {
      write(`one-${probe}${suffix}`, formatMicrometres(source?.[`amplitude_peak_${probe}_um`]));
      write(`one-${probe}${suffix}-lag`, formatLag(source?.[`lag_${probe}_deg`]));
    }
  }
  write("one-source", compensated ? "compensated" : runout && !runout.is_known ? "measured, run-out not known" : "measured");
  const scatter = isKnown(shown?.amplitude_sigma_um) ? `± ${formatSigma(shown.amplitude_sigma_um)} µm, ± ${formatSigma(shown.lag_sigma_x_deg)}°` : "";
  const rawVectors = ["x", "y"].map((probe) => `${probe} ${formatMicrometres(raw?.[`amplitude_peak_${probe}_um`])} ${formatLag(raw?.[`lag_${probe}_deg`])}`);
  const levels = limitsText(limits.order_1x_peak_alarm_um, limits.order_1x_peak_danger_um, formatMicrometres);
  write("one-note", [compensated && `as measured ${rawVectors.join(" ")}`, scatter, levels].filter(Boolean).join(" · "));
  showSeverity("one", "one-verdict", "1X", status.alarms, levels);
}

function drawWhirl({ measured, predicted, limits, status }) {
  const whirl = measured?.whirl;
  write("whirl", whirl ? formatOrder(whirl.order) : measured?.order_1x ? "none" : "–");
  write("whirl-size", whirl ? `${formatMicrometres(whirl.amplitude_peak_um)} µm` : "");
  const others = (measured?.whirls ?? []).slice(1).map((each) => `${formatOrder(each.order)} ${formatMicrometres(each.amplitude_peak_um)} µm ${each.direction}`);
  const levels = limitsText(limits.below_1x_peak_alarm_um, limits.below_1x_peak_danger_um, formatMicrometres);
  const also = [others.length && `also ${others.join(", ")}`, levels && `${levels} together`].filter(Boolean).join(" · ");
  write("whirls", also);
  element("whirls").hidden = !also;
  showSeverity("below", "below-verdict", "below 1X", status.alarms, levels);
  const scatter = isKnown(whirl?.amplitude_sigma_um) ? ` · ± ${formatSigma(whirl.amplitude_sigma_um)} µm` : "";
  write("whirl-note", whirl ? `${whirl.direction} · ${formatFixed(whirl.frequency_hz, 0)} Hz${scatter}` : "");
  const expected = predicted?.whirl;
  write("whirl-model", expected ? formatOrder(expected.order) : predicted ? "none" : "–");
  write("whirl-model-size", expected ? `${formatMicrometres(expected.amplitude_peak_um)} µm` : "");
  const growth = predicted?.growth_rate_per_s;
  write("whirl-model-note", isKnown(growth) ? `film ${growth > 0 ? "unstable" : "stable"} · ${growth > 0 ? "+" : ""}${formatFixed(growth, 0)} 1/s` : "");
}

function drawStatus({ measured, predicted, status }) {
  write("samples", formatCount(status.samples));
  write("lost", `${status.lost_is_exact ? "" : "≥ "}${formatInteger(status.lost_samples)}`);
  toggleClass("lost-cell", "bad", status.lost_samples > 0 || !status.lost_is_exact);
  write("backlog", `${formatFixed(status.backlog_s, 1)} s`);
  toggleClass("backlog-cell", "poor", status.backlog_s > 1 || status.state === "degraded");
  write("disk", status.disk_left_s === null ? "–" : formatDuration(status.disk_left_s));
  toggleClass("disk-cell", "poor", isKnown(status.disk_left_s) && status.disk_left_s < 1800);
  toggleClass("disk-cell", "bad", isKnown(status.disk_left_s) && status.disk_left_s < 300);
  for (const probe of ["x", "y"]) {
    const state = measured?.[`probe_${probe}`];
    write(`gap-${probe}`, isKnown(state?.gap_v) ? `${formatFixed(state.gap_v, 2)} V` : "–");
    toggleClass(`gap-${probe}-cell`, "bad", state && !state.gap_ok);
  }
  const seen = measured ? measured.probe_x.clipped_samples + measured.probe_y.clipped_samples : null;
  const clipped = status.clipped.length ? status.clipped.reduce((sum, one) => sum + one.samples, 0) : seen;
  write("clipped", formatInteger(clipped));
  element("clipped").title = status.clipped.map((one) => `${one.channel}: ${formatInteger(one.samples)} samples in ${formatInteger(one.blocks)} blocks, last at ${formatClock(one.last_s)}`).join("; ");
  element("lost").title = status.last_loss;
  toggleClass("clipped-cell", "poor", clipped > 0);
  write("skipped", formatCount(status.skipped_samples));
  toggleClass("skipped-cell", "poor", status.skipped_samples > 0);
  write("dropped", formatCount(status.dropped_updates));
  const basis = predicted && (predicted.is_exact ? `exact at ${formatInteger(predicted.speed_rpm)} r/min` : "interpolated");
  write("model", basis ? `${status.model}, ${basis}` : status.model);
}

// Data quality in one line, the most serious problem first.
function drawQuality({ measured, status }) {
  const problems = status.clipped.map((one) => `${one.channel} clipped`);
  for (const probe of ["x", "y"]) {
    const state = measured?.[`probe_${probe}`];
    if (state && !state.gap_ok) problems.push(`probe ${probe} reads ${formatFixed(state.gap_v, 2)} V`);
  }
  if (measured && measured.tacho.state !== "good") problems.push(`tacho: ${measured.tacho.state}`);
  const lost = status.lost_samples > 0 || !status.lost_is_exact;
  if (lost) problems.unshift(`${status.lost_is_exact ? "" : "at least "}${formatInteger(status.lost_samples)} samples lost`);
  const isChecked = measured && !["interrupted", "failed"].includes(status.state); // otherwise the banner shows the problem
  const good = isChecked ? `✓ ${status.state === "armed" ? "" : "no samples lost · "}signals good` : "";
  element("quality").className = `quality ${lost ? "bad" : problems.length ? "poor" : "good"}`;
  write("quality", problems.length ? `▲ ${problems.join(" · ")}` : good);
  element("quality").title = element("quality").textContent;
}

const WORST_FIRST = { danger: 0, alarm: 1 };

function drawAlarms({ alarms, acknowledged_alarm: acknowledged }) {
  const messages = [...alarms].sort((a, b) => WORST_FIRST[a.severity] - WORST_FIRST[b.severity] || a.number - b.number).map((alarm) => {
    const at = isKnown(alarm.begin.speed_rpm) ? ` at ${formatInteger(alarm.begin.speed_rpm)} r/min` : "";
    const now = alarm.end ? "over" : "still active";
    const name = alarm.name.replace(alarm.severity, alarm.severity.toUpperCase());
    return `${name}: ${alarm.message}, began ${formatClock(alarm.begin.time_s)}${at}, ${now}.`;
  });
  const more = messages.length > 2 ? ` And ${messages.length - 2} more.` : "";
  write("alarm", messages.length ? `▲ ${messages.slice(0, 2).join(" ")}${more}` : "");
  toggleClass("alarms", "danger", alarms.some((alarm) => alarm.severity === "danger"));
  element("alarms").hidden = !messages.length;
  element("acknowledge").hidden = alarms.every((alarm) => alarm.number <= acknowledged);
}

function drawBanners({ status, measured }) {
  drawAlarms(status);
  const outside = ["x", "y"].filter((probe) => measured && !measured[`probe_${probe}`].gap_ok);
  const gaps = outside.map((probe) => `Probe ${probe} reads ${formatFixed(measured[`probe_${probe}`].gap_v, 2)} V: outside its gap window.`);
  const tacho = { irregular: "Tacho irregular: speed and phase are not known.", "too fast": "Tacho too fast for its sensor: speed may read too low." };
  const counter = [measured?.tacho.counter?.message, measured?.tacho.counter?.recent_message].filter(Boolean).join("; ");
  const messages = [status.detail, ...gaps, tacho[measured?.tacho.state] ?? "", counter ? `Tacho: ${counter}.` : ""].filter(Boolean);
  banner("trouble", messages.join(" "), status.state === "failed");
}

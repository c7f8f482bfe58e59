// Draws one moment of a run into the page.

import { clock, count, decimals, known, lag, micrometres, order, sigma, span, whole } from "./figures.js";

const element = (id) => document.getElementById(id);

function write(id, text) {
  const node = element(id);
  if (node.textContent !== text) node.textContent = text;
}

function mark(id, name, on) {
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
  const passed = live.status.latched_severity === "normal" ? "" : `▲ ${live.status.latched_severity.toUpperCase()} · `;
  document.title = `${passed}${live.status.state} · ${live.rig}`;
  document.body.dataset.run = ["finished", "failed"].includes(live.status.state) ? "" : live.run;
  element("marking").hidden = !["recording", "degraded", "interrupted", "armed"].includes(live.status.state);
  element("stop").hidden = element("marking").hidden && live.status.state !== "replaying";
  write("state", live.status.state);
  write("clock", clock(live.status.elapsed_s));
  write("run", live.run);
  const device = live.device;
  const serial = device.serial ? ` (serial ${device.serial})` : "";
  write("device", `${live.rig} · ${device.product}${serial}${device.simulated ? " · simulated: no shaft turns" : ""}`);
  drawSpeed(live);
  drawOverall(live);
  drawRunningSpeed(live);
  drawWhirl(live);
  drawStatus(live);
  drawTrust(live);
  drawBanners(live);
}

export function drawIdle() {
  document.body.dataset.state = "idle";
  document.body.dataset.run = "";
  document.title = "Rig · no run";
  element("marking").hidden = true;
  element("stop").hidden = true;
  write("state", "no run");
  write("trust", "");
  write("clock", "–:––");
  write("run", "No run is under way");
  write("device", "rig record RIG.TOML starts one and says where to watch it; recorded runs are below");
  for (const node of document.querySelectorAll("#values b, #status dd")) node.textContent = "–";
  for (const node of document.querySelectorAll("#values .size, #values td span, #values .trend, #values .note, #values .verdict")) {
    if (node.id) node.textContent = "";
  }
  for (const node of document.querySelectorAll(".gauge i")) node.style.setProperty("--fill", "0%");
  for (const node of document.querySelectorAll("#status div")) node.classList.remove("bad", "poor");
  write("clearance", "");
  for (const tile of document.querySelectorAll(".tile")) delete tile.dataset.severity;
  element("alarms").hidden = true;
  banner("trouble", "");
}

function fill(id, value, full) {
  const share = known(value) && full > 0 ? Math.min(100, (100 * value) / full) : 0;
  element(id).querySelector("i").style.setProperty("--fill", `${share}%`);
}

const worstOf = (alarms) => (alarms.some((alarm) => alarm.severity === "danger") ? "danger" : alarms.length ? "alarm" : "normal");

// Colours a tile by the alarms of what it shows, and names the worst of them; where nothing is watched it says nothing.
function judge(tile, verdict, quantity, alarms, isWatched) {
  const mine = alarms.filter((alarm) => alarm.quantity === quantity);
  const inSight = worstOf(mine);
  const lasting = worstOf(mine.filter((alarm) => !alarm.end));
  element(tile).dataset.severity = inSight;
  write(verdict, isWatched ? `${inSight.toUpperCase()}${inSight === lasting ? "" : " LATCHED"}` : "");
}

// Marks alarm and danger on a gauge; what is not watched lies outside.
function markLimits(id, full, levels) {
  element(id).querySelectorAll("s").forEach((node, k) => {
    node.style.setProperty("--at", known(levels[k]) ? `${(100 * levels[k]) / full}%` : "200%");
  });
}

function watched(alarm, danger, figure) {
  const levels = [["alarm", alarm], ["danger", danger]].filter(([, level]) => known(level));
  return levels.map(([name, level]) => `${name} ${figure(level)}`).join(" · ");
}

function drawSpeed({ measured, limits, status }) {
  const speed = measured?.speed_rpm;
  write("speed", whole(speed));
  const change = measured?.acceleration_rpm_per_s ?? 0;
  const steady = Math.abs(change) <= 0.002 * (speed ?? Infinity);
  write("trend", !known(speed) || steady ? "" : change > 0 ? "▲" : "▼");
  fill("speed-gauge", speed, limits.speed_rpm);
  markLimits("speed-gauge", limits.speed_rpm, [limits.speed_alarm_rpm, limits.speed_danger_rpm]);
  const tacho = measured?.tacho.state ?? "no result yet";
  const source = measured?.tacho.counter ? ` by ${measured.tacho.reference}` : "";
  const levels = watched(limits.speed_alarm_rpm, limits.speed_danger_rpm, whole);
  write("tacho", `tacho ${tacho}${source} · ${levels || `limit ${whole(limits.speed_rpm)}`} r/min`);
  judge("speed-tile", "speed-verdict", "speed", status.alarms, levels);
}

function drawOverall({ measured, predicted, limits, status }) {
  const full = 1.15 * limits.peak_to_peak_danger_um;
  for (const probe of ["x", "y"]) {
    const value = measured?.[`peak_to_peak_${probe}_um`];
    write(`pp-${probe}`, micrometres(value));
    fill(`pp-${probe}-gauge`, value, full);
    markLimits(`pp-${probe}-gauge`, full, [limits.peak_to_peak_alarm_um, limits.peak_to_peak_danger_um]);
  }
  const part = measured?.peak_to_peak_clearance_fraction;
  write("clearance", known(part) ? ` · ${decimals(100 * part, 0)} % of clearance` : "");
  judge("overall", "verdict", "overall", status.alarms, true);
  write("limits", watched(limits.peak_to_peak_alarm_um, limits.peak_to_peak_danger_um, micrometres));
  const model = predicted && `· model x ${micrometres(predicted.peak_to_peak_x_um)} y ${micrometres(predicted.peak_to_peak_y_um)}`;
  write("pp-model", model ?? "");
}

function drawRunningSpeed({ measured, predicted, runout, limits, status }) {
  const raw = measured?.order_1x;
  const compensated = measured?.order_1x_compensated;
  const shown = compensated ?? raw;
  for (const probe of ["x", "y"]) {
    for (const [source, suffix] of [[shown, ""], [predicted?.order_1x, "-model"]]) {
      write(`one-${probe}${suffix}`, micrometres(source?.[`amplitude_peak_${probe}_um`]));
      write(`one-${probe}${suffix}-lag`, lag(source?.[`lag_${probe}_deg`]));
    }
  }
  write("one-source", compensated ? "compensated" : runout && !runout.is_known ? "measured, run-out not known" : "measured");
  const sure = known(shown?.amplitude_sigma_um) ? `± ${sigma(shown.amplitude_sigma_um)} µm, ± ${sigma(shown.lag_sigma_x_deg)}°` : "";
  const measuredToo = ["x", "y"].map((probe) => `${probe} ${micrometres(raw?.[`amplitude_peak_${probe}_um`])} ${lag(raw?.[`lag_${probe}_deg`])}`);
  const levels = watched(limits.order_1x_peak_alarm_um, limits.order_1x_peak_danger_um, micrometres);
  write("one-note", [compensated && `as measured ${measuredToo.join(" ")}`, sure, levels].filter(Boolean).join(" · "));
  judge("one", "one-verdict", "1X", status.alarms, levels);
}

function drawWhirl({ measured, predicted, limits, status }) {
  const whirl = measured?.whirl;
  write("whirl", whirl ? order(whirl.order) : measured?.order_1x ? "none" : "–");
  write("whirl-size", whirl ? `${micrometres(whirl.amplitude_peak_um)} µm` : "");
  const others = (measured?.whirls ?? []).slice(1).map((each) => `${order(each.order)} ${micrometres(each.amplitude_peak_um)} µm ${each.direction}`);
  const levels = watched(limits.below_1x_peak_alarm_um, limits.below_1x_peak_danger_um, micrometres);
  const also = [others.length && `also ${others.join(", ")}`, levels && `${levels} together`].filter(Boolean).join(" · ");
  write("whirls", also);
  element("whirls").hidden = !also;
  judge("below", "below-verdict", "below 1X", status.alarms, levels);
  const sure = known(whirl?.amplitude_sigma_um) ? ` · ± ${sigma(whirl.amplitude_sigma_um)} µm` : "";
  write("whirl-note", whirl ? `${whirl.direction} · ${decimals(whirl.frequency_hz, 0)} Hz${sure}` : "");
  const expected = predicted?.whirl;
  write("whirl-model", expected ? order(expected.order) : predicted ? "none" : "–");
  write("whirl-model-size", expected ? `${micrometres(expected.amplitude_peak_um)} µm` : "");
  const growth = predicted?.growth_rate_per_s;
  write("whirl-model-note", known(growth) ? `film ${growth > 0 ? "lets go" : "holds"} · ${growth > 0 ? "+" : ""}${decimals(growth, 0)} 1/s` : "");
}

function drawStatus({ measured, predicted, status }) {
  write("samples", count(status.samples));
  write("lost", `${status.lost_is_exact ? "" : "≥ "}${whole(status.lost_samples)}`);
  mark("lost-cell", "bad", status.lost_samples > 0 || !status.lost_is_exact);
  write("backlog", `${decimals(status.backlog_s, 1)} s`);
  mark("backlog-cell", "poor", status.backlog_s > 1 || status.state === "degraded");
  write("disk", status.disk_left_s === null ? "–" : span(status.disk_left_s));
  mark("disk-cell", "poor", known(status.disk_left_s) && status.disk_left_s < 1800);
  mark("disk-cell", "bad", known(status.disk_left_s) && status.disk_left_s < 300);
  for (const probe of ["x", "y"]) {
    const state = measured?.[`probe_${probe}`];
    write(`gap-${probe}`, known(state?.gap_v) ? `${decimals(state.gap_v, 2)} V` : "–");
    mark(`gap-${probe}-cell`, "bad", state && !state.gap_ok);
  }
  const seen = measured ? measured.probe_x.clipped_samples + measured.probe_y.clipped_samples : null;
  const clipped = status.clipped.length ? status.clipped.reduce((sum, one) => sum + one.samples, 0) : seen;
  write("clipped", whole(clipped));
  element("clipped").title = status.clipped.map((one) => `${one.channel}: ${whole(one.samples)} samples in ${whole(one.blocks)} blocks, last at ${clock(one.last_s)}`).join("; ");
  element("lost").title = status.last_loss;
  mark("clipped-cell", "poor", clipped > 0);
  write("skipped", count(status.skipped_samples));
  mark("skipped-cell", "poor", status.skipped_samples > 0);
  write("dropped", count(status.dropped_updates));
  const basis = predicted && (predicted.is_exact ? `exact at ${whole(predicted.speed_rpm)} r/min` : "interpolated");
  write("model", basis ? `${status.model}, ${basis}` : status.model);
}

// Whether what is recorded and measured can be trusted, in one line; the most serious doubt first.
function drawTrust({ measured, status }) {
  const doubts = status.clipped.map((one) => `${one.channel} clipped`);
  for (const probe of ["x", "y"]) {
    const state = measured?.[`probe_${probe}`];
    if (state && !state.gap_ok) doubts.push(`probe ${probe} reads ${decimals(state.gap_v, 2)} V`);
  }
  if (measured && measured.tacho.state !== "good") doubts.push(`tacho: ${measured.tacho.state}`);
  const lost = status.lost_samples > 0 || !status.lost_is_exact;
  if (lost) doubts.unshift(`${status.lost_is_exact ? "" : "at least "}${whole(status.lost_samples)} samples lost`);
  const isJudged = measured && !["interrupted", "failed"].includes(status.state); // else the banner says what is wrong
  const good = isJudged ? `✓ ${status.state === "armed" ? "" : "gap-free · "}signals good` : "";
  element("trust").className = `trust ${lost ? "bad" : doubts.length ? "poor" : "good"}`;
  write("trust", doubts.length ? `▲ ${doubts.join(" · ")}` : good);
  element("trust").title = element("trust").textContent;
}

const WORST_FIRST = { danger: 0, alarm: 1 };

function drawAlarms({ alarms, acknowledged_alarm: acknowledged }) {
  const told = [...alarms].sort((a, b) => WORST_FIRST[a.severity] - WORST_FIRST[b.severity] || a.number - b.number).map((alarm) => {
    const at = known(alarm.begin.speed_rpm) ? ` at ${whole(alarm.begin.speed_rpm)} r/min` : "";
    const now = alarm.end ? "over" : "still so";
    const name = alarm.name.replace(alarm.severity, alarm.severity.toUpperCase());
    return `${name}: ${alarm.message}, came ${clock(alarm.begin.time_s)}${at}, ${now}.`;
  });
  const more = told.length > 2 ? ` And ${told.length - 2} more.` : "";
  write("alarm", told.length ? `▲ ${told.slice(0, 2).join(" ")}${more}` : "");
  mark("alarms", "danger", alarms.some((alarm) => alarm.severity === "danger"));
  element("alarms").hidden = !told.length;
  element("acknowledge").hidden = alarms.every((alarm) => alarm.number <= acknowledged);
}

function drawBanners({ status, measured }) {
  drawAlarms(status);
  const closed = ["x", "y"].filter((probe) => measured && !measured[`probe_${probe}`].gap_ok);
  const gaps = closed.map((probe) => `Probe ${probe} reads ${decimals(measured[`probe_${probe}`].gap_v, 2)} V: outside its gap window.`);
  const tacho = { irregular: "Tacho irregular: speed and phase are not known.", "too fast": "Tacho too fast for its sensor: speed may read too low." };
  const counter = [measured?.tacho.counter?.message, measured?.tacho.counter?.recent_message].filter(Boolean).join("; ");
  const told = [status.detail, ...gaps, tacho[measured?.tacho.state] ?? "", counter ? `Tacho: ${counter}.` : ""].filter(Boolean);
  banner("trouble", told.join(" "), status.state === "failed");
}

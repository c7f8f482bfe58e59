// List of the last runs; an opened run shows its summary and plots.

import { element, elements } from "./elements.js";
import { plotsOf } from "./plots.js";
import { formatClock, formatCount, formatDate, formatFixed, formatInteger, formatLag, formatMicrometres, formatOrder, isKnown } from "./format.js";
import { getJson, runJob } from "./service_client.js";

const SHOWN = 12;
const SUMMARY_TIMEOUT = 60000; // ms: the service may have to analyse the whole recording first

const list = element("runs");
const note = element("runs-note");
let listed = "";

function make(tag, text = "", className = "") {
  const node = document.createElement(tag);
  node.textContent = text;
  if (className) node.className = className;
  return node;
}

// Updates the list; the run `opened` is shown expanded.
export async function drawRuns(opened = "") {
  let page;
  try {
    page = await getJson(`/api/v1/runs?limit=${SHOWN}`, 5000);
  } catch (error) {
    if (error.name !== "token-required") note.textContent = `The runs cannot be listed: ${error.message}`;
    return;
  }
  note.textContent = page.total ? "" : "This data folder has no runs yet.";
  const text = JSON.stringify(page);
  if (text === listed && !opened) return;
  listed = text;
  const open = new Set([...elements("details[open]", list)].map((node) => node.dataset.run));
  list.replaceChildren(...page.runs.map((run) => entry(run, run.run === opened || open.has(run.run))));
}

function entry(run, open) {
  const details = make("details");
  details.dataset.run = run.run;
  const line = make("summary");
  const badge = badgeOf(run);
  line.append(
    make("b", run.run),
    make("span", formatDate(run.started_at), "note"),
    make("span", formatClock(run.duration_s)),
    make("span", run.note ?? run.fault, "note"),
    make("span", badge.text, `badge ${badge.level}`),
  );
  const body = make("div", "", "body");
  details.append(line, body);
  details.addEventListener("toggle", () => details.open && showSummary(body, run));
  details.open = open;
  return details;
}

function badgeOf(run) {
  if (run.rig === null) return { text: "✕ unreadable", level: "bad" };
  if (!run.is_complete) return { text: run.run === document.body.dataset.run ? "under way" : "not finished", level: "poor" };
  return run.is_gap_free ? { text: "✓ no samples lost", level: "good" } : { text: "samples lost", level: "bad" };
}

async function showSummary(body, run) {
  if (body.childElementCount) return;
  body.replaceChildren(make("p", "Reading the summary …", "note"));
  try {
    const [facts, ...others] = summary(await loadSummary(run.run, body.firstChild));
    body.replaceChildren(facts, plotsOf(run.run), ...others);
  } catch (error) {
    body.replaceChildren();
    body.append(make("p", run.fault || error.message));
  }
}

// Returns a run's summary; if it exceeds the request's time limit, a job makes it and `line` shows its progress.
async function loadSummary(id, line) {
  try {
    return await getJson(`/api/v1/runs/${encodeURIComponent(id)}/summary`, SUMMARY_TIMEOUT);
  } catch (error) {
    if (!error.job) throw error;
    return runJob(error.job, (text) => {
      line.textContent = text;
    });
  }
}

function facts(pairs) {
  const node = make("dl", "", "facts");
  for (const [name, value] of pairs) {
    const pair = make("div");
    pair.append(make("dt", name), make("dd", value));
    node.append(pair);
  }
  return node;
}

// Columns from index `textFrom` contain text and are left-aligned.
function table(caption, heads, rows, textFrom = heads.length) {
  const node = make("table");
  node.append(make("caption", caption));
  const head = node.createTHead().insertRow();
  for (const [k, name] of heads.entries()) {
    const cell = make("th", name, k < textFrom ? "" : "text");
    cell.scope = "col";
    head.append(cell);
  }
  const body = node.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    for (const [k, value] of row.entries()) line.append(make("td", value, k < textFrom ? "" : "text"));
  }
  const wide = make("div", "", "wide");
  wide.tabIndex = 0; // allows scrolling a wide table with the keyboard
  wide.setAttribute("role", "region");
  wide.setAttribute("aria-label", caption);
  wide.append(node);
  return wide;
}

function backlogFact(run) {
  if (run.largest_backlog_s === null || !run.buffer_s) return [];
  return [["Backlog", `at most ${formatFixed(run.largest_backlog_s, 2)} s of the card's ${formatFixed(run.buffer_s, 1)} s buffer`]];
}

function tachoFact(tacho) {
  if (!tacho?.counter) return [];
  const compared = tacho.counter.message || `${formatCount(tacho.counter.compared)} edges agree between counter and samples`;
  return [["Tacho", `speed and phase from the ${tacho.reference} · ${compared}`]];
}

function summary(run) {
  const lost = `${run.lost_is_exact ? "" : "at least "}${formatInteger(run.lost_samples)}`;
  const part = Math.max(0, ...run.probes.map((probe) => probe.largest_clearance_fraction ?? 0));
  const room = part ? `, ${percent(part)} of the clearance` : "";
  const parts = [
    facts([
      ["Recording", run.is_gap_free ? "complete, no samples lost" : `${run.segments.length} segments, ${lost} samples lost`],
      ["Length", `${formatClock(run.duration_s)} · ${formatCount(run.samples)} samples`],
      ...backlogFact(run),
      ["Speed", `${formatInteger(run.lowest_speed_rpm)} to ${formatInteger(run.highest_speed_rpm)} r/min`],
      ...tachoFact(run.tacho),
      ...(run.tacho?.phase_reference_is_arbitrary ? [["Phases", "relative to the first mark detected, because the marks are indistinguishable"]] : []),
      ["Largest overall", `${formatMicrometres(run.largest_peak_to_peak_um)} µm peak-to-peak${room} · ${run.severity}`],
      ...run.probes.map((probe) => [`Gap ${probe.name}`, `${formatFixed(probe.gap_min_v, 2)} to ${formatFixed(probe.gap_max_v, 2)} V${probe.gap_ok ? "" : " · outside the gap window"}`]),
    ]),
  ];
  for (const end of run.segments) if (end.detail) parts.push(make("p", `Segment ${end.segment + 1} ended (${end.end_reason}): ${end.detail}`));
  parts.push(...alarms(run), subSynchronous(run.sub_synchronous), ...hysteresis(run), ...runOut(run));
  if (run.agreement) parts.push(model(run.agreement));
  if (run.by_speed.length) parts.push(bySpeed(run.by_speed));
  if (run.standards.length) parts.push(standards(run.standards));
  return parts;
}

const arrow = (direction) => (direction === "run-up" ? "▲" : "▼");

function alarms(run) {
  return run.alarms.map((alarm) => {
    const until = alarm.end ? `until ${formatClock(alarm.end.time_s)}` : "to the end";
    const name = alarm.name.replace(alarm.severity, alarm.severity.toUpperCase());
    return make("p", `▲ ${name} from ${formatClock(alarm.begin.time_s)}, ${formatInteger(alarm.begin.speed_rpm)} r/min, ${until}: maximum ${alarm.message}.`);
  });
}

function standards(figures) {
  return table(
    "Standards, for information only: none covers floating-ring bearings",
    ["limit", "µm peak-to-peak", "ratio to limit", "scope", "source"],
    figures.map((one) => [`${one.standard} ${one.name}`, formatMicrometres(one.limit_peak_to_peak_um), isKnown(one.limit_ratio) ? percent(one.limit_ratio) : "", one.scope, one.source]),
    3,
  );
}

function runOut({ runout }) {
  if (!runout) return [];
  const below = isKnown(runout.slow_roll_rpm) ? ` up to ${formatInteger(runout.slow_roll_rpm)} r/min` : "";
  if (!runout.order_1x) return [make("p", `Run-out unknown: no ${runout.source}${below}. 1X and 2X are not compensated.`)];
  const at = ["x", "y"].map((probe) => `${probe} ${formatMicrometres(runout.order_1x[`amplitude_peak_${probe}_um`])} µm ∠ ${formatLag(runout.order_1x[`lag_${probe}_deg`])}`);
  return [make("p", `Run-out at 1X, from ${runout.source}${below}: ${at.join(", ")}. It is subtracted from compensated values.`)];
}

function hysteresis(run) {
  return run.hysteresis.map((one) => {
    const apart = `${formatInteger(Math.abs(one.width_rpm))} r/min ${one.width_rpm < 0 ? "higher" : "lower"}`;
    return make("p", `${formatOrder(one.order)} starts at ${formatInteger(one.onset_rpm)} r/min on the run-up and ends at ${formatInteger(one.end_rpm)} on the run-down: ${apart}.`);
  });
}

function subSynchronous(found) {
  if (!found.length) return make("p", "No component below 1X was found.");
  const at = (place, direction) => `${formatInteger(place.speed_rpm)} r/min ${direction ? arrow(direction) : ""}`.trim();
  return table(
    "Below 1X",
    ["order", "from", "to", "direction", "maximum, µm peak", "maximum at"],
    found.map((one) => [formatOrder(one.order), at(one.begin, one.begin_ramp_direction), at(one.end, one.end_ramp_direction), one.direction, formatMicrometres(one.largest_peak_um), at(one.largest_at)]),
  );
}

function model(agreement) {
  const one = agreement.synchronous;
  const lines = [];
  if (one && isKnown(one.agrees_to_rpm)) {
    lines.push(`1X agrees within ${percent(one.within_amplitude_ratio)} and ${formatLag(one.within_lag_difference_deg)} up to ${formatInteger(one.agrees_to_rpm)} r/min.`);
  }
  if (one) {
    lines.push(
      `1X, median: measured ${formatFixed(one.median_amplitude_ratio, 2)} times the prediction, ${lagging(one.median_lag_difference_deg)}.`,
      `1X, largest deviation at ${formatInteger(one.worst_amplitude_at_rpm)} r/min: measured ${formatFixed(one.worst_amplitude_ratio, 2)} times the prediction; ` +
        `at ${formatInteger(one.worst_lag_at_rpm)} r/min ${lagging(one.worst_lag_difference_deg)}.`,
    );
  }
  for (const whirl of agreement.whirls) {
    const expected = isKnown(whirl.predicted_order) ? `${formatOrder(whirl.predicted_order)} predicted from ${formatInteger(whirl.predicted_onset_rpm)} r/min` : "none predicted";
    const missing = whirl.was_reached ? "none measured" : "not reached";
    const seen = isKnown(whirl.measured_order) ? `${formatOrder(whirl.measured_order)} measured from ${formatInteger(whirl.measured_onset_rpm)} r/min` : missing;
    lines.push(`Below 1X: ${expected}; ${seen}.`);
  }
  if (isKnown(agreement.instability_onset_rpm)) lines.push(`Predicted onset of oil-film instability at ${formatInteger(agreement.instability_onset_rpm)} r/min.`);
  const node = make("div", "", "model");
  node.append(make("h3", "Model"), ...lines.map((line) => make("p", line)));
  return node;
}

function lagging(difference) {
  return `lagging ${formatFixed(Math.abs(difference), 0)}° ${difference < 0 ? "less" : "more"}`;
}

function percent(share) {
  return `${Math.round(100 * share)} %`;
}

function bySpeed(rows) {
  const step = Math.ceil(rows.length / 16);
  const polar = (line, probe) => `${formatMicrometres(line[`amplitude_peak_${probe}_um`])} ∠ ${formatLag(line[`lag_${probe}_deg`])}`;
  return table(
    `By speed${step > 1 ? `, every ${step}th of ${rows.length} rows` : ""}${rows.some((row) => row.order_1x_compensated) ? "; compensated where run-out was known" : ""}`,
    ["r/min", "1X x, µm peak ∠ lag", "1X y", "2X x", "2X y", "overall x, µm p-p", "overall y"],
    rows
      .filter((_, index) => index % step === 0 && isKnown(rows[index].speed_rpm))
      .map((row) => [
        `${formatInteger(row.speed_rpm)} ${arrow(row.ramp_direction)}`, ...["order_1x", "order_2x"].flatMap((name) => ["x", "y"].map((probe) => polar(row[`${name}_compensated`] ?? row[name], probe))),
        formatMicrometres(row.mean_peak_to_peak_x_um), formatMicrometres(row.mean_peak_to_peak_y_um),
      ]),
  );
}

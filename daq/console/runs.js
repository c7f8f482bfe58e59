// The last runs; a run that is opened shows its summary.

import { drawingsOf } from "./drawings.js";
import { clock, count, decimals, known, lag, micrometres, moment, order, whole } from "./figures.js";
import { doJob } from "./jobs.js";
import { ask } from "./service_client.js";

const SHOWN = 12;
const SUMMARY_PATIENCE = 60000; // ms: a summary may have to be made from the whole recording first

const list = document.getElementById("runs");
const note = document.getElementById("runs-note");
let listed = "";

function make(tag, text = "", className = "") {
  const node = document.createElement(tag);
  node.textContent = text;
  if (className) node.className = className;
  return node;
}

// Lists the runs anew; one that is named is opened.
export async function drawRuns(opened = "") {
  let page;
  try {
    page = await ask(`/api/v1/runs?limit=${SHOWN}`, 5000);
  } catch (error) {
    if (error.name !== "token-required") note.textContent = `The runs cannot be listed: ${error.message}`;
    return;
  }
  note.textContent = page.total ? "" : "Nothing has been recorded in this data folder yet.";
  const text = JSON.stringify(page);
  if (text === listed && !opened) return;
  listed = text;
  const open = new Set([...list.querySelectorAll("details[open]")].map((node) => node.dataset.run));
  list.replaceChildren(...page.runs.map((run) => entry(run, run.run === opened || open.has(run.run))));
}

function entry(run, open) {
  const details = make("details");
  details.dataset.run = run.run;
  const line = make("summary");
  const badge = badgeOf(run);
  line.append(
    make("b", run.run),
    make("span", moment(run.started_at), "note"),
    make("span", clock(run.duration_s)),
    make("span", run.note ?? run.fault, "note"),
    make("span", badge.text, `badge ${badge.level}`),
  );
  const body = make("div", "", "body");
  details.append(line, body);
  details.addEventListener("toggle", () => details.open && fillIn(body, run));
  details.open = open;
  return details;
}

function badgeOf(run) {
  if (run.rig === null) return { text: "✕ unreadable", level: "bad" };
  if (!run.is_complete) return { text: run.run === document.body.dataset.run ? "under way" : "not finished", level: "poor" };
  return run.is_gap_free ? { text: "✓ gap-free", level: "good" } : { text: "samples lost", level: "bad" };
}

async function fillIn(body, run) {
  if (body.childElementCount) return;
  body.replaceChildren(make("p", "Reading the summary …", "note"));
  try {
    const [facts, ...others] = summary(await summaryOf(run.run, body.firstChild));
    body.replaceChildren(facts, drawingsOf(run.run), ...others);
  } catch (error) {
    body.replaceChildren();
    body.append(make("p", run.fault || error.message));
  }
}

// Returns a run's summary; where that takes too long to wait for, a job makes it, and `line` tells how it goes.
async function summaryOf(id, line) {
  try {
    return await ask(`/api/v1/runs/${encodeURIComponent(id)}/summary`, SUMMARY_PATIENCE);
  } catch (error) {
    if (!error.job) throw error;
    return doJob(error.job, (words) => {
      line.textContent = words;
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

// Columns from `words` on hold words, which begin at the left.
function table(caption, heads, rows, words = heads.length) {
  const node = make("table");
  node.append(make("caption", caption));
  const head = node.createTHead().insertRow();
  for (const [k, name] of heads.entries()) {
    const cell = make("th", name, k < words ? "" : "words");
    cell.scope = "col";
    head.append(cell);
  }
  const body = node.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    for (const [k, value] of row.entries()) line.append(make("td", value, k < words ? "" : "words"));
  }
  const wide = make("div", "", "wide");
  wide.tabIndex = 0; // a table wider than the window is moved with the keys, too
  wide.setAttribute("role", "region");
  wide.setAttribute("aria-label", caption);
  wide.append(node);
  return wide;
}

function waited(run) {
  if (run.largest_backlog_s === null || !run.buffer_s) return [];
  return [["Backlog", `at most ${decimals(run.largest_backlog_s, 2)} s of the ${decimals(run.buffer_s, 1)} s that the card holds`]];
}

function counted(tacho) {
  if (!tacho?.counter) return [];
  const compared = tacho.counter.message || `${count(tacho.counter.compared)} edges by counter and samples agree`;
  return [["Tacho", `speed and phase from the ${tacho.reference} · ${compared}`]];
}

function summary(run) {
  const lost = `${run.lost_is_exact ? "" : "at least "}${whole(run.lost_samples)}`;
  const part = Math.max(0, ...run.probes.map((probe) => probe.largest_clearance_fraction ?? 0));
  const room = part ? `, ${percent(part)} of the clearance` : "";
  const parts = [
    facts([
      ["Recording", run.is_gap_free ? "gap-free" : `${run.segments.length} parts, ${lost} lost`],
      ["Length", `${clock(run.duration_s)} · ${count(run.samples)} samples`],
      ...waited(run),
      ["Speed", `${whole(run.lowest_speed_rpm)} to ${whole(run.highest_speed_rpm)} r/min`],
      ...counted(run.tacho),
      ...(run.tacho?.phase_reference_is_arbitrary ? [["Phases", "from the first mark seen: the marks cannot be told apart"]] : []),
      ["Largest overall", `${micrometres(run.largest_peak_to_peak_um)} µm peak-to-peak${room} · ${run.severity}`],
      ...run.probes.map((probe) => [`Gap ${probe.name}`, `${decimals(probe.gap_min_v, 2)} to ${decimals(probe.gap_max_v, 2)} V${probe.gap_ok ? "" : " · outside its window"}`]),
    ]),
  ];
  for (const end of run.segments) if (end.detail) parts.push(make("p", `Part ${end.segment + 1} ended (${end.end_reason}): ${end.detail}`));
  parts.push(...alarms(run), subSynchronous(run.sub_synchronous), ...hysteresis(run), ...runOut(run));
  if (run.agreement) parts.push(model(run.agreement));
  if (run.by_speed.length) parts.push(bySpeed(run.by_speed));
  if (run.standards.length) parts.push(standards(run.standards));
  return parts;
}

const arrow = (direction) => (direction === "run-up" ? "▲" : "▼");

function alarms(run) {
  return run.alarms.map((alarm) => {
    const until = alarm.end ? `until ${clock(alarm.end.time_s)}` : "to the end";
    const name = alarm.name.replace(alarm.severity, alarm.severity.toUpperCase());
    return make("p", `▲ ${name} from ${clock(alarm.begin.time_s)}, ${whole(alarm.begin.speed_rpm)} r/min, ${until}: up to ${alarm.message}.`);
  });
}

function standards(figures) {
  return table(
    "Standards, for information: none is written for floating rings",
    ["figure", "µm peak-to-peak", "largest of it", "meant for", "read in"],
    figures.map((one) => [`${one.standard} ${one.name}`, micrometres(one.limit_peak_to_peak_um), known(one.limit_ratio) ? percent(one.limit_ratio) : "", one.scope, one.source]),
    3,
  );
}

function runOut({ runout }) {
  if (!runout) return [];
  const below = known(runout.slow_roll_rpm) ? ` up to ${whole(runout.slow_roll_rpm)} r/min` : "";
  if (!runout.order_1x) return [make("p", `Run-out not known: no ${runout.source}${below}. 1X and 2X are as measured.`)];
  const at = ["x", "y"].map((probe) => `${probe} ${micrometres(runout.order_1x[`amplitude_peak_${probe}_um`])} µm ∠ ${lag(runout.order_1x[`lag_${probe}_deg`])}`);
  return [make("p", `Run-out at 1X, from ${runout.source}${below}: ${at.join(", ")}. It is taken off where it says compensated.`)];
}

function hysteresis(run) {
  return run.hysteresis.map((one) => {
    const apart = `${whole(Math.abs(one.width_rpm))} r/min ${one.width_rpm < 0 ? "higher" : "lower"}`;
    return make("p", `${order(one.order)} came at ${whole(one.onset_rpm)} r/min on the run-up and went at ${whole(one.end_rpm)} on the run-down: ${apart}.`);
  });
}

function subSynchronous(found) {
  if (!found.length) return make("p", "No component below 1X stood out.");
  const at = (place, direction) => `${whole(place.speed_rpm)} r/min ${direction ? arrow(direction) : ""}`.trim();
  return table(
    "Below 1X",
    ["order", "from", "to", "direction", "largest, µm peak", "there at"],
    found.map((one) => [order(one.order), at(one.begin, one.begin_ramp_direction), at(one.end, one.end_ramp_direction), one.direction, micrometres(one.largest_peak_um), at(one.largest_at)]),
  );
}

function model(agreement) {
  const one = agreement.synchronous;
  const lines = [];
  if (one && known(one.agrees_to_rpm)) {
    lines.push(`1X agrees within ${percent(one.within_amplitude_ratio)} and ${lag(one.within_lag_difference_deg)} up to ${whole(one.agrees_to_rpm)} r/min.`);
  }
  if (one) {
    lines.push(
      `1X in the median: measured ${decimals(one.median_amplitude_ratio, 2)} times the predicted, ${lagging(one.median_lag_difference_deg)}.`,
      `1X is furthest apart at ${whole(one.worst_amplitude_at_rpm)} r/min: measured ${decimals(one.worst_amplitude_ratio, 2)} times the predicted; ` +
        `at ${whole(one.worst_lag_at_rpm)} r/min ${lagging(one.worst_lag_difference_deg)}.`,
    );
  }
  for (const whirl of agreement.whirls) {
    const expected = known(whirl.predicted_order) ? `${order(whirl.predicted_order)} expected from ${whole(whirl.predicted_onset_rpm)} r/min` : "none expected";
    const missing = whirl.was_reached ? "none measured" : "not reached";
    const seen = known(whirl.measured_order) ? `${order(whirl.measured_order)} measured from ${whole(whirl.measured_onset_rpm)} r/min` : missing;
    lines.push(`Below 1X: ${expected}; ${seen}.`);
  }
  if (known(agreement.instability_onset_rpm)) lines.push(`The film is expected to let go at ${whole(agreement.instability_onset_rpm)} r/min.`);
  const node = make("div", "", "model");
  node.append(make("h3", "Model"), ...lines.map((line) => make("p", line)));
  return node;
}

function lagging(difference) {
  return `lagging ${decimals(Math.abs(difference), 0)}° ${difference < 0 ? "less" : "more"}`;
}

function percent(share) {
  return `${Math.round(100 * share)} %`;
}

function bySpeed(rows) {
  const step = Math.ceil(rows.length / 16);
  const polar = (line, probe) => `${micrometres(line[`amplitude_peak_${probe}_um`])} ∠ ${lag(line[`lag_${probe}_deg`])}`;
  return table(
    `By speed${step > 1 ? `, every ${step}th of ${rows.length} rows` : ""}${rows.some((row) => row.order_1x_compensated) ? "; compensated where run-out was known" : ""}`,
    ["r/min", "1X x, µm peak ∠ lag", "1X y", "2X x", "2X y", "overall x, µm p-p", "overall y"],
    rows
      .filter((_, index) => index % step === 0 && known(rows[index].speed_rpm))
      .map((row) => [
        `${whole(row.speed_rpm)} ${arrow(row.ramp_direction)}`, ...["order_1x", "order_2x"].flatMap((name) => ["x", "y"].map((probe) => polar(row[`${name}_compensated`] ?? row[name], probe))),
        micrometres(row.mean_peak_to_peak_x_um), micrometres(row.mean_peak_to_peak_y_um),
      ]),
  );
}

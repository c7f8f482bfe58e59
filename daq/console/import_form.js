// Form that uploads another program's file, maps its columns to a rig's channels and imports it as a run.

import { element } from "./elements.js";
import { formatInteger, isKnown } from "./format.js";
import { drawRuns } from "./run_list.js";
import { getJson, runJob, uploadFile } from "./service_client.js";

const UPLOADS = "/api/v1/uploads";
const READ_TIMEOUT = 35000; // ms
const UNITS = ["V", "mV", "um", "mm", "m"];

const note = (text) => {
  element("import-note").textContent = text;
};
let uploaded = null;
let content = null;
let runs = new Map();

function choice(name, values, chosen) {
  const node = document.createElement("select");
  node.setAttribute("aria-label", name);
  node.append(...values.map((value) => new Option(value, value, false, value === chosen)));
  return node;
}

// Lists the distinct rigs of the last recorded runs.
async function listRigs() {
  const { runs: listed } = await getJson("/api/v1/runs?complete=true&limit=100");
  const recorded = listed.filter((run) => run.device && run.device.backend !== "imported");
  const rigs = new Map(recorded.reverse().map((run) => [`${run.rig} ${run.calibration}`, run]));
  runs = new Map([...rigs.values()].reverse().map((run) => [run.run, run]));
  element("import-rig").replaceChildren(...[...runs.values()].map((run) => new Option(`${run.rig} as in ${run.run}`, run.run)));
  if (!runs.size) note("An import needs a recorded run of the same rig in this data folder.");
}

function drawColumns() {
  const run = runs.get(element("import-rig", HTMLSelectElement).value);
  const ready = Boolean(run && content);
  element("import-form").hidden = !ready;
  if (!ready) return;
  element("import-rate").hidden = isKnown(content.rate_hz);
  const names = content.columns.map((column) => column.name);
  const rows = run.channels.map((channel, index) => {
    const row = document.createElement("tr");
    const same = names.find((name) => name.split("/").pop().split("_")[0] === channel.name);
    const guess = same ?? names[Math.min(index, names.length - 1)];
    const unit = content.columns[names.indexOf(guess)].unit.replace("µ", "u");
    row.dataset.channel = channel.name;
    row.append(
      Object.assign(document.createElement("th"), { scope: "row", textContent: channel.name }),
      document.createElement("td"),
      document.createElement("td"),
    );
    row.cells[1].append(choice(`Column of ${channel.name}`, names, guess));
    row.cells[2].append(choice(`Unit of ${channel.name}`, channel.role === "tacho" ? UNITS.slice(0, 2) : UNITS, unit));
    return row;
  });
  element("import-columns").replaceChildren(...rows);
}

async function upload(file) {
  content = null;
  drawColumns();
  note(`Uploading ${file.name} …`);
  try {
    uploaded = await uploadFile(UPLOADS, file.name, file);
    note(`Reading ${file.name} …`);
    content = await getJson(uploaded.columns, READ_TIMEOUT);
    const rate = isKnown(content.rate_hz) ? ` at ${formatInteger(content.rate_hz)} samples/s` : "";
    note(`${file.name}: ${formatInteger(content.rows)} rows${rate}.`);
  } catch (error) {
    note(`${file.name} cannot be read: ${error.message}`);
  }
  drawColumns();
}

async function importFile(event) {
  event.preventDefault();
  const rows = [...element("import-columns", HTMLTableSectionElement).rows];
  const channel = Object.fromEntries(
    rows.map((row) => {
      const [source, unit] = [...row.querySelectorAll("select")].map((select) => select.value);
      return [row.dataset.channel, { source, unit }];
    }),
  );
  const rate = element("import-rate").hidden ? {} : { rate_hz: Number(element("import-rate-value", HTMLInputElement).value) };
  const jobRequest = {
    kind: "import",
    upload: uploaded.upload,
    rig: { source: "run", run: element("import-rig", HTMLSelectElement).value },
    mapping: { ...rate, note: element("import-comment", HTMLInputElement).value, channel },
  };
  try {
    const run = await runJob(jobRequest, note);
    note(`Imported as ${run.run}.`);
    drawRuns(run.run);
  } catch (error) {
    note(`Not imported: ${error.message}`);
  }
}

// Shows the form if the service accepts uploads and the token is valid.
export async function offerImport() {
  try {
    await getJson(UPLOADS);
  } catch {
    return;
  }
  element("importing").hidden = false;
}

function addListeners() {
  const [details, file] = [element("importing", HTMLDetailsElement), element("import-file", HTMLInputElement)];
  details.addEventListener("toggle", () => details.open && listRigs().then(drawColumns, (error) => note(error.message)));
  file.addEventListener("change", () => file.files?.length && upload(file.files[0]));
  element("import-rig").addEventListener("change", drawColumns);
  element("import-form").addEventListener("submit", importFile);
}

addListeners();

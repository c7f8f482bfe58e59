// Sends another program's file in, lets its columns be chosen, and has it made into a run of a rig that is known here.

import { known, whole } from "./figures.js";
import { doJob } from "./jobs.js";
import { drawRuns } from "./runs.js";
import { ask, sendFile } from "./service_client.js";

const UPLOADS = "/api/v1/uploads";
const READING_PATIENCE = 35000; // ms
const UNITS = ["V", "mV", "um", "mm", "m"];

const element = (id) => document.getElementById(id);
const note = (words) => {
  element("import-note").textContent = words;
};
let upload = null;
let found = null;
let runs = new Map();

function choice(name, values, chosen) {
  const node = document.createElement("select");
  node.setAttribute("aria-label", name);
  node.append(...values.map((value) => new Option(value, value, false, value === chosen)));
  return node;
}

// The rigs as they were in the last runs that were recorded, each once.
async function listRigs() {
  const { runs: listed } = await ask("/api/v1/runs?complete=true&limit=100");
  const recorded = listed.filter((run) => run.device && run.device.backend !== "imported");
  const rigs = new Map(recorded.reverse().map((run) => [`${run.rig} ${run.calibration}`, run]));
  runs = new Map([...rigs.values()].reverse().map((run) => [run.run, run]));
  element("import-rig").replaceChildren(...[...runs.values()].map((run) => new Option(`${run.rig} as in ${run.run}`, run.run)));
  if (!runs.size) note("A run that was recorded must be here first: it tells which rig the file is of.");
}

function drawColumns() {
  const run = runs.get(element("import-rig").value);
  const ready = Boolean(run && found);
  element("import-form").hidden = !ready;
  if (!ready) return;
  element("import-rate").hidden = known(found.rate_hz);
  const names = found.columns.map((column) => column.name);
  const rows = run.channels.map((channel, index) => {
    const row = document.createElement("tr");
    const same = names.find((name) => name.split("/").pop().split("_")[0] === channel.name);
    const guess = same ?? names[Math.min(index, names.length - 1)];
    const unit = found.columns[names.indexOf(guess)].unit.replace("µ", "u");
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

async function take(file) {
  found = null;
  drawColumns();
  note(`Sending ${file.name} …`);
  try {
    upload = await sendFile(UPLOADS, file.name, file);
    note(`Reading ${file.name} …`);
    found = await ask(upload.columns, READING_PATIENCE);
    const rate = known(found.rate_hz) ? ` at ${whole(found.rate_hz)} a second` : "";
    note(`${file.name}: ${whole(found.rows)} rows${rate}.`);
  } catch (error) {
    note(`${file.name} cannot be taken: ${error.message}`);
  }
  drawColumns();
}

async function make(event) {
  event.preventDefault();
  const rows = [...element("import-columns").rows];
  const channel = Object.fromEntries(
    rows.map((row) => {
      const [source, unit] = [...row.querySelectorAll("select")].map((select) => select.value);
      return [row.dataset.channel, { source, unit }];
    }),
  );
  const rate = element("import-rate").hidden ? {} : { rate_hz: Number(element("import-rate-value").value) };
  const order = {
    kind: "import",
    upload: upload.upload,
    rig: { source: "run", run: element("import-rig").value },
    mapping: { ...rate, note: element("import-words").value, channel },
  };
  try {
    const run = await doJob(order, note);
    note(`Imported as ${run.run}.`);
    drawRuns(run.run);
  } catch (error) {
    note(`Not imported: ${error.message}`);
  }
}

// Shows the place for it where the service takes files, and lets who asks in.
export async function offerImport() {
  try {
    await ask(UPLOADS);
  } catch {
    return;
  }
  element("importing").hidden = false;
}

function begin() {
  element("importing").addEventListener("toggle", () => element("importing").open && listRigs().then(drawColumns, (error) => note(error.message)));
  element("import-file").addEventListener("change", (event) => event.target.files.length && take(event.target.files[0]));
  element("import-rig").addEventListener("change", drawColumns);
  element("import-form").addEventListener("submit", make);
}

begin();

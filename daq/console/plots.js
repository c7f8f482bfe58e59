// Plots of a run's analyses, rendered by the service, one at a time.

import { getImage, runJob } from "./service_client.js";

const PLOT_TIMEOUT = 60000; // ms: the service may have to read samples first
/** @typedef {[name: string, kind: string, parameters: Record<string, string | number>]} PlotChoice */

/** @type {PlotChoice[]} */
const PLOTS_AT_TIME = [
  ["orbit", "orbit", {}],
  ["1X orbit", "orbit", { filter: "orders", orders: "1" }],
  ["not-1X orbit", "orbit", { filter: "without", orders: "1", revolutions: 8 }],
  ["order spectrum", "order-spectrum", {}],
  ["full spectrum", "full-spectrum", {}],
  ["average revolution", "average", {}],
  ["1X and 2X waveforms", "waveforms", { orders: "1,2" }],
  ["Poincaré points", "poincare", {}],
];
/** @type {PlotChoice[]} */
const PLOTS_OF_RUN = [
  ["Bode 1X", "bode", {}],
  ["Bode 2X", "bode", { order: 2 }],
  ["polar 1X", "polar", {}],
  ["cascade", "cascade", {}],
  ["full cascade", "cascade", { lines: "full" }],
  ["waterfall", "waterfall", {}],
  ["below 1X", "sub-synchronous", {}],
  ["1X and 2X over time", "envelopes", { orders: "1,2" }],
  ["bifurcation", "bifurcation", {}],
  ["centreline", "centreline", {}],
  ["overall", "overall", {}],
  ["frequency spectrum", "frequency-spectrum", {}],
  ["run-out", "slow-roll", {}],
];

function make(tag, properties = {}, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

// Returns buttons for the plots of a run, and the element that shows them.
export function plotsOf(run) {
  const speed = make("input", { type: "number", min: 1, step: "any", placeholder: "max. vibration", ariaLabel: "Speed, r/min" });
  const note = make("p", { className: "note", role: "status" });
  const plot = make("img", { alt: "", hidden: true });
  const save = make("a", { textContent: "Save plot", hidden: true });
  let latest = 0;

  async function show(name, kind, parameters) {
    const number = ++latest;
    note.textContent = `Plotting ${name} …`;
    const showProgress = (text) => number === latest && (note.textContent = text);
    try {
      const image = await plotImage(run, kind, parameters, showProgress);
      if (number !== latest) return;
      URL.revokeObjectURL(plot.src);
      Object.assign(plot, { src: URL.createObjectURL(image), alt: `${name} of ${run}`, hidden: false });
      Object.assign(save, { href: plot.src, download: `${run}-${name.replaceAll(" ", "-")}.svg`, hidden: false });
      note.textContent = "";
    } catch (error) {
      showProgress(error.message);
    }
  }

  const button = ([name, kind, parameters], more = () => ({})) =>
    make("button", { type: "button", textContent: name, onclick: () => show(name, kind, { ...parameters, ...more() }) });
  const at = () => (speed.value ? { speed_rpm: speed.value } : {});
  return make(
    "section",
    { className: "plots", ariaLabel: "Plots" },
    make("div", {}, make("span", { textContent: "over the run" }), ...PLOTS_OF_RUN.map((one) => button(one))),
    make("div", {}, make("label", {}, "at r/min ", speed), ...PLOTS_AT_TIME.map((one) => button(one, at))),
    note,
    plot,
    save,
  );
}

// Returns a plot as an image; if it exceeds the request's time limit, a job makes it and `onProgress` gets its progress.
async function plotImage(run, kind, parameters, onProgress) {
  const query = new URLSearchParams({ ...parameters, format: "svg", theme: "dark" });
  try {
    return await getImage(`/api/v1/runs/${encodeURIComponent(run)}/analyses/${kind}?${query}`, PLOT_TIMEOUT);
  } catch (error) {
    if (!error.job) throw error;
    return runJob(error.job, onProgress, getImage);
  }
}

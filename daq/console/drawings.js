// Draws what the samples of a run say: the service's own pictures, one at a time, as an operator asks for them.

import { doJob } from "./jobs.js";
import { askPicture } from "./service_client.js";

const PATIENCE = 60000; // ms: samples may have to be read first
const OF_A_MOMENT = [
  ["orbit", "orbit", {}],
  ["1X orbit", "orbit", { filter: "orders", orders: "1" }],
  ["not-1X orbit", "orbit", { filter: "rest", orders: "1", revolutions: 8 }],
  ["order spectrum", "order-spectrum", {}],
  ["full spectrum", "full-spectrum", {}],
  ["average revolution", "average", {}],
  ["Poincaré points", "poincare", {}],
];
const OF_THE_RUN = [
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
];

function make(tag, properties = {}, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

// Returns buttons that draw a run, and room for the drawing.
export function drawingsOf(run) {
  const speed = make("input", { type: "number", min: 1, step: "any", placeholder: "largest vibration", ariaLabel: "Speed, r/min" });
  const note = make("p", { className: "note", role: "status" });
  const picture = make("img", { alt: "", hidden: true });
  const save = make("a", { textContent: "save it", hidden: true });
  let latest = 0;

  async function show(name, kind, parameters) {
    const number = ++latest;
    note.textContent = `Drawing ${name} …`;
    const told = (words) => number === latest && (note.textContent = words);
    try {
      const drawn = await pictureOf(run, kind, parameters, told);
      if (number !== latest) return;
      URL.revokeObjectURL(picture.src);
      Object.assign(picture, { src: URL.createObjectURL(drawn), alt: `${name} of ${run}`, hidden: false });
      Object.assign(save, { href: picture.src, download: `${run}-${name.replaceAll(" ", "-")}.svg`, hidden: false });
      note.textContent = "";
    } catch (error) {
      told(error.message);
    }
  }

  const button = ([name, kind, parameters], more = () => ({})) =>
    make("button", { type: "button", textContent: name, onclick: () => show(name, kind, { ...parameters, ...more() }) });
  const at = () => (speed.value ? { speed_rpm: speed.value } : {});
  return make(
    "section",
    { className: "drawings", ariaLabel: "Drawings" },
    make("div", {}, make("span", { textContent: "over the run" }), ...OF_THE_RUN.map((one) => button(one))),
    make("div", {}, make("label", {}, "at r/min ", speed), ...OF_A_MOMENT.map((one) => button(one, at))),
    note,
    picture,
    save,
  );
}

// Returns a drawing; where that takes too long to wait for, a job makes it, and `told` hears how it goes.
async function pictureOf(run, kind, parameters, told) {
  const asked = new URLSearchParams({ ...parameters, format: "svg" });
  try {
    return await askPicture(`/api/v1/runs/${encodeURIComponent(run)}/analyses/${kind}?${asked}`, PATIENCE);
  } catch (error) {
    if (!error.job) throw error;
    return doJob(error.job, told, askPicture);
  }
}

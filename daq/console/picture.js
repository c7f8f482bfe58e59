// Draws the orbit in its clearance circle and the order spectrum, measured and predicted, where there is no viewer.

import { listen } from "./live_socket.js";
import { ask } from "./service_client.js";
import { drawTrend } from "./trend.js";

const SVG = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT] = [800, 640]; // of the spectrum's plane
const INTERVAL = 500; // ms between two pictures that are asked for where the socket is not let through

export function draw(parent, tag, attributes, text = "") {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.textContent = text;
  parent.append(node);
  return node;
}

export function plane(parent, box, label) {
  const svg = draw(parent, "svg", { viewBox: box, role: "img", "aria-label": label });
  return svg;
}

// The next of 1, 2, 5 times a power of ten.
function rounded(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * (1 - 1e-9));
}

function largest(curves, names) {
  return Math.max(0, ...curves.filter(Boolean).flatMap((one) => names.flatMap((name) => one[name].map(Math.abs))));
}

// The parts of a full scale between its grid lines, so that their numbers are short.
export function parts(scale) {
  const count = String(scale).startsWith("2") ? 4 : 5;
  return Array.from({ length: count + 1 }, (_, k) => k / count);
}

// A scale that grows at once and shrinks only when a third of it would do.
export function follow(scale, needed) {
  const wanted = rounded(Math.max(needed * 1.1, 1));
  return wanted > scale || needed < scale / 3 ? wanted : scale;
}

let reach = 5;
let level = 5;

const figure = (value) => String(Number(value.toPrecision(3)));
const placed = (across, up, unit) => across.map((x, k) => [x * unit, -up[k] * unit]);

function drawPath(svg, points, kind) {
  draw(svg, "polyline", { points: points.map((point) => point.map((one) => one.toFixed(2)).join()).join(" "), class: kind });
}

function drawOrbit(parent, picture) {
  reach = follow(reach, largest([picture.measured, picture.predicted], ["orbit_x_um", "orbit_y_um"]));
  const svg = plane(parent, "-118 -118 236 250", "Orbit seen from the compressor end, measured and predicted, µm");
  const unit = 100 / reach;
  draw(svg, "rect", { x: -100, y: -100, width: 200, height: 200, class: "frame" });
  draw(svg, "path", { d: "M-100 0H100M0 -100V100", class: "grid" });
  for (const part of [-1, -0.5, 0.5, 1]) {
    draw(svg, "text", { x: 100 * part, y: 112, class: "tick middle" }, figure(part * reach));
  }
  draw(svg, "text", { x: 0, y: 112, class: "tick middle" }, "µm");
  draw(svg, "text", { x: 0, y: 128, class: "caption middle" }, `orbit${picture.measured?.compensated_orbit_x_um ? ", compensated (thin: as measured)" : ""} · clearance ${picture.clearance_um} µm`);
  if (picture.clearance_um <= reach) draw(svg, "circle", { r: picture.clearance_um * unit, class: "clearance" });
  for (const [source, kind] of [[picture.predicted, "model"], [picture.measured, "measured"]]) {
    if (!source) continue;
    const compensated = source.compensated_orbit_x_um;
    if (compensated) drawPath(svg, placed(source.orbit_x_um, source.orbit_y_um, unit), "curve raw");
    const points = placed(compensated ?? source.orbit_x_um, source.compensated_orbit_y_um ?? source.orbit_y_um, unit);
    drawPath(svg, points, `curve ${kind}`);
    for (let k = 0; k < points.length; k += picture.points_per_revolution) {
      draw(svg, "circle", { cx: points[k][0], cy: points[k][1], r: 3, class: `mark ${kind}` });
    }
  }
}

function drawSpectrum(parent, picture) {
  const sources = [picture.measured, picture.predicted];
  level = follow(level, largest(sources, ["spectrum_peak_x_um", "spectrum_peak_y_um"]));
  const svg = plane(parent, `-70 -16 ${WIDTH + 90} ${HEIGHT + 86}`, "Order spectrum, measured and predicted, µm peak by order");
  const orders = sources.find(Boolean)?.orders ?? [0, 8];
  const highest = Math.min(4, orders[orders.length - 1]);
  for (let k = 0; k <= highest; k += 0.5) {
    const x = (WIDTH * k) / highest;
    draw(svg, "path", { d: `M${x} 0V${HEIGHT}`, class: k === 1 ? "first" : "grid" });
    draw(svg, "text", { x, y: HEIGHT + 30, class: "label middle" }, `${k}X`);
  }
  for (const part of parts(level)) {
    draw(svg, "path", { d: `M0 ${HEIGHT * (1 - part)}H${WIDTH}`, class: "grid" });
    draw(svg, "text", { x: -10, y: HEIGHT * (1 - part) + 7, class: "label end" }, figure(level * part));
  }
  draw(svg, "text", { x: WIDTH / 2, y: HEIGHT + 66, class: "label middle" }, "order spectrum · µm peak · Hann window");
  const curve = (source, name, kind) => {
    const points = source.orders.flatMap((order, k) => (order <= highest ? [`${((WIDTH * order) / highest).toFixed(1)},${(HEIGHT * (1 - source[name][k] / level)).toFixed(1)}`] : []));
    draw(svg, "polyline", { points: points.join(" "), class: `curve ${kind}` });
  };
  if (picture.measured) {
    curve(picture.measured, "spectrum_peak_x_um", "x");
    curve(picture.measured, "spectrum_peak_y_um", "y");
  }
  if (!picture.measured) {
    draw(svg, "text", { x: WIDTH / 2, y: HEIGHT / 2, class: "missing middle" }, "no whole revolutions measured now");
  }
  if (picture.predicted) curve(picture.predicted, "spectrum_peak_x_um", "model");
}

function legend(parent) {
  const node = document.createElement("p");
  node.className = "legend";
  for (const [name, text] of [["x", "━ measured x, orbit"], ["y", "━ measured y"], ["model", "╍ model"]]) {
    const part = document.createElement("span");
    part.className = name;
    part.textContent = text;
    node.append(part);
  }
  parent.append(node);
}

let shown = null; // where, what there is without a picture, and the latest picture

// Draws the latest picture anew, for what else is drawn beside it.
export function drawAgain() {
  if (shown) show(...shown);
}

function show(parent, empty, picture) {
  shown = [parent, empty, picture];
  if (!picture) {
    parent.replaceChildren(empty);
    return;
  }
  const drawn = document.createElement("div");
  drawn.className = "picture";
  drawOrbit(drawn, picture);
  drawSpectrum(drawn, picture);
  drawTrend(drawn);
  legend(drawn);
  parent.replaceChildren(drawn);
}

// Draws what the socket tells; where it is not let through the page asks.
export async function followPicture(parent, empty) {
  const isOpen = listen("/api/v1/live/curves", (picture) => show(parent, empty, picture));
  for (;;) {
    await new Promise((done) => setTimeout(done, INTERVAL));
    if (isOpen()) continue;
    try {
      show(parent, empty, await ask("/api/v1/live/curves"));
    } catch (error) {
      if (error.name === "no-live-run") show(parent, empty, null);
    }
  }
}

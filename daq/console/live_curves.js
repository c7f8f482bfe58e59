// Live orbit within the clearance circle and order spectrum, measured and predicted, for a page without the viewer.

import { drawTrend } from "./trend.js";
import { getJson, listen } from "./service_client.js";

const SVG = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT] = [800, 640]; // of the spectrum's plane
const POLL_INTERVAL = 500; // ms, while the WebSocket is not open

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

// Returns the value rounded up to 1, 2 or 5 times a power of ten.
function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * ([1, 2, 5].find((step) => step * power >= value * (1 - 1e-9)) ?? 10);
}

function largest(sources, names) {
  return Math.max(0, ...sources.filter(Boolean).flatMap((one) => names.flatMap((name) => one[name].map(Math.abs))));
}

// Returns the positions of a scale's grid lines, 0 to 1, such that their labels are short.
export function gridPositions(scale) {
  const count = String(scale).startsWith("2") ? 4 : 5;
  return Array.from({ length: count + 1 }, (_, k) => k / count);
}

// Returns an axis scale that grows at once and shrinks only if a third of it suffices.
export function adaptScale(scale, needed) {
  const wanted = roundUp(Math.max(needed * 1.1, 1));
  return wanted > scale || needed < scale / 3 ? wanted : scale;
}

let reach = 5;
let level = 5;

const formatTick = (value) => String(Number(value.toPrecision(3)));
const toPoints = (xs, ys, unit) => xs.map((x, k) => [x * unit, -ys[k] * unit]);

function drawPath(svg, points, kind) {
  draw(svg, "polyline", { points: points.map((point) => point.map((one) => one.toFixed(2)).join()).join(" "), class: kind });
}

function drawOrbit(parent, curves) {
  reach = adaptScale(reach, largest([curves.measured, curves.predicted], ["orbit_x_um", "orbit_y_um"]));
  const svg = plane(parent, "-118 -118 236 250", "Orbit seen from the compressor end, measured and predicted, µm");
  const unit = 100 / reach;
  draw(svg, "rect", { x: -100, y: -100, width: 200, height: 200, class: "frame" });
  draw(svg, "path", { d: "M-100 0H100M0 -100V100", class: "grid" });
  for (const part of [-1, -0.5, 0.5, 1]) {
    draw(svg, "text", { x: 100 * part, y: 112, class: "tick middle" }, formatTick(part * reach));
  }
  draw(svg, "text", { x: 0, y: 112, class: "tick middle" }, "µm");
  draw(svg, "text", { x: 0, y: 128, class: "caption middle" }, `orbit${curves.measured?.compensated_orbit_x_um ? ", compensated (thin: as measured)" : ""} · clearance ${curves.clearance_um} µm`);
  if (curves.clearance_um <= reach) draw(svg, "circle", { r: curves.clearance_um * unit, class: "clearance" });
  for (const [source, kind] of [[curves.predicted, "model"], [curves.measured, "measured"]]) {
    if (!source) continue;
    const compensated = source.compensated_orbit_x_um;
    if (compensated) drawPath(svg, toPoints(source.orbit_x_um, source.orbit_y_um, unit), "curve raw");
    const points = toPoints(compensated ?? source.orbit_x_um, source.compensated_orbit_y_um ?? source.orbit_y_um, unit);
    drawPath(svg, points, `curve ${kind}`);
    for (let k = 0; k < points.length; k += curves.points_per_revolution) {
      draw(svg, "circle", { cx: points[k][0], cy: points[k][1], r: 3, class: `mark ${kind}` });
    }
  }
}

function drawSpectrum(parent, curves) {
  const sources = [curves.measured, curves.predicted];
  level = adaptScale(level, largest(sources, ["spectrum_peak_x_um", "spectrum_peak_y_um"]));
  const svg = plane(parent, `-70 -16 ${WIDTH + 90} ${HEIGHT + 86}`, "Order spectrum, measured and predicted, µm peak by order");
  const orders = sources.find(Boolean)?.orders ?? [0, 8];
  const highest = Math.min(4, orders[orders.length - 1]);
  for (let k = 0; k <= highest; k += 0.5) {
    const x = (WIDTH * k) / highest;
    draw(svg, "path", { d: `M${x} 0V${HEIGHT}`, class: k === 1 ? "first" : "grid" });
    draw(svg, "text", { x, y: HEIGHT + 30, class: "label middle" }, `${k}X`);
  }
  for (const part of gridPositions(level)) {
    draw(svg, "path", { d: `M0 ${HEIGHT * (1 - part)}H${WIDTH}`, class: "grid" });
    draw(svg, "text", { x: -10, y: HEIGHT * (1 - part) + 7, class: "label end" }, formatTick(level * part));
  }
  draw(svg, "text", { x: WIDTH / 2, y: HEIGHT + 66, class: "label middle" }, "order spectrum · µm peak");
  const curve = (source, name, kind) => {
    const points = source.orders.flatMap((order, k) => (order <= highest ? [`${((WIDTH * order) / highest).toFixed(1)},${(HEIGHT * (1 - source[name][k] / level)).toFixed(1)}`] : []));
    draw(svg, "polyline", { points: points.join(" "), class: `curve ${kind}` });
  };
  if (curves.measured) {
    curve(curves.measured, "spectrum_peak_x_um", "x");
    curve(curves.measured, "spectrum_peak_y_um", "y");
  }
  if (!curves.measured) {
    draw(svg, "text", { x: WIDTH / 2, y: HEIGHT / 2, class: "missing middle" }, "no complete revolutions measured now");
  }
  if (curves.predicted) curve(curves.predicted, "spectrum_peak_x_um", "model");
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

let shown = null; // parent element, placeholder without a run, and the latest curves

// Draws the latest curves again, together with the trend.
export function redraw() {
  if (shown) show(...shown);
}

function show(parent, empty, curves) {
  shown = [parent, empty, curves];
  if (!curves) {
    parent.replaceChildren(empty);
    return;
  }
  const drawn = document.createElement("div");
  drawn.className = "curves";
  drawOrbit(drawn, curves);
  drawSpectrum(drawn, curves);
  drawTrend(drawn);
  legend(drawn);
  parent.replaceChildren(drawn);
}

// Draws the curves as they arrive over the WebSocket; polls while it is not open.
export async function followCurves(parent, empty) {
  const isOpen = listen("/api/v1/live/curves", (curves) => show(parent, empty, curves));
  for (;;) {
    await new Promise((done) => setTimeout(done, POLL_INTERVAL));
    if (isOpen()) continue;
    try {
      show(parent, empty, await getJson("/api/v1/live/curves"));
    } catch (error) {
      if (error.name === "no-live-run") show(parent, empty, null);
    }
  }
}

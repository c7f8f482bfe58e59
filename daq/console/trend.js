// Overall vibration, speed and markers over the last minutes, for a page without the viewer.

import { formatFixed, formatInteger, isKnown } from "./format.js";
import { adaptScale, draw, plane } from "./live_curves.js";

const [WIDTH, HEIGHT] = [1600, 260];
const SHORT_SPANS = [60, 300]; // s: the shortest that holds the run, or the longest
const LONGEST_SPAN = 1800; // s
const INTERVAL = 0.5; // s between two points
const MAX_LABEL_LENGTH = 30; // characters of a marker's label

let run = null;
let points = [];
let markers = [];
let now = 0;
let vibrationScale = 10;
let speedScale = 1000;

// Adds a live update to the trend; returns whether it must be redrawn: a new run or a new marker.
export function addToTrend({ run: id, status, measured }) {
  const mustRedraw = id !== run || status.markers.length !== markers.length;
  if (id !== run || status.elapsed_s < now) points = [];
  run = id;
  now = status.elapsed_s;
  markers = status.markers;
  if (!measured) return mustRedraw;
  const [x, y, speed] = [measured.peak_to_peak_x_um, measured.peak_to_peak_y_um, measured.speed_rpm];
  const last = points.at(-1);
  if (last && now < last.at + INTERVAL) Object.assign(last, { x: Math.max(last.x, x), y: Math.max(last.y, y), speed });
  else points.push({ at: now, x, y, speed });
  if (points.length > LONGEST_SPAN / INTERVAL) points.shift();
  return mustRedraw;
}

export function drawTrend(parent) {
  const span = SHORT_SPANS.find((one) => now <= one) ?? LONGEST_SPAN;
  const shown = points.filter((point) => point.at >= now - span);
  const across = (at) => (WIDTH * (at - now + span)) / span;
  vibrationScale = adaptScale(vibrationScale, Math.max(0, ...shown.map((point) => Math.max(point.x ?? 0, point.y ?? 0))));
  speedScale = adaptScale(speedScale, Math.max(0, ...shown.map((point) => point.speed ?? 0)));
  const svg = plane(parent, `-80 -30 ${WIDTH + 190} ${HEIGHT + 84}`, "Overall vibration, µm peak-to-peak, and speed, r/min, over the last minutes");
  svg.classList.add("trend");
  for (const part of [0, 0.5, 1]) {
    const y = HEIGHT * (1 - part);
    draw(svg, "path", { d: `M0 ${y}H${WIDTH}`, class: "grid" });
    draw(svg, "text", { x: -10, y: y + 7, class: "label end" }, `${vibrationScale * part}`);
    draw(svg, "text", { x: WIDTH + 10, y: y + 7, class: "label" }, formatInteger(speedScale * part));
  }
  for (let part = 0; part <= 1; part += 1 / 6) {
    const value = (span * (part - 1)) / (span > 60 ? 60 : 1);
    draw(svg, "path", { d: `M${WIDTH * part} 0V${HEIGHT}`, class: "grid" });
    draw(svg, "text", { x: WIDTH * part, y: HEIGHT + 30, class: "label middle" }, formatFixed(Math.round(value), 0));
  }
  draw(svg, "text", { x: 0, y: -8, class: "label" }, "overall · µm peak-to-peak");
  draw(svg, "text", { x: WIDTH, y: -8, class: "label end" }, "speed · r/min (white)");
  draw(svg, "text", { x: WIDTH / 2, y: HEIGHT + 52, class: "label middle" }, `${span > 60 ? "min" : "s"} before now`);
  const scales = { speed: speedScale, y: vibrationScale, x: vibrationScale };
  for (const [name, full] of Object.entries(scales)) {
    const curve = shown.filter((point) => isKnown(point[name]));
    const path = curve.map((point) => `${across(point.at).toFixed(1)},${(HEIGHT * (1 - point[name] / full)).toFixed(1)}`);
    draw(svg, "polyline", { points: path.join(" "), class: `curve ${name}` });
  }
  for (const marker of markers.filter((one) => isKnown(one.elapsed_s) && one.elapsed_s >= now - span)) {
    const x = across(marker.elapsed_s);
    const label = marker.text.length > MAX_LABEL_LENGTH ? `${marker.text.slice(0, MAX_LABEL_LENGTH - 1)}…` : marker.text;
    draw(svg, "path", { d: `M${x} 0V${HEIGHT}`, class: `flag ${marker.kind}` });
    const isFarLeft = x < WIDTH / 4; // otherwise the label would extend beyond the left edge
    draw(svg, "text", { x: isFarLeft ? x + 6 : x - 6, y: 22, class: `label ${isFarLeft ? "" : "end"} ${marker.kind}` }, label);
  }
}

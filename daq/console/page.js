// Follows the live run over a WebSocket, asks for it where nothing is told, and says so when neither answers.

import { clock } from "./figures.js";
import { offerImport } from "./imports.js";
import { drawIdle, drawLive } from "./live.js";
import { listen } from "./live_socket.js";
import { drawAgain, followPicture } from "./picture.js";
import { drawRuns } from "./runs.js";
import { ask, heldToken, keepToken, send, takeTokenFromAddress } from "./service_client.js";
import { addToTrend } from "./trend.js";

const LIVE_INTERVAL = 200; // ms
const IDLE_INTERVAL = 1000; // also without a word over the socket before the page asks itself
const RUNS_INTERVAL = 10000;
const PATIENCE = 1500; // ms without an answer, or without new samples, before that is said

const element = (id) => document.getElementById(id);
const later = (interval) => new Promise((done) => setTimeout(done, interval));
let answered = performance.now();
let moved = performance.now();
let elapsed = null;
let state = null;

const isUnderWay = (name) => ["armed", "recording", "degraded", "interrupted", "replaying"].includes(name);
const isMoving = (name) => isUnderWay(name) && !["armed", "interrupted"].includes(name);

function tell(text) {
  const node = element("connection");
  node.className = "banner lost";
  if (text && node.textContent !== text) node.textContent = text;
  node.hidden = !text;
  document.body.classList.toggle("stale", Boolean(text));
}

function watch() {
  const now = performance.now();
  const silent = now - answered;
  const still = now - moved;
  if (silent > PATIENCE && (state === "finished" || state === "failed")) {
    tell(`The run has ${state} and its service has ended. These are its last values.`);
  } else if (silent > PATIENCE) {
    tell(`CONNECTION LOST: no answer from the service for ${clock(silent / 1000)}. The values shown are old.`);
  } else if (isMoving(state) && still > PATIENCE + 500) {
    tell(`NO NEW SAMPLES for ${clock(still / 1000)}. The values shown are old.`);
  } else {
    tell("");
  }
}

function take(live) {
  answered = performance.now();
  element("token").hidden = true;
  if (!live) {
    state = null;
    drawIdle();
    return;
  }
  const ended = state && state !== live.status.state;
  if (live.status.elapsed_s !== elapsed) moved = answered;
  elapsed = live.status.elapsed_s;
  state = live.status.state;
  drawLive(live);
  if (addToTrend(live)) drawAgain();
  if (ended && !isUnderWay(state)) drawRuns(live.run);
}

async function step() {
  try {
    take(await ask("/api/v1/live"));
    return LIVE_INTERVAL;
  } catch (error) {
    if (error.name === "no-live-run") {
      take(null);
      return IDLE_INTERVAL;
    }
    if (error.name === "token-required") {
      answered = performance.now();
      element("token").hidden = false;
      if (heldToken()) element("token-label").textContent = "That is not this service's token";
      return IDLE_INTERVAL;
    }
    return IDLE_INTERVAL / 2;
  }
}

let told = performance.now() - IDLE_INTERVAL / 2; // when the socket last had a word; it is given a moment to open

async function follow() {
  const isOpen = listen("/api/v1/live", (live) => {
    told = performance.now();
    take(live);
  });
  for (;;) {
    const isQuiet = isOpen() && state === null; // nothing goes on, and nothing is told until something does
    if (isQuiet) answered = performance.now();
    await later(isQuiet || performance.now() - told < IDLE_INTERVAL ? LIVE_INTERVAL : await step());
  }
}

async function listRuns() {
  for (;;) {
    await drawRuns();
    await later(RUNS_INTERVAL);
  }
}

// The viewer is a server of its own that only the bench's machine can reach; elsewhere the page draws by itself.
function showViewer(address) {
  const here = ["localhost", "127.0.0.1", "[::1]"];
  if (!address || (here.includes(new URL(address).hostname) && !here.includes(location.hostname))) {
    const empty = element("empty");
    empty.textContent = "No run is under way.\nOrbit and order spectrum are drawn here when one is.";
    followPicture(element("view"), empty);
  } else {
    const frame = document.createElement("iframe");
    frame.src = address;
    frame.title = "Live view: orbit, order spectrum, cascade, amplitude and phase against speed";
    frame.referrerPolicy = "no-referrer";
    frame.allow = "fullscreen; clipboard-write";
    element("view").replaceChildren(frame);
  }
}

element("token").addEventListener("submit", (event) => {
  event.preventDefault();
  keepToken(element("token-value").value);
  drawRuns();
  offerImport();
});

async function acknowledge() {
  const button = element("acknowledge");
  button.disabled = true;
  try {
    await send("/api/v1/live/acknowledge");
    button.textContent = "Acknowledge";
  } catch (error) {
    button.textContent = `Not acknowledged: ${error.message}`;
  } finally {
    button.disabled = false;
  }
}

element("acknowledge").addEventListener("click", acknowledge);
document.addEventListener("keydown", (event) => {
  const typing = event.target.matches("input, textarea") || event.ctrlKey || event.metaKey || event.altKey;
  if (event.key === "a" && !typing && !element("alarms").hidden && !element("acknowledge").hidden) acknowledge();
});

async function markMoment(event) {
  event.preventDefault();
  const word = element("mark-text");
  try {
    const made = await send("/api/v1/live/markers", { text: word.value.trim() || "mark" });
    word.value = "";
    word.placeholder = `marked “${made.text}”`;
  } catch (error) {
    word.placeholder = `not marked: ${error.message}`;
  }
  word.blur();
}

element("marking").addEventListener("submit", markMoment);

const SURE = 4000; // ms in which a second press ends the run

// A single press, perhaps by mistake, ends nothing.
async function stopRun({ currentTarget: button }) {
  if (!button.classList.contains("sure")) {
    button.classList.add("sure");
    button.textContent = "Press again to stop";
    setTimeout(() => {
      button.classList.remove("sure");
      button.textContent = "Stop";
    }, SURE);
    return;
  }
  try {
    await send("/api/v1/live/stop");
    button.textContent = "Stopping …";
  } catch (error) {
    button.textContent = `Not stopped: ${error.message}`;
  }
}

element("stop").addEventListener("click", stopRun);
document.addEventListener("keydown", (event) => {
  const typing = event.target.matches("input, textarea") || event.ctrlKey || event.metaKey || event.altKey;
  if (event.key !== "m" || typing || element("marking").hidden) return;
  event.preventDefault();
  element("mark-text").focus();
});

takeTokenFromAddress();
showViewer(document.body.dataset.viewer);
setInterval(watch, 250);
follow();
listRuns();
offerImport();

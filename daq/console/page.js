// The operator's page: shows the live run from a WebSocket or by polling, and reports a lost connection.

import { element, isTyping } from "./elements.js";
import { formatClock } from "./format.js";
import { offerImport } from "./import_form.js";
import { drawIdle, drawLive } from "./live_values.js";
import { redraw, followCurves } from "./live_curves.js";
import { drawRuns } from "./run_list.js";
import { addToTrend } from "./trend.js";
import { getJson, listen, postJson, readTokenFromUrl, storeToken, storedToken } from "./service_client.js";

const LIVE_INTERVAL = 200; // ms
const IDLE_INTERVAL = 1000; // also the time without a WebSocket message until the page polls
const RUNS_INTERVAL = 10000;
const STALE_AFTER = 1500; // ms without a response, or without new samples, until a warning

const delay = (interval) => new Promise((done) => setTimeout(done, interval));
let lastResponse = performance.now();
let lastProgress = performance.now();
let elapsed = null;
let state = null;

const isUnderWay = (name) => ["armed", "recording", "degraded", "interrupted", "replaying"].includes(name);
const isMoving = (name) => isUnderWay(name) && !["armed", "interrupted"].includes(name);

function showConnection(text) {
  const node = element("connection");
  node.className = "banner lost";
  if (text && node.textContent !== text) node.textContent = text;
  node.hidden = !text;
  document.body.classList.toggle("stale", Boolean(text));
}

function checkConnection() {
  const now = performance.now();
  const silent = now - lastResponse;
  const still = now - lastProgress;
  if (silent > STALE_AFTER && (state === "finished" || state === "failed")) {
    showConnection(`The run has ${state} and the service has stopped. These are its last values.`);
  } else if (silent > STALE_AFTER) {
    showConnection(`CONNECTION LOST: no response from the service for ${formatClock(silent / 1000)}. The values shown are old.`);
  } else if (isMoving(state) && still > STALE_AFTER + 500) {
    showConnection(`NO NEW SAMPLES for ${formatClock(still / 1000)}. The values shown are old.`);
  } else {
    showConnection("");
  }
}

function update(live) {
  lastResponse = performance.now();
  element("token").hidden = true;
  if (!live) {
    state = null;
    drawIdle();
    return;
  }
  const ended = state && state !== live.status.state;
  if (live.status.elapsed_s !== elapsed) lastProgress = lastResponse;
  elapsed = live.status.elapsed_s;
  state = live.status.state;
  drawLive(live);
  if (addToTrend(live)) redraw();
  if (ended && !isUnderWay(state)) drawRuns(live.run);
}

async function poll() {
  try {
    update(await getJson("/api/v1/live"));
    return LIVE_INTERVAL;
  } catch (error) {
    if (error.name === "no-live-run") {
      update(null);
      return IDLE_INTERVAL;
    }
    if (error.name === "token-required") {
      lastResponse = performance.now();
      element("token").hidden = false;
      if (storedToken()) element("token-label").textContent = "The token is wrong";
      return IDLE_INTERVAL;
    }
    return IDLE_INTERVAL / 2;
  }
}

let lastMessage = performance.now() - IDLE_INTERVAL / 2; // of the WebSocket; the offset gives it time to open

async function follow() {
  const isOpen = listen("/api/v1/live", (live) => {
    lastMessage = performance.now();
    update(live);
  });
  for (;;) {
    const isQuiet = isOpen() && state === null; // without a run the WebSocket sends nothing until one starts
    if (isQuiet) lastResponse = performance.now();
    await delay(isQuiet || performance.now() - lastMessage < IDLE_INTERVAL ? LIVE_INTERVAL : await poll());
  }
}

async function listRuns() {
  for (;;) {
    await drawRuns();
    await delay(RUNS_INTERVAL);
  }
}

// Only the bench's own machine can reach the viewer's server; on other machines the page draws the curves itself.
function showViewer(address) {
  const here = ["localhost", "127.0.0.1", "[::1]"];
  if (!address || (here.includes(new URL(address).hostname) && !here.includes(location.hostname))) {
    const empty = element("empty");
    empty.textContent = "No run in progress.\nA run's orbit and order spectrum appear here.";
    followCurves(element("view"), empty);
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
  storeToken(element("token-value", HTMLInputElement).value);
  drawRuns();
  offerImport();
});

async function acknowledge() {
  const button = element("acknowledge", HTMLButtonElement);
  button.disabled = true;
  try {
    await postJson("/api/v1/live/acknowledge");
    button.textContent = "Acknowledge";
  } catch (error) {
    button.textContent = `Not acknowledged: ${error.message}`;
  } finally {
    button.disabled = false;
  }
}

element("acknowledge").addEventListener("click", acknowledge);
document.addEventListener("keydown", (event) => {
  if (event.key === "a" && !isTyping(event) && !element("alarms").hidden && !element("acknowledge").hidden) acknowledge();
});

async function addMarker(event) {
  event.preventDefault();
  const input = element("marker-text", HTMLInputElement);
  try {
    const marker = await postJson("/api/v1/live/markers", { text: input.value.trim() });
    input.value = "";
    input.placeholder = `marked “${marker.text}”`;
  } catch (error) {
    input.placeholder = `not marked: ${error.message}`;
  }
  input.blur();
}

element("marker-form").addEventListener("submit", addMarker);

const CONFIRM_TIME = 4000; // ms for the second press that stops the run

// Stops the run on the second press, so that an accidental one has no effect.
async function stopRun({ currentTarget: button }) {
  if (!button.classList.contains("confirm")) {
    button.classList.add("confirm");
    button.textContent = "Press again to stop";
    setTimeout(() => {
      button.classList.remove("confirm");
      button.textContent = "Stop";
    }, CONFIRM_TIME);
    return;
  }
  try {
    await postJson("/api/v1/live/stop");
    button.textContent = "Stopping …";
  } catch (error) {
    button.textContent = `Not stopped: ${error.message}`;
  }
}

element("stop").addEventListener("click", stopRun);
document.addEventListener("keydown", (event) => {
  if (event.key !== "m" || isTyping(event) || element("marker-form").hidden) return;
  event.preventDefault();
  element("marker-text").focus();
});

readTokenFromUrl();
showViewer(document.body.dataset.viewer);
setInterval(checkConnection, 250);
follow();
listRuns();
offerImport();

// Requests to the service: token, JSON, images, file uploads, jobs and live WebSockets.

const TOKEN_KEY = "rig-token";
const UPLOAD_TIMEOUT = 600000; // ms
const JOB_POLL_INTERVAL = 400; // ms
const RECONNECT_DELAY = 2000; // ms

// A problem response (RFC 9457); `name` is the problem type, for example "run-not-found".
export class Problem extends Error {
  constructor(problem) {
    super(problem.detail || problem.title);
    this.name = problem.type.split("#").pop();
    this.status = problem.status;
    this.job = problem.job;
  }
}

export function storeToken(token) {
  sessionStorage.setItem(TOKEN_KEY, token);
}

export function storedToken() {
  return sessionStorage.getItem(TOKEN_KEY);
}

// The page's URL may contain the token after the #, which browsers do not send.
export function readTokenFromUrl() {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (token) {
    storeToken(token);
    history.replaceState(null, "", location.pathname);
  }
}

export async function getJson(path, timeout = 2000) {
  return (await request(path, { cache: "no-store" }, timeout)).json();
}

export async function getImage(path, timeout = 2000) {
  return (await request(path, { cache: "no-cache" }, timeout)).blob();
}

export async function postJson(path, content = {}, timeout = 2000) {
  const options = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(content) };
  return (await request(path, options, timeout)).json();
}

// Uploads a file; of its properties only `name` is sent.
export async function uploadFile(path, name, file) {
  const options = { method: "POST", headers: { "Content-Type": "application/octet-stream" }, body: file };
  return (await request(`${path}?name=${encodeURIComponent(name)}`, options, UPLOAD_TIMEOUT)).json();
}

async function request(path, options, timeout) {
  const token = storedToken();
  const headers = { ...options.headers, ...(token ? { Authorization: `Bearer ${token}` } : {}) };
  const response = await fetch(path, { ...options, headers, signal: AbortSignal.timeout(timeout) });
  if (response.ok) return response;
  if (response.headers.get("content-type")?.startsWith("application/problem+json")) {
    throw new Problem(await response.json());
  }
  throw new Error(`HTTP ${response.status}`);
}

// Runs a job and returns its result, downloaded by `download`; `onProgress` receives the progress as text.
export async function runJob(jobRequest, onProgress, download = getJson) {
  let job = await postJson("/api/v1/jobs", jobRequest);
  const url = `/api/v1/jobs/${job.job}`;
  while (["waiting", "running"].includes(job.state)) {
    const percent = job.progress === null ? "" : `${Math.round(100 * job.progress)} %`;
    onProgress(job.state === "waiting" ? "Waiting for another job …" : `${job.step} ${percent} …`);
    await new Promise((done) => setTimeout(done, JOB_POLL_INTERVAL));
    job = await getJson(url);
  }
  if (job.state !== "done") throw new Error(job.detail || `the job was ${job.state}`);
  return download(job.result, 10000);
}

// Calls `onUpdate` with each update of /api/v1/live or /api/v1/live/curves from its WebSocket, null without a run.
// Reconnects after a lost connection. Returns a function that tells whether the socket is open.
export function listen(path, onUpdate) {
  const url = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}/socket`;
  let socket = null;
  const connect = () => {
    const token = storedToken();
    try {
      socket = new WebSocket(url, token ? ["rig.live", `token.${token}`] : ["rig.live"]);
    } catch {
      return; // the token is not a valid subprotocol name: the page polls instead
    }
    socket.onmessage = (message) => onUpdate(JSON.parse(message.data));
    socket.onclose = () => setTimeout(connect, RECONNECT_DELAY);
  };
  connect();
  return () => socket?.readyState === WebSocket.OPEN;
}

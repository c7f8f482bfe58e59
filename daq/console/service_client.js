// Asks the service; knows its token and tells failures apart.

const KEY = "rig-token";
const FILE_PATIENCE = 600000; // ms

export class Problem extends Error {
  constructor(problem) {
    super(problem.detail || problem.title);
    this.name = problem.type.split("#").pop();
    this.status = problem.status;
    this.job = problem.job;
  }
}

export function keepToken(token) {
  sessionStorage.setItem(KEY, token);
}

export function heldToken() {
  return sessionStorage.getItem(KEY);
}

// A token may come with the page's address, behind the # that browsers do not send.
export function takeTokenFromAddress() {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (token) {
    keepToken(token);
    history.replaceState(null, "", location.pathname);
  }
}

export async function ask(path, patience = 2000) {
  return (await answer(path, { cache: "no-store" }, patience)).json();
}

export async function askPicture(path, patience = 2000) {
  return (await answer(path, { cache: "no-cache" }, patience)).blob();
}

export async function send(path, content = {}, patience = 2000) {
  return (await answer(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(content) }, patience)).json();
}

// Sends a file in; `name` is all that is told of it.
export async function sendFile(path, name, file) {
  const request = { method: "POST", headers: { "Content-Type": "application/octet-stream" }, body: file };
  return (await answer(`${path}?name=${encodeURIComponent(name)}`, request, FILE_PATIENCE)).json();
}

async function answer(path, request, patience) {
  const token = heldToken();
  const headers = { ...request.headers, ...(token ? { Authorization: `Bearer ${token}` } : {}) };
  const response = await fetch(path, { ...request, headers, signal: AbortSignal.timeout(patience) });
  if (response.ok) return response;
  if (response.headers.get("content-type")?.startsWith("application/problem+json")) {
    throw new Problem(await response.json());
  }
  throw new Error(`HTTP ${response.status}`);
}

// Is told of the live run over a WebSocket whenever it changes; comes again when the connection was lost.

import { heldToken } from "./service_client.js";

const AGAIN = 2000; // ms

// Calls `told` with the document of /live, or null without a run.
export function followLive(told) {
  const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/v1/live/socket`;
  const token = heldToken();
  const again = () => setTimeout(() => followLive(told), AGAIN);
  let socket;
  try {
    socket = new WebSocket(address, token ? ["rig.live", `token.${token}`] : ["rig.live"]);
  } catch {
    return; // a token that cannot name a protocol: the page asks again and again instead
  }
  socket.onmessage = (message) => told(JSON.parse(message.data));
  socket.onclose = again;
}

// Is told of the live run over a WebSocket whenever it changes; comes again when the connection was lost. Where
// nothing is told, who follows asks.

import { heldToken } from "./service_client.js";

const AGAIN = 2000; // ms

// Calls `told` with the document of an address, /api/v1/live or what is below it, or with null without a run.
// Returns what says whether the connection stands.
export function listen(path, told) {
  const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}/socket`;
  let socket = null;
  const connect = () => {
    const token = heldToken();
    try {
      socket = new WebSocket(address, token ? ["rig.live", `token.${token}`] : ["rig.live"]);
    } catch {
      return; // a token that cannot name a protocol: the page asks again and again instead
    }
    socket.onmessage = (message) => told(JSON.parse(message.data));
    socket.onclose = () => setTimeout(connect, AGAIN);
  };
  connect();
  return () => socket?.readyState === WebSocket.OPEN;
}

"use strict";
// Connection of the window: messages of the server by their type, and messages to it.
{
  const AGAIN = 1000; // wait until the next attempt to connect [ms]
  const handlers = new Map();
  let socket, wanted = true;

  // Call handler(message) for each message of a type: "scene", "frame", "refused" and those of the parts; "sent" before a message is sent, "lost" when the connection is lost.
  report.on = (type, handler) => handlers.set(type, [...(handlers.get(type) || []), handler]);

  const dispatch = (message) => {
    if (message.type === "scene") wanted = message.live || Boolean(report.follow); // a recorded scene is complete
    if (message.type === "refused" && !report.data && !report.follow) wanted = false; // there is no such scene
    for (const handler of handlers.get(message.type) || []) handler(message);
  };

  // Send a message; return false without a connection.
  report.send = (message) => {
    if (socket?.readyState !== WebSocket.OPEN) return false;
    dispatch({ type: "sent" });
    socket.send(JSON.stringify(message));
    return true;
  };

  report.connect = () => {
    socket = new WebSocket(`ws://${location.host}/socket${location.search}`);
    socket.addEventListener("message", (event) => dispatch(JSON.parse(event.data)));
    socket.addEventListener("close", () => {
      if (!wanted) return;
      dispatch({ type: "lost" });
      setTimeout(report.connect, AGAIN);
    });
  };
}

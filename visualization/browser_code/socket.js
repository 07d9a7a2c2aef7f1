// A run behind the server that the page is from: messages over a websocket, in both directions.
export function connected({ received, opened, lost }) {
  let socket = null;
  const connect = () => {
    const url = new URL("run", location.href);
    url.protocol = "ws:";
    socket = new WebSocket(url);
    socket.onopen = opened;
    socket.onmessage = (event) => received(JSON.parse(event.data));
    socket.onclose = () => {
      lost("The run has ended, or its connection: start hapticlink view again.");
      setTimeout(connect, 2000);
    };
  };
  connect();
  const send = (message) => { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); };
  return { send, compare: (on) => send({ type: "compare", on }) };
}

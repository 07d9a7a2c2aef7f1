// The run behind a page, on a server or in a worker: messages to it, and from it. Beyond what a server can, a worker sends
// samples to be heard.
import { unpacked, unpackedText } from "./packed.js";

// A run behind the server that the page is from: messages over a websocket, in both directions.
export function connectToServer({ received, opened, lost }) {
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
  const leave = () => { socket.onclose = null; socket.close(); };
  return { send, leave, compare: (on) => send({ type: "compare", on }) };
}

// A run in a worker of the page's own file: the same messages as with a server. A frame is asked for whenever the
// screen is drawn.
export function startWorker({ received, opened, lost }) {
  const ready = loadWorker(received, lost);
  const send = (message, moved = []) => ready.then((worker) => worker.postMessage(message, moved));
  const ask = () => { send({ type: "frame" }); requestAnimationFrame(ask); };
  opened();
  ask();
  return {
    send: (message) => send(message),
    compare: (on) => send({ type: "compare", on }),
    listen: (signal, port) => send({ type: "sound", signal, port }, port ? [port] : []),
  };
}

async function loadWorker(received, lost) {
  const [source, data, program] = await Promise.all([unpackedText("worker"), unpackedText("data"), unpacked("program")]);
  const worker = new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
  worker.onmessage = ({ data: message }) => (message.type === "file" ? save(message) : received(message));
  worker.onerror = (event) => lost(`The run has ended: ${event.message}`);
  worker.postMessage({ type: "begin", data: JSON.parse(data), program });
  return worker;
}

function save({ name, text }) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// A run in a worker of the page's own file: the same messages as with a server. A frame is asked for whenever the
// screen is drawn. Beyond what a server can, it compares two settings, and sends samples to be heard.
import { unpacked, unpackedText } from "./packed.js";

export function started({ received, opened, lost }) {
  const ready = begun(received, lost);
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

async function begun(received, lost) {
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

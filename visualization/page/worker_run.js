// A run in a worker of the page's own file: the same messages as with a server. A frame is asked for whenever the
// screen is drawn. Beyond what a server can, it compares two settings, and sends samples to be heard.
export function started({ received, opened, lost }) {
  const element = (id) => document.getElementById(id).textContent;
  const worker = new Worker(URL.createObjectURL(new Blob([element("worker")], { type: "text/javascript" })));
  worker.onmessage = ({ data }) => (data.type === "file" ? save(data) : received(data));
  worker.onerror = (event) => lost(`The run has ended: ${event.message}`);
  worker.postMessage({ type: "begin", data: JSON.parse(element("data")), program: element("program") });
  opened();
  const ask = () => { worker.postMessage({ type: "frame" }); requestAnimationFrame(ask); };
  ask();
  return {
    send: (message) => worker.postMessage(message),
    compare: (on) => worker.postMessage({ type: "compare", on }),
    listen: (signal, port) => worker.postMessage({ type: "sound", signal, port }, port ? [port] : []),
  };
}

function save({ name, text }) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

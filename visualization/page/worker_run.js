// A run in a worker of the page's own file: the same messages as with a server. A frame is asked for whenever the
// screen is drawn.
export function started({ received, opened, lost }) {
  const element = (id) => document.getElementById(id).textContent;
  const source = URL.createObjectURL(new Blob([element("worker")], { type: "text/javascript" }));
  const worker = new Worker(source);
  worker.onmessage = ({ data }) => received(data);
  worker.onerror = (event) => lost(`The run has ended: ${event.message}`);
  worker.postMessage({ type: "begin", data: JSON.parse(element("data")), program: element("program") });
  opened();
  const ask = () => { worker.postMessage({ type: "frame" }); requestAnimationFrame(ask); };
  ask();
  return { send: (message) => worker.postMessage(message) };
}

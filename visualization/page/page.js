// The page: messages from and to the run, the buttons, and who draws what.
import { Charts } from "./charts.js";
import { Controls } from "./controls.js";
import { tags } from "./legend.js";
import { connected } from "./socket.js";
import { Stage } from "./stage.js";
import { started } from "./worker_run.js";

const $ = (id) => document.getElementById(id);
const stage = new Stage($("scene"), $("legend"), (at, user) => send({ type: "hand", at, user }));
const charts = new Charts($("charts"));
const controls = new Controls($("controls"), send);
const view = { frame: null, state: {}, frames: 0, refused: null, stage };
window.view = view; // for tests and for the curious, in the browser's console
let refusedUntil = 0;

function send(message) { run.send(message); }

const HANDLERS = {
  scene(message) {
    document.title = $("title").textContent = message.title;
    stage.begin(message.marks, message.shapes);
    view.kinds = message.kinds;
    charts.begin(message.energies, message.users);
    view.frame = null;
  },
  controls: (message) => controls.show(message),
  state(message) {
    view.state = message;
    $("pause").textContent = message.paused ? "Go on" : "Pause";
    $("record").classList.toggle("on", Boolean(message.recording));
    if (message.ended && view.energy === "green") show({ energy: null }); // a run that diverged at once never turned red
    $("record").textContent = message.recording ? "End recording" : "Record";
    note();
  },
  frame(message) {
    const first = !view.frame;
    view.frame = message;
    view.frames += 1;
    if (first) note();
    if (message.light) show({ energy: message.light });
    charts.add(message);
  },
  map: (message) => show({ map: message }),
  refused(message) {
    view.refused = message.why;
    refusedUntil = performance.now() + 4000;
    note();
    setTimeout(note, 4100);
  },
};

// The light, with the level of the sampling energy and the stability verdict.
function show(change) {
  Object.assign(view, change);
  const level = { green: "none", amber: "low", red: "high" }[view.energy];
  $("light").className = `light ${view.map?.verdict === "unstable" ? "red" : view.energy ?? ""}`;
  $("energy").textContent = level ? `sampling energy: ${level}` : "sampling energy";
  $("map").textContent = view.map ? `stability: ${view.map.said}` : "";
  $("map").title = `Small motions about the start pose, in a hand that holds the handle there (lifted map). ${view.map?.why ?? ""}`;
}

function note() {
  const { ended, recording } = view.state;
  const refused = performance.now() < refusedUntil && view.refused;
  $("note").textContent = refused || (ended && `${ended}. Reset begins anew.`) ||
    (recording && `recording to ${recording}`) || (!view.frame && "the FMUs are being built ...") || "";
}

function received(message) { HANDLERS[message.type]?.(message); }

function lost(why) { $("note").textContent = why; }

const act = (what) => send({ type: "time", do: what });
$("pause").onclick = () => act(view.state.paused ? "resume" : "pause");
for (const what of ["step", "reset", "record"]) $(what).onclick = () => act(what);
document.addEventListener("keydown", (event) => {
  if (event.target.closest("input, select, button")) return;
  const button = { " ": "pause", ".": "step", r: "reset" }[event.key];
  if (event.key === "f") stage.refit();
  if (button && !event.ctrlKey && !event.metaKey) { event.preventDefault(); $(button).click(); }
});

function draw() {
  if (view.frame) {
    stage.draw(view.frame);
    tags($("tags"), view.frame.states.map((state) => {
      const [kind, user] = state.split(" "), [color, meaning] = view.kinds[kind];
      return [color, user ? `${meaning}: ${user}` : meaning];
    }));
    $("time").textContent = `${view.frame.t.toFixed(2)} s`;
  }
  charts.draw();
  requestAnimationFrame(draw);
}
// The run is in this file, as its data, or behind the server that the page is from.
const run = ($("data") ? started : connected)({ received, opened: note, lost });
draw();

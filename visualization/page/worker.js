// The worker of a page that needs nothing else: runs the scene beside the clock, and answers the page's messages as the
// server does.
import { Program, settings, unpacked } from "./program.js";

const BEHIND = 0.1; // s, by which a run may be late before time is moved
const LONGEST = 600; // s, of a recording
let module, data, run = null, origin = 0, missed = 0, rows = null;
const changed = settings();
const state = { type: "state", paused: false, recording: null, ended: null };
const seconds = () => performance.now() / 1e3;

function begin() {
  state.ended = null;
  origin = seconds();
  rows = state.recording ? [] : null;
  run = new Program(module, data, changed);
  guarded(tick); // that of t = 0
  postMessage({ ...data.scene, type: "scene" });
  tell();
}

function tell() {
  postMessage({ type: "controls", ...run.controls });
  postMessage(state);
  const is_changed = JSON.stringify(run.controls) !== JSON.stringify(data.controls);
  postMessage(is_changed ? { ...data.map, verdict: "", said: "computed for the settings of the start alone" } : data.map);
}

// Ends a run that cannot go on, with the reason.
function guarded(act) {
  try { act(); } catch (error) {
    state.ended = error.message;
    postMessage(state);
  }
}

function tick() {
  run.run();
  if (!rows) return;
  rows.push(run.row);
  if (run.time > LONGEST) HANDLERS.time({ do: "record" });
}

// All haptic events that are due.
function turn() {
  if (!state.paused && !state.ended) guarded(() => {
    const late = seconds() - origin - run.due;
    if (late > BEHIND) {
      missed += Math.round(late * data.scene.haptics);
      origin += late;
    }
    while (!state.ended && run.due <= seconds() - origin) tick();
  });
}

function saved() {
  const names = data.tables.flatMap(({ columns }) => columns);
  const text = [["time", ...names].map((name) => (name.includes(",") ? `"${name}"` : name)), ...rows].map((row) => row.join(",")).join("\n");
  postMessage({ type: "file", name: `${data.name}.csv`, text: `${text}\n` });
  rows = null;
}

const HANDLERS = {
  async begin(message) {
    data = message.data;
    Object.assign(changed, message.changed);
    module = new WebAssembly.Module(await unpacked(message.program));
    begin();
    setInterval(turn, 2);
  },
  frame() {
    if (run) postMessage({ ...run.frame, type: "frame", missed });
  },
  time(message) {
    switch (message.do) {
      case "pause": state.paused = true; break;
      case "resume": state.paused = false; origin = seconds() - run.due; break;
      case "step": state.paused = true; guarded(tick); break;
      case "reset": return begin();
      case "record":
        if (rows) saved();
        state.recording = state.recording ? null : `${data.name}.csv`;
        if (state.recording) return begin();
    }
    tell();
  },
};

onmessage = ({ data: message }) => {
  const handler = HANDLERS[message.type];
  if (handler) { handler(message); return; }
  try { run.apply(message); } catch (error) { postMessage({ type: "refused", why: error.message }); }
  if (message.type !== "hand") tell();
};

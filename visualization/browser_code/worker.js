// The worker of a page that needs nothing else: runs the scene beside the clock, once or with two settings beside each
// other, and answers the page's messages as the server does.
import { Program, SPEED } from "./program.js";

const BEHIND = 0.1; // s, by which a run may be late before time is moved
const LONGEST = 600; // s, of a recording
let module, data, runs = [], origin = 0, missed = 0, rows = null, heard = null;
const changed = [{}]; // of run A, and of B where there are two
const state = { type: "state", paused: false, recording: null, ended: null };
const seconds = () => performance.now() / 1e3;
const speed = () => changed[0][SPEED] ?? 1; // which both runs have
const now = () => (seconds() - origin) * speed(); // s, the simulated time that it is
const setNow = (time) => { origin = seconds() - time / speed(); };

function begin() {
  state.ended = null;
  setNow(0);
  rows = state.recording ? changed.map(() => []) : null;
  runs = changed.map((each) => new Program(module, data, each));
  guarded(tick); // that of t = 0
  postMessage({ ...data.scene, type: "scene", runs: runs.length });
  tell();
}

function tell() {
  const [a, b] = runs.map((run) => run.controls);
  postMessage({ type: "controls", controls: a, b: b && { controls: b } });
  postMessage(state);
  const is_changed = a.some(({ key, value }, i) => key !== SPEED && value !== data.controls[i].value);
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
  runs.forEach((run, i) => { state.b = i > 0; run.run(); }); // which of them ends both
  heard?.samples.push(...[0, 1].map((side) => (runs[side] ?? runs[0]).heard(heard.signal)));
  if (!rows) return;
  runs.forEach((run, i) => rows[i].push(run.row));
  if (runs[0].time > LONGEST) HANDLERS.time({ do: "record" });
}

// All haptic events that are due.
function turn() {
  if (!state.paused && !state.ended) guarded(() => {
    const late = now() - runs[0].due, until = seconds() + BEHIND;
    if (late > BEHIND * speed()) {
      missed += Math.round(late * data.scene.haptics);
      setNow(runs[0].due);
    }
    while (!state.ended && runs[0].due <= now() && seconds() < until) tick();
  });
  if (heard?.samples.length) {
    heard.port.postMessage(heard.samples);
    heard.samples = [];
  }
}

function save() {
  const names = ["time", ...data.tables.flatMap(({ columns }) => columns)].map((name) => (name.includes(",") ? `"${name}"` : name));
  rows.forEach((each, i) => {
    const text = [names, ...each].map((row) => row.join(",")).join("\n");
    postMessage({ type: "file", name: `${data.name}${i ? "-b" : ""}.csv`, text: `${text}\n` });
  });
  rows = null;
}

const HANDLERS = {
  begin(message) {
    data = message.data;
    module = new WebAssembly.Module(message.program);
    begin();
    setInterval(turn, 2);
  },
  frame() {
    const [a, b] = runs.map((run) => run.frame);
    if (a) postMessage({ ...a, b, type: "frame", missed });
  },
  time(message) {
    switch (message.do) {
      case "pause": state.paused = true; break;
      case "resume": state.paused = false; setNow(runs[0].due); break;
      case "step": state.paused = true; guarded(tick); break;
      case "reset": return begin();
      case "record":
        if (rows) save();
        state.recording = state.recording ? null : `${data.name}.csv`;
        if (state.recording) return begin();
    }
    tell();
  },
  // A second run beside the first, which begin with the same settings; or the first alone again.
  compare({ on }) {
    if (rows) HANDLERS.time({ do: "record" });
    changed.splice(1, 1, ...(on ? [structuredClone(changed[0])] : []));
    begin();
  },
  // Samples of a signal of both runs at each haptic tick go to a port, none without one.
  sound({ port, signal }) { heard = port ? { port, signal, samples: [] } : null; },
};

// What is set behind an end is for the next run, and refused where none could begin with it; who pulls does so when it is there.
function applyToNext(run, message) {
  if (!run || message.type === "hand") return;
  const next = new Program(module, data, { ...run.changed });
  next.apply(message);
  run.changed = changed[runs.indexOf(run)] = next.changed;
}

onmessage = ({ data: message }) => {
  const handler = HANDLERS[message.type];
  if (handler) { handler(message); return; }
  const is_hand = message.type === "hand", is_speed = message.key === SPEED;
  const on = is_hand || is_speed ? runs : [runs[message.b ? 1 : 0]], time = now();
  try {
    for (const run of on) {
      if (state.ended) applyToNext(run, message);
      else run?.apply(message);
    }
  } catch (error) {
    postMessage({ type: "refused", why: error.message });
  }
  if (is_speed) setNow(time);
  if (!is_hand && runs.length) tell();
};

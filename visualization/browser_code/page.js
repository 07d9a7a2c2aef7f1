// The page: messages from and to the run, the buttons, and who draws what.
import { SECOND } from "./canvas.js";
import { Charts } from "./charts.js";
import { Controls } from "./controls.js";
import { Ending } from "./ending.js";
import { Energies, LIGHTS } from "./energies.js";
import { FirstMinute } from "./first_minute.js";
import { tags } from "./legend.js";
import { addressOf, differing, messagesOf } from "./settings.js";
import { loudness } from "./loudness.js";
import { presets, restored } from "./presets.js";
import { connectToServer, startWorker } from "./runs.js";
import { Sound } from "./sound.js";
import { Stage } from "./stage.js";

const $ = (id) => document.getElementById(id);
let untouched = true; // nobody has pulled yet
const stage = new Stage($("scene"), $("legend"), (at, user, begins) => {
  if (begins) {
    untouched = false;
    $("door").hidden = true;
  }
  run.send({ type: "hand", at, user });
});
const ending = new Ending($("ended"), () => act("reset"));
const charts = new Charts($("charts"));
const controls = new Controls($("controls"), (message) => { choose(null); change(message); });
const first_minute = new FirstMinute($("first"), (message) => change(message));
const view = { frame: null, levels: [], state: {}, frames: 0, refused: null, stage };
window.view = view; // for tests and for the curious, in the browser's console
let refusedUntil = 0, energies = [], sound = null;
let start = null, shown = null, acts_on_b = false; // controls at the start, and as they are
let address = "", later = null;

// Sends a change to the run on which the controls act.
function change(message) { run.send(acts_on_b ? { ...message, b: true } : message); }

const HANDLERS = {
  opening({ title, marks, shapes, kinds, view: seen, frame }) {
    document.title = $("title").textContent = title;
    if (!frame) return;
    stage.begin(marks, shapes, seen);
    view.kinds = kinds;
    view.start = frame;
  },
  scene(message) {
    document.title = $("title").textContent = message.title;
    stage.begin(message.marks, message.shapes, message.view);
    $("anywhere").hidden = stage.view.inSpace;
    $("space").hidden = !stage.view.inSpace;
    view.kinds = message.kinds;
    const runs = message.runs ?? 1;
    energies = Array.from({ length: runs }, () => new Energies(message));
    const port = message.boards ? [] : [{ name: message.port, words: message.port }];
    charts.begin([...port, ...message.power], message.users, stage.view.dimension, runs);
    ending.begin();
    view.start = view.frame = null;
    view.levels = [];
    view.marks = message.marks;
    document.body.classList.toggle("boards", Boolean(message.boards)); // whoever holds one is the hand
    if (run.listen) view.sound = sound ??= new Sound(run.listen, message.haptics);
  },
  controls(message) {
    const begins = !start;
    start ??= message.controls;
    if (begins) offer();
    shown = message;
    acts_on_b &&= Boolean(message.b);
    $("acts").textContent = `Controls act on ${acts_on_b ? "B" : "A"}`;
    $("acts").hidden = !message.b;
    $("compare").ariaPressed = Boolean(message.b);
    controls.show(acting());
    first_minute.show(acting(), !message.b);
    if (begins) follow();
    else note_address();
  },
  state(message) {
    if (message.ended && !view.state.ended) {
      ending.show(message.ended, shown?.b && (message.b ? "B" : "A"));
      stage.include(ending.frames);
    }
    view.state = message;
    $("pause").textContent = message.paused ? "Go on" : "Pause";
    $("record").classList.toggle("on", Boolean(message.recording));
    if (view.frame) watch();
    if (message.ended) show({ energy: "red", levels: ["the run has ended"] }); // one that diverged at once never turned red
    $("record").textContent = message.recording ? "End recording" : "Record";
    note();
  },
  frame(message) {
    const first = !view.frame;
    view.frame = message;
    view.frames += 1;
    ending.add(message);
    watch();
    if (first) note();
    if (untouched) $("door").hidden = false;
    if (first && !message.directions) $("resists").hidden = true;
    [message, message.b].forEach((frame, i) => {
      if (!frame || !energies[i]) return;
      energies[i].add(frame);
      if (frame.said) view.levels[i] = frame.said;
      charts.add(frame, i);
    });
    const lights = [message.light, message.b?.light];
    if (message.light) show({ energy: LIGHTS.findLast((light) => lights.includes(light)) });
    if (sound?.signal) sound.feel(loudness(sound.signal, message, stage.view.dimension));
  },
  map: (message) => show({ map: { ...message, since: performance.now() } }),
  // Of a blind trial, whose page has no controls, and nothing that says how it is set.
  question({ text, answers, question, over }) {
    document.body.classList.add("trial");
    $("question").textContent = text;
    $("answers").replaceChildren(...answers.map(([given, label]) => {
      const button = document.createElement("button");
      button.textContent = label;
      button.onclick = () => run.send({ type: "answer", question, given });
      return button;
    }));
    $("answers").firstChild?.focus();
    if (over) { run.send({ type: "answer", question, given: "seen" }); run.leave(); }
  },
  building({ said, took }) { view.building = { said, took, since: performance.now() }; },
  refused(message) {
    view.refused = message.why;
    refusedUntil = performance.now() + 4000;
    note();
    setTimeout(note, 4100);
  },
};

// The light of the energy with its statement, and that of the stability verdict: amber, too, where another hand than the
// mouse's is unstable, which the picture does not show.
function show(change) {
  Object.assign(view, change);
  const { levels, map } = view, elsewhere = map?.verdict === "unstable" && map.mouse === "stable";
  $("light").className = `light ${view.energy ?? ""}`;
  $("energy").textContent = levels.length > 1 ? levels.map((said, i) => `${"AB"[i]}: ${said}`).join("; ") : levels[0] ?? "energy generated";
  $("verdict").className = `light ${elsewhere ? "amber" : { stable: "green", marginal: "amber", unstable: "red" }[map?.verdict] ?? ""}`;
  $("verdict").hidden = !map;
  $("verdict").title = `Small motions about the start pose, in a hand that holds the handle there (lifted map). ${map?.why ?? ""}`;
}

// What is seen of the handle of the run on which the controls act.
function watch() { first_minute.add(view.frame.t, (acts_on_b && view.frame.b) || view.frame, view.state.ended, stage.view.dimension); }

// For how long something has been waited for.
function waited(since) {
  const seconds = Math.floor((performance.now() - since) / 1e3);
  return seconds > 1 ? `, ${seconds} s` : "";
}

// The verdict, or that it is being computed.
const verdict = ({ said, since }) => `stability: ${said}${said === "computing" ? waited(since) : ""}`;

// What is done before the first run.
function building({ said, took, since }) {
  const before = took >= 2 ? ` (all blocks together took up to ${Math.round(took)} s before)` : "";
  return `${said}${waited(since)}${before}`;
}

function note() {
  const { recording } = view.state;
  const refused = performance.now() < refusedUntil && view.refused;
  $("note").textContent = refused || (ending.frame && "slow motion of the last 0.2 s") ||
    (recording && `recording to ${recording}`) || (!view.frame && (view.building ? building(view.building) : "reading the scene ...")) || "";
}

function received(message) { HANDLERS[message.type]?.(message); }

function lost(why) { $("note").textContent = why; }
window.addEventListener("error", ({ message }) => lost(`This page has failed: ${message}`));

// What the scene shows first, before "More"; or its presets, each a button that says what it changes.
function offer() {
  const is_first = first_minute.begin(start), found = is_first ? [] : presets(start);
  $("more").open = !is_first;
  $("more").querySelector("summary").hidden = !is_first;
  $("presets").hidden = !found.length;
  $("presets").replaceChildren(...found.map(({ name, about, messages }) => {
    const button = document.createElement("button"), small = document.createElement("small");
    button.append(name, small);
    small.textContent = about;
    button.onclick = () => { restore(); messages.forEach(change); choose(button); };
    return button;
  }));
}

// Marks the preset that was pressed, until something else is changed.
function choose(preset) { for (const button of $("presets").children) button.ariaPressed = button === preset; }

// The controls of the run on which they act.
const acting = () => (acts_on_b ? shown.b : shown).controls;

function restore() { choose(null); restored(acting(), start).forEach(change); }

// Does what the page's address asks for, of run A and, where it has settings of B, of both.
function follow() {
  const { "": a, "b.": b, why } = messagesOf(location.hash, start);
  for (const message of a) run.send(message);
  if (b.length || !a.every((message) => first_minute.has(message))) $("more").open = true;
  if (b.length) {
    run.compare(true);
    for (const message of b) run.send({ ...message, b: true });
  }
  if (why.length) HANDLERS.refused({ why: why.join("; ") });
}

// Writes into the address how the controls differ from the start, so that a link leads there; once they rest, since
// browsers take few changes of it.
function note_address() {
  clearTimeout(later);
  later = setTimeout(() => {
    const b = shown.b ? differing(shown.b.controls, start).map(([key, value]) => [`b.${key}`, value]) : [];
    address = addressOf([...differing(shown.controls, start), ...b]);
    if (address !== location.hash.slice(1)) location.replace(`#${address}`);
  }, 300);
}
window.addEventListener("hashchange", () => { if (location.hash.slice(1) !== address) follow(); });

const TURN = 0.1; // rad, by which a key turns the view
const PULLS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const act = (what) => run.send({ type: "time", do: what });
$("pause").onclick = () => act(view.state.paused ? "resume" : "pause");
for (const what of ["step", "reset", "record"]) $(what).onclick = () => act(what);
$("restore").onclick = restore;
$("compare").onclick = () => run.compare(!shown.b);
$("acts").onclick = () => { acts_on_b = !acts_on_b; HANDLERS.controls(shown); };
$("hear").onchange = () => {
  $("listen").ariaPressed = $("hear").value !== "";
  sound.hear($("hear").value || null);
};
$("listen").onclick = () => {
  $("hear").value = $("hear").value ? "" : "force";
  $("hear").onchange();
};
// Who opens More reads there why the run ended.
document.addEventListener("pointerdown", ({ target }) => { if (!target.closest("summary")) ending.hide(); }, true);
document.addEventListener("keydown", (event) => {
  if (!event.repeat && event.target.localName !== "summary") ending.hide();
  if (event.target.closest("input, select, button, summary")) return;
  if (event.key in PULLS) {
    event.preventDefault();
    const [right, up] = PULLS[event.key];
    if (event.shiftKey && stage.view?.inSpace) stage.turn(-TURN * right, -TURN * up);
    else stage.pullBy([right, up]);
    return;
  }
  if (event.key === "+" || event.key === "-") stage.zoom(event.key === "+" ? 0.8 : 1.25);
  const button = { " ": "pause", ".": "step", r: "reset" }[event.key];
  if (event.key === "f") stage.refit();
  if (button && !event.ctrlKey && !event.metaKey) { event.preventDefault(); $(button).click(); }
});

document.addEventListener("keyup", (event) => { if (event.key in PULLS) stage.letGo(); });

function label(state) {
  const [kind, user] = state.split(" "), [color, meaning] = view.kinds[kind];
  return [color, user ? `${meaning}: ${user}` : meaning];
}

// Run B, which is drawn over A, and how its controls differ.
function second() {
  const other = shown.b ? differing(shown.b.controls, shown.controls).map((pair) => pair.join(" ")) : [];
  return `B, in orange: ${other.join(", ") || "as A; let the controls act on B and change something"}`;
}

function draw() {
  if (view.frame) {
    const slow = ending.frame, frame = slow ?? view.frame, { b } = frame;
    stage.trace = first_minute.trace;
    stage.draw(frame, b ? [{ marks: view.marks, frame: b, color: SECOND }] : []);
    tags($("tags"), [...frame.states.filter((state) => !state.startsWith("energy")).map(label), ...(b ? [[SECOND, second()]] : [])]);
    $("time").textContent = `${frame.t.toFixed(2)} s`;
    charts.draw(undefined, slow?.t);
  } else {
    if (view.start) stage.draw(view.start);
    if (view.building) note();
  }
  if (view.map) $("map").textContent = verdict(view.map);
  requestAnimationFrame(draw);
}
// The run is in this file, as its program, or behind the server that the page is from.
const run = ($("program") ? startWorker : connectToServer)({ received, opened: note, lost });
$("hear").hidden = $("listen").hidden = !run.listen;
draw();

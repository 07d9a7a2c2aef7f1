// A replay of one or two recorded runs: time, pictures, charts and episodes.
import { SECOND, SPEEDS } from "./canvas.js";
import { Charts } from "./charts.js";
import { tags } from "./legend.js";
import { Lanes } from "./lanes.js";
import { Recording } from "./recording.js";
import { Stage } from "./stage.js";

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const recordings = data.runs.map((run) => new Recording(run));
const end = Math.max(...recordings.map((r) => r.end), 1e-9);
const views = recordings.map((recording) => new View(recording));
const charts = new Charts($("charts"));
const lanes = new Lanes($("lanes"), data.kinds, recordings, end, seek);
const view = { t: 0, playing: false, overlaid: false, frame: null, frames: [], stage: views[0].stage, views, recordings, seek };
window.view = view; // for tests and for the curious, in the browser's console

function View(recording) {
  const section = document.createElement("section"), title = document.createElement("h2");
  const canvas = document.createElement("canvas"), legend = document.createElement("ul");
  this.tags = document.createElement("ul");
  this.tags.className = "tags";
  legend.className = "legend";
  this.about = document.createElement("span");
  title.append(recording.short, " ", this.about);
  section.append(title, canvas, this.tags, legend);
  $("stages").append(section);
  this.section = section;
  this.stage = new Stage(canvas, legend);
  this.stage.begin(recording.marks, data.shapes, recording.view);
}

// One window for all frames of all runs, as a stage sees them, so that pictures can be compared.
function bounds({ view: seen }) {
  const found = [];
  recordings.forEach((recording, k) => {
    const every = Math.max(1, Math.floor(recording.times.length / 60));
    for (let i = 0; i < recording.times.length; i += every) found.push(views[k].stage.frameLimits(recording.frame(i), 0.12, seen));
  });
  return [0, 1].map((axis) => [Math.min(...found.map((l) => l[axis][0])), Math.max(...found.map((l) => l[axis][1]))]);
}

function seek(t) {
  view.t = Math.min(Math.max(t, 0), end);
  show();
}

function step(count) {
  pause();
  const i = recordings.map((r) => r.index(view.t));
  const k = recordings.findIndex((r) => r.end === end), times = recordings[k].times;
  seek(times[Math.min(Math.max(i[k] + count, 0), times.length - 1)]);
}

function pause() { view.playing = false; $("play").textContent = "Play"; }

function play() {
  if (view.t >= end) view.t = 0;
  view.playing = true;
  $("play").textContent = "Pause";
}

function overlay(on) {
  view.overlaid = on;
  $("layout").textContent = on ? "Side by side" : "Overlay";
  views.slice(1).forEach((each) => { each.section.hidden = on; });
  show();
}

function show() {
  view.frames = recordings.map((r) => r.frame(r.index(view.t)));
  view.frame = view.frames[0];
  view.changed = true;
}

function draw() {
  $("time").textContent = `${view.t.toFixed(3)} s`;
  $("slider").value = view.t;
  views.forEach((each, k) => {
    if (each.section.hidden) return;
    const recording = recordings[k], frame = view.frames[k];
    const others = view.overlaid ? recordings.slice(1).map((r, i) => ({ marks: r.marks, frame: view.frames[i + 1], color: SECOND })) : [];
    each.stage.draw(frame, others);
    each.about.textContent = view.overlaid ? `in colour; ${recordings.slice(1).map((r) => r.short).join(", ")} in orange`
      : view.t >= recording.end ? recording.ending : "";
    tags(each.tags, frame.episodes.map(({ kind, said }) => [data.kinds[kind][0], said]));
  });
  charts.draw([0, end], view.t);
  lanes.draw(view.t);
}

let before = null;
function turn(now) {
  if (view.playing) {
    seek(view.t + ((now - (before ?? now)) / 1e3) * Number($("speed").value));
    if (view.t >= end) pause();
  }
  before = now;
  if (view.changed) { view.changed = false; draw(); }
  requestAnimationFrame(turn);
}

function begin() {
  document.title = $("title").textContent = [...new Set(recordings.map((r) => r.title))].join(" and ");
  $("slider").max = end;
  $("speed").append(...SPEEDS.map((s) => new Option(`${s}×`, s, s === 1, s === 1)));
  charts.begin(recordings[0].energies.map((name) => ({ name, words: name })), recordings[0].users, views[0].stage.view.dimension, recordings.length);
  recordings.forEach((recording, k) => {
    for (let i = 0; i < recording.times.length; i++) charts.add(recording.frame(i), k, Infinity);
  });
  for (const { stage } of views) stage.bounds = () => bounds(stage);
  $("layout").hidden = recordings.length < 2;
  $("note").textContent = recordings.flatMap((r) => [
    r.missing.length ? `${r.short}: not recorded, and so not shown: ${r.missing.join(", ")}.` : "",
    r.left_out ? `${r.short}: ${r.left_out} frames are not shown, since their poses are not finite.` : "",
    r.every > 1 ? `${r.short}: every ${r.every}th sample is shown.` : "",
  ]).filter(Boolean).join(" ");
}

$("slider").addEventListener("input", () => { pause(); seek(Number($("slider").value)); });
$("play").onclick = () => (view.playing ? pause() : play());
$("back").onclick = () => step(-1);
$("on").onclick = () => step(1);
$("layout").onclick = () => overlay(!view.overlaid);
$("fit").onclick = () => { for (const { stage } of views) stage.refit(); view.changed = true; };
charts.host.addEventListener("toggle", () => { view.changed = true; }, true);
charts.host.addEventListener("pointerdown", (event) => {
  const at = charts.time(event, [0, end]);
  if (at !== null) { pause(); seek(at); }
});
window.addEventListener("resize", () => { view.changed = true; });
for (const moved of ["wheel", "pointermove"]) $("stages").addEventListener(moved, () => { view.changed = true; });
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select")) return;
  const many = event.shiftKey ? 10 : 1;
  const act = {
    " ": $("play").onclick, ArrowLeft: () => step(-many), ArrowRight: () => step(many), Home: () => seek(0), End: () => seek(end),
    o: () => recordings.length > 1 && overlay(!view.overlaid), f: $("fit").onclick,
  }[event.key];
  if (act) { event.preventDefault(); act(); }
});
begin();
show();
requestAnimationFrame(turn);

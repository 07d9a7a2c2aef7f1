// The mechanism on its canvas, and where `pull` is given the pointers that pull the handles: each
// that of the user whose handle is nearest when it is pressed; whether it begins to pull.
import { fitted, inTheme, themed } from "./canvas.js";
import { Legend } from "./legend.js";
import { paint, place, zigzag } from "./painter.js";
import { View } from "./view.js";

const HAND = "#b85c00";
// The mouse's spring, as the legend has it.
const PULL = { kind: "spring", at: [[["handle"], []]], stroke: HAND, dash: [], vector: [], label: "pull of the mouse" };
const SEND_INTERVAL = 8; // ms, the least between two targets that are sent; frames are slower
const KEYS = "keys", STEP = 0.004; // who pulls where keys do, and how far each time (m)
const FITTED = ["obstacle", "body", "handle"]; // roles of marks that the picture contains
const GRASP = 40, TURN = 0.01; // px from a handle in space that still take hold of it; rad to a px beside it
const AXES = [44, 68, 24]; // px from the left, px from below, and length of the world's axes

export class Stage {
  constructor(canvas, legend, pull) {
    this.canvas = canvas;
    this.legend = new Legend(legend);
    this.pulls = new Map(); // by pointer: the user, the target, when it was sent, the next timer
    this.limits = null;
    this.bounds = null; // gives the part of the picture to show, in place of what the first frame has
    const pointAt = (event) => {
      const box = canvas.getBoundingClientRect();
      return this.toWorld(event.clientX - box.left, event.clientY - box.top);
    };
    const sendTarget = (pulling) => {
      clearTimeout(pulling.later);
      const begins = !pulling.sent;
      pulling.sent = performance.now();
      pulling.later = null;
      pull(pulling.target, pulling.user, begins);
    };
    const release = ({ pointerId }) => {
      if (pointerId === this.panning) this.panning = null;
      if (pointerId === this.turning) this.turning = null;
      const pulling = this.pulls.get(pointerId);
      if (!pulling) return;
      clearTimeout(pulling.later);
      this.pulls.delete(pointerId);
      canvas.classList.toggle("held", this.pulls.size > 0);
      pull(null, pulling.user);
    };
    // What is still pressed pulls on a run that begins anew, whose picture may have another size.
    this.pullAgain = (pulling) => {
      if (pulling.event) pulling.target = this.target(pointAt(pulling.event), pulling.depth);
      sendTarget(pulling);
    };
    this.pulled = Boolean(pull);
    this.sendTarget = sendTarget;
    this.release = release;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.limits || !(event.shiftKey || event.button)) return;
      canvas.setPointerCapture(event.pointerId);
      this.panning = event.pointerId;
    });
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.limits || event.button || event.shiftKey) return;
      const at = pointAt(event), user = pull && this.nearest(at);
      if (user === undefined && !this.view.inSpace) return;
      canvas.setPointerCapture(event.pointerId);
      if (user === undefined) { this.turning = event.pointerId; return; }
      const { handle } = users(this.frame).find(([name]) => name === user)[1], depth = this.view.project(handle)[2];
      const pulling = { user, depth, event, target: this.target(at, depth) };
      this.pulls.set(event.pointerId, pulling);
      canvas.classList.add("held");
      sendTarget(pulling);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.pointerId === this.panning) {
        const by = [-event.movementX / this.scale, event.movementY / this.scale];
        this.follows = false;
        this.limits = this.limits.map((axis, i) => axis.map((v) => v + by[i]));
      }
      if (event.pointerId === this.turning) this.turn(-TURN * event.movementX, TURN * event.movementY);
      const pulling = this.pulls.get(event.pointerId);
      if (!pulling) return;
      Object.assign(pulling, { event, target: this.target(pointAt(event), pulling.depth) });
      if (pulling.later) return; // the timer sends the newest target, also where the mouse has stopped
      const wait = pulling.sent + SEND_INTERVAL - performance.now();
      if (wait > 0) pulling.later = setTimeout(sendTarget, wait, pulling);
      else sendTarget(pulling);
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (this.limits) this.zoom(Math.exp(event.deltaY / 500), pointAt(event));
    }, { passive: false });
    window.addEventListener("resize", () => this.refit());
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) canvas.addEventListener(end, release);
  }

  begin(marks, shapes, view) {
    this.marks = marks;
    this.shapes = shapes;
    if (JSON.stringify(view) !== this.given) this.view = new View(view); // one that was turned stays
    this.given = JSON.stringify(view);
    this.refit();
    this.frame = null;
  }

  refit() {
    this.limits = null;
    this.follows = true; // what moves out of the picture, until that is moved or zoomed
  }

  // Widens a picture in space so that it has all bodies, which gravity takes farther there than a start lets expect.
  follow(frame) {
    const now = this.frameLimits(frame, 0.05);
    this.limits = this.limits.map(([low, high], i) => [Math.min(low, now[i][0]), Math.max(high, now[i][1])]);
  }

  // Widens a picture so that it has the handles of frames, with a margin, as far as it becomes three times as large.
  include(frames) {
    if (!this.limits) return;
    const size = Math.max(...this.limits.map(([low, high]) => high - low)), margin = 0.15 * size;
    const at = frames.flatMap((frame) => users(frame)).flatMap(([, { handle }]) => (handle ? [this.view.project(handle)] : []));
    this.limits = this.limits.map(([low, high], i) => [
      Math.max(low - size, Math.min(low, ...at.map((place) => place[i] - margin))),
      Math.min(high + size, Math.max(high, ...at.map((place) => place[i] + margin))),
    ]);
  }

  // Scales what is shown about a place, by default the middle.
  zoom(factor, about = this.limits?.map(([a, b]) => (a + b) / 2)) {
    this.follows = false;
    this.limits = this.limits?.map((axis, i) => axis.map((v) => about[i] + factor * (v - about[i])));
  }

  // Turns a picture in space about the middle of its bodies.
  turn(about, down) {
    if (!this.view.inSpace || !this.limits) return;
    const ends = this.marks.filter(({ role }) => role === "body").flatMap(({ at }) => at.map((each) => place(this.frame, each))).filter(Boolean);
    const middle = [0, 1, 2].map((i) => ends.reduce((sum, end) => sum + end[i] / ends.length, 0)), before = this.view.project(middle);
    this.view.turn(about, down);
    const by = this.view.project(middle).map((v, i) => v - before[i]);
    this.limits = this.limits.map((axis, i) => axis.map((v) => v + by[i]));
  }

  // Where a pointer at a place of the picture pulls to: as near to the eye as the handle was.
  target(at, depth) { return this.view.back([at[0], at[1], depth]); }

  // A key pulls the first user's handle further in a direction, until all are let go.
  pullBy([dx, dy]) {
    if (!this.limits || !this.frame?.handle) return;
    const pulling = this.pulls.get(KEYS) ?? { user: "", target: this.frame.handle.slice(0, this.view.dimension) };
    const by = this.view.back([STEP * dx, STEP * dy]);
    pulling.target = pulling.target.map((v, i) => v + by[i]);
    this.pulls.set(KEYS, pulling);
    this.sendTarget(pulling);
  }

  letGo() { this.release({ pointerId: KEYS }); }

  // The user whose handle is nearest to a place of the picture, of those that no pointer here pulls; none where that is far
  // away in space.
  nearest([x, y]) {
    const pulled = [...this.pulls.values()].map((pulling) => pulling.user);
    const free = users(this.frame).filter(([name, { handle }]) => handle && !pulled.includes(name));
    const distance = ([, { handle }]) => {
      const [right, up] = this.view.project(handle);
      return Math.hypot(right - x, up - y);
    };
    const [first] = free.sort((a, b) => distance(a) - distance(b));
    return first && (!this.view.inSpace || distance(first) * this.scale < GRASP) ? first[0] : undefined;
  }

  // The part of the picture that is shown (m): all that the first frame has, with a margin.
  frameLimits(frame, open = 0.45, view = this.view) {
    const fitted = this.marks.filter((mark) => FITTED.includes(mark.role)), points = [];
    for (const mark of fitted) {
      for (const [x, y] of mark.at.map((each) => place(frame, each)).filter(Boolean).map((each) => view.project(each))) {
        points.push([x - mark.size, y - mark.size], [x + mark.size, y + mark.size]);
      }
    }
    const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
    const low = [Math.min(...xs), Math.min(...ys)], high = [Math.max(...xs), Math.max(...ys)];
    const size = Math.max(high[0] - low[0], high[1] - low[1], 0.02);
    const margin = fitted.some((mark) => mark.label === "enclosure") ? 0.12 : open;
    return [0, 1].map((i) => [low[i] - margin * size, high[i] + margin * size]);
  }

  fit(width, height) {
    const [[x0, x1], [y0, y1]] = this.limits;
    this.scale = Math.min(width / (x1 - x0), height / (y1 - y0));
    this.origin = [width / 2 - (this.scale * (x0 + x1)) / 2, height / 2 + (this.scale * (y0 + y1)) / 2];
  }

  toScreen = (place) => {
    const [x, y] = this.view.project(place);
    return [this.origin[0] + this.scale * x, this.origin[1] - this.scale * y];
  };
  // The place of the picture (m, to the right and up) at a pixel.
  toWorld = (px, py) => [(px - this.origin[0]) / this.scale, (this.origin[1] - py) / this.scale];

  // `others` are runs in the same picture: marks, frame and color of each.
  draw(frame, others = []) {
    const { context, width, height } = fitted(this.canvas);
    const begins = !this.frame;
    if (begins) this.legend.begin(this.pulled ? [...this.marks, PULL] : this.marks, frame, this.shapes);
    this.frame = frame;
    this.limits ??= this.bounds?.() ?? this.frameLimits(frame);
    if (this.view.inSpace && this.follows && !this.pulls.size) this.follow(frame);
    this.fit(width, height);
    if (begins) this.pulls.forEach((pulling) => this.pullAgain(pulling));
    paint(context, this.marks, frame, this);
    for (const other of others) paint(context, outlined(other), other.frame, this);
    if (this.trace?.length) this.drawTrace(context);
    for (const [name, user] of users(frame)) this.drawPull(context, user, name);
    this.legend.draw(frame);
    this.drawScale(context, height);
    if (this.view.inSpace) this.drawAxes(context, height);
  }

  // Where a vibrating handle was in the last second.
  drawTrace(context) {
    context.strokeStyle = inTheme("#cc3311");
    context.lineWidth = 1.4;
    context.beginPath();
    this.trace.forEach((place) => context.lineTo(...this.toScreen(place)));
    context.stroke();
  }

  // The mouse's spring.
  drawPull(context, user, name) {
    const pulling = [...this.pulls.values()].find((pull) => pull.user === name);
    if (!pulling) return;
    const target = this.toScreen(pulling.target);
    context.strokeStyle = context.fillStyle = HAND;
    context.lineWidth = 1.4;
    context.beginPath();
    zigzag(this.toScreen(user.handle), target).forEach((p) => context.lineTo(...p));
    context.stroke();
    context.beginPath();
    context.arc(...target, 4, 0, 7);
    context.fill();
  }

  // The directions x, y and z of the world.
  drawAxes(context, height) {
    const [left, below, size] = AXES, from = [left, height - below];
    context.strokeStyle = context.fillStyle = themed("soft");
    context.lineWidth = 1.5;
    context.font = "12px system-ui, sans-serif";
    "xyz".split("").forEach((name, i) => {
      const [right, up] = this.view.project([0, 1, 2].map((k) => size * (k === i))), to = [from[0] + right, from[1] - up];
      context.beginPath();
      context.moveTo(...from);
      context.lineTo(...to);
      context.stroke();
      context.fillText(name, to[0] + right / 4 - 3, to[1] - up / 4 + 4);
    });
  }

  drawScale(context, height) {
    const length = [0.5, 1, 2, 5].flatMap((m) => [1e-3, 1e-2, 1e-1, 1].map((p) => m * p))
      .sort((a, b) => a - b).find((l) => l * this.scale > 60) ?? 5;
    context.strokeStyle = context.fillStyle = themed("soft");
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(14, height - 18);
    context.lineTo(14 + length * this.scale, height - 18);
    context.stroke();
    context.font = "12px system-ui, sans-serif";
    context.fillText(`${+(length * 1e3).toPrecision(3)} mm`, 14, height - 24);
  }
}

// The users of a frame: name of the point ("" for the first one's), and what the frame has of them.
export const users = (frame) => [["", frame], ...Object.entries(frame.others ?? {})];

// Bodies and handle of another run in its colour.
const outlined = ({ marks, color }) => marks
  .filter(({ role, when }) => ["body", "handle"].includes(role) && !when)
  .map((mark) => ({ ...mark, stroke: color, fill: null, width: 1.5 }));

// The mechanism on its canvas, and where `pull` is given the pointers that pull the handles: each
// that of the user whose handle is nearest when it is pressed.
import { fitted } from "./canvas.js";
import { Arrows } from "./arrows.js";
import { drawBody, drawClosure, drawGhost, drawJoint, drawObstacles, drawSpring } from "./shapes.js";

const HANDLE = "#cc3311", HAND = "#b85c00", GHOST = "#333a", ARMS = "#c3c7d0", SATURATED = "#ee7733", GENERATED = "#ddaa0099";

// Whether a recorded frame is in an episode of a kind.
const marked = (frame, kind) => frame.episodes?.some((e) => e.kind === kind);

export class Stage {
  constructor(canvas, legend, pull) {
    this.canvas = canvas;
    this.arrows = new Arrows(legend);
    this.pulls = new Map(); // by pointer: the user, the target, and when it was sent
    this.limits = null;
    this.bounds = null; // the part of the plane to show, in place of what the first frame has
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      return this.toWorld(event.clientX - box.left, event.clientY - box.top);
    };
    const release = ({ pointerId }) => {
      const held = this.pulls.get(pointerId);
      if (!held) return;
      this.pulls.delete(pointerId);
      canvas.classList.toggle("held", this.pulls.size > 0);
      pull(null, held.user);
    };
    if (pull) canvas.addEventListener("pointerdown", (event) => {
      if (!this.limits || event.button) return;
      const target = at(event), user = this.nearest(target);
      if (user === undefined) return;
      canvas.setPointerCapture(event.pointerId);
      this.pulls.set(event.pointerId, { user, target, sent: event.timeStamp });
      canvas.classList.add("held");
      pull(target, user);
    });
    canvas.addEventListener("pointermove", (event) => {
      const held = this.pulls.get(event.pointerId);
      if (!held) return;
      held.target = at(event);
      if (event.timeStamp - held.sent < 8) return;
      held.sent = event.timeStamp;
      pull(held.target, held.user);
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const factor = Math.exp(event.deltaY / 500);
      this.limits = this.limits?.map(([a, b]) => [a + b - factor * (b - a), a + b + factor * (b - a)].map((v) => v / 2));
    }, { passive: false });
    window.addEventListener("resize", () => this.refit());
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) canvas.addEventListener(end, release);
  }

  begin(shapes) {
    this.shapes = shapes;
    this.limits = null;
    this.pulls.clear();
    this.canvas.classList.remove("held");
  }

  refit() { this.limits = null; }

  // The user whose handle is nearest to a place, of those that no pointer here pulls.
  nearest([x, y]) {
    const pulled = [...this.pulls.values()].map((held) => held.user);
    const free = users(this.frame).filter(([name]) => !pulled.includes(name));
    const apart = ([, { handle }]) => Math.hypot(handle[0] - x, handle[1] - y);
    return free.sort((a, b) => apart(a) - apart(b))[0]?.[0];
  }

  // The part of the plane that is shown (m): all that the first frame has, with a margin.
  frameLimits(frame, open = 0.45) {
    const handles = users(frame).map(([, user]) => (user.handle ?? user.x).slice(0, 2));
    const points = [...handles, ...this.shapes.enclosure, ...this.shapes.polygons.flat()];
    for (const [[x, y], r] of this.shapes.discs) points.push([x - r, y - r], [x + r, y + r]);
    for (const body of this.shapes.bodies) {
      for (const at of [...body.outline, ...body.shape]) points.push(place(frame.poses, body.name, at));
    }
    const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
    const low = [Math.min(...xs), Math.min(...ys)], high = [Math.max(...xs), Math.max(...ys)];
    const size = Math.max(high[0] - low[0], high[1] - low[1], 0.02);
    const margin = this.shapes.enclosure.length ? 0.12 : open;
    return [0, 1].map((i) => [low[i] - margin * size, high[i] + margin * size]);
  }

  fit(width, height) {
    const [[x0, x1], [y0, y1]] = this.limits;
    this.scale = Math.min(width / (x1 - x0), height / (y1 - y0));
    this.origin = [width / 2 - (this.scale * (x0 + x1)) / 2, height / 2 + (this.scale * (y0 + y1)) / 2];
  }

  toScreen = ([x, y]) => [this.origin[0] + this.scale * x, this.origin[1] - this.scale * y];
  toWorld = (px, py) => [(px - this.origin[0]) / this.scale, (this.origin[1] - py) / this.scale];

  // `others` are runs in the same picture: shapes, frame and color of each.
  draw(frame, others = []) {
    this.frame = frame;
    const { context, width, height } = fitted(this.canvas);
    this.limits ??= this.bounds ?? this.frameLimits(frame);
    this.fit(width, height);
    const shapes = this.shapes, on = (poses) => (body, at) => this.toScreen(place(poses, body, at));
    const at = on(frame.poses);
    context.lineJoin = context.lineCap = "round";
    drawObstacles(context, shapes, this.toScreen, this.scale);
    const arms = marked(frame, "saturated") ? SATURATED : ARMS;
    for (const [name, user] of users(frame)) {
      this.drawArms(context, user.arms, name ? ARMS : arms);
      this.drawDirections(context, user, width + height);
    }
    for (const body of shapes.bodies) drawBody(context, body, at);
    for (const spring of shapes.springs) drawSpring(context, at(...spring[0]), at(...spring[1]));
    for (const joint of shapes.joints) drawJoint(context, joint, at, frame.poses);
    for (const loop of shapes.loops) drawClosure(context, loop, at, frame.poses);
    const folded = frame.branch_ok?.[0] === 0;
    if (frame.ghost) for (const body of shapes.bodies) drawGhost(context, body, on(frame.ghost), folded ? HANDLE : GHOST);
    for (const other of others) this.drawOther(context, other, on(other.frame.poses));
    for (const [name, user] of users(frame)) this.drawHandle(context, user, HANDLE, name);
    this.arrows.draw(context, frame, shapes, this.toScreen, at);
    this.drawScale(context, height);
  }

  drawOther(context, { shapes, frame, color }, at) {
    for (const body of shapes.bodies) drawGhost(context, body, at, color, []);
    this.drawHandle(context, frame, color);
  }

  drawArms(context, arms, color) {
    if (!arms) return;
    context.strokeStyle = color;
    context.lineWidth = 3;
    for (let i = 0; i < arms.length; i += 3) {
      const points = arms.slice(i, i + 3).filter(Boolean).map(this.toScreen);
      context.beginPath();
      points.forEach((p) => context.lineTo(...p));
      context.stroke();
    }
  }

  drawDirections(context, user, reach) {
    if (!user.directions?.length) return;
    const [x, y] = this.toScreen(user.x);
    context.save();
    context.strokeStyle = "#aa337788";
    context.lineWidth = 1.5;
    context.setLineDash([2, 5]);
    for (const [dx, dy] of user.directions) {
      context.beginPath();
      context.moveTo(x - reach * dx, y + reach * dy);
      context.lineTo(x + reach * dx, y - reach * dy);
      context.stroke();
    }
    context.restore();
  }

  drawHandle(context, user, color, name) {
    const handle = this.toScreen(user.handle ?? user.x), [x, y] = this.toScreen(user.x);
    const held = [...this.pulls.values()].find((pull) => pull.user === name);
    if (held) {
      const target = this.toScreen(held.target);
      drawSpring(context, handle, target, HAND);
      context.beginPath();
      context.arc(...target, 4, 0, 7);
      context.fillStyle = HAND;
      context.fill();
    }
    context.lineWidth = 3;
    context.strokeStyle = color;
    context.beginPath();
    for (const s of [-1, 1]) { context.moveTo(x - 5, y - 5 * s); context.lineTo(x + 5, y + 5 * s); }
    context.stroke();
    if (!user.handle) return;
    context.beginPath();
    context.arc(...handle, 9, 0, 7);
    if (marked(user, "energy")) {
      context.fillStyle = GENERATED;
      context.fill();
    }
    context.lineWidth = 2;
    context.stroke();
  }

  drawScale(context, height) {
    const length = [0.5, 1, 2, 5].flatMap((m) => [1e-3, 1e-2, 1e-1, 1].map((p) => m * p))
      .sort((a, b) => a - b).find((l) => l * this.scale > 60) ?? 5;
    context.strokeStyle = context.fillStyle = "#556";
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

// The place in the world (m) of a point of a body.
export function place(poses, body, [px, py]) {
  const [x, y, angle] = poses[body], c = Math.cos(angle), s = Math.sin(angle);
  return [x + c * px - s * py, y + s * px + c * py];
}

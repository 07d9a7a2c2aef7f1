// The mechanism on its canvas, and the pointer that pulls the handle where `pull` is given.
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
    this.target = null;
    this.limits = null;
    this.bounds = null; // the part of the plane to show, in place of what the first frame has
    let sent = 0;
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      return this.toWorld(event.clientX - box.left, event.clientY - box.top);
    };
    const hold = (event) => {
      this.target = at(event);
      canvas.classList.add("held");
      pull(this.target);
    };
    const release = () => {
      if (!this.target) return;
      this.target = null;
      canvas.classList.remove("held");
      pull(null);
    };
    if (pull) canvas.addEventListener("pointerdown", (event) => {
      if (!this.limits || event.button) return;
      canvas.setPointerCapture(event.pointerId);
      hold(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.target) return;
      this.target = at(event);
      if (event.timeStamp - sent < 8) return;
      sent = event.timeStamp;
      pull(this.target);
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
    this.target = null;
    this.canvas.classList.remove("held");
  }

  refit() { this.limits = null; }

  // The part of the plane that is shown (m): all that the first frame has, with a margin.
  frameLimits(frame, open = 0.45) {
    const points = [(frame.handle ?? frame.x).slice(0, 2), ...this.shapes.enclosure, ...this.shapes.polygons.flat()];
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
    const { context, width, height } = fitted(this.canvas);
    this.limits ??= this.bounds ?? this.frameLimits(frame);
    this.fit(width, height);
    const shapes = this.shapes, on = (poses) => (body, at) => this.toScreen(place(poses, body, at));
    const at = on(frame.poses);
    context.lineJoin = context.lineCap = "round";
    drawObstacles(context, shapes, this.toScreen, this.scale);
    this.drawArms(context, frame.arms, marked(frame, "saturated") ? SATURATED : ARMS);
    this.drawDirections(context, frame, width + height);
    for (const body of shapes.bodies) drawBody(context, body, at);
    for (const spring of shapes.springs) drawSpring(context, at(...spring[0]), at(...spring[1]));
    for (const joint of shapes.joints) drawJoint(context, joint, at, frame.poses);
    for (const loop of shapes.loops) drawClosure(context, loop, at, frame.poses);
    const folded = frame.branch_ok?.[0] === 0;
    if (frame.ghost) for (const body of shapes.bodies) drawGhost(context, body, on(frame.ghost), folded ? HANDLE : GHOST);
    for (const other of others) this.drawOther(context, other, on(other.frame.poses));
    this.drawHandle(context, frame, HANDLE);
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

  drawDirections(context, frame, reach) {
    if (!frame.directions?.length) return;
    const [x, y] = this.toScreen(frame.x);
    context.save();
    context.strokeStyle = "#aa337788";
    context.lineWidth = 1.5;
    context.setLineDash([2, 5]);
    for (const [dx, dy] of frame.directions) {
      context.beginPath();
      context.moveTo(x - reach * dx, y + reach * dy);
      context.lineTo(x + reach * dx, y - reach * dy);
      context.stroke();
    }
    context.restore();
  }

  drawHandle(context, frame, color) {
    const handle = this.toScreen(frame.handle ?? frame.x), [x, y] = this.toScreen(frame.x);
    if (this.target) {
      const target = this.toScreen(this.target);
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
    if (!frame.handle) return;
    context.beginPath();
    context.arc(...handle, 9, 0, 7);
    if (marked(frame, "energy")) {
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

// The place in the world (m) of a point of a body.
export function place(poses, body, [px, py]) {
  const [x, y, angle] = poses[body], c = Math.cos(angle), s = Math.sin(angle);
  return [x + c * px - s * py, y + s * px + c * py];
}

// Paints marks (visualization/mechanism/marks.py) on a canvas: `frame` has what they name, `toScreen` turns places
// of the plane (m) into pixels, `scale` is pixels to a metre. Sizes of marks are in points.
import { inTheme } from "./canvas.js";

const PX = 96 / 72, MIN_ARROW = 4, MAX_ARROW = 160; // px

export const reach = (frame, keys) => keys.reduce((found, key) => found?.[key], frame);

// The place in the plane (m) of a point of what is in the frame; undefined if it is not there.
export function place(frame, [keys, point]) {
  const pose = reach(frame, keys);
  if (!pose) return undefined;
  const [dx, dy] = turned(point, pose[2] ?? 0);
  return [pose[0] + dx, pose[1] + dy];
}

function turned([x, y], angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  return [c * x - s * y, s * x + c * y];
}

const shown = (mark, frame) => !mark.when || frame.states.includes(mark.when);

export function paint(context, marks, frame, { shapes, toScreen, scale }) {
  context.lineJoin = context.lineCap = "round";
  for (const mark of marks) {
    const at = mark.at.map((each) => place(frame, each)).filter(Boolean).map(toScreen);
    if (!at.length || !shown(mark, frame)) continue;
    context.save();
    context.strokeStyle = inTheme(mark.stroke);
    context.fillStyle = inTheme(mark.fill);
    context.lineWidth = mark.width * PX;
    context.setLineDash(mark.dash.map((length) => length * PX));
    const angle = mark.angle === null ? 0 : (reach(frame, mark.at.at(-1)[0])[2] ?? 0) + mark.angle;
    const vector = reach(frame, mark.vector);
    const lines = {
      area: () => [[...at, at[0]]],
      line: () => [at],
      rail: () => [rail(at, angle, mark.size * scale)],
      spring: () => [zigzag(...at)],
      disc: () => [[]],
      arrow: () => arrow(at[0], vector, mark.size * PX),
      directions: () => (vector ?? []).map((way) => lineThrough(at[0], way)),
    }[mark.kind];
    for (const points of lines ? lines() : [corners(shapes[mark.kind], at[0], angle)]) {
      context.beginPath();
      if (mark.kind === "disc") context.arc(...at[0], mark.size * scale, 0, 7);
      points.forEach((p) => context.lineTo(...p));
      if (mark.fill) context.fill();
      if (mark.stroke) context.stroke();
    }
    context.restore();
  }
}

const BEYOND_PAGE = 4000; // px

const lineThrough = ([x, y], [dx, dy]) => [[x - BEYOND_PAGE * dx, y + BEYOND_PAGE * dy], [x + BEYOND_PAGE * dx, y - BEYOND_PAGE * dy]];

function corners(shape, [x, y], angle) {
  const found = shape.map((corner) => turned(corner, angle)).map(([dx, dy]) => [x + dx * PX, y - dy * PX]);
  return [...found, found[0]];
}

// The line along which something slides, to `beyond` both its ends.
function rail([from, to], angle, beyond) {
  let [dx, dy] = [beyond * Math.cos(angle), -beyond * Math.sin(angle)];
  if ((to[0] - from[0]) * dx + (to[1] - from[1]) * dy < 0) [dx, dy] = [-dx, -dy];
  return [[from[0] - dx, from[1] - dy], [to[0] + dx, to[1] + dy]];
}

export function zigzag(a, b) {
  const dx = b[0] - a[0], dy = b[1] - a[1], length = Math.hypot(dx, dy) || 1, wide = Math.min(5, length / 25);
  const waves = Array.from({ length: 13 }, (_, i) => {
    const s = 0.2 + i * 0.05, w = (i % 2 ? wide : -wide) / length;
    return [a[0] + s * dx - w * dy, a[1] + s * dy + w * dx];
  });
  return [a, ...waves, b];
}

// Shaft and head; none where the force is too small to be seen.
function arrow([x, y], force, perNewton) {
  const size = force ? Math.hypot(force[0], force[1]) : 0, length = Math.min(perNewton * size, MAX_ARROW);
  if (!(length > MIN_ARROW)) return [];
  const ux = force[0] / size, uy = -force[1] / size, tip = [x + length * ux, y + length * uy];
  const long = Math.min(10, length), wide = long / 2;
  const head = [wide, -wide].map((w) => [tip[0] - long * ux + w * uy, tip[1] - long * uy - w * ux]);
  return [[[x, y], [tip[0] - long * ux, tip[1] - long * uy]], [tip, ...head]];
}

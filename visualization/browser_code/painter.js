// Paints marks (visualization/mechanism/marks.py) on a canvas: `frame` has what they name, `view` projects it, `toScreen`
// turns places (m) into pixels, `scale` is pixels to a metre. Sizes of marks are in points.
import { inTheme } from "./canvas.js";

const PX = 96 / 72, MIN_ARROW = 4, MAX_ARROW = 160; // px

export const reach = (frame, keys) => keys.reduce((found, key) => found?.[key], frame);

// The place in the world (m) of a point of what is in the frame; undefined if it is not there. In space a pose is a place,
// and the columns of a rotation matrix where it has a frame.
export function place(frame, [keys, point]) {
  const pose = reach(frame, keys);
  if (!pose) return undefined;
  if (point.length > 2) {
    if (pose.length < 12) return pose;
    return [0, 1, 2].map((i) => pose[i] + point[0] * pose[3 + i] + point[1] * pose[6 + i] + point[2] * pose[9 + i]);
  }
  const [dx, dy] = turned(point, pose[2] ?? 0);
  return [pose[0] + dx, pose[1] + dy];
}

// What is at the `vector` of a mark, without its moment.
export const vectorOf = (mark, frame) => reach(frame, mark.vector)?.slice(0, mark.at[0][1].length);

function turned([x, y], angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  return [c * x - s * y, s * x + c * y];
}

const shown = (mark, frame) => !mark.when || frame.states.includes(mark.when);

// From back to front: of the bodies in space, those that are farther from the eye before nearer ones.
function inOrder(marks, frame, view) {
  const nearness = (mark) => {
    const ends = mark.at.map((each) => place(frame, each)).filter(Boolean);
    return ends.reduce((sum, end) => sum + view.project(end)[2], 0) / (ends.length || 1);
  };
  const bodies = marks.filter(({ role }) => role === "body").map((mark) => [nearness(mark), mark]).sort(([a], [b]) => a - b);
  return marks.map((mark) => (mark.role === "body" ? bodies.shift()[1] : mark));
}

export function paint(context, marks, frame, { shapes, toScreen, scale, view }) {
  context.lineJoin = context.lineCap = "round";
  for (const mark of view.inSpace ? inOrder(marks, frame, view) : marks) {
    const at = mark.at.map((each) => place(frame, each)).filter(Boolean).map(toScreen);
    if (!at.length || !shown(mark, frame)) continue;
    context.save();
    context.strokeStyle = inTheme(mark.stroke);
    context.fillStyle = inTheme(mark.fill);
    context.lineWidth = mark.width * PX;
    context.setLineDash(mark.dash.map((length) => length * PX));
    const angle = mark.angle === null ? 0 : (reach(frame, mark.at.at(-1)[0])[2] ?? 0) + mark.angle;
    const vector = mark.vector.length ? reach(frame, mark.vector) : null;
    const lines = {
      area: () => [[...at, at[0]]],
      line: () => [at],
      rail: () => [rail(...at)],
      spring: () => [zigzag(...at)],
      disc: () => [[]],
      arrow: () => arrow(at[0], vector && view.project(vectorOf(mark, frame)), mark.size * PX),
      directions: () => (vector ?? []).map((way) => lineThrough(at[0], view.project(way))),
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

// The line along which something slides, beyond both its ends by the way from the second to `past`.
function rail(from, to, past) {
  let [dx, dy] = [past[0] - to[0], past[1] - to[1]];
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

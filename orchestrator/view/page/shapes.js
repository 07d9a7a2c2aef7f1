// Bodies, joints, springs and obstacles, as the project's figures have them.
export function path(context, points, closed) {
  context.beginPath();
  points.forEach((p) => context.lineTo(...p));
  if (closed) context.closePath();
}

export function drawBody(context, body, at) {
  const corners = body.outline.map((p) => at(body.name, p));
  context.strokeStyle = body.color;
  context.fillStyle = `${body.color}40`;
  context.lineWidth = corners.length > 2 ? 2.5 : 6;
  if (body.shape.length) {
    path(context, body.shape.map((p) => at(body.name, p)), true);
    context.fill();
    context.lineWidth = 1.2;
    context.stroke();
    context.lineWidth = corners.length > 2 ? 2.5 : 5;
  }
  if (corners.length === 1 && !body.shape.length) {
    context.fillRect(corners[0][0] - 9, corners[0][1] - 9, 18, 18);
  } else if (corners.length > 1) {
    path(context, corners, corners.length > 2);
    if (corners.length > 2) context.fill();
    context.stroke();
  }
}

export function drawGhost(context, body, at, color, dashes = [5, 4]) {
  const points = body.outline.length > 1 || !body.shape.length ? body.outline : body.shape;
  context.save();
  context.strokeStyle = color;
  context.lineWidth = dashes.length ? 1.3 : 2;
  context.setLineDash(dashes);
  path(context, points.map((p) => at(body.name, p)), points.length > 2);
  context.stroke();
  context.restore();
}

function circle(context, [x, y], fill) {
  context.beginPath();
  context.arc(x, y, 4.5, 0, 7);
  context.fillStyle = fill;
  context.fill();
  context.strokeStyle = "#222";
  context.lineWidth = 1.5;
  context.stroke();
}

function ground(context, [x, y]) {
  path(context, [[x, y], [x - 9, y + 15], [x + 9, y + 15]], true);
  context.fillStyle = "#9aa0ac";
  context.fill();
}

// The line along which something slides, from `from` to beyond `to`.
function axis(context, from, to, angle) {
  const along = [Math.cos(angle), -Math.sin(angle)];
  const reach = (to[0] - from[0]) * along[0] + (to[1] - from[1]) * along[1];
  const side = Math.sign(reach) || 1, ends = [-25 * side, reach + 25 * side];
  context.save();
  context.setLineDash([8, 4, 2, 4]);
  context.strokeStyle = "#666";
  context.lineWidth = 1.2;
  path(context, ends.map((l) => [from[0] + l * along[0], from[1] + l * along[1]]));
  context.stroke();
  context.restore();
}

export function drawJoint(context, joint, at, poses) {
  const parent = at(...joint.at);
  if (joint.ground) ground(context, parent);
  if (joint.type !== "prismatic") return circle(context, parent, "#fff");
  const child = at(...joint.child), angle = poses[joint.at[0]][2] + joint.axis;
  axis(context, parent, child, angle);
  context.save();
  context.translate(...child);
  context.rotate(-angle);
  context.fillStyle = "#fff";
  context.strokeStyle = "#222";
  context.lineWidth = 1.5;
  context.fillRect(-7, -5, 14, 10);
  context.strokeRect(-7, -5, 14, 10);
  context.restore();
}

export function drawClosure(context, loop, at, poses) {
  const pin = at(...loop.at);
  if (loop.type !== "revolute") axis(context, at(...loop.second), pin, poses[loop.second[0]][2] + loop.axis);
  if (loop.ground) ground(context, pin);
  circle(context, pin, "#222");
}

export function drawSpring(context, a, b, color = "#555") {
  const dx = b[0] - a[0], dy = b[1] - a[1], length = Math.hypot(dx, dy) || 1, wide = Math.min(5, length / 10);
  const points = [a];
  for (let i = 0; i < 13; i++) {
    const s = 0.2 + i * 0.05, w = i % 2 ? wide : -wide;
    points.push([a[0] + s * dx - (w * dy) / length, a[1] + s * dy + (w * dx) / length]);
  }
  path(context, [...points, b]);
  context.strokeStyle = color;
  context.lineWidth = 1.4;
  context.stroke();
}

export function drawObstacles(context, shapes, toScreen, scale) {
  context.fillStyle = "#dfe2e8";
  context.strokeStyle = "#777";
  context.lineWidth = 1.5;
  for (const corners of shapes.polygons) {
    path(context, corners.map(toScreen), true);
    context.fill();
    context.stroke();
  }
  for (const [center, radius] of shapes.discs) {
    context.beginPath();
    context.arc(...toScreen(center), radius * scale, 0, 7);
    context.fill();
    context.stroke();
  }
  if (shapes.enclosure.length) {
    context.lineWidth = 4;
    path(context, shapes.enclosure.map(toScreen), true);
    context.stroke();
  }
}

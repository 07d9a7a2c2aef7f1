// Forces as arrows, and the legend, with the newest values.
import { text } from "./canvas.js";

const PER_NEWTON = 22, MOST = 170; // px
const FORCES = [
  ["F_hand", "hand", "#b85c00"],
  ["F_constraint", "topology controller", "#aa3377"],
  ["F_env", "contacts and others", "#cc3311"],
  ["lambda", "in the cut joints", "#228833"],
];

export class Arrows {
  constructor(legend) { this.legend = legend; }

  draw(context, frame, shapes, toScreen, at) {
    if (this.shown !== shapes) this.begin(frame, shapes);
    for (const [key, , color] of FORCES) {
      let size = 0;
      if (key === "lambda" && frame.lambda) {
        const values = frame.lambda;
        shapes.loops.forEach((loop, i) => {
          const first = shapes.rows[i], across = loop.type !== "revolute" && frame.poses[loop.second[0]][2] + loop.axis;
          // That of a slot or a prismatic joint is along its normal; a moment has no arrow.
          const force = across === false ? values.slice(first, first + 2)
            : [-values[first] * Math.sin(across), values[first] * Math.cos(across)];
          size = Math.max(size, Math.hypot(...force));
          arrow(context, at(...loop.at), force, color);
        });
      }
      for (const user of key === "lambda" ? [] : [frame, ...Object.values(frame.others ?? {})]) {
        if (!user[key]) continue;
        size = Math.max(size, Math.hypot(user[key][0], user[key][1]));
        arrow(context, toScreen(key === "F_env" ? user.x : user.handle ?? user.x), user[key], color);
      }
      this.values[key].textContent = text(size, "N");
    }
  }

  begin(frame, shapes) {
    this.shown = shapes;
    this.values = {};
    // Rows of lambda: two for a joint or a sliding body, one for a slot.
    let row = 0;
    shapes.rows = shapes.loops.map((loop) => { const first = row; row += loop.type === "slot" ? 1 : 2; return first; });
    const items = FORCES.filter(([key]) => frame[key]?.length).map(([key, name, color]) => {
      this.values[key] = document.createElement("b");
      return entry(color, `force, ${name} `, this.values[key]);
    });
    for (const [key] of FORCES) this.values[key] ??= document.createElement("b");
    if (frame.handle) items.unshift(entry("#cc3311", "operational point", null, "cross"), entry("#cc3311", "handle", null, "ring"));
    if (frame.directions) items.push(entry("#aa3377", "constrained directions", null, "dashed"));
    if (frame.ghost) items.push(entry("#333", "as the graphics block has it", null, "dashed"));
    if (frame.arms) items.push(entry("#c3c7d0", "device"));
    this.legend.replaceChildren(...items);
  }
}

// A line of a colour, or what `look` says: dashed, cross, ring.
function entry(color, name, value, look) {
  const item = document.createElement("li"), chip = document.createElement("i");
  chip.style.color = color;
  if (look) chip.className = look;
  item.append(chip, name);
  if (value) item.append(value);
  return item;
}

function arrow(context, [x, y], [fx, fy], color) {
  const size = Math.hypot(fx, fy), length = Math.min(PER_NEWTON * size, MOST);
  if (!(length > 4)) return;
  const ux = fx / size, uy = -fy / size, tip = [x + length * ux, y + length * uy];
  context.strokeStyle = context.fillStyle = color;
  context.lineWidth = 3;
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(tip[0] - 6 * ux, tip[1] - 6 * uy);
  context.stroke();
  context.beginPath();
  context.moveTo(...tip);
  context.lineTo(tip[0] - 10 * ux + 5 * uy, tip[1] - 10 * uy - 5 * ux);
  context.lineTo(tip[0] - 10 * ux - 5 * uy, tip[1] - 10 * uy + 5 * ux);
  context.fill();
}

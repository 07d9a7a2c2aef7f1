// The legend of a drawing, with the newest forces, and labels of the current states.
import { place, reach, vectorOf } from "./painter.js";
import { inTheme, text } from "./canvas.js";

export class Legend {
  constructor(host) { this.host = host; }

  begin(marks, frame, shapes) {
    this.shapes = shapes;
    this.entries = new Map(); // by label: marks, and where their largest force is written
    for (const mark of marks) {
      const there = mark.label && !mark.when && mark.at.some((each) => place(frame, each));
      if (!there || (mark.vector.length && !reach(frame, mark.vector))) continue;
      const found = this.entries.get(mark.label);
      if (found) found.marks.push(mark);
      else this.entries.set(mark.label, { marks: [mark], value: this.entry(mark) });
    }
    this.host.replaceChildren(...[...this.entries.values()].map(({ value }) => value.parentNode));
  }

  draw(frame) {
    for (const { marks, value } of this.entries.values()) {
      if (marks[0].kind !== "arrow") continue;
      const sizes = marks.map((mark) => vectorOf(mark, frame)).map((force) => (force ? Math.hypot(...force) : 0));
      value.textContent = text(Math.max(...sizes), "N");
    }
  }

  // The chip is the mark as it is drawn.
  entry(mark) {
    const item = document.createElement("li"), value = document.createElement("b"), shape = this.shapes[mark.kind];
    item.innerHTML = shape ? '<svg viewBox="-9 -7 18 14"><polygon/></svg>' : `<svg viewBox="0 -4 18 14"><path d="${mark.kind === "spring" ? "M1 3H3L5 0 8 6 11 0 13 3H17" : "M1 3H17"}"/></svg>`;
    const drawn = item.firstChild.firstChild;
    if (shape) drawn.setAttribute("points", shape.map(([x, y]) => `${x},${-y}`).join(" "));
    drawn.setAttribute("stroke", inTheme(mark.stroke ?? "none"));
    drawn.setAttribute("fill", inTheme((shape && mark.fill) || "none"));
    drawn.setAttribute("stroke-width", shape ? mark.width : mark.kind === "spring" ? 1.4 : 2.5);
    if (mark.dash.length) drawn.setAttribute("stroke-dasharray", "4 2");
    item.append(` ${mark.label} `, value);
    return value;
  }
}

// Replaces the labels of an element; each has a colour and a text.
export function tags(host, shown) {
  host.replaceChildren(...shown.map(([color, label]) => {
    const tag = document.createElement("li");
    tag.style.background = color;
    tag.style.color = luminance(color) > 0.179 ? "#000" : "#fff"; // where both have 4.58:1
    tag.textContent = label;
    return tag;
  }));
}

// Of a colour #rrggbb, as the contrast of a text on it needs it (WCAG 2.2).
function luminance(color) {
  const parts = [1, 3, 5].map((i) => parseInt(color.slice(i, i + 2), 16) / 255);
  const [r, g, b] = parts.map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

// The legend of a drawing, with the newest forces, and labels of the current states.
import { place, reach } from "./painter.js";
import { text } from "./canvas.js";

const LOOKS = { "operational point": "cross", point: "cross", ring: "ring", pin: "dot", centre: "cross" };

export class Legend {
  constructor(host) { this.host = host; }

  begin(marks, frame) {
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
      const sizes = marks.map((mark) => reach(frame, mark.vector)).map((f) => (f ? Math.hypot(f[0], f[1]) : 0));
      value.textContent = text(Math.max(...sizes), "N");
    }
  }

  entry(mark) {
    const item = document.createElement("li"), chip = document.createElement("i");
    const value = document.createElement("b");
    chip.style.color = mark.stroke ?? mark.fill;
    chip.className = LOOKS[mark.kind] ?? (mark.dash.length ? "dashed" : "");
    item.append(chip, `${mark.label} `, value);
    return value;
  }
}

// Replaces the labels of an element; each has a colour and a text.
export function tags(host, shown) {
  host.replaceChildren(...shown.map(([color, label]) => {
    const tag = document.createElement("li");
    tag.style.background = color;
    tag.textContent = label;
    return tag;
  }));
}

// Episodes of the runs over time, one lane to each kind that a run has.
import { fitted } from "./canvas.js";

export class Lanes {
  constructor(host, kinds, recordings, end, seek) {
    this.end = end;
    this.lanes = [];
    for (const [kind, [color, meaning]] of Object.entries(kinds)) {
      for (const recording of recordings) {
        const found = recording.episodes.filter((e) => e.kind === kind);
        if (!found.length) continue;
        const lane = document.createElement("div"), label = document.createElement("span");
        const canvas = document.createElement("canvas");
        lane.className = "lane";
        lane.dataset.kind = kind;
        label.textContent = recordings.length > 1 ? `${recording.short}: ${meaning}` : meaning;
        canvas.title = `${found.length} times: ${[...new Set(found.map((e) => e.said))].join("; ")}`;
        canvas.addEventListener("pointerdown", (event) => seek((end * event.offsetX) / canvas.clientWidth));
        lane.append(label, canvas);
        host.append(lane);
        this.lanes.push({ canvas, color, found });
      }
    }
  }

  draw(now) {
    for (const { canvas, color, found } of this.lanes) {
      const { context, width, height } = fitted(canvas), x = (t) => (width * t) / this.end;
      context.fillStyle = color;
      for (const { begin, end } of found) context.fillRect(x(begin), 0, Math.max(2, x(end) - x(begin)), height);
      context.fillStyle = "#222";
      context.fillRect(x(now) - 0.5, 0, 1.5, height);
    }
  }
}

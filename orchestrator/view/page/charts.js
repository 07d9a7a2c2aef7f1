// Strip charts of the last 10 s.
import { fitted, text } from "./canvas.js";

const SPAN = 10, COLORS = ["#4477aa", "#b85c00", "#228833", "#aa3377", "#cc3311", "#66ccee"];
const size = (v) => v && Math.hypot(v[0], v[1]);
const CHARTS = [
  { title: "tracking error", unit: "mm", series: { error: (f) => f.arms && 1e3 * Math.hypot(f.x[0] - f.handle[0], f.x[1] - f.handle[1]) } },
  { title: "force", unit: "N", colors: ["#b85c00", "#aa3377", "#cc3311"], series: { hand: (f) => size(f.F_hand), topology: (f) => size(f.F_constraint), contacts: (f) => size(f.F_env) } },
  { title: "closure error", unit: "m", series: { gap: (f) => f.closure_error?.[0] } },
  { title: "constrained directions", unit: "count", series: { number: (f) => f.n?.[0] } },
  { title: "energy generated", unit: "mJ", energies: true },
  { title: "deadlines missed", unit: "count", series: { missed: (f) => f.missed } },
];

export class Charts {
  constructor(host) {
    this.host = host;
    this.charts = [];
  }

  begin(energies) {
    this.charts = CHARTS.map((chart) => new Chart(chart, energies));
    this.host.replaceChildren(...this.charts.map((chart) => chart.figure));
  }

  add(frame) { for (const chart of this.charts) chart.add(frame); }
  draw() { for (const chart of this.charts) chart.draw(); }
}

// The user's port, or what is held by a connection, and where.
function named(connection) {
  const [source, target] = connection.split(" -> ");
  if (!target) return source;
  const what = source.startsWith("hand") ? "F_hand" : source.split(".")[1];
  return `${what} to ${target.split(".")[0].replace("virtual_", "").replace("haptic_", "")}`;
}

class Chart {
  constructor({ title, unit, series, energies, colors = COLORS }, connections) {
    this.unit = unit;
    this.colors = colors;
    this.names = energies ? connections.map(named) : Object.keys(series);
    this.read = energies
      ? connections.map((name) => (f) => f.energy && 1e3 * f.energy[name])
      : Object.values(series);
    this.times = [];
    this.rows = [];
    this.figure = document.createElement("figure");
    this.figure.hidden = true;
    this.figure.dataset.chart = title;
    const caption = document.createElement("figcaption");
    this.values = this.names.map(() => document.createElement("b"));
    caption.append(title, ...this.values);
    this.canvas = document.createElement("canvas");
    this.figure.append(caption, this.canvas);
  }

  add(frame) {
    const row = this.read.map((read) => read(frame) ?? null);
    if (row.every((v) => v === null)) return;
    this.figure.hidden = false;
    if (this.times.at(-1) >= frame.t) return;
    this.times.push(frame.t);
    this.rows.push(row);
    const old = this.times.findIndex((t) => t > frame.t - SPAN);
    if (old > 50) { this.times.splice(0, old); this.rows.splice(0, old); }
  }

  draw() {
    if (this.figure.hidden || !this.times.length) return;
    const { context, width, height } = fitted(this.canvas), end = this.times.at(-1);
    const shown = this.names.map((_, i) => this.rows.some((row) => row[i] !== null));
    const all = this.rows.flat().filter((v) => v !== null);
    const low = Math.min(0, ...all), high = Math.max(low + (this.unit === "count" ? 1 : 1e-18), ...all);
    const top = low + nice(high - low), left = 44, base = height - 4;
    const x = (t) => left + ((width - left - 2) * (t - end + SPAN)) / SPAN;
    const y = (v) => base - ((base - 12) * (v - low)) / (top - low);
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "middle";
    context.textAlign = "right";
    context.lineWidth = 1;
    for (const v of [low, (low + top) / 2, top]) {
      context.strokeStyle = "#e4e6ec";
      context.beginPath();
      context.moveTo(left, y(v));
      context.lineTo(width, y(v));
      context.stroke();
      context.fillStyle = "#667";
      context.fillText(tick(v), left - 4, y(v));
    }
    context.lineWidth = 1.6;
    context.save();
    context.beginPath();
    context.rect(left, 0, width, height);
    context.clip();
    this.names.forEach((_, i) => {
      context.strokeStyle = this.colors[i % this.colors.length];
      context.beginPath();
      this.times.forEach((t, k) => { if (this.rows[k][i] !== null) context.lineTo(x(t), y(this.rows[k][i])); });
      context.stroke();
    });
    context.restore();
    this.label(shown, this.rows.at(-1));
  }

  // The newest values in the caption, with their names where there are several.
  label(shown, last) {
    const several = shown.filter(Boolean).length > 1;
    this.values.forEach((value, i) => {
      value.hidden = !shown[i];
      value.style.color = several ? this.colors[i % this.colors.length] : "";
      value.textContent = (several ? `${this.names[i]} ` : "") + text(last[i] ?? 0, this.unit);
    });
  }
}

// A number at an axis, in two digits.
function tick(v) {
  const size = Math.abs(v);
  return size >= 1e4 || (size && size < 1e-2) ? v.toExponential(1).replace(".0e", "e") : +v.toPrecision(2);
}

// The least of 1, 2, 5 times a power of ten that is not below a length.
function nice(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * [1, 2, 5, 10].find((m) => m * power >= length * (1 - 1e-9));
}

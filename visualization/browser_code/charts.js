// Strip charts: of the last 10 s of a run that goes on, or of whole runs that are recorded.
import { FELT, fitted, inTheme, text, themed } from "./canvas.js";
import { apart, length } from "./view.js";

const SPAN = 10, LEFT = 44, ENERGIES = 4; // s, px, and the most lines of energies
const COLORS = ["#4477aa", "#b85c00", "#228833", "#aa3377", "#cc3311", "#8250c8", "#75751f", "#882255", "#1f7d70", "#666666"], DASHES = [[], [5, 3], [2, 3], [7, 3, 2, 3]];
const size = (v, d) => v && length(v, d);
// `each`: series of every user, from that user's part of a frame and the dimension of the linkage; `series`: from the whole frame.
const CHARTS = [
  { title: "tracking error", unit: "mm", each: { error: (u, d) => u.arms && 1e3 * apart(u.x, u.handle, d) } },
  { title: "force", unit: "N", colors: ["#b85c00", "#4477aa", "#aa3377", "#cc3311"], each: { hand: (u, d) => size(u.F_hand, d), motors: (u, d) => size(u.F_motor, d), "of them topology": (u, d) => size(u.F_constraint, d), contacts: (u, d) => size(u.F_env, d) } },
  { title: "constrained directions", unit: "count", each: { number: (u) => u.n?.[0] } },
  { title: "energy generated since the start", unit: "mJ", energies: true },
  { title: "closure error", unit: "m", series: { gap: (f) => f.closure_error?.[0] }, expert: true },
  { title: "deadlines missed", unit: "count", series: { missed: (f) => f.missed }, expert: true },
];

export class Charts {
  constructor(host) {
    this.host = host;
    this.charts = [];
  }

  begin(energies, users, dimension, runs = 1) {
    this.charts = CHARTS.map((chart) => {
      const series = chart.series ?? ofUsers(chart.each, users, dimension);
      return new Chart({ ...chart, series, users: chart.each ? users : [""] }, energies, runs);
    });
    const fold = document.createElement("details"), title = document.createElement("summary");
    title.textContent = "Expert: closure error, deadlines";
    fold.append(title, ...this.charts.filter((chart) => chart.expert).map((chart) => chart.figure));
    this.host.replaceChildren(...this.charts.filter((chart) => !chart.expert).map((chart) => chart.figure), fold);
  }

  // Of a run, the frames of the newest `kept` seconds are kept.
  add(frame, run = 0, kept = SPAN) { for (const chart of this.charts) chart.add(frame, run, kept); }

  // Over `span` (s), with a cursor `at` a time; by default over what is kept.
  draw(span, at) { for (const chart of this.charts) chart.draw(span, at); }

  // The time (s) at a pointer on a chart that is drawn over `span`, null beside them.
  time({ target, offsetX }, [from, to]) {
    if (!(target instanceof HTMLCanvasElement)) return null;
    return from + ((to - from) * (offsetX - LEFT)) / (target.clientWidth - LEFT - 2);
  }
}

// The series of each user, whose name stands first for further users.
function ofUsers(each, users, dimension) {
  const of = (frame, user) => (user ? frame.others?.[user] : frame);
  const read = (user) => Object.entries(each ?? {}).map(([name, value]) => [
    user ? `${user}: ${name}` : name,
    (frame) => of(frame, user) && value(of(frame, user), dimension),
  ]);
  return Object.fromEntries(users.flatMap(read));
}

class Chart {
  constructor({ title, unit, series, energies, users, colors = COLORS, expert = false }, connections, runs) {
    this.unit = unit;
    this.expert = expert;
    this.most = energies ? ENERGIES : Infinity;
    this.names = energies ? connections.map(({ words }) => words) : Object.keys(series);
    this.read = energies
      ? connections.map(({ name }) => (f) => (name in (f.energy ?? {}) ? 1e3 * f.energy[name] : null))
      : Object.values(series);
    // Of several users each has a hue, and each series a dash; of one each series has a colour.
    const of = this.names.length / users.length, several = users.length > 1;
    this.colors = this.names.map((_, i) => (several ? COLORS[Math.floor(i / of)] : colors[i % colors.length]));
    this.dashes = this.names.map((_, i) => (several ? DASHES[(i % of) % DASHES.length] : []));
    this.runs = Array.from({ length: runs }, () => ({ times: [], rows: [] }));
    this.figure = document.createElement("figure");
    this.figure.hidden = true;
    this.figure.dataset.chart = title;
    const caption = document.createElement("figcaption");
    this.values = this.names.map(() => document.createElement("b"));
    caption.append(title, ...this.values);
    this.canvas = document.createElement("canvas");
    this.figure.append(caption, this.canvas);
  }

  add(frame, run, kept) {
    const row = this.read.map((read) => read(frame) ?? null), { times, rows } = this.runs[run];
    if (row.every((v) => v === null)) return;
    this.figure.hidden = false;
    if (times.at(-1) >= frame.t) return;
    times.push(frame.t);
    rows.push(row);
    const old = times.findIndex((t) => t > frame.t - kept);
    if (old > 50) { times.splice(0, old); rows.splice(0, old); }
  }

  draw(span, at) {
    if (this.figure.hidden || this.figure.closest("details:not([open])")) return;
    const newest = Math.max(...this.runs.map(({ times }) => times.at(-1) ?? 0));
    const [from, to] = span ?? [newest - SPAN, newest];
    const { context, width, height } = fitted(this.canvas);
    const drawn = this.largest();
    const all = this.runs.flatMap(({ rows }) => rows.flatMap((row) => row.filter((v, i) => v !== null && drawn.includes(i))));
    const { low, top } = limits(all, FELT[this.unit]), base = height - 4;
    const grid = themed("line"), soft = themed("soft");
    const x = (t) => LEFT + ((width - LEFT - 2) * (t - from)) / (to - from);
    const y = (v) => base - ((base - 12) * (v - low)) / (top - low);
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "middle";
    context.textAlign = "right";
    context.lineWidth = 1;
    const crowded = Math.min(y(low) - y(0), y(0) - y(top)) < 12;
    for (const v of !low || !top ? [low, (low + top) / 2, top] : crowded ? [low, top] : [low, 0, top]) {
      line(context, grid, [[LEFT, y(v)], [width, y(v)]]);
      context.fillStyle = soft;
      context.fillText(tick(v), LEFT - 4, y(v));
    }
    context.save();
    context.beginPath();
    context.rect(LEFT, 0, width, height);
    context.clip();
    this.runs.forEach(({ times, rows }, run) => {
      context.lineWidth = run ? 1.2 : 1.6;
      for (const i of drawn) {
        context.setLineDash(run ? [4, 3] : this.dashes[i]);
        line(context, inTheme(this.colors[i]), times.flatMap((t, k) => (rows[k][i] === null ? [] : [[x(t), y(rows[k][i])]])));
      }
    });
    context.setLineDash([]);
    if (at !== undefined) line(context, themed("ink"), [[x(at), 0], [x(at), height]]);
    context.restore();
    queueMicrotask(() => this.label(at, drawn)); // behind all charts: the size of the next one would have the page laid out
  }

  // The series that are drawn: all, or the first one and those with the largest values.
  largest() {
    const every = this.names.map((_, i) => i);
    if (every.length <= this.most) return every;
    const peak = (i) => this.runs.reduce((found, { rows }) => rows.reduce((m, row) => Math.max(m, Math.abs(row[i] ?? 0)), found), 0);
    const sizes = every.map(peak), [first, ...others] = every;
    return [first, ...others.sort((a, b) => sizes[b] - sizes[a] || a - b).slice(0, this.most - 1)];
  }

  // The values in the caption, at a time or the newest, with their names where there are several.
  label(at, drawn) {
    const shown = this.names.map((_, i) => drawn.includes(i) && this.runs.some(({ rows }) => rows.some((row) => row[i] !== null)));
    const several = shown.filter(Boolean).length > 1;
    this.values.forEach((value, i) => {
      value.hidden = !shown[i];
      value.style.color = several ? inTheme(this.colors[i]) : "";
      const found = this.runs.map(({ times, rows }) => {
        const after = at === undefined ? -1 : times.findIndex((t) => t > at + 1e-9);
        return (after < 0 ? rows.at(-1) : rows[Math.max(after - 1, 0)])?.[i] ?? null;
      });
      const values = found.map((v) => (v === null ? "-" : text(v, this.unit))).join(" | ");
      value.textContent = (several ? `${this.names[i]} ` : "") + (this.runs.length > 1 ? values : text(found[0] ?? 0, this.unit));
    });
  }
}

function line(context, color, points) {
  context.strokeStyle = color;
  context.beginPath();
  for (const point of points) context.lineTo(...point);
  context.stroke();
}

// A number at an axis, in two digits.
function tick(v) {
  const size = Math.abs(v);
  return size >= 1e4 || (size && size < 1e-2) ? v.toExponential(1).replace(".0e", "e").replace("e+", "e") : +v.toPrecision(2);
}

// Round limits of an axis that has 0 and all values, at least of a length.
function limits(values, least) {
  const low = values.reduce((a, b) => Math.min(a, b), 0), high = values.reduce((a, b) => Math.max(a, b), 0);
  if (high - low < least) return { low: 0, top: least };
  return { low: low < -0.02 * (high - low) ? -nice(-low) : 0, top: high > 0.02 * (high - low) ? nice(high) : 0 };
}

// The least of 1, 2, 5 times a power of ten that is not below a length.
function nice(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * [1, 2, 5, 10].find((m) => m * power >= length * (1 - 1e-9));
}

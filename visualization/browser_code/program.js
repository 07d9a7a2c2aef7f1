// A scene compiled to WebAssembly (programs/page.c): one run of it, its frames, and what is changed of it.

import { loudness } from "./loudness.js";

export const SPEED = "speed";
const RATE = "graphics.rate", RENDERED = "controller.topology", POINT = "linkage.operational_point";
// The key of what is set at once: a rate with its jitter, a hold with its delay.
const together = (key) => (key === "jitter" ? RATE : key.replace(/^delays\./, "holds."));

// There are no files for what the C library would write to.
const WASI = new Proxy({}, { get: () => () => 8 });

export class Program {
  // `data` describes the scene (visualization/standalone/description.py); `changed` is what a page has set, by key of the
  // control, as a run that begins anew gets it again.
  constructor(module, data, changed = {}) {
    this.c = new WebAssembly.Instance(module, { wasi_snapshot_preview1: WASI }).exports;
    this.c._initialize();
    this.data = data;
    this.changed = changed;
    this.start = Object.fromEntries(data.controls.map((control) => [control.key, control]));
    this.m = this.c.create();
    this.pulling = new Map();
    for (const key of new Set(Object.keys(changed).map(together))) if (key !== POINT) this.act(key);
    this.require(this.c.begin_run(this.m));
    if (POINT in changed) this.act(POINT); // the hand begins at the scene's point, where the handle is
  }

  require(done) {
    if (!done) throw new Error(this.text(this.c.message()));
  }

  text(at) {
    const bytes = new Uint8Array(this.c.memory.buffer, at);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }

  numbers(at, n) { return new Float64Array(this.c.memory.buffer, at, n); }

  // Times (s) of the newest haptic event, and of the next one.
  get time() { return this.c.newest(this.m); }
  get due() { return this.c.due(this.m); }

  run(ticks = 1) { this.require(this.c.run(this.m, ticks)); }

  // --- what is changed: as visualization/live_page/controls.py does it --------------------------------

  apply(message) {
    const { type, key, value } = message;
    if (type === "hand") return this.pull(message.user ?? "", message.at);
    if (type !== "set") throw new Error(`there is no message ${type}`);
    if (!(key in this.start)) throw new Error(`there is no control ${key}`);
    if (this.start[key].only_at_start) throw new Error(`${key} = ${value}: make a file with ${this.start[key].only_at_start}`);
    const before = { ...this.changed };
    this.changed[key] = value;
    try { this.act(together(key)); } catch (error) {
      delete this.changed[key];
      Object.assign(this.changed, before);
      throw error;
    }
  }

  // Carries out what is set of a control.
  act(key) {
    const [kind] = key.split("."), name = key.slice(kind.length + 1);
    if (key === SPEED) return; // the worker's
    if (key === RATE) this.rate();
    else if (kind === "holds") this.hold(name);
    else if (key === POINT) this.point();
    else for (const gain of key === RENDERED ? this.data.topology : [name]) this.gain(gain);
  }

  set(name, values) {
    this.data.parameters[name].forEach((reference, i) => this.require(this.c.set(this.m, reference, values[i])));
  }

  gain(name) {
    const off = this.data.topology.includes(name) && !(this.changed[RENDERED] ?? true);
    const user = Object.keys(this.data.hands).find((each) => this.data.hands[each].stiffness === name);
    if (user !== undefined && !this.pulling.get(user)) return; // it acts while the hand pulls
    const factor = off ? 0 : this.changed[`gains.${name}`] ?? 1;
    this.set(name, this.start[`gains.${name}`].start.map((v) => v * factor));
  }

  rate() {
    const { changed } = this, own = this.start[RATE].value;
    if (changed[RATE] === own) delete changed[RATE];
    const { [RATE]: rate, jitter = 0 } = changed;
    if (!rate && !own) throw new Error("the rate varies in this scene: set the rate first");
    const shortest = (1 - jitter) / (rate ?? own), late = this.data.result_after;
    if ((rate || jitter) && shortest < late * (1 - 1e-9)) {
      throw new Error(`steps would be down to ${+shortest.toPrecision(6)} s, and the result of one is there after ${late} s (computing_time)`);
    }
    this.c.rate(this.m, rate ?? (jitter ? own : 0), jitter);
  }

  point() {
    const { choices } = this.start[POINT], number = choices.indexOf(this.changed[POINT]);
    if (number < 0) throw new Error(`no point ${this.changed[POINT]}; there are ${choices.join(", ")}`);
    this.set(this.data.point, [number]);
  }

  hold(name) {
    const wanted = this.changed[`holds.${name}`] ?? this.start[`holds.${name}`].value;
    const choice = this.data.choices.findIndex((each) => each.connection === name && each.hold === wanted);
    if (choice < 0) throw new Error(`there is no hold ${wanted} of ${name} in this file`);
    const delay = this.changed[`delays.${name}`];
    this.require(this.c.hold(this.m, choice, delay === undefined ? -1 : Math.round(1e6 * delay)));
  }

  // A pointer pulls a user's handle to a place, null where it lets go.
  pull(user, at) {
    const hand = this.data.hands[user];
    if (at) this.set(hand.target, [...at, 0].slice(0, 3)); // in the plane with its angle
    if (Boolean(at) === Boolean(this.pulling.get(user))) return;
    this.pulling.set(user, Boolean(at));
    if (at) this.gain(hand.stiffness);
    else this.set(hand.stiffness, [0, 0, 0]);
  }

  // The controls with their values, as messages have them.
  get controls() {
    return this.data.controls.map((control) => ({ ...control, value: this.changed[control.key] ?? control.value }));
  }

  // --- what is shown ------------------------------------------------------------------------------

  // A frame as the server sends it.
  get frame() {
    const { data } = this, values = this.numbers(this.c.signal_values(this.m), data.n_values);
    const frame = { t: this.time, states: [], stored: values[data.stored], pulled: Boolean(this.pulling.get("")) };
    const of = (user) => (user ? ((frame.others ??= {})[user] ??= {}) : frame);
    for (const { user, name, places } of data.signals) of(user)[name] = places.map((place) => values[place]);
    const drawn = this.numbers(this.c.drawn(this.m), data.n_drawn);
    for (const part of data.parts) {
      const found = entries(part, drawn);
      if (part.is_state) { if (found[0][0]) frame.states.push(part.user ? `${part.gives} ${part.user}` : part.gives); }
      else if (part.names.length) of(part.user)[part.gives] = Object.fromEntries(part.names.map((name, i) => [name, found[i]]));
      else of(part.user)[part.gives] = found;
    }
    const work = this.numbers(this.c.work(this.m), 2 * data.scene.power.length);
    frame.booked = data.scene.power.map((_, i) => [work[2 * i], work[2 * i + 1]]);
    return frame;
  }

  // What is heard of the newest signals.
  heard(signal) {
    const values = this.numbers(this.c.signal_values(this.m), this.data.n_values);
    this.places ??= Object.fromEntries(this.data.signals.filter(({ user }) => !user).map(({ name, places }) => [name, places]));
    const of = (name) => this.places[name].map((place) => values[place]);
    return loudness(signal, { F_hand: of("F_hand"), x: of("x"), handle: of("handle") }, this.data.scene.view.dimension);
  }

  // Time and all outputs at the newest haptic event.
  get row() {
    return this.data.tables.flatMap(({ columns }, i) =>
      [...this.numbers(this.c.row(this.m, i), 1 + columns.length)].slice(i ? 1 : 0));
  }
}

// The columns of a part's matrix; null where one is not finite, none of zeros where the part is sparse.
function entries({ at, rows, columns, sparse }, drawn) {
  const found = Array.from({ length: columns }, (_, k) => [...drawn.subarray(at + k * rows, at + (k + 1) * rows)]);
  const known = found.map((entry) => (entry.every(Number.isFinite) ? entry : null));
  return sparse ? known.filter((entry) => !entry || entry.some(Boolean)) : known;
}

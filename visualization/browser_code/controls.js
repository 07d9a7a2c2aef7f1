// The controls of the running FMUs. They show the values that the run reports, not those last set.
import { SPEEDS, text } from "./canvas.js";
import { set } from "./settings.js";

const NAMES = {
  "hand.stiffness": "Hand: stiffness", "hand.damping": "Hand: damping",
  "controller.K_pc": "Virtual coupling: stiffness", "controller.B_pc": "Virtual coupling: damping",
  "controller.k_j": "Topology controller: stiffness", "controller.b_j": "Topology controller: damping",
  "controller.K_d": "Desired stiffness", "controller.B_d": "Desired damping",
  "virtual_mechanism.k_contact": "Contact: stiffness", "virtual_mechanism.b_contact": "Contact: damping",
  "virtual_mechanism.beta": "Loop closure: damping of Baumgarte",
  "virtual_mechanism.hysteresis": "Constrained directions: hysteresis", "virtual_environment.hysteresis": "Constrained directions: hysteresis",
};
// Units of gains per inertia, in the words of what they render; those of their FMUs are 1/s2 and 1/s.
const UNITS = { k_j: "N/m per kg", b_j: "N.s/m per kg" };
// Rates (Hz) with a short common period with the haptic rate, for which stability is computed fast.
export const RATES = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 20, 22, 24, 25, 26, 28, 30, 32, 36, 40, 44, 48, 50, 56,
  60, 64, 72, 75, 80, 90, 96, 100, 110, 120, 128, 144, 160, 180, 200];
// A gain's name, and the user's where it is of a further one: hand_left.damping.
const titled = (gain) => {
  const [, fmu, user, port] = gain.match(/^(hand|controller)_(\w+)\.(.+)$/) ?? [];
  return fmu ? `${user}: ${titled(`${fmu}.${port}`)}` : NAMES[gain] ?? gain;
};

// By the first part of the keys of controls: the group in which they are, in the order of the page.
const GROUPS = {
  linkage: "Hand", graphics: "Rate", speed: "Time", controller: "Controller", model: "Holds, between the rates", holds: "Holds, between the rates", gains: "Gains",
  jitter: "Expert: jitter, delays", delays: "Expert: jitter, delays",
};
const LEFT = -1.05; // of a gain's slider: 0, then 0.1 to 10 times the scene's value

export class Controls {
  constructor(host, send) {
    this.host = host;
    this.send = send;
    host.closest("form")?.addEventListener("submit", (event) => event.preventDefault());
  }

  show(found) {
    const shape = JSON.stringify(found.map(({ key, max, choices }) => [key, max, choices && [...choices].sort()]));
    if (shape !== this.shape) this.build(found);
    this.shape = shape;
    for (const control of found) this.updates[control.key](control);
  }

  build(found) {
    this.updates = {};
    this.host.replaceChildren();
    this.fieldset = null;
    for (const [kind, title] of Object.entries(GROUPS)) {
      for (const control of found.filter(({ key }) => key.split(".")[0] === kind)) {
        if (this.fieldset?.dataset.title !== title) this.group(title);
        this[kind](control, control.key.slice(kind.length + 1));
      }
    }
  }

  graphics({ key, words, max }) {
    const rates = RATES.filter((rate) => rate <= max);
    this.slider(key, `${words} at`, [0, rates.length - 1, 1], (i) => rates[i],
      ({ value }) => (value ? [rates.findLastIndex((rate) => rate <= value), text(value, "Hz")] : [0, "varying"]));
  }

  speed({ key }) {
    this.slider(key, "Real-time factor", [0, SPEEDS.length - 1, 1], (i) => SPEEDS[i],
      ({ value }) => [SPEEDS.findLastIndex((speed) => speed <= value), `${value}×`]);
  }

  controller({ key }) {
    this.checkbox(key, "Topology controller: render the constrained directions");
  }

  model({ key, only_at_start }) {
    const how = only_at_start ? `not in this file: make one with ${only_at_start}` : "begins anew at t = 0";
    this.checkbox(key, `Hold model, where a connection can have it (${how})`).disabled = Boolean(only_at_start);
  }

  checkbox(key, title) {
    const input = Object.assign(document.createElement("input"), { type: "checkbox" });
    this.labelled(key, title, input);
    input.addEventListener("change", () => this.send(set(key, input.checked)));
    this.updates[key] = ({ value }) => { input.checked = value; };
    return input;
  }

  linkage(control) {
    this.select(control);
  }

  holds(control, connection) {
    this.select(control).textContent = connection.split(" -> ")[0].split(".").slice(1).join(" ");
  }

  select({ key, words, choices }) {
    const select = document.createElement("select");
    select.append(...[...choices].sort().map((name) => new Option(name, name)));
    select.addEventListener("change", () => this.send(set(key, select.value)));
    this.updates[key] = ({ value }) => { select.value = value; };
    return this.labelled(key, words, select);
  }

  gains({ key, start, units }, name) {
    const k = start.reduce((best, v, j) => (Math.abs(v) > Math.abs(start[best]) ? j : best), 0);
    this.slider(key, titled(name), [LEFT, 1, 0.05], (s) => (s < -1 ? 0 : 10 ** s),
      ({ value }) => [value ? Math.log10(value) : LEFT, text(value * start[k], UNITS[name.split(".").at(-1)] ?? units[k])]);
  }

  jitter({ key }) {
    this.slider(key, "Jitter", [0, 90, 5], (share) => share / 100,
      ({ value }) => [100 * value, `${(100 * value).toFixed(0)} % of a period`]);
  }

  delays({ key, words }) {
    this.slider(key, `Delay: ${words}`, [0, 100, 1], (ms) => ms / 1e3, ({ value }) => [1e3 * value, `${(1e3 * value).toFixed(0)} ms`]);
  }

  // Controls under a title, those for experts folded.
  group(title) {
    const folds = title.startsWith("Expert");
    this.fieldset = document.createElement(folds ? "details" : "fieldset");
    this.fieldset.dataset.title = title;
    const head = document.createElement(folds ? "summary" : "legend");
    head.textContent = title;
    this.fieldset.append(head);
    this.host.append(this.fieldset);
  }

  labelled(key, title, input) {
    const label = document.createElement("label"), output = document.createElement("output");
    input.dataset.control = input.id = label.htmlFor = key; // an output, which comes first, takes a label, too
    label.append(title, output, input);
    this.fieldset.append(label);
    return output;
  }

  // `value` of a place on it; `shown`: the place of a control, and what is written beside it.
  slider(key, title, [min, max, step], value, shown) {
    const input = Object.assign(document.createElement("input"), { type: "range", min, max, step });
    const output = this.labelled(key, title, input);
    input.addEventListener("input", () => this.send(set(key, value(Number(input.value)))));
    this.updates[key] = (control) => {
      const [place, label] = shown(control);
      if (!input.matches(":active")) input.value = place;
      output.textContent = label;
    };
  }
}

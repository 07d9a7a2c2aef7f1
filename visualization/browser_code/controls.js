// The controls of the running FMUs. They show the values that the run reports, not those last set.
import { text } from "./canvas.js";

const NAMES = {
  "hand.stiffness": "Hand: stiffness", "hand.damping": "Hand: damping",
  "controller.K_pc": "Virtual coupling: stiffness", "controller.B_pc": "Virtual coupling: damping",
  "controller.k_j": "Topology controller: stiffness", "controller.b_j": "Topology controller: damping",
  "controller.K_d": "Desired stiffness", "controller.B_d": "Desired damping",
  "virtual_mechanism.k_contact": "Contact: stiffness", "virtual_mechanism.b_contact": "Contact: damping",
  "virtual_mechanism.hysteresis": "Constrained directions: hysteresis", "virtual_environment.hysteresis": "Constrained directions: hysteresis",
};
// Rates (Hz) with a short common period with the haptic rate, for which stability is computed fast.
const RATES = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 20, 22, 24, 25, 26, 28, 30, 32, 36, 40, 44, 48, 50, 56,
  60, 64, 72, 75, 80, 90, 96, 100, 110, 120, 128, 144, 160, 180, 200];
const symbol = (connection) => connection.split(" -> ")[0].split(".").slice(1).join(" ");
// A gain's name, and the user's where it is of a further one: hand_left.damping.
const titled = (gain) => {
  const [, fmu, user, port] = gain.match(/^(hand|controller)_(\w+)\.(.+)$/) ?? [];
  return fmu ? `${user}: ${titled(`${fmu}.${port}`)}` : NAMES[gain] ?? gain;
};

export class Controls {
  constructor(host, send) {
    this.host = host;
    this.send = send;
    host.closest("form")?.addEventListener("submit", (event) => event.preventDefault());
  }

  show(found) {
    const shape = JSON.stringify([found.rate?.max, found.topology === null,
      found.holds.map((h) => [h.connection, [...h.choices].sort()]), found.gains.map((g) => g.name)]);
    if (shape !== this.shape) this.build(found);
    this.shape = shape;
    this.updates.forEach((update) => update(found));
  }

  build(found) {
    this.updates = [];
    this.host.replaceChildren();
    if (found.rate) {
      this.group("Rate");
      const rates = RATES.filter((rate) => rate <= found.rate.max);
      this.slider("rate", `${found.rate.of} at`, 0, rates.length - 1, 1, (i) => ({ type: "rate", value: rates[i] }),
        ({ rate: { value } }) => (value ? [rates.findLastIndex((rate) => rate <= value), text(value, "Hz")] : [0, "varying"]));
    }
    if (found.topology !== null) {
      this.group("Controller");
      this.checkbox("topology", "Topology controller: render the constrained directions", (on) => ({ type: "topology", on }), (f) => f.topology);
    }
    found.holds.forEach((hold, i) => {
      if (!i) this.group("Holds, between the rates");
      const name = hold.connection;
      this.choice(name, hold.words, symbol(name), [...hold.choices].sort(),
        (value) => ({ type: "hold", connection: name, hold: value }), (f) => f.holds[i].hold);
    });
    found.gains.forEach((gain, i) => {
      if (!i) this.group("Gains");
      // 0 at the left end, then 0.1 to 10 times the scene's value.
      this.slider(gain.name, titled(gain.name), -1.05, 1, 0.05,
        (s) => ({ type: "gain", name: gain.name, factor: s < -1 ? 0 : 10 ** s }),
        (f) => {
          const { factor, value, units } = f.gains[i];
          const k = value.reduce((best, v, j) => (Math.abs(v) > Math.abs(value[best]) ? j : best), 0);
          return [factor ? Math.log10(factor) : -1.05, text(factor * value[k], units[k])];
        });
    });
    this.expert(found);
  }

  // Jitter and delays, folded.
  expert(found) {
    const fold = document.createElement("details"), title = document.createElement("summary");
    title.textContent = "Expert: jitter, delays";
    fold.append(title);
    if (found.rate || found.holds.length) this.host.append(fold);
    this.fieldset = fold;
    if (found.rate) {
      this.slider("jitter", "Jitter", 0, 90, 5, (share) => ({ type: "jitter", value: share / 100 }),
        (f) => [100 * f.rate.jitter, `${(100 * f.rate.jitter).toFixed(0)} % of a period`]);
    }
    found.holds.forEach(({ connection, words }, i) => {
      this.slider(`delay ${connection}`, `Delay: ${words}`, 0, 100, 1,
        (ms) => ({ type: "delay", connection, value: ms / 1e3 }),
        (f) => [1e3 * f.holds[i].delay, `${(1e3 * f.holds[i].delay).toFixed(0)} ms`]);
    });
  }

  group(title) {
    this.fieldset = document.createElement("fieldset");
    const legend = document.createElement("legend");
    legend.textContent = title;
    this.fieldset.append(legend);
    this.host.append(this.fieldset);
  }

  labelled(id, title, input) {
    const label = document.createElement("label"), output = document.createElement("output");
    input.dataset.control = id;
    label.append(title, output, input);
    this.fieldset.append(label);
    return output;
  }

  slider(id, title, min, max, step, message, shown) {
    const input = Object.assign(document.createElement("input"), { type: "range", min, max, step });
    const output = this.labelled(id, title, input);
    input.addEventListener("input", () => this.send(message(Number(input.value))));
    this.updates.push((found) => {
      const [value, label] = shown(found);
      if (!input.matches(":active")) input.value = value;
      output.textContent = label;
    });
  }

  choice(id, title, symbol, choices, message, shown) {
    const select = document.createElement("select");
    select.append(...choices.map((name) => new Option(name, name)));
    this.labelled(id, title, select).textContent = symbol;
    select.addEventListener("change", () => this.send(message(select.value)));
    this.updates.push((found) => { select.value = shown(found); });
  }

  checkbox(id, title, message, shown) {
    const input = Object.assign(document.createElement("input"), { type: "checkbox" });
    this.labelled(id, title, input);
    input.addEventListener("change", () => this.send(message(input.checked)));
    this.updates.push((found) => { input.checked = shown(found); });
  }
}

// What the meters of a run say: of each connection that carries power the work of the effort that was held, and that of an
// ideal source. `power` lists the connections, whether a hand pushes there (`hand`), and whether what is put in there
// counts (`counts`: what a controller passes on was not put in by it).
const WINDOW = 1; // s, over which the light judges
const LIGHTS = ["green", "amber", "red"];

export class Energies {
  constructor({ power, port, noticeable }) {
    this.power = power;
    this.port = port;
    this.noticeable = noticeable;
    this.past = [];
    this.energy = {};
  }

  // Gives a frame its `energy` (J): generated at the user's port, which is what the mechanism has stored beyond the work
  // of the hands, and by connection, both since the start; where it has new sums, the `light`, the worst
  // of a second lest it flickers, and the state "energy" while the port generates: both judge the last second.
  add(frame) {
    if (frame.booked) {
      this.sum(frame);
      const port = this.energy[this.port];
      const now = { t: frame.t, generated: this.generated, put_in: this.put_in, port };
      this.past.push(now);
      while (frame.t - this.past[0].t > WINDOW) this.past.shift();
      const [before] = this.past;
      now.level = LIGHTS.indexOf(light(this.generated - before.generated, this.put_in - before.put_in, this.noticeable));
      frame.light = LIGHTS[Math.max(...this.past.map((each) => each.level))];
      this.generates = port - Math.min(...this.past.map((each) => each.port)) > this.noticeable && port > this.noticeable;
    }
    frame.energy = this.energy;
    if (this.generates) frame.states.push("energy");
  }

  sum({ booked, stored }) {
    this.start ??= stored;
    this.energy = { [this.port]: stored - this.start };
    this.generated = this.put_in = 0;
    this.power.forEach(({ name, hand, counts }, i) => {
      const [held, ideal] = booked[i];
      this.energy[name] = held - ideal;
      this.generated += held - ideal;
      if (hand) this.energy[this.port] -= held;
      if (counts) this.put_in += Math.max(ideal, 0);
    });
  }
}

// Red where sampling and holding generated more (J) than hands and mechanism put in, as in the judgement of a whole run,
// by more than what is noticeable; amber from a tenth of that on.
export function light(generated, put_in, noticeable) {
  const most = Math.max(put_in, 0) + noticeable;
  return generated > most ? "red" : generated > 0.1 * most ? "amber" : "green";
}

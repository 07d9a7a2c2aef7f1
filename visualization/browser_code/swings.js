// How often in the last second a point swung to and fro: it turns where, along x, y or z, it has come back by LEAST.
const WINDOW = 1; // s
const LEAST = 1e-3; // m
const OFTEN = 6; // turns in it, two to each time to and fro, from which on it vibrates; who drags does not turn as often

class Axis {
  constructor(at) {
    this.extreme = at;
    this.way = 0; // 1 or -1, in which it goes; 0 before it has gone anywhere
    this.turns = [];
  }

  add(t, at) {
    const gone = at - this.extreme;
    if (gone * this.way > 0) this.extreme = at;
    else if (Math.abs(gone) >= LEAST) {
      if (this.way) this.turns.push({ t, at: this.extreme });
      this.way = Math.sign(gone);
      this.extreme = at;
    }
    while (this.turns.length && t - this.turns[0].t > WINDOW) this.turns.shift();
  }
}

export class Swings {
  constructor() { this.axes = []; }

  // A run that begins anew is another one.
  add(t, point, dimension) {
    if (!this.axes.length || t < this.t) {
      this.axes = point.slice(0, dimension).map((at) => new Axis(at));
      this.since = t;
      this.past = [];
    }
    this.t = t;
    this.past.push({ t, point });
    while (t - this.past[0].t > WINDOW) this.past.shift();
    this.axes.forEach((axis, i) => axis.add(t, point[i]));
  }

  // Where it was in the last second.
  get trace() { return this.past.map(({ point }) => point); }

  // Whether it has been seen for that long.
  get watched() { return this.t - this.since >= WINDOW; }

  // How many `times` to and fro along that of x, y and z which has more, and by how much on average (`mm`); null where too few.
  get vibration() {
    const [{ turns }] = this.axes.toSorted((a, b) => b.turns.length - a.turns.length);
    if (turns.length < OFTEN) return null;
    const swings = turns.slice(1).map(({ at }, i) => Math.abs(at - turns[i].at));
    return { times: Math.floor(turns.length / 2), mm: (1e3 * swings.reduce((sum, swing) => sum + swing)) / swings.length };
  }
}

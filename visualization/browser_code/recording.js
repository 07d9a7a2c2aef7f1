// A recorded run. For each name, `is` are its distinct values and `at` the frames from which on they hold.
export class Recording {
  constructor(run) {
    Object.assign(this, run);
    this.end = this.times.at(-1);
    this.columns = Object.entries(this.frames).map(([key, { at, is }]) => [key, expanded(at, is, this.times.length)]);
  }

  // The newest frame at a time (s).
  index(t) {
    let low = 0, high = this.times.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.times[middle] <= t + 1e-9) low = middle; else high = middle;
    }
    return low;
  }

  frame(i) {
    const frame = { t: this.times[i] };
    for (const [key, values] of this.columns) if (values[i] !== null) frame[key] = values[i];
    frame.episodes = this.episodes.filter((e) => e.begin <= frame.t && (frame.t < e.end || e.end === this.end));
    return frame;
  }
}

function expanded(at, is, length) {
  const values = new Array(length);
  for (let k = 0; k < at.length; k++) values.fill(is[k], at[k], at[k + 1] ?? length);
  return values;
}

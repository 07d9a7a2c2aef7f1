// Plays samples of a signal at the haptic rate: without what is constant in it, so that a buzz is heard and a pull is not.
const LEAST = 24, MOST = 200; // samples that wait: before it begins, and before old ones are dropped
const SLOWEST = 25; // Hz, below which nothing is heard

class Heard extends AudioWorkletProcessor {
  constructor({ processorOptions: { rate, gain } }) {
    super();
    this.step = rate / sampleRate;
    this.gain = gain;
    this.keep = Math.exp((-2 * Math.PI * SLOWEST) / sampleRate);
    this.samples = [[], []];
    this.at = 0;
    this.before = [0, 0];
    this.high = [0, 0];
    this.plays = false;
    this.port.onmessage = ({ data: port }) => {
      port.onmessage = ({ data }) => data.forEach((value, i) => this.samples[i % 2].push(value));
    };
  }

  process(_, [output]) {
    const [left] = this.samples;
    if (left.length > MOST) this.drop(left.length - LEAST);
    this.plays = left.length > (this.plays ? 1 : LEAST);
    for (let i = 0; i < output[0].length; i++) {
      if (this.plays) this.at += this.step;
      if (this.at >= 1) this.drop(1);
      output.forEach((channel, side) => {
        const [a = this.before[side], b = a] = this.samples[side % 2];
        const value = a + this.at * (b - a);
        this.high[side] = this.keep * (this.high[side] + value - this.before[side]);
        this.before[side] = value;
        channel[i] = Math.tanh(this.gain * this.high[side]);
      });
    }
    return true;
  }

  drop(count) {
    for (const each of this.samples) each.splice(0, Math.min(count, each.length - 1));
    this.at = Math.max(this.at - count, 0);
  }
}
registerProcessor("heard", Heard);

// How a run ended that did not go on: its cause in a line, and the last moments in slow motion.
const LAST = 0.2, SLOWER = 10; // s that are shown again, and how much slower
export const DIVERGED = /became -?(nan|inf)|not finite|diverge/i; // in the cause of a run that did

export class Ending {
  constructor(host, again) {
    this.host = host;
    this.again = again; // begins anew
    this.frames = [];
    this.until = 0;
  }

  // A run begins: what is said is of the one before it.
  begin() {
    clearTimeout(this.later);
    if (this.played && !this.acted) this.word.textContent = `${this.run ? `${this.run} of the` : "The"} run before ${this.ended}`;
    else this.host.replaceChildren();
    this.host.className = "before";
    this.played = null;
    this.frames = [];
  }

  add(frame) {
    this.frames.push(frame);
    while (frame.t - this.frames[0].t > LAST) this.frames.shift();
  }

  // Says why, and which of two runs it was; in the first minute in plain words, unless More is open. The page goes on when
  // the last moments have been shown.
  show(why, run) {
    const diverged = DIVERGED.test(why), t = this.frames.at(-1)?.t ?? 0;
    const [word, plain, cause] = ["b", "span", "span"].map((tag) => document.createElement(tag));
    const ended = `${diverged ? "diverged" : "ended"} at ${t.toFixed(2)} s`;
    word.textContent = run ? `${run} ${ended}` : ended[0].toUpperCase() + ended.slice(1);
    if (diverged) [plain.className, plain.textContent, cause.className] = ["plain", ": the motion grew beyond all bounds (see More).", "cause"];
    cause.textContent = ` ${why}`;
    this.host.className = "";
    this.host.replaceChildren(word, plain, cause);
    Object.assign(this, { word, run, ended });
    this.started = performance.now();
    this.played = this.frames;
    clearTimeout(this.later);
    this.acted = false;
    this.later = setTimeout(this.again, 1e3 * LAST * SLOWER);
  }

  // The frame of the slow motion, null where none is shown.
  get frame() {
    if (!this.played?.length) return null;
    const t = this.played[0].t + (performance.now() - this.started) / 1e3 / SLOWER;
    return this.played.findLast((frame) => frame.t <= t) ?? this.played[0];
  }

  // The line stays until somebody acts, and while the last moments are shown: until the next run begins.
  hide() {
    this.acted = true;
    if (!this.played) this.host.replaceChildren();
  }
}

// What a scene shows first whose mechanism runs at the graphics rate: that rate, what it does to the handle, and a remedy.
import { RATES } from "./controls.js";
import { DIVERGED } from "./ending.js";
import { scaled } from "./presets.js";
import { set } from "./settings.js";
import { Swings } from "./swings.js";

const SLOWEST = 10, FASTEST = 60; // Hz; from 12 Hz down the mouse's hand sees closed-loop-direct vibrate
// Factors on the coupling, the same damping ratio but for rounding, with which all hands are stable at all these rates.
const SOFTER = { K_pc: 0.1, B_pc: 0.3 };

// The control of the rate, the rates (Hz) to choose from, and the messages that make the coupling softer (none where it
// has no gains that the page may change) with what they are `about`; null for a scene whose mechanism does not run at the graphics rate.
export function firstMinute(controls) {
  const rate = controls.find(({ key }) => key === "graphics.rate");
  if (!rate || !controls.some(({ key }) => /\.[xv] -> /.test(key))) return null;
  const rates = RATES.filter((hertz) => hertz >= SLOWEST && hertz <= Math.min(FASTEST, rate.max));
  const about = `stiffness ${SOFTER.K_pc} times the scene's, damping ${SOFTER.B_pc} times: the handle follows less closely`;
  return { rate, rates, softer: scaled(controls, SOFTER), about };
}

// What is said of the handle, and in which light: of its vibration, whether a hand pulls it (a board's always does), whether it
// was watched for long enough, whether the run has ended, and what it did without the remedy that is on.
export function felt(vibration, pulled, watched, ended, did) {
  if (DIVERGED.test(ended)) return ["The motion grew beyond all bounds: see the slow motion. Then it begins anew.", "red"];
  if (ended) return ["The run has ended: the line on the picture says why.", "red"];
  if (vibration) {
    const seen = `in the last second, by ${vibration.mm.toPrecision(2)} mm.`, { times } = vibration;
    return [pulled ? `The handle vibrates (red trace): ${times} times to and fro ${seen}` : `No hand pulls (its damper stays): the handle vibrates, ${times} times ${seen}`, "red"];
  }
  if (!pulled) return ["No hand pulls: press on the picture and drag.", ""];
  if (!watched) return ["A second is watched first.", ""];
  if (did) return [`The handle is steady: at this rate it ${did} before, and the softer coupling ended that.`, "green"];
  return ["The handle is steady: in the last second, fewer than 3 swings of 1 mm are seen.", "green"];
}

// Why, of the control of the rate, and whether the linkage's steps are taken when they begin.
export const why = ({ value, haptics }, early) => `The linkage is computed ${value ? `${+value.toPrecision(3)} times a second` : "at a rate that varies"}, \
the force on the hand ${Math.round(haptics)} times a second. In between, that force uses ${early ? "where the linkage goes: its step is computed when it begins."
  : "where the linkage was. A late force can feed a swing that it should damp."}`;

export class FirstMinute {
  // `send` is given what is changed.
  constructor(host, send) {
    this.host = host;
    this.send = send;
    this.swings = new Swings();
    this.did = new Map(); // by all other settings: what the handle did without the remedy, "" where the remedy did not end it
    const $ = (id) => host.querySelector(`#${id}`);
    [this.slider, this.ends, this.hertz, this.light, this.felt, this.remedy, this.why] = ["slow", "ends", "hertz", "felt", "said", "remedy", "why"].map($);
  }

  // Whether the scene is one that shows it.
  begin(controls) {
    this.offered = firstMinute(controls);
    this.host.hidden = !this.offered;
    if (!this.offered) return false;
    const { rate, rates, softer, about } = this.offered;
    Object.assign(this.slider, { min: 0, max: rates.length - 1, step: 1 });
    this.ends.replaceChildren(...[rates[0], rates.at(-1)].map((hertz) => Object.assign(document.createElement("span"), { textContent: `${hertz} Hz` })));
    this.slider.oninput = () => this.send(set(rate.key, rates[this.slider.value]));
    this.remedy.hidden = !softer.length;
    this.remedy.querySelector("small").textContent = about;
    this.remedy.onclick = () => {
      const pressed = this.remedy.ariaPressed === "true";
      for (const { key, value } of softer) this.send(set(key, pressed ? 1 : value));
    };
    return true;
  }

  // Whether it shows what a setting changes.
  has({ key, value }) {
    if (!this.offered) return false;
    const { rate, rates, softer } = this.offered;
    return key === rate.key ? value >= rates[0] && value <= rates.at(-1) : softer.some((each) => each.key === key && each.value === value);
  }

  // `alone`: no second run is beside it.
  show(controls, alone) {
    if (!this.offered) return;
    const { rate, rates, softer } = this.offered, of = new Map(controls.map((control) => [control.key, control]));
    const now = of.get(rate.key), place = rates.findLastIndex((hertz) => hertz <= now.value);
    if (!this.slider.matches(":active")) this.slider.value = Math.max(place, 0);
    this.hertz.textContent = this.slider.ariaValueText = now.value ? `${+now.value.toPrecision(3)} Hz` : "varying";
    this.remedy.hidden = !softer.length || !softer.every(({ key }) => of.has(key)); // the hold model counts with these gains
    this.remedy.ariaPressed = this.soft = !this.remedy.hidden && softer.every(({ key, value }) => of.get(key)?.value === value);
    this.others = alone && JSON.stringify(controls.map(({ key, value }) => (softer.some((each) => each.key === key) ? null : value)));
    const settings = JSON.stringify([...of].map(([key, { value }]) => [key, value]));
    if (settings !== this.settings) this.changed = this.swings.t;
    this.settings = settings;
    this.why.textContent = why(now, controls.some(({ value }) => value === "ahead"));
  }

  // A frame of the run that is shown, at its time (s), and whether that has ended.
  add(t, { handle, pulled }, ended, dimension) {
    if (!this.offered) return;
    if (!(t >= this.swings.t)) [this.changed, this.pulled] = [-Infinity, false]; // a run begins, with what was set before
    if (pulled && !this.pulled) this.pressed = t;
    this.pulled = pulled;
    this.swings.add(t, handle, dimension);
    const { vibration, trace } = this.swings, settled = t - this.changed >= 1, watched = this.swings.watched && settled && t - this.pressed >= 1;
    const does = DIVERGED.test(ended) ? "diverged" : vibration && "vibrated";
    if (does && pulled && settled && this.others && this.did.get(this.others) !== "") this.did.set(this.others, this.soft ? "" : does);
    const [words, light] = felt(vibration, pulled, watched, ended, this.soft && this.did.get(this.others));
    if (words !== this.felt.textContent) this.felt.textContent = words;
    this.light.className = `light ${light}`;
    this.trace = vibration ? trace : [];
  }
}

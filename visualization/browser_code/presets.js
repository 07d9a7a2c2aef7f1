// Settings of a scene that show something, each with what it changes; and all settings as at the start.
import { changes, set } from "./settings.js";

// Hz: all hands are stable with the first in closed-loop-direct, and with the second the mouse's hand sees it vibrate.
const CALM_RATE = 64, BUZZ_RATE = 11;
// Factors on the coupling, the same damping ratio but for rounding, with which all hands are stable at BUZZ_RATE.
const SOFTER = { K_pc: 0.1, B_pc: 0.3 };
// Factors on a virtual coupling: a sampled spring generates energy that no damping takes out, on any mechanism.
const BUZZ = { K_pc: 10, B_pc: 0 };

// The messages that set all controls as they were at the `start`.
export const restored = (controls, start) => changes(start, controls).map(({ key, value }) => set(key, value));

// The messages that scale gains by factors, by the names of their parameters.
const scaled = (gains, factors) => gains.map(({ key }) => set(key, factors[key.split(".").at(-1)])).filter(({ value }) => value !== undefined);

// Name, what it changes, and the messages of each preset, to be sent after those of `restored`.
export function presets(controls) {
  const rate = controls.find(({ key }) => key === "graphics.rate"), gains = controls.filter(({ key }) => key.startsWith("gains."));
  const slow = controls.some(({ key }) => /\.[xv] -> /.test(key)); // the mechanism itself runs at the graphics rate
  if (rate && slow) {
    const softer = scaled(gains, SOFTER);
    const [slowly, fast] = [BUZZ_RATE, CALM_RATE].map((hertz) => set(rate.key, Math.min(hertz, rate.max)));
    const mended = `the same, but a softer coupling: stiffness times ${SOFTER.K_pc}, damping times ${SOFTER.B_pc}`;
    return [
      { name: "Calm", about: `mechanism at ${fast.value} Hz`, messages: [fast] },
      { name: "Buzz", about: `mechanism at ${slowly.value} Hz: pull`, messages: [slowly] },
      ...(softer.length ? [{ name: "Mend it", about: mended, messages: [slowly, ...softer] }] : []),
    ];
  }
  const undamped = scaled(gains, BUZZ);
  if (!undamped.length) return [];
  return [
    { name: "As given", about: "everything as the scene has it", messages: [] },
    { name: "Buzz", about: `virtual coupling ${BUZZ.K_pc} times as stiff, without damping: pull, and most mechanisms vibrate`, messages: undamped },
  ];
}

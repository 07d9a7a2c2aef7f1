// Settings of a scene that show something, each with what it changes; and all settings as at the start.
import { changes, set } from "./settings.js";

// Hz, and the factor of the coupling's damping with which extrapolated motion grows by half the rate in the mouse's hand.
const CALM_RATE = 64, BUZZ_RATE = 16, MORE = 1.1;
// Factors on a virtual coupling: a sampled spring generates energy that no damping takes out, on any mechanism.
const BUZZ = { K_pc: 10, B_pc: 0 };

// The messages that set all controls as they were at the `start`.
export const restored = (controls, start) => changes(start, controls).map(({ key, value }) => set(key, value));

// Name, what it changes, and the messages of each preset, to be sent after those of `restored`.
export function presets(controls) {
  const rate = controls.find(({ key }) => key === "graphics.rate"), gains = controls.filter(({ key }) => key.startsWith("gains."));
  const passive = controls.filter(({ choices }) => choices?.includes("passive"));
  const poses = controls.filter(({ key, choices }) => /\.[xv] -> /.test(key) && choices?.includes("foh"));
  const all = (some, value) => some.map(({ key }) => set(key, value));
  if (rate && poses.length) {
    const more = all(gains.filter(({ key }) => key.endsWith(".B_pc")), MORE);
    const [slow, fast] = [BUZZ_RATE, CALM_RATE].map((hertz) => set(rate.key, Math.min(hertz, rate.max)));
    // A page in one file has no passive hold of the forces; zero-order holds shake less than first-order ones.
    const [mended, mending] = passive.length
      ? ["the forces on the mechanism in a passive hold", all(passive, "passive")]
      : ["pose and velocity held (zoh)", all(poses, "zoh")];
    return [
      { name: "Calm", about: `mechanism at ${fast.value} Hz`, messages: [fast] },
      { name: "Buzz", about: `mechanism at ${slow.value} Hz, its pose and velocity extrapolated (foh), coupling damping times ${MORE}: pull`, messages: [slow, ...more, ...all(poses, "foh")] },
      { name: "Mend it", about: `the same, but ${mended}`, messages: [slow, ...more, ...mending] },
    ];
  }
  const undamped = gains.map(({ key }) => set(key, BUZZ[key.split(".").at(-1)])).filter(({ value }) => value !== undefined);
  if (!undamped.length) return [];
  return [
    { name: "As given", about: "everything as the scene has it", messages: [] },
    { name: "Buzz", about: `virtual coupling ${BUZZ.K_pc} times as stiff, without damping: pull, and most mechanisms vibrate`, messages: undamped },
  ];
}

// Settings of a scene that show something, each with what it changes; and all settings as at the start.
import { changes } from "./changes.js";

// Hz, and the factor of the coupling's damping with which extrapolated motion grows by half the rate in the mouse's hand.
const CALM_RATE = 64, BUZZ_RATE = 16, MORE = 1.1;
// Factors on a virtual coupling: a sampled spring generates energy that no damping takes out, on any mechanism.
const BUZZ = { K_pc: 10, B_pc: 0 };

// The messages that set all controls as they were at the `start`.
export const restored = (controls, start) => changes(start, controls).map(({ message }) => message);

// Name, what it changes, and the messages of each preset, to be sent after those of `restored`.
export function presets({ rate, holds, gains }) {
  const passive = holds.filter(({ choices }) => choices.includes("passive"));
  const poses = holds.filter(({ connection, choices }) => /\.[xv] -> /.test(connection) && choices.includes("foh"));
  const held = (some, hold) => some.map(({ connection }) => ({ type: "hold", connection, hold }));
  if (rate && poses.length) {
    const more = gains.filter(({ name }) => name.endsWith(".B_pc")).map(({ name }) => ({ type: "gain", name, factor: MORE }));
    const slow = { type: "rate", value: Math.min(BUZZ_RATE, rate.max) }, fast = { type: "rate", value: Math.min(CALM_RATE, rate.max) };
    // A page in one file has no passive hold of the forces; zero-order holds shake less than first-order ones.
    const [mended, mending] = passive.length
      ? ["the forces on the mechanism in a passive hold", held(passive, "passive")]
      : ["pose and velocity held (zoh)", held(poses, "zoh")];
    return [
      { name: "Calm", about: `mechanism at ${fast.value} Hz`, messages: [fast] },
      { name: "Buzz", about: `mechanism at ${slow.value} Hz, its pose and velocity extrapolated (foh), coupling damping times ${MORE}: pull`, messages: [slow, ...more, ...held(poses, "foh")] },
      { name: "Mend it", about: `the same, but ${mended}`, messages: [slow, ...more, ...mending] },
    ];
  }
  const coupling = gains.map(({ name }) => ({ type: "gain", name, factor: BUZZ[name.split(".").at(-1)] }));
  const undamped = coupling.filter(({ factor }) => factor !== undefined);
  if (!undamped.length) return [];
  return [
    { name: "As given", about: "everything as the scene has it", messages: [] },
    { name: "Buzz", about: `virtual coupling ${BUZZ.K_pc} times as stiff, without damping: pull, and most mechanisms vibrate`, messages: undamped },
  ];
}

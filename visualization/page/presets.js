// Settings of a scene that show something, each with what it changes; and all settings as at the start.
import { changes } from "./changes.js";

const BUZZ_RATE = 18, STIFF = 5; // Hz, and the factor of the coupling's damping

// The messages that set all controls as they were at the `start`.
export const restored = (controls, start) => changes(start, controls).map(({ message }) => message);

// Name, what it changes, and the messages of each preset, to be sent after those of `restored`.
export function presets({ rate, holds, gains }) {
  const calm = { name: "Calm", about: "everything as the scene has it", messages: [] };
  const passive = holds.filter(({ choices }) => choices.includes("passive"));
  const poses = holds.filter(({ connection, choices }) => /\.[xv] -> /.test(connection) && choices.includes("foh"));
  const damping = gains.filter(({ name }) => name.endsWith(".B_pc"));
  const held = (some, hold) => some.map(({ connection }) => ({ type: "hold", connection, hold }));
  if (rate && passive.length) {
    const slow = { type: "rate", value: Math.min(BUZZ_RATE, rate.max) };
    return [
      calm,
      { name: "Buzz", about: `mechanism at ${slow.value} Hz, its pose and velocity extrapolated (foh)`, messages: [slow, ...held(poses, "foh")] },
      { name: "Mend it", about: `still ${slow.value} Hz, but the forces on the mechanism in a passive hold`, messages: [slow, ...held(passive, "passive")] },
    ];
  }
  if (!damping.length) return [];
  const stiffer = damping.map(({ name }) => ({ type: "gain", name, factor: STIFF }));
  return [calm, { name: "Buzz", about: `coupling damping times ${STIFF}: more than its rate allows`, messages: stiffer }];
}

// Settings of a scene that show something, each with what it changes; and all settings as at the start.
import { changes, set } from "./settings.js";

// Factors on a virtual coupling: a sampled spring generates energy that no damping takes out, on any mechanism.
const BUZZ = { K_pc: 10, B_pc: 0 };

// The messages that set all controls as they were at the `start`.
export const restored = (controls, start) => changes(start, controls).map(({ key, value }) => set(key, value));

// The messages that scale gains by factors, by the names of their parameters.
export const scaled = (controls, factors) => controls.filter(({ key }) => key.startsWith("gains."))
  .map(({ key }) => set(key, factors[key.split(".").at(-1)])).filter(({ value }) => value !== undefined);

// Name, what it changes, and the messages of each preset, to be sent after those of `restored`.
export function presets(controls) {
  const undamped = scaled(controls, BUZZ);
  if (!undamped.length) return [];
  return [
    { name: "As given", about: "everything as the scene has it", messages: [] },
    { name: "Buzz", about: `virtual coupling ${BUZZ.K_pc} times as stiff, without damping: pull, and most mechanisms vibrate`, messages: undamped },
  ];
}

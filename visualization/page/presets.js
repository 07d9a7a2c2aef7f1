// Settings of a scene that show something, each with what it changes; and all settings as at the start.
const BUZZ_RATE = 20, STIFF = 5; // Hz, and the factor of the coupling's damping

// The messages that set all controls as they were at the `start`.
export function restored(controls, start) {
  const messages = [];
  if (start.rate?.value && controls.rate.value !== start.rate.value) messages.push({ type: "rate", value: start.rate.value });
  if (start.rate && controls.rate.jitter !== start.rate.jitter) messages.push({ type: "jitter", value: start.rate.jitter });
  if (start.topology !== controls.topology) messages.push({ type: "topology", on: start.topology });
  start.holds.forEach(({ connection, hold, delay }, i) => {
    if (controls.holds[i].hold !== hold) messages.push({ type: "hold", connection, hold });
    if (controls.holds[i].delay !== delay) messages.push({ type: "delay", connection, value: delay });
  });
  start.gains.forEach(({ name, factor }, i) => {
    if (controls.gains[i].factor !== factor) messages.push({ type: "gain", name, factor });
  });
  return messages;
}

// Name, what it changes, and the messages of each preset, to be sent after those of `restored`.
export function presets({ rate, holds, gains }) {
  const calm = { name: "Calm", about: "everything as the scene has it", messages: [] };
  const passive = holds.filter(({ choices }) => choices.includes("passive"));
  const poses = holds.filter((hold) => !passive.includes(hold) && hold.choices.includes("foh"));
  const damping = gains.filter(({ name }) => name.endsWith(".B_pc"));
  const held = (some, hold) => some.map(({ connection }) => ({ type: "hold", connection, hold }));
  if (rate && passive.length) {
    const slow = { type: "rate", value: Math.min(BUZZ_RATE, rate.max) };
    return [
      calm,
      { name: "Buzz", about: `mechanism at ${slow.value} Hz, and what it sends extrapolated (foh)`, messages: [slow, ...held(poses, "foh")] },
      { name: "Mend it", about: `still ${slow.value} Hz, but the forces on the mechanism in a passive hold`, messages: [slow, ...held(passive, "passive")] },
    ];
  }
  if (!damping.length) return [];
  const stiffer = damping.map(({ name }) => ({ type: "gain", name, factor: STIFF }));
  return [calm, { name: "Buzz", about: `coupling damping times ${STIFF}: more than its rate allows`, messages: stiffer }];
}

// What is heard of a frame: the force of the hand (N), or the tracking error (mm).
export const loudness = (signal, { F_hand, x, handle }) =>
  signal === "force" ? Math.hypot(F_hand[0], F_hand[1]) : 1e3 * Math.hypot(x[0] - handle[0], x[1] - handle[1]);

// What is heard of a frame: the force of the hand (N), or the tracking error (mm).
import { apart, length } from "./view.js";

export const loudness = (signal, { F_hand, x, handle }, dimension) =>
  signal === "force" ? length(F_hand, dimension) : 1e3 * apart(x, handle, dimension);

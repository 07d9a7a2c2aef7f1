// How a picture is seen: by parallel projection, as in visualization/mechanism/view.py. The plane is seen along z; a linkage
// in space can be turned about the vertical and tilted.
const STEEPEST = Math.PI / 2; // rad
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + (a[2] ?? 0) * (b[2] ?? 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const sum = (a, v, b, w) => v.map((x, i) => a * x + b * w[i]);

export class View {
  constructor(given) {
    Object.assign(this, given);
    this.turn(0, 0);
  }

  get inSpace() { return this.dimension > 2; }

  // Turns by angles (rad) about the vertical and to look down more.
  turn(about, down) {
    this.turned += about;
    this.above = Math.min(Math.max(this.above + down, -STEEPEST), STEEPEST);
    const deep = cross(this.up, this.aside);
    const away = sum(Math.cos(this.turned), deep, -Math.sin(this.turned), this.aside);
    const right = sum(Math.cos(this.turned), this.aside, Math.sin(this.turned), deep);
    const upward = sum(Math.cos(this.above), this.up, Math.sin(this.above), away);
    this.rows = [right, upward, cross(right, upward)];
  }

  // To the right, up on the page, and towards the eye (m).
  project(vector) { return this.rows.map((row) => dot(row, vector)); }

  // The vector of these parts, of as many numbers as the world has directions.
  back(parts) {
    const [right, upward, near] = this.rows;
    return right.map((_, i) => parts[0] * right[i] + parts[1] * upward[i] + (parts[2] ?? 0) * near[i]).slice(0, this.dimension);
  }
}

// The length of what a vector has along directions; in the plane its third number is about an axis.
export const length = (vector, dimension) => Math.hypot(...vector.slice(0, dimension));
export const apart = (a, b, dimension) => length(a.map((v, i) => v - b[i]), dimension);

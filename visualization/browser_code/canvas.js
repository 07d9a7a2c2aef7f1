// A canvas that is as sharp as the screen: its context in CSS pixels, and its size.
export function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

// Magnitudes that nobody feels: charts do not magnify less, and numbers below a fiftieth of it show 0.
export const FELT = { mm: 1, N: 0.5, mJ: 1, m: 1e-9, count: 2 };

// A number with its unit, in three digits; a count, without a unit, as it is.
export function text(value, unit) {
  const size = Math.abs(value) < (FELT[unit] ?? 0) / 50 ? 0 : Math.abs(value);
  if (unit === "count" || !size) return unit === "count" ? String(value) : `0 ${unit}`;
  if (unit === "1") return value.toFixed(2);
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : 2;
  const [small, large] = [size < 0.01, size >= 1e4];
  return `${small || large ? value.toExponential(large ? 1 : 0) : value.toFixed(digits)} ${unit}`;
}

// A colour of the page, which differs in the dark.
export const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`);

export const SECOND = "#dd6600"; // of the second of two runs in one picture
export const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4]; // real-time factors that pages offer

// Colours of marks and curves in the dark: greys change places, hues are lighter.
const DARK = {
  "#000000": "#f0f2f6", "#333333": "#c4c8d2", "#666666": "#9aa0ac", "#8c8c8c": "#8a909c", "#bfbfbf": "#596070", "#d9d9d9": "#3b4150",
  "#ffffff": "#1d2129", "#4477aa": "#7aa7d9", "#b85c00": "#f0964a", "#228833": "#5cc46e", "#aa3377": "#e07ab5", "#cc3311": "#ff7a5c",
  "#8250c8": "#b794f4", "#75751f": "#c3c35a", "#882255": "#d987ab", "#1f7d70": "#4fc4b2",
};
const dark = globalThis.matchMedia?.("(prefers-color-scheme: dark)");
export const inTheme = (color) => (dark?.matches && color && color.slice(0, 7) in DARK ? DARK[color.slice(0, 7)] + color.slice(7) : color);

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

// Magnitudes below which a value is rounding error: charts do not magnify it, numbers show 0.
export const ROUNDING = { mm: 1e-6, N: 1e-6, m: 1e-15, mJ: 1e-6 };

// A number with its unit, in three digits; a count, without a unit, as it is.
export function text(value, unit) {
  const size = Math.abs(value) < (ROUNDING[unit] ?? 0) ? 0 : Math.abs(value);
  if (unit === "count" || !size) return unit === "count" ? String(value) : `0 ${unit}`;
  if (unit === "1") return value.toFixed(2);
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : 2;
  return `${size && size < 0.01 ? value.toExponential(0) : value.toFixed(digits)} ${unit}`;
}

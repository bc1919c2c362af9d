// Numbers for display: ranges in words, slider positions, radiance as screen colours.

// For sliders and drags: four digits.
export const rounded = (value) => Number(value.toPrecision(4));
// Short enough for a small input; integers stay integers.
export function shown(value) {
  if (!Number.isFinite(value)) return "";
  return String(Number.isInteger(value) ? value : Number(value.toPrecision(5)));
}

export function rangeInWords({ min, max, open_min, open_max }) {
  const words = (value) => shown(value).replace("-", "−");
  const low = Number.isFinite(min) ? `${open_min ? "above" : "from"} ${words(min)}` : "";
  const high = Number.isFinite(max) ? `${open_max ? "below" : low ? "to" : "up to"} ${words(max)}` : "";
  return [low, high].filter(Boolean).join(low && open_max ? " and " : " ");
}

// Maps a number to a slider position from 0 to 1, and back. Linear between near bounds, otherwise logarithmic around
// the current value, including 0 where allowed. Null where neither makes sense.
export function scaleOf({ min, max, open_min, open_max }, value) {
  const [hasMin, hasMax] = [Number.isFinite(min), Number.isFinite(max)];
  if (hasMin && hasMax && max > min && !(min > 0 && max / min > 1000) && max - min <= 1000) {
    const edge = 1e-3 * (max - min);
    const [low, high] = [open_min ? min + edge : min, open_max ? max - edge : max];
    return {
      holds: () => true,
      place: (v) => (v - min) / (max - min),
      value: (place) => Math.min(high, Math.max(low, min + place * (max - min))),
    };
  }
  if (!hasMin || min < 0) return null;
  const middle = Math.max(Math.abs(value) || 1, min);
  const low = Math.max(middle / 100, min);
  const high = Math.min(100 * middle, hasMax ? max : Infinity);
  if (!(high > low)) return null;
  const stops = Math.log(high / low);
  const bottom = min === 0 && !open_min ? 0 : low;
  return {
    holds: (v) => (v >= low && v <= high) || v === bottom,
    place: (v) => v <= low ? 0 : Math.log(v / low) / stops,
    value: (place) => place <= 0.001 ? bottom : low * Math.exp(place * stops),
  };
}

// A number dragged by some pixels.
export function scrubbed(field, from, pixels) {
  const { min, max, open_min, open_max } = field;
  const [hasMin, hasMax] = [Number.isFinite(min), Number.isFinite(max)];
  let to;
  if (hasMin && hasMax && max - min <= 1000) to = from + pixels * (max - min) / 300;
  else if (hasMin && min >= 0 && from > 0) to = from * Math.exp(pixels / 100);
  else to = from + pixels * Math.max(0.01, 0.005 * Math.abs(from));
  const edge = hasMin && hasMax ? 1e-3 * (max - min) : 1e-3;
  if (hasMax) to = Math.min(to, open_max ? max - edge : max);
  if (hasMin) to = Math.max(to, open_min ? min + Math.min(edge, 0.5 * Math.max(from - min, 1e-6)) : min);
  return to;
}

// Step of the arrow keys.
export function stepOf({ min, max }, value) {
  if (Number.isFinite(min) && Number.isFinite(max) && max - min <= 1000) return (max - min) / 100;
  return value === 0 ? 0.1 : 10 ** (Math.floor(Math.log10(Math.abs(value))) - 1);
}

const encoded = (v) => v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055;
const decoded = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;

// Linear values as #rrggbb, with the brightest at 1.
export function colourOf(values, scale) {
  const byte = (v) => Math.round(255 * encoded(Math.min(1, Math.max(0, v / scale))));
  return `#${values.map((v) => byte(v).toString(16).padStart(2, "0")).join("")}`;
}

export function valuesOf(colour, scale) {
  return [1, 3, 5].map((at) => rounded(scale * decoded(parseInt(colour.slice(at, at + 2), 16) / 255)));
}

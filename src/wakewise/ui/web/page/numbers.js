// Numbers as they come over the wire: anything may be missing, and nothing of it may break the page.

export const UNKNOWN = "–";

/** The number, or null of anything that is not a finite one. */
export function finite(value) {
  return typeof value === "number" && Number.isFinite(value) ? value : null;
}

/** "12.3 m/s"; a dash where the value is not known. A real minus sign keeps columns straight. */
export function shown(value, digits, unit) {
  const number = finite(value);
  if (number === null) return UNKNOWN;
  const text = number.toFixed(digits).replace("-", "−");
  const zero = Number(number.toFixed(digits)) === 0 ? text.replace("−", "") : text;
  return unit ? `${zero}\u202f${unit}` : zero;
}

/** Three or so significant figures, without powers of ten. */
export function brief(value, unit) {
  const number = finite(value);
  if (number === null) return UNKNOWN;
  const size = Math.abs(number);
  if (size >= 1e4) return shown(number / 1e3, size >= 1e5 ? 0 : 1, `k${unit ? `\u202f${unit}` : ""}`).replace("\u202fk", "k");
  return shown(number, size >= 100 ? 0 : size >= 10 ? 1 : 2, unit);
}

/** An array of numbers or nulls; of anything else an empty one. */
export function numbers(value) {
  return Array.isArray(value) ? value.map(finite) : [];
}

/** A point of three numbers, or null. */
export function point(value) {
  const p = numbers(value);
  return p.length === 3 && p.every((v) => v !== null) ? p : null;
}

/** Length of a vector whose unknown parts make it unknown. */
export function length(value) {
  const p = point(value);
  return p === null ? null : Math.hypot(...p);
}

export function clip(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

/** Minutes and seconds of a flight, "4:07". */
export function clock(time_s) {
  const t = finite(time_s);
  if (t === null) return UNKNOWN;
  const whole = Math.max(0, Math.floor(t));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

/** Text of at most so many characters, of whatever came. */
export function words(value, most = 200) {
  return typeof value === "string" ? value.slice(0, most) : "";
}

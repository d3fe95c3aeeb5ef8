// One animation frame for everything that draws. Nothing but drawing waits for it: a page in the background does not
// draw, and the sticks must not care.

const waiting = new Set();
let asked = false;

/** Draw `paint` with the next frame, once however often it is asked. */
export function soon(paint) {
  waiting.add(paint);
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    const now = [...waiting];
    waiting.clear();
    for (const one of now) {
      try {
        one();
      } catch (error) {
        console.warn("could not draw", error);
      }
    }
  });
}

/** A canvas' context in CSS pixels, its store at the screen's resolution; null while it has no size. */
export function fit(canvas) {
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (!width || !height) return null;
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const w = Math.round(width * ratio), h = Math.round(height * ratio);
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

const inks = new Map();

/** A colour of the style sheet by its variable. */
export function ink(name) {
  if (!inks.has(name)) inks.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return inks.get(name);
}

/** After the theme changed. */
export function forgetInks() {
  inks.clear();
}

export const FONT = '12px system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif';

/** "rgb(…)" between stops [[share, [r, g, b]], …], at a share from 0 to 1. */
export function blend(stops, share) {
  const s = Math.min(Math.max(share, 0), 1);
  for (let i = 1; i < stops.length; i++) {
    const [a, from] = stops[i - 1], [b, to] = stops[i];
    if (s <= b) {
      const t = (s - a) / (b - a);
      return `rgb(${from.map((v, k) => Math.round(v + t * (to[k] - v))).join(" ")})`;
    }
  }
  return `rgb(${stops[stops.length - 1][1].join(" ")})`;
}

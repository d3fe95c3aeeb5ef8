// The last minutes as two lines: the water's speed at the target as flown, and with gentler thrusts.

import { FONT, fit, ink, soon } from "./draw.js";
import { finite, numbers } from "./numbers.js";

const KEPT_S = 600, LEAST_S = 120;
const LEFT = 36, RIGHT = 6, TOP = 10, BOTTOM = 18;

export class Past {
  #canvas;
  #words;
  #rows = []; // [second, flown, gentle]

  constructor(canvas, words) {
    this.#canvas = canvas;
    this.#words = words;
    new ResizeObserver(() => this.repaint()).observe(canvas);
  }

  /** Highest speed that is shown. */
  get most() {
    return this.#rows.reduce((most, [, flown, gentle]) => Math.max(most, flown ?? 0, gentle ?? 0), 0);
  }

  /** All that the server keeps; replaces what was there. */
  fill(told) {
    const flown = numbers(told.flown_mm_s), gentle = numbers(told.gentle_mm_s), until = finite(told.until_s) ?? 0;
    this.#rows = flown.map((value, i) => [until - flown.length + i, value, gentle[i] ?? null]);
    this.repaint();
  }

  /** One more second; the same one again, or none, changes nothing. */
  add(second, values) {
    const at = finite(second), [flown, gentle] = numbers(values);
    const last = this.#rows.length ? this.#rows[this.#rows.length - 1][0] : -Infinity;
    if (at === null || at === last) return;
    if (at < last) this.#rows = [];
    this.#rows.push([at, flown ?? null, gentle ?? null]);
    while (this.#rows[0][0] <= at - KEPT_S) this.#rows.shift();
    this.repaint();
  }

  repaint() {
    soon(this.#paint);
  }

  #paint = () => {
    const on = fit(this.#canvas);
    if (!on) return;
    const { context, width, height } = on;
    const end = this.#rows.length ? this.#rows[this.#rows.length - 1][0] : 0;
    const begin = this.#rows.length ? this.#rows[0][0] : 0;
    const span = [LEAST_S, 300, KEPT_S].find((s) => end - begin < s) ?? KEPT_S;
    this.#words.textContent = { 120: "two minutes", 300: "five minutes", 600: "ten minutes" }[span];
    const top = ceiling(Math.max(this.most, 1));
    const x = (t) => LEFT + (1 + (t - end) / span) * (width - LEFT - RIGHT);
    const y = (v) => height - BOTTOM - (v / top) * (height - TOP - BOTTOM);
    context.font = FONT;
    context.lineWidth = 1;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const tick of [0, top / 2, top]) {
      context.strokeStyle = ink("--line");
      context.beginPath();
      context.moveTo(LEFT, Math.round(y(tick)) + 0.5);
      context.lineTo(width - RIGHT, Math.round(y(tick)) + 0.5);
      context.stroke();
      context.fillStyle = ink("--muted");
      context.fillText(String(tick), LEFT - 5, y(tick));
    }
    context.textBaseline = "alphabetic";
    context.textAlign = "left";
    context.fillText(`mm/s   ${span / 60} min ago`, LEFT, height - 4);
    context.textAlign = "right";
    context.fillText("now", width - RIGHT, height - 4);
    if (!this.#rows.length) return;
    this.#line(context, x, y, 1, "--s2", []);
    this.#line(context, x, y, 2, "--s1", [5, 4]);
  };

  #line(context, x, y, column, colour, dashes) {
    context.strokeStyle = ink(colour);
    context.lineWidth = 2;
    context.lineJoin = "round";
    context.setLineDash(dashes);
    context.beginPath();
    let open = false;
    for (const row of this.#rows) {
      const value = row[column];
      if (value === null) open = false;
      else if (open) context.lineTo(x(row[0]), y(value));
      else {
        context.moveTo(x(row[0]), y(value));
        open = true;
      }
    }
    context.stroke();
    context.setLineDash([]);
  }
}

/** The next of 1, 2, 5, 10, 20, … */
function ceiling(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].find((k) => value <= k * power) * power;
}

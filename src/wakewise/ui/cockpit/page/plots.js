// Lines over the last minute of the flight.

import { FONT, fit, ink, soon } from "./draw.js";
import { clip, finite } from "./numbers.js";

const SPAN_S = 60;
const LEFT = 34, BOTTOM = 17, TOP = 15, RIGHT = 6;

export class Plot {
  #canvas;
  #lines;
  #rows = [];
  #axis;

  /** `lines`: [{ ink, dashed }]; `axis`: { unit, least, most } of its end, and `decades` for a scale by powers of ten. */
  constructor(canvas, lines, axis) {
    this.#canvas = canvas;
    this.#lines = lines;
    this.#axis = axis;
    new ResizeObserver(() => this.repaint()).observe(canvas);
  }

  /** Values at a time of the flight; a time that runs backwards begins anew. */
  add(time_s, values) {
    const t = finite(time_s);
    if (t === null) return;
    const last = this.#rows[this.#rows.length - 1];
    if (last && t < last[0]) this.#rows = [];
    if (last && t === last[0]) return;
    this.#rows.push([t, ...values.map(finite)]);
    while (this.#rows.length && this.#rows[0][0] < t - SPAN_S) this.#rows.shift();
    // Whatever the clock does, a page left open for a day does not grow.
    if (this.#rows.length > 2000) this.#rows.splice(0, this.#rows.length - 2000);
    this.repaint();
  }

  repaint() {
    soon(this.#paint);
  }

  /** Ticks from the bottom up, and the share of the height at which a value lies. */
  #scale() {
    const { least, most = Infinity, decades } = this.#axis;
    const highest = Math.max(least, ...this.#rows.flatMap((row) => row.slice(1).filter((v) => v !== null)));
    if (!decades) {
      const top = Math.min(ceiling(highest), most);
      return { ticks: [0, top / 2, top], share: (v) => clip(v / top, 0, 1) };
    }
    const top = Math.ceil(Math.log10(highest)), bottom = top - decades;
    const ticks = Array.from({ length: decades + 1 }, (_, k) => 10 ** (bottom + k));
    return { ticks, share: (v) => (v > 0 ? clip((Math.log10(v) - bottom) / decades, 0, 1) : 0) };
  }

  #paint = () => {
    const on = fit(this.#canvas);
    if (!on) return;
    const { context, width, height } = on;
    const { ticks, share } = this.#scale();
    const end = this.#rows.length ? this.#rows[this.#rows.length - 1][0] : 0;
    const x = (t) => LEFT + (1 + (t - end) / SPAN_S) * (width - LEFT - RIGHT);
    const y = (v) => height - BOTTOM - share(v) * (height - BOTTOM - TOP);
    context.font = FONT;
    context.strokeStyle = ink("--line");
    context.fillStyle = ink("--muted");
    context.lineWidth = 1;
    context.textBaseline = "middle";
    context.textAlign = "right";
    for (const v of ticks) {
      context.beginPath();
      context.moveTo(LEFT, Math.round(y(v)) + 0.5);
      context.lineTo(width - RIGHT, Math.round(y(v)) + 0.5);
      context.stroke();
      context.fillText(short(v), LEFT - 5, y(v));
    }
    context.textBaseline = "alphabetic";
    context.textAlign = "left";
    context.fillText(this.#axis.unit, LEFT + 3, TOP - 4);
    for (const [t, align] of [[-60, "left"], [-30, "center"], [0, "right"]]) {
      context.textAlign = align;
      context.fillText(t ? `−${-t} s` : "now", x(end + t), height - 3);
    }
    context.lineJoin = "round";
    // The first line lies on top.
    for (let k = this.#lines.length - 1; k >= 0; k--) {
      context.strokeStyle = ink(this.#lines[k].ink);
      context.lineWidth = this.#lines[k].dashed ? 1.4 : 2;
      context.setLineDash(this.#lines[k].dashed ? [4, 3] : []);
      context.beginPath();
      let pen = false;
      for (const row of this.#rows) {
        const v = row[k + 1];
        if (v === null) pen = false;
        else if (pen) context.lineTo(x(row[0]), y(v));
        else {
          context.moveTo(x(row[0]), y(v));
          pen = true;
        }
      }
      context.stroke();
    }
    context.setLineDash([]);
  };
}

/** The next 1, 2 or 5 times a power of ten. */
function ceiling(value) {
  if (!(value > 0) || !Number.isFinite(value)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [1, 2, 5, 10].find((step) => step * power >= value * 0.999);
}

/** 10k for ten thousand: an axis has little room. */
function short(value) {
  for (const [size, sign] of [[1e9, "G"], [1e6, "M"], [1e3, "k"]]) if (value >= size) return `${Number((value / size).toPrecision(3))}${sign}`;
  return String(Number(value.toPrecision(3)));
}

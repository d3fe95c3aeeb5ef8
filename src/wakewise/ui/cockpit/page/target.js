// The target as seen from the vehicle, a dot per point, coloured by the speed of the wash there.

import { FONT, blend, fit, ink, soon } from "./draw.js";
import { numbers, point } from "./numbers.js";

/** Fixed, so that a colour means the same in every flight; a logarithm from 1 mm/s on, for gentle and rough alike. */
const MOST_MM_S = 100;
const SPEED = [[0, [108, 146, 160]], [0.3, [226, 190, 104]], [0.6, [224, 116, 60]], [1, [178, 34, 62]]];
const APART = [[0, [38, 120, 178]], [0.5, [158, 168, 172]], [1, [203, 82, 40]]];
const TICKS_MM_S = [0, 1, 3, 10, 30, 100];
const ACROSS_MM_S = [-10, 0, 10];
const MARGIN = 0.86;

/** Where a speed lies on the scale, 0 to 1. */
function share(mm_s) {
  return Math.log1p(Math.max(mm_s, 0)) / Math.log1p(MOST_MM_S);
}

export class Target {
  #canvas;
  #scale;
  #points = [];
  #centre = [0, 0, 0];
  #radius = 0.2;
  #predicted = [];
  #truth = null;
  #eye = null;
  #turn = [0, 0];
  show = "predicted";

  constructor(canvas, scale) {
    this.#canvas = canvas;
    this.#scale = scale;
    this.#drag();
    new ResizeObserver(() => this.repaint()).observe(canvas);
  }

  /** The target of a `welcome`. */
  place(target) {
    this.#points = (Array.isArray(target?.points_W_m) ? target.points_W_m : []).map(point);
    const known = this.#points.filter((p) => p);
    const mean = known.length ? [0, 1, 2].map((k) => known.reduce((sum, p) => sum + p[k], 0) / known.length) : [0, 0, 0];
    this.#centre = point(target?.centre_W_m) ?? mean;
    const far = Math.max(0.02, ...known.map((p) => Math.hypot(...p.map((v, k) => v - this.#centre[k]))));
    this.#radius = typeof target?.radius_m === "number" && target.radius_m > 0 && target.radius_m < 100 ? Math.max(target.radius_m, 0.5 * far) : far;
    this.repaint();
  }

  /** Where the vehicle is and what its wash does; what is missing stays as it was. */
  update(state) {
    this.#eye = point(state.position_W_m) ?? this.#eye;
    if (Array.isArray(state.predicted_m_s)) this.#predicted = numbers(state.predicted_m_s);
    if ("true_m_s" in state) this.#truth = Array.isArray(state.true_m_s) ? numbers(state.true_m_s) : null;
    this.repaint();
  }

  get hasTruth() {
    return this.#truth !== null;
  }

  get worst_m_s() {
    const values = this.#values().filter((v) => v !== null);
    return values.length ? values.reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a), 0) : null;
  }

  repaint() {
    soon(this.#paint);
  }

  #values() {
    if (this.show === "predicted" || !this.#truth) return this.#predicted;
    if (this.show === "true") return this.#truth;
    return this.#predicted.map((v, k) => (v === null || this.#truth[k] == null ? null : v - this.#truth[k]));
  }

  #colour(value) {
    if (value == null) return ink("--line");
    if (this.show === "difference") return blend(APART, 0.5 + 0.5 * (1e3 * value) / ACROSS_MM_S[2]);
    return blend(SPEED, share(1e3 * value));
  }

  #paint = () => {
    this.#paintScale();
    const on = fit(this.#canvas);
    if (!on) return;
    const { context, width, height } = on;
    const seen = this.#projected();
    const half = 0.5 * Math.min(width, height) * MARGIN;
    const values = this.#values();
    const dot = Math.max(2.2, Math.min(7, (1.5 * half) / Math.sqrt(Math.max(seen.length, 1))));
    for (const { k, x, y, z } of seen) {
      context.beginPath();
      context.fillStyle = this.#colour(values[k]);
      // What lies behind is smaller and paler.
      context.globalAlpha = 0.35 + 0.65 * (0.5 - 0.5 * z);
      context.arc(width / 2 + half * x, height / 2 + half * y, dot * (1 - 0.22 * z), 0, 2 * Math.PI);
      context.fill();
    }
    context.globalAlpha = 1;
    if (!seen.length) {
      context.font = FONT;
      context.fillStyle = ink("--muted");
      context.textAlign = "center";
      context.fillText("no target known", width / 2, height / 2);
    }
  };

  /** Points across, down and away from the eye, in radii of the target, farthest first. */
  #projected() {
    const eye = this.#eye ?? [this.#centre[0] - 1, this.#centre[1], this.#centre[2]];
    const ahead = this.#centre.map((v, k) => v - eye[k]);
    const bearing = Math.atan2(ahead[1], ahead[0]) + this.#turn[0];
    const dip = Math.max(-1.5, Math.min(1.5, Math.atan2(ahead[2], Math.hypot(ahead[0], ahead[1])) + this.#turn[1]));
    const [cb, sb, cd, sd] = [Math.cos(bearing), Math.sin(bearing), Math.cos(dip), Math.sin(dip)];
    return this.#points
      .map((p, k) => {
        if (!p) return null;
        const [n, e, d] = p.map((v, i) => (v - this.#centre[i]) / this.#radius);
        const out = cb * n + sb * e;
        return { k, x: cb * e - sb * n, y: cd * d - sd * out, z: cd * out + sd * d };
      })
      .filter((one) => one)
      .sort((a, b) => b.z - a.z);
  }

  #paintScale() {
    const on = fit(this.#scale);
    if (!on) return;
    const { context, width } = on;
    const apart = this.show === "difference";
    for (let i = 0; i < width; i++) {
      context.fillStyle = blend(apart ? APART : SPEED, i / (width - 1));
      context.fillRect(i, 0, 1, 8);
    }
    context.font = FONT;
    context.fillStyle = ink("--muted");
    for (const tick of apart ? ACROSS_MM_S : TICKS_MM_S) {
      const at = apart ? 0.5 + 0.05 * tick : share(tick);
      context.textAlign = at < 0.02 ? "left" : at > 0.98 ? "right" : "center";
      context.fillText(String(tick).replace("-", "−"), at * width, 20);
    }
  }

  #drag() {
    let from = null;
    this.#canvas.addEventListener("pointerdown", (event) => {
      from = [event.clientX, event.clientY, ...this.#turn];
      this.#canvas.setPointerCapture(event.pointerId);
    });
    this.#canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      this.#turn = [from[2] - 0.01 * (event.clientX - from[0]), from[3] - 0.01 * (event.clientY - from[1])];
      this.repaint();
    });
    for (const name of ["pointerup", "pointercancel"]) this.#canvas.addEventListener(name, () => { from = null; });
    this.#canvas.addEventListener("dblclick", () => {
      this.#turn = [0, 0];
      this.repaint();
    });
  }
}

// Which patches of the target are seen well.

import { blend, fit, ink, soon } from "./draw.js";
import { finite, numbers, shown } from "./numbers.js";
import { wayTo } from "./instruments.js";

const GOOD = [[0, [150, 160, 166]], [0.5, [106, 170, 168]], [1, [26, 122, 100]]];

export class Coverage {
  #canvas;
  #share;
  #next;
  #patches = [];

  constructor({ canvas, share, next }) {
    this.#canvas = canvas;
    this.#share = share;
    this.#next = next;
    new ResizeObserver(() => this.repaint()).observe(canvas);
  }

  update(state) {
    const coverage = state.coverage;
    if (coverage === null || typeof coverage !== "object") {
      this.#next.hidden = true;
      return;
    }
    if (Array.isArray(coverage.patches)) this.#patches = numbers(coverage.patches).slice(0, 2000);
    const share = finite(coverage.share);
    const text = share === null ? "–" : `${shown(100 * share, 0, "%")}${this.#patches.length ? ` of ${this.#patches.length} patches` : ""}`;
    if (this.#share.textContent !== text) this.#share.textContent = text;
    const next = coverage.next;
    this.#next.hidden = !next;
    if (next) {
      const { angle_deg, said } = wayTo(next, state);
      const arrow = this.#next.querySelector("#next-arrow");
      arrow.parentNode.classList.toggle("there", angle_deg === null);
      if (angle_deg !== null) arrow.setAttribute("transform", `rotate(${angle_deg.toFixed(0)})`);
      const line = this.#next.querySelector("#next-words");
      if (line.textContent !== said) line.textContent = said;
    }
    this.repaint();
  }

  repaint() {
    soon(this.#paint);
  }

  #paint = () => {
    const on = fit(this.#canvas);
    const count = this.#patches.length;
    if (!on || !count) return;
    const { context, width, height } = on;
    // As many columns as keep the cells square.
    const side = Math.max(3, Math.min(18, Math.floor(Math.sqrt((width * height) / count))));
    const across = Math.max(1, Math.floor(width / side));
    const scale = Math.min(1, height / (Math.ceil(count / across) * side));
    this.#patches.forEach((score, k) => {
      context.fillStyle = score === null ? ink("--line") : blend(GOOD, score);
      context.globalAlpha = score ? 1 : 0.45;
      const gap = side > 6 ? 2 : 1;
      context.fillRect((k % across) * side, Math.floor(k / across) * side * scale, side - gap, side * scale - gap);
    });
    context.globalAlpha = 1;
  };
}

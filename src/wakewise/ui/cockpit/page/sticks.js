// Sticks go out 25 times a second by a timer, never by an animation frame, and stop at once where nobody is looking.

import { clip } from "./numbers.js";

export const AXES = ["forward", "right", "down", "turn", "tilt"];
const PERIOD_MS = 40;
/** A page that stood still for longer has nothing in its hands: whatever was held must be let go and pressed anew. */
const FROZEN_MS = 300;

/** Sum of sources, each with `read()` -> five shares of full stick, and `drop()`: forget what is held until it is let go. */
export class Sticks {
  axes = [0, 0, 0, 0, 0];
  sending = false;
  #seq = 0;
  #link;
  #helm;
  #sources;
  #attentive;
  #changed;
  #ticked_ms = performance.now();

  /** `attentive()` tells whether somebody looks at this page; `changed()` is called when sending begins or ends. */
  constructor({ link, helm, sources, attentive, changed }) {
    this.#link = link;
    this.#helm = helm;
    this.#sources = sources;
    this.#attentive = attentive;
    this.#changed = changed;
    helm.addEventListener("change", () => {
      // Sticks held before the helm came do not fly: they must be let go first.
      if (helm.mine !== this.sending) this.cut();
    });
    setInterval(() => this.tick(), PERIOD_MS);
  }

  /** Centre everything now: one message with zeros, then silence until `tick` finds somebody there again. */
  cut() {
    for (const source of this.#sources) source.drop();
    this.axes.fill(0);
    if (this.sending) {
      this.#send();
      this.sending = false;
      this.#changed();
    }
  }

  tick() {
    const now_ms = performance.now(), frozen = now_ms - this.#ticked_ms > FROZEN_MS;
    this.#ticked_ms = now_ms;
    if (frozen || !this.#attentive()) {
      this.cut();
      return;
    }
    const sum = [0, 0, 0, 0, 0];
    for (const source of this.#sources) source.read().forEach((v, k) => { sum[k] += Number.isFinite(v) ? v : 0; });
    this.axes = sum.map((v) => Math.round(1000 * clip(v, -1, 1)) / 1000);
    const can = this.#helm.mine && this.#link.open;
    if (can) this.#send();
    if (can !== this.sending) {
      this.sending = can;
      this.#changed();
    }
  }

  #send() {
    if (!this.#helm.mine) return;
    this.#seq += 1;
    this.#link.send({ type: "sticks", seq: this.#seq, t: Math.round(10 * performance.now()) / 10, axes: this.axes, lease: this.#helm.lease });
  }
}

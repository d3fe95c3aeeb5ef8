// Two sticks for thumbs, and the camera's tilt held down.

import { clip } from "./numbers.js";

const DEAD = 0.08;

export class Touch {
  #left = [0, 0];
  #right = [0, 0];
  #tilt = 0;
  #held = new Map();
  #box;

  constructor(box) {
    this.#box = box;
    this.#stick(box.querySelector("[data-stick=left]"), (x, y) => { this.#left = [x, y]; });
    this.#stick(box.querySelector("[data-stick=right]"), (x, y) => { this.#right = [x, y]; });
    for (const button of box.querySelectorAll("[data-tilt]")) {
      const sign = Number(button.dataset.tilt);
      button.addEventListener("pointerdown", (event) => {
        event.preventDefault();
        button.setPointerCapture(event.pointerId);
        this.#tilt = sign;
      });
      for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(name, () => { this.#tilt = 0; });
      button.addEventListener("contextmenu", (event) => event.preventDefault());
    }
  }

  /** Shown where thumbs are. */
  show(yes) {
    this.#box.hidden = !yes;
    document.body.classList.toggle("thumbs", yes);
  }

  read() {
    const [right, up] = this.#left, [turn, rise] = this.#right;
    return [-up, right, rise, turn, this.#tilt].map((v) => (Math.abs(v) < DEAD ? 0 : v));
  }

  drop() {
    for (const [id, release] of [...this.#held]) {
      this.#held.delete(id);
      release();
    }
    this.#tilt = 0;
  }

  #stick(pad, put) {
    const knob = pad.querySelector("i");
    const move = (x, y) => {
      put(x, y);
      knob.style.setProperty("--x", x.toFixed(3));
      knob.style.setProperty("--y", y.toFixed(3));
    };
    const from = (event) => {
      const box = pad.getBoundingClientRect();
      const radius = 0.36 * Math.min(box.width, box.height);
      const x = (event.clientX - box.left - box.width / 2) / radius, y = (event.clientY - box.top - box.height / 2) / radius;
      const far = Math.max(1, Math.hypot(x, y));
      move(clip(x / far, -1, 1), clip(y / far, -1, 1));
    };
    pad.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      if (this.#held.size && [...this.#held.values()].includes(release)) return;
      pad.setPointerCapture(event.pointerId);
      pad.classList.add("held");
      this.#held.set(event.pointerId, release);
      from(event);
    });
    pad.addEventListener("pointermove", (event) => {
      if (this.#held.get(event.pointerId) === release) from(event);
    });
    const release = () => {
      pad.classList.remove("held");
      move(0, 0);
    };
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      pad.addEventListener(name, (event) => {
        if (this.#held.get(event.pointerId) !== release) return;
        this.#held.delete(event.pointerId);
        release();
      });
    }
    pad.addEventListener("contextmenu", (event) => event.preventDefault());
  }
}

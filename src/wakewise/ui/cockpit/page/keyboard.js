// The keyboard: keys by their place on the board, so that WASD lies alike on every layout.

import { AXES } from "./sticks.js";

/** Code of the key: axis, sign. */
export const FLY = {
  KeyW: ["forward", 1], KeyS: ["forward", -1], KeyD: ["right", 1], KeyA: ["right", -1],
  ArrowUp: ["down", -1], ArrowDown: ["down", 1], ArrowRight: ["turn", 1], ArrowLeft: ["turn", -1],
  KeyE: ["turn", 1], KeyQ: ["turn", -1], KeyR: ["tilt", 1], KeyF: ["tilt", -1],
};

export const HELP = [
  ["Space", "stop: hold this place, from anywhere on the page"],
  ["W S", "forward, back"], ["A D", "left, right"], ["↑ ↓", "rise, sink"], ["← → or Q E", "turn"], ["R F", "tilt the camera up, down"],
  ["O H M", "operate, hold, scan"], ["C", "capture a photo"], ["G", "take the helm, or give it back"], ["P", "precise sticks"],
  ["− +", "gain down, up"], ["[ ]", "gentler, more obedient (w_track)"], ["X", "direct or wake-aware"], ["V", "wash: predicted, true, difference"],
  ["T", "target: what lies in the middle of the picture"], ["Esc", "forget the designated target"],
  ["B", "propose a target: what stands on the bed nearest to the middle"], ["K N", "accept, refuse the proposed target"],
  ["L", "colours light, dark, as the system"], ["?", "this page"],
];

export class Keyboard {
  #held = new Set();
  #act;

  /** `act(code, event)` gets what is no stick and says whether it was of use; `stop()` whatever happens on Space. */
  constructor({ act, stop }) {
    this.#act = act;
    // Captured, so that Space stops even where a button has the focus: it must never press one by accident.
    window.addEventListener("keydown", (event) => {
      if (event.code === "Space" && !typing(event.target)) {
        event.preventDefault();
        event.stopPropagation();
        if (!event.repeat) {
          this.drop();
          stop();
        }
        return;
      }
      this.#down(event);
    }, true);
    window.addEventListener("keyup", (event) => {
      if (event.code === "Space" && !typing(event.target)) event.preventDefault();
      this.#held.delete(event.code);
    }, true);
  }

  #down(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || typing(event.target) || document.querySelector("dialog[open]")) return;
    if (FLY[event.code]) {
      // A slider that was reached by Tab keeps its arrows.
      if (event.code.startsWith("Arrow") && event.target.matches?.("input[type=range]:focus-visible, [role=log]:focus-visible")) return;
      event.preventDefault();
      // A key that repeats was held before it was let go: it counts only when pressed anew.
      if (!event.repeat) this.#held.add(event.code);
      return;
    }
    if (!event.repeat && this.#act(event.code, event)) event.preventDefault();
  }

  read() {
    const axes = [0, 0, 0, 0, 0];
    for (const code of this.#held) {
      const [axis, sign] = FLY[code];
      const k = AXES.indexOf(axis);
      axes[k] = Math.max(-1, Math.min(1, axes[k] + sign));
    }
    return axes;
  }

  drop() {
    this.#held.clear();
  }
}

function typing(element) {
  return Boolean(element?.matches?.("input:not([type=range]), textarea, select, [contenteditable]"));
}

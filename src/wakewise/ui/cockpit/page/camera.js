// The camera's picture: newest wins, one at a time, acknowledged once it is decoded. A page that lags gets fewer.

import { soon } from "./draw.js";

const HEADER = 8;
const OLD_MS = 1500;

export class Camera {
  #canvas;
  #empty;
  #late;
  #link;
  #next = null;
  #busy = false;
  #bitmap = null;
  #owed = null;
  #seen_ms = 0;
  #frame = null;
  bad = 0;

  constructor({ canvas, empty, late, link }) {
    this.#canvas = canvas;
    this.#empty = empty;
    this.#late = late;
    this.#link = link;
    link.addEventListener("picture", (event) => this.#take(event.detail));
    link.addEventListener("down", () => { this.#owed = null; });
    // Nobody looks: the picture stays owed, and the server sends no other.
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden && this.#owed !== null) this.#acknowledge(this.#owed);
    });
    setInterval(() => this.#age(), 500);
  }

  /** Number of the picture that is shown; null before the first. */
  get frame() {
    return this.#frame;
  }

  get canvas() {
    return this.#canvas;
  }

  #take(data) {
    if (data.byteLength <= HEADER) {
      this.bad += 1;
      return;
    }
    this.#next = data;
    if (!this.#busy) this.#decode();
  }

  async #decode() {
    this.#busy = true;
    while (this.#next) {
      const data = this.#next;
      this.#next = null;
      const frame = new DataView(data).getUint32(0, true);
      try {
        const bitmap = await createImageBitmap(new Blob([new Uint8Array(data, HEADER)], { type: "image/jpeg" }));
        this.#bitmap?.close();
        this.#bitmap = bitmap;
        this.#frame = frame;
        this.#seen_ms = performance.now();
        soon(() => this.#paint());
      } catch {
        // No picture, yet it has arrived: unless it is acknowledged, none follows.
        this.bad += 1;
      }
      if (document.hidden) this.#owed = frame;
      else this.#acknowledge(frame);
    }
    this.#busy = false;
  }

  #acknowledge(frame) {
    this.#owed = null;
    this.#link.send({ type: "seen", frame });
  }

  #paint() {
    const bitmap = this.#bitmap;
    if (!bitmap || !bitmap.width) return;
    if (this.#canvas.width !== bitmap.width || this.#canvas.height !== bitmap.height) {
      this.#canvas.width = bitmap.width;
      this.#canvas.height = bitmap.height;
    }
    this.#canvas.getContext("2d", { alpha: false }).drawImage(bitmap, 0, 0);
    this.#empty.hidden = true;
    this.#age();
  }

  #age() {
    const age_ms = performance.now() - this.#seen_ms;
    const old = this.#seen_ms > 0 && age_ms > OLD_MS;
    this.#late.hidden = !old;
    if (old) this.#late.textContent = `picture is ${(age_ms / 1000).toFixed(0)}\u202fs old`;
    this.#canvas.classList.toggle("old", old);
  }
}

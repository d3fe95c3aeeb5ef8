// The log: what happened, newest first.

import { clock, finite, words } from "./numbers.js";

const MOST = 80;
const LEVELS = ["info", "warn", "error"];

export class Notes {
  #list;
  #time_s = null;

  constructor(list) {
    this.#list = list;
  }

  /** The flight's time, for notes of the page itself. */
  at(time_s) {
    this.#time_s = finite(time_s) ?? this.#time_s;
  }

  add(level, text, time_s = this.#time_s) {
    const said = words(text, 300);
    if (!said) return;
    const first = this.#list.firstElementChild;
    // The same again is counted, not repeated.
    if (first && first.dataset.said === said) {
      first.dataset.times = String(Number(first.dataset.times) + 1);
      first.lastElementChild.textContent = `${said} (×${first.dataset.times})`;
      return;
    }
    const item = document.createElement("li");
    item.dataset.level = LEVELS.includes(level) ? level : "info";
    item.dataset.said = said;
    item.dataset.times = "1";
    const time = document.createElement("time"), line = document.createElement("span");
    time.textContent = clock(time_s);
    line.textContent = said;
    item.append(time, line);
    this.#list.prepend(item);
    while (this.#list.children.length > MOST) this.#list.lastElementChild.remove();
  }
}

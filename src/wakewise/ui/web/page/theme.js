// Light, dark, or as the system says; kept for the next visit where the browser allows it.

import { forgetInks } from "./draw.js";

const ORDER = ["auto", "light", "dark"];
const SAID = { auto: "as the system", light: "light", dark: "dark" };
const SIGN = { auto: "◐", light: "☀", dark: "☾" };

export function keep(name, value) {
  try {
    localStorage.setItem(`wakewise.${name}`, value);
  } catch {
    // Private windows and sandboxed frames keep nothing.
  }
}

export function kept(name) {
  try {
    return localStorage.getItem(`wakewise.${name}`);
  } catch {
    return null;
  }
}

export class Theme {
  #button;
  #repaint;
  #now = "auto";

  constructor(button, repaint) {
    this.#button = button;
    this.#repaint = repaint;
    const asked = new URLSearchParams(location.search).get("theme") ?? kept("theme");
    this.#wear(ORDER.includes(asked) ? asked : "auto");
    button.addEventListener("click", () => this.next());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#wear(this.#now));
  }

  next() {
    this.#wear(ORDER[(ORDER.indexOf(this.#now) + 1) % ORDER.length]);
    keep("theme", this.#now);
  }

  #wear(name) {
    this.#now = name;
    if (name === "auto") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = name;
    this.#button.textContent = SIGN[name];
    this.#button.setAttribute("aria-label", `Colours: ${SAID[name]}`);
    forgetInks();
    this.#repaint();
  }
}

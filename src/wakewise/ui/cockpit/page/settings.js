// How the vehicle heeds the sticks: gentleness, method, gain, assists. What is shown is what the server says.

import { clip, finite, shown } from "./numbers.js";

const REGIMES = {
  delicate: "Still water first: the vehicle may lag the stick.",
  work: "Stick and still water both count.",
  transit: "Stick first: wash is spared where that is free.",
};
const QUIET_MS = 700;
const EVERY_MS = 150;
const STEP = 1.25;

export function regime(w_track) {
  return w_track > 10 ? "transit" : w_track < 2 ? "delicate" : "work";
}

export class FlightSettings {
  state = {};
  #helm;
  #touched = new Map();
  #sent_ms = 0;
  #owed = null;
  #range = [0.5, 50];
  #dial = document.getElementById("w-track");
  #gain = document.getElementById("gain");

  constructor(helm) {
    this.#helm = helm;
    this.#slider(this.#dial, "w_track", () => this.#weight(Number(this.#dial.value)));
    this.#slider(this.#gain, "gain", () => Number(this.#gain.value));
    for (const button of document.querySelectorAll("[data-method]")) button.addEventListener("click", () => this.#set({ method: button.dataset.method }));
    for (const button of document.querySelectorAll("[data-assist]")) {
      button.addEventListener("click", () => this.#set({ [button.dataset.assist]: !this.state[button.dataset.assist] }));
    }
    document.getElementById("precise").addEventListener("click", () => this.press("precise"));
  }

  /** Ranges of a `welcome`. */
  place(settings) {
    const range = settings?.ranges?.w_track, gain = settings?.ranges?.gain;
    if (Array.isArray(range) && range[0] > 0 && range[1] > range[0]) this.#range = range;
    if (Array.isArray(gain) && gain[1] > gain[0]) [this.#gain.min, this.#gain.max] = gain;
    this.update(settings);
  }

  /** The settings of a `state`. What a finger is on stays where the finger is. */
  update(settings, figures = {}) {
    if (settings === null || typeof settings !== "object") return;
    this.state = { ...settings };
    const w_track = finite(settings.w_track), gain = finite(settings.gain);
    if (w_track !== null && !this.#busy("w_track")) this.#dial.value = this.#place(w_track);
    if (gain !== null && !this.#busy("gain")) this.#gain.value = gain;
    this.#words(figures);
    pressed("[data-method]", (button) => button.dataset.method === settings.method);
    pressed("[data-assist]", (button) => settings[button.dataset.assist] === true);
    pressed("#precise", () => settings.precise === true);
    document.body.dataset.method = settings.method === "direct" ? "direct" : "wake-aware";
  }

  /** Turn w_track by steps. */
  nudge(steps) {
    const w_track = finite(this.state.w_track);
    if (w_track !== null) this.#set({ w_track: round(clip(w_track * STEP ** steps, ...this.#range)) });
  }

  swap() {
    this.#set({ method: this.state.method === "direct" ? "wake-aware" : "direct" });
  }

  press(what) {
    this.#helm.press(what);
  }

  #set(changes) {
    if (this.#helm.set(changes)) Object.assign(this.state, changes);
  }

  #slider(input, field, value) {
    input.addEventListener("input", () => {
      this.#touched.set(field, performance.now());
      this.#words({}, field === "w_track" ? value() : undefined);
      // A drag is many events; the last one always goes.
      const wait_ms = this.#sent_ms + EVERY_MS - performance.now();
      clearTimeout(this.#owed);
      const go = () => {
        this.#sent_ms = performance.now();
        this.#set({ [field]: value() });
      };
      if (wait_ms <= 0) go();
      else this.#owed = setTimeout(go, wait_ms);
    });
    // Back to the sticks: arrows fly again.
    input.addEventListener("pointerup", () => input.blur());
  }

  #busy(field) {
    return performance.now() - (this.#touched.get(field) ?? -Infinity) < QUIET_MS;
  }

  #weight(place) {
    const [low, high] = this.#range;
    return round(low * (high / low) ** (place / 1000));
  }

  #place(w_track) {
    const [low, high] = this.#range;
    return Math.round((1000 * Math.log(clip(w_track, low, high) / low)) / Math.log(high / low));
  }

  #words(figures, dragged) {
    const w_track = dragged ?? (this.#busy("w_track") ? this.#weight(Number(this.#dial.value)) : finite(this.state.w_track));
    const name = w_track === null ? "" : regime(w_track);
    text("w-track-out", w_track === null ? "–" : shown(w_track, w_track < 10 ? 1 : 0));
    text("regime", name);
    text("gain-out", shown(100 * Number(this.#gain.value), 0, "%"));
    document.body.dataset.regime = name;
    this.#dial.setAttribute("aria-valuetext", `${shown(w_track, 1)}, ${name}`);
    if (this.state.method === "direct") {
      text("meaning", "Direct: the least thrusts, blind to where their wash goes. For comparison.");
      return;
    }
    const deviation = finite(figures.deviation_pct), saved = finite(figures.saved_pct);
    const now = deviation === null || saved === null ? "" : ` Now: ${shown(deviation, 0, "%")} off the command, ${shown(Math.abs(saved), 0, "%")} ${saved < 0 ? "more" : "less"} disturbance than direct.`;
    if (dragged === undefined) text("meaning", (REGIMES[name] ?? "") + now);
  }
}

function round(value) {
  return Number(value.toPrecision(3));
}

function text(id, words) {
  const element = document.getElementById(id);
  if (element.textContent !== words) element.textContent = words;
}

/** Mark which of some buttons are down. */
export function pressed(selector, is) {
  for (const button of document.querySelectorAll(selector)) button.setAttribute("aria-pressed", String(Boolean(is(button))));
}

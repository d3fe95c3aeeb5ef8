// Figures, horizon and thrusts.

import { brief, clip, finite, length, numbers, point, shown, words } from "./numbers.js";

const fields = new Map([...document.querySelectorAll("[data-field]")].map((element) => [element.dataset.field, element]));

/** Write one figure; only what changed touches the page. */
export function put(name, text) {
  const element = fields.get(name);
  if (element && element.textContent !== text) element.textContent = text;
}

export function figures(state) {
  put("depth", shown(state.depth_m, 2, "m"));
  const speed = length(state.velocity_m_s), asked = length(state.commanded_m_s);
  put("speed", shown(speed, 2, "m/s"));
  put("asked", shown(asked, 2, "m/s"));
  put("heading", shown(turned(state.heading_deg), 0, "°").replace("\u202f", ""));
  put("roll", shown(state.roll_deg, 1, "°").replace("\u202f", ""));
  put("pitch", shown(state.pitch_deg, 1, "°").replace("\u202f", ""));
  put("tilt", shown(state.tilt_deg, 0, "°").replace("\u202f", ""));
  put("power", shown(state.power_W, 0, "W"));
  const energy = finite(state.energy_J);
  put("energy", energy === null ? shown(null) : shown(energy / 3600, energy < 36000 ? 2 : 1, "Wh"));
  const photos = Array.isArray(state.photos) ? state.photos.length : state.photos;
  put("photos", shown(photos, 0));
  put("rms", speedOfWash(state.rms_m_s));
  put("saved", shown(state.saved_pct, 0, "%"));
  document.body.dataset.saves = String(Number(state.saved_pct) > 0);
  put("deviation", `now ${shown(state.deviation_pct, 1, "%")}`);
  horizon(state);
}

/** A speed of m/s, in mm/s. */
export function millimetres(value) {
  const speed = finite(value);
  return speed === null ? null : 1e3 * speed;
}

function speedOfWash(value) {
  return brief(millimetres(value), "mm/s");
}

function turned(deg) {
  const value = finite(deg);
  return value === null ? null : Math.round(((value % 360) + 360) % 360) % 360;
}

const world = document.getElementById("horizon-world");
const glass = document.getElementById("horizon");

function horizon(state) {
  const roll = finite(state.roll_deg), pitch = finite(state.pitch_deg);
  glass.classList.toggle("blind", roll === null || pitch === null);
  if (roll === null || pitch === null) return;
  world.setAttribute("transform", `rotate(${(-roll).toFixed(1)}) translate(0 ${(clip(pitch, -70, 70) * 1.2).toFixed(1)})`);
}

export class Thrusts {
  #list;
  #rows = [];

  constructor(list) {
    this.#list = list;
  }

  /** The thrusters of a `welcome`. */
  place(thrusters) {
    this.#rows = [];
    this.#list.replaceChildren();
    for (const one of Array.isArray(thrusters) ? thrusters.slice(0, 24) : []) {
      const [low, high] = numbers(one?.limit_N);
      const row = document.createElement("li");
      row.innerHTML = "<span></span><div class=\"bar\"><i></i></div><output></output>";
      const [name, bar, value] = row.children;
      name.textContent = name.title = short(words(one?.name, 60) || "thruster");
      bar.title = `limits ${shown(low, 0)} to ${shown(high, 0, "N")}`;
      this.#rows.push({ bar, value, low: low < 0 ? low : -1, high: high > 0 ? high : 1, fill: bar.firstChild });
      this.#list.append(row);
    }
    this.#list.classList.toggle("many", this.#rows.length > 8);
  }

  update(thrusts_N) {
    const thrusts = numbers(thrusts_N);
    this.#rows.forEach(({ bar, value, low, high, fill }, k) => {
      const thrust = thrusts[k] ?? null;
      // Zero in the middle, each side to its own limit.
      const share = thrust === null ? 0 : clip(thrust < 0 ? -thrust / low : thrust / high, -1, 1);
      fill.style.setProperty("--share", share.toFixed(3));
      bar.classList.toggle("back", share < 0);
      bar.classList.toggle("full", Math.abs(share) > 0.98);
      const text = shown(thrust, 1, "N");
      if (value.textContent !== text) value.textContent = text;
    });
  }
}

function short(name) {
  return name.replace("horizontal", "horiz.").replace("vertical", "vert.");
}

/** The way to the next photograph, seen from the vehicle: an arrow's angle in degrees clockwise from ahead, and words. */
export function wayTo(next, state) {
  const to = point(next?.position_W_m), from = point(state.position_W_m), heading = finite(state.heading_deg);
  const said = words(next?.words, 120);
  if (!to || !from || heading === null) return { angle_deg: null, said };
  const [north, east, down] = to.map((v, k) => v - from[k]);
  const level = Math.hypot(north, east);
  const angle_deg = (Math.atan2(east, north) * 180) / Math.PI - heading;
  const way = `${shown(Math.hypot(level, down), 2, "m")}${Math.abs(down) > 0.05 ? `, ${shown(Math.abs(down), 2, "m")} ${down > 0 ? "deeper" : "higher"}` : ""}`;
  return { angle_deg: level > 0.03 ? angle_deg : null, said: said || way };
}

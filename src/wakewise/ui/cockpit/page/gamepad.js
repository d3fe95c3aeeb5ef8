// Gamepads as the browser knows them. Polled with the sticks' timer, so plugging in and out needs no event.

const DEAD = 0.12;
const REST = 0.3;

/** Index of the axis in the standard mapping: which stick axis, sign. Up is negative on every gamepad. */
const STANDARD = [[1, -1, 0], [0, 1, 1], [3, 1, 2], [2, 1, 3]];
const PRESSES = { 0: "capture", 1: "hold", 2: "precise", 3: "operator", 4: "gain_down", 5: "gain_up", 9: "scan" };
const TILT_UP = 12, TILT_DOWN = 13, GENTLER = 14, OBEY = 15;

export const HELP = [
  ["left stick", "forward, back, left, right"], ["right stick", "turn, rise and sink"], ["cross ↑ ↓", "tilt the camera"],
  ["cross ← →", "gentler, more obedient"], ["A", "capture"], ["B", "stop: hold this place"], ["X", "precise"], ["Y", "operate"],
  ["LB RB", "gain down, up"], ["Start", "scan"],
];

export class Pads {
  name = null;
  #index = null;
  #armed = [];
  #down = new Set();
  #stale = new Set();
  #press;
  #nudge;
  #say;

  /** `press(what)`; `nudge(steps)` turns w_track; `say(level, text)`. */
  constructor({ press, nudge, say }) {
    this.#press = press;
    this.#nudge = nudge;
    this.#say = say;
  }

  read() {
    const axes = [0, 0, 0, 0, 0];
    const pad = this.#pad();
    if (!pad) return axes;
    pad.axes.forEach((value, k) => {
      // An axis counts once it was seen at rest: a trigger that rests at -1, or a stick held over, does not fly.
      if (Number.isFinite(value) && Math.abs(value) < REST) this.#armed[k] = true;
    });
    // Which of its sticks is which is known of a standard mapping alone.
    if (pad.mapping !== "standard") return axes;
    for (const [from, sign, to] of STANDARD) {
      const value = pad.axes[from];
      if (this.#armed[from] && Number.isFinite(value) && Math.abs(value) > DEAD) {
        axes[to] = sign * Math.sign(value) * Math.min(1, (Math.abs(value) - DEAD) / (1 - DEAD));
      }
    }
    const held = new Set(pad.buttons.map((b, k) => (b && b.pressed ? k : -1)).filter((k) => k >= 0));
    for (const k of [...this.#stale]) if (!held.has(k)) this.#stale.delete(k);
    const fresh = [...held].filter((k) => !this.#down.has(k) && !this.#stale.has(k));
    this.#down = held;
    const tilts = (k) => held.has(k) && !this.#stale.has(k);
    axes[4] = (tilts(TILT_UP) ? 1 : 0) - (tilts(TILT_DOWN) ? 1 : 0);
    for (const k of fresh) {
      if (PRESSES[k]) this.#press(PRESSES[k]);
      if (k === GENTLER) this.#nudge(-1);
      if (k === OBEY) this.#nudge(1);
    }
    return axes;
  }

  /** Sticks count once they were seen at rest, buttons that are down now once they were let go. */
  drop() {
    this.#armed = [];
    this.#stale = new Set(this.#found()?.buttons.map((_, k) => k));
  }

  #found() {
    let pads = [];
    try {
      pads = [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad && pad.connected);
    } catch {
      // Not allowed in this frame: flown without.
    }
    // One that can be flown is taken before one that cannot.
    const flown = pads.filter((pad) => pad.mapping === "standard"), kept = (one) => one.index === this.#index;
    return flown.find(kept) ?? flown[0] ?? pads.find(kept) ?? pads[0] ?? null;
  }

  #pad() {
    const pad = this.#found();
    const index = pad ? pad.index : null;
    if (index !== this.#index) {
      if (this.#index !== null) this.#say("warn", `Gamepad lost (${this.name}): its sticks are at zero`);
      this.#index = index;
      this.name = pad ? short(pad.id) : null;
      this.#armed = [];
      // A button held while it is plugged in presses nothing.
      this.#down = new Set(pad ? pad.buttons.map((_, k) => k) : []);
      if (pad) this.#say("info", `Gamepad: ${this.name}`);
      if (pad && pad.mapping !== "standard") this.#say("warn", "This gamepad is not flown: the browser does not know which of its sticks is which. Plug it into the computer that runs the cockpit: wakewise cockpit --gamepad --mapping FILE");
    }
    return pad;
  }
}

function short(id) {
  return String(id).replace(/\s*\(.*$/, "").slice(0, 40) || "gamepad";
}

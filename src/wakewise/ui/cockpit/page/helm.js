// Who flies. The page never assumes that it holds the helm: it asks, and believes the server.

import { words } from "./numbers.js";

const HOLD_SOON_MS = 2000;

/** Events: "change". */
export class Helm extends EventTarget {
  lease = null;
  holder = null;
  askedBy = null;
  why = "";
  waiting = false;
  quiet = false;
  armed = true;
  id = null;
  #link;
  #holdUntil_ms = 0;

  constructor(link) {
    super();
    this.#link = link;
    link.addEventListener("down", () => this.#set({}));
    link.addEventListener("refused", () => this.#set({}));
  }

  /** The lease that this tab had last, through reloads of the page; null if none. */
  static last() {
    try {
      return sessionStorage.getItem("lease");
    } catch {
      // A frame may not be allowed to keep anything.
      return null;
    }
  }

  get mine() {
    return this.lease !== null;
  }

  /** Ask for it. Taken at once where it is free; else its holder is asked. */
  ask() {
    if (this.mine) return;
    this.#link.send({ type: "helm", want: true, force: false });
  }

  giveBack() {
    if (this.mine) this.#link.send({ type: "helm", want: false, force: false });
  }

  answer(yes) {
    if (this.askedBy) this.#link.send({ type: "consent", to: this.askedBy.id, yes });
    this.askedBy = null;
    this.#tell();
  }

  press(what) {
    return this.mine && this.#link.send({ type: "press", what, lease: this.lease });
  }

  set(changes) {
    return this.mine && this.#link.send({ type: "settings", set: changes, lease: this.lease });
  }

  /** A box of picture `frame` that holds the target, or "clear". */
  designate(box, frame = 0) {
    return this.mine && this.#link.send({ type: "designate", box, frame, lease: this.lease });
  }

  /** About a proposed target: "ask", "accept" or "refuse". */
  propose(what) {
    return this.mine && this.#link.send({ type: "proposal", what, lease: this.lease });
  }

  /** Hold the place. Whoever is not at the helm asks for it to do so: an emergency is no time for two buttons. */
  stop() {
    if (this.press("hold")) return;
    this.#holdUntil_ms = performance.now() + HOLD_SOON_MS;
    this.ask();
  }

  /** A `helm` message. */
  take(message) {
    const asked = message.asked_by;
    const lease = message.yours === true && typeof message.lease === "string" ? message.lease : null;
    this.#set({
      lease,
      holder: words(message.holder, 40) || null,
      askedBy: lease && asked && typeof asked === "object" ? { id: asked.id, name: words(asked.name, 40) || "Somebody" } : null,
      why: words(message.why),
      waiting: lease === null && asked != null && this.id !== null && asked.id === this.id,
      // Whoever has it sends nothing: it may be taken.
      quiet: message.flying === false,
      // After a pause the sticks count once they were let go.
      armed: message.armed !== false,
    });
    if (lease) keepLease(lease);
    if (lease && performance.now() < this.#holdUntil_ms) {
      this.#holdUntil_ms = 0;
      this.press("hold");
    }
  }

  #set({ lease = null, holder = null, askedBy = null, why = "", waiting = false, quiet = false, armed = true }) {
    Object.assign(this, { lease, holder, askedBy, why, waiting, quiet, armed });
    this.#tell();
  }

  #tell() {
    this.dispatchEvent(new Event("change"));
  }
}

function keepLease(lease) {
  try {
    sessionStorage.setItem("lease", lease);
  } catch {
    // Without it a lost connection comes back as any other.
  }
}

// The connection: comes back by itself, always as a spectator, and says when it is down or silent.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 8000;
const SILENT_MS = 1500;
const DEAD_MS = 12000;
const REFUSED = 4401;

/** Events: "up", "down" (detail.wait_ms), "silent", "heard", "refused" (detail.why), "message" (object), "picture" (ArrayBuffer). */
export class Link extends EventTarget {
  #socket = null;
  #wait_ms = FIRST_WAIT_MS;
  #timer = 0;
  #heard_ms = 0;
  #silent = false;
  #ended = false;
  /** Whether news are due all the time, so that silence means something. */
  expectant = false;
  #hello;

  /** `hello` gives the first message anew for each connection. */
  constructor(hello) {
    super();
    this.#hello = hello;
    setInterval(() => this.#listen(), 250);
  }

  get open() {
    return this.#socket !== null && this.#socket.readyState === WebSocket.OPEN;
  }

  connect() {
    clearTimeout(this.#timer);
    if (this.#socket || this.#ended) return;
    const url = new URL("ws", location.href);
    url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    url.search = url.hash = "";
    const socket = new WebSocket(url);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    socket.onopen = () => {
      this.#heard_ms = performance.now();
      this.expectant = false;
      this.send(this.#hello());
      this.#tell("up");
    };
    socket.onmessage = (event) => this.#take(event.data);
    socket.onclose = (event) => this.#closed(socket, event);
  }

  /** Send an object; false if it could not go. */
  send(message) {
    if (!this.open) return false;
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  /** Leave; `forGood` does not come back. */
  close(forGood = false) {
    this.#ended ||= forGood;
    const socket = this.#socket;
    if (socket) {
      socket.close(1000);
      this.#closed(socket, null);
    }
  }

  #take(data) {
    this.#heard_ms = performance.now();
    if (this.#silent) {
      this.#silent = false;
      this.#tell("heard");
    }
    if (data instanceof ArrayBuffer) {
      this.#tell("picture", data);
      return;
    }
    let message;
    try {
      message = JSON.parse(data);
    } catch {
      console.warn("not JSON, ignored");
      return;
    }
    if (message === null || typeof message !== "object" || typeof message.type !== "string") {
      console.warn("no message, ignored");
      return;
    }
    if (message.type === "welcome") this.#wait_ms = FIRST_WAIT_MS;
    this.#tell("message", message);
  }

  #closed(socket, event) {
    if (socket !== this.#socket) return;
    this.#socket = null;
    this.#silent = false;
    if (event && event.code === REFUSED) {
      this.#ended = true;
      this.#tell("refused", { why: event.reason });
      return;
    }
    // Some spread, so that the pages of a server that restarts do not all come at once.
    const wait_ms = this.#wait_ms * (0.8 + 0.4 * Math.random());
    this.#wait_ms = Math.min(2 * this.#wait_ms, LONGEST_WAIT_MS);
    if (!this.#ended) this.#timer = setTimeout(() => this.connect(), wait_ms);
    this.#tell("down", { wait_ms });
  }

  #listen() {
    if (!this.open || !this.expectant) return;
    const since_ms = performance.now() - this.#heard_ms;
    if (since_ms > DEAD_MS) this.close();
    else if (since_ms > SILENT_MS && !this.#silent) {
      this.#silent = true;
      this.#tell("silent");
    }
  }

  #tell(name, detail = null) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}

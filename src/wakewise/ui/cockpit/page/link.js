// The connection: comes back by itself, always as a spectator, and says when it is down or silent.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 8000;
const SILENT_MS = 1500;
const DEAD_MS = 12000;
const REFUSED = 4401, FULL = 1013;
const NOT_LET_IN = [401, 403];

/** Events: "up", "down" (detail.wait_ms, detail.why), "silent", "heard", "refused" (detail.why), "message" (object), "picture" (ArrayBuffer). */
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

  /** `hello` gives the first message anew for each connection; its token is shown with the handshake, too. */
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
    const token = this.#hello().token;
    // A token that cannot be one is not shown; the hello tells what is wrong with it.
    const socket = new WebSocket(url, /^[\w-]+$/.test(token ?? "") ? ["wakewise", `token.${token}`] : ["wakewise"]);
    let opened = false;
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    socket.onopen = () => {
      opened = true;
      this.#heard_ms = performance.now();
      this.expectant = false;
      this.send(this.#hello());
      this.#tell("up");
    };
    socket.onmessage = (event) => this.#take(event.data);
    socket.onclose = (event) => {
      this.#closed(socket, event);
      if (!opened) this.#askWhy(token);
    };
  }

  /** A browser does not tell why a socket was refused: the same request without a socket is answered in words. */
  async #askWhy(token) {
    try {
      const answer = await fetch("ws", { headers: token ? { "X-Wakewise-Token": encodeURI(token) } : {}, cache: "no-store" });
      if (!NOT_LET_IN.includes(answer.status) || this.#socket || this.#ended) return;
      this.#refused(await answer.text());
    } catch {
      // Nobody answers: it is tried again.
    }
  }

  #refused(why) {
    clearTimeout(this.#timer);
    this.#ended = true;
    this.#tell("refused", { why: why.trim() });
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
      this.#refused(event.reason);
      return;
    }
    // Some spread, so that the pages of a server that restarts do not all come at once.
    const wait_ms = this.#wait_ms * (0.8 + 0.4 * Math.random());
    this.#wait_ms = Math.min(2 * this.#wait_ms, LONGEST_WAIT_MS);
    if (!this.#ended) this.#timer = setTimeout(() => this.connect(), wait_ms);
    this.#tell("down", { wait_ms, why: event?.code === FULL ? event.reason : "" });
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

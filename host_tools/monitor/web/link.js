// The WebSocket to the monitor: opens it again when it closes or falls silent, takes its messages apart.

const KIND_TILES = 1, KIND_TRACK = 2, KIND_COMPLETE = 3, KIND_COARSE_TILES = 4;
const TILE_WORDS = 513, COARSE_TILE_WORDS = 529;
// A monitor speaks four times a second. Counted by a clock that stands while the page sleeps.
const TICK_MS = 1000, QUIET_TICKS = 5, GIVE_UP_TICKS = 20;

export class Link extends EventTarget {
  constructor() {
    super();
    this.waitMs = 500;
    this.ticks = 0; // since something came
    this.#open();
    setInterval(() => this.tick(), TICK_MS);
  }

  /** Seconds without a word from a monitor that should speak; 0: it speaks. */
  get quietS() { return this.ticks >= QUIET_TICKS ? (this.ticks * TICK_MS) / 1000 : 0; }

  tick() {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    this.ticks++;
    if (this.ticks >= QUIET_TICKS) this.#say("quiet");
    if (this.ticks < GIVE_UP_TICKS) return;
    // A network that went away tells nobody: closing would wait for an answer.
    const dead = this.socket;
    dead.onopen = dead.onclose = dead.onmessage = null;
    dead.close();
    this.#closed();
  }

  send(request) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }

  #open() {
    this.socket = new WebSocket(`ws://${location.host}/live`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.waitMs = 500;
      this.#say("open");
    };
    this.socket.onclose = () => this.#closed();
    this.socket.onmessage = (event) => {
      const quiet = this.quietS > 0;
      this.ticks = 0;
      if (quiet) this.#say("quiet");
      if (typeof event.data === "string") {
        const message = JSON.parse(event.data);
        this.#say(message.type, message);
      } else {
        this.#binary(event.data);
      }
    };
  }

  #closed() {
    this.ticks = 0;
    this.#say("closed");
    setTimeout(() => this.#open(), this.waitMs);
    this.waitMs = Math.min(this.waitMs * 1.6, 5000);
  }

  #binary(buffer) {
    const head = new DataView(buffer);
    const kind = head.getUint8(0), count = head.getUint16(2, true), epoch = head.getUint32(4, true);
    if (kind === KIND_TILES || kind === KIND_COARSE_TILES) {
      const tiles = [], size = kind === KIND_TILES ? TILE_WORDS : COARSE_TILE_WORDS;
      for (let k = 0; k < count; k++) tiles.push(new Uint32Array(buffer, 8 + 4 * size * k, size));
      this.#say("tiles", { epoch, tiles });
    } else if (kind === KIND_TRACK) {
      this.#say("track", { epoch, first: head.getUint32(8, true), points: new Float32Array(buffer, 12, 4 * count) });
    } else if (kind === KIND_COMPLETE) {
      this.#say("complete", { epoch });
    }
  }

  #say(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}

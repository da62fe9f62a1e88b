/** Workers that answer messages, each one at a time. */

/** The error when the WebAssembly of a worker failed, which happens when memory runs out. */
const FAULT = 'the decoder failed, perhaps for lack of memory';
/** The error of a worker that never began. Browsers give no reason. */
const NO_SCRIPT = "its script could not be loaded: is it where the package's other files are, and does the page allow it (worker-src)?";

export class Pool {
  /** Milliseconds that workers took for their answers, those of all workers added up. */
  milliseconds = 0;
  #workers = [];
  #next = 1;

  /**
   * @param {number} count how many workers; 0 for none
   * @param {{module: WebAssembly.Module, worker: () => Worker, handler: () => (message: object) => {reply: object}}} env
   */
  static async of(count, env) {
    const pool = new Pool();
    if (count === 0) {
      const handle = env.handler();
      // A turn of the event loop lets the page breathe between two chunks.
      const ask = async (message, _, onPart) => {
        await turn();
        const began = performance.now();
        const { reply } = handle(message, onPart);
        pool.milliseconds += performance.now() - began;
        return reply;
      };
      pool.#workers.push({ ask, busy: 0, stop() {} });
      return pool;
    }
    pool.#workers = await Promise.all(Array.from({ length: count }, () => pool.#start(env)));
    return pool;
  }

  async #start(env) {
    const worker = env.worker();
    const waiting = new Map();
    const listen = (name, take) => (worker.on ? worker.on(name, take) : worker.addEventListener(name, take));
    const failAll = (error) => {
      waiting.forEach(({ reject }) => reject(error));
      waiting.clear();
    };
    listen('message', (event) => {
      const { id, reply, part, milliseconds = 0, error, fatal } = worker.on ? event : event.data;
      const { resolve, reject, onPart } = waiting.get(id) ?? {};
      if (part !== undefined) {
        try {
          onPart?.(part);
        } catch (refusal) {
          // Later messages of the worker are not taken.
          waiting.delete(id);
          reject?.(refusal);
        }
        return;
      }
      waiting.delete(id);
      this.milliseconds += milliseconds;
      if (waiting.size === 0) worker.unref?.();
      if (error !== undefined) reject?.(new Error(fatal ? `lexisplat: ${FAULT} (${error})` : error));
      else resolve?.(reply);
    });
    listen('error', (event) => failAll(new Error(`lexisplat: a worker failed: ${event.message ?? NO_SCRIPT}`)));
    const slot = {
      busy: 0,
      failed: false,
      ask: (message, transfer = [], onPart) =>
        new Promise((resolve, reject) => {
          const id = this.#next++;
          waiting.set(id, { resolve, reject, onPart });
          // Node goes on while an answer is awaited, and ends although a scene was not closed.
          worker.ref?.();
          worker.postMessage({ ...message, id }, transfer);
        }),
      stop: () => {
        worker.terminate();
        failAll(new Error('lexisplat: the scene was closed'));
      },
    };
    await slot.ask({ type: 'module', module: env.module });
    return slot;
  }

  /** How many messages can be answered at the same time. */
  get size() {
    return this.#workers.length;
  }

  /** How many workers have no message that waits. One waits for each, so that workers need not wait for the page. */
  get free() {
    return this.#workers.filter((worker) => worker.busy < 2).length;
  }

  /** Asks the worker that has least to do. `onPart` takes what it sends before its answer. */
  async ask(message, transfer, onPart) {
    const worker = this.#workers.reduce((a, b) => (b.busy < a.busy ? b : a));
    worker.busy++;
    try {
      return await worker.ask(message, transfer, onPart);
    } finally {
      worker.busy--;
    }
  }

  /** Asks all workers the same. */
  askAll(message) {
    return Promise.all(this.#workers.map((worker) => worker.ask(message)));
  }

  close() {
    this.#workers.forEach((worker) => worker.stop());
  }
}

function turn() {
  return new Promise((resolve) => setTimeout(resolve));
}

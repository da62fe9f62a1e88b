/** A packed file of which a page draws what a view shows, within a budget of Gaussians and bytes. */

/** Most requests at the same time. Browsers allow six to a server of HTTP 1.1. */
const REQUESTS = 6;
/** Most chunks of a change that are new, and that are finer than before, so that all of it is decoded within a second or so. */
const CHUNKS = 8;
/** Least milliseconds between two choices of chunks while the view moves. */
const PAUSE = 200;

/**
 * @typedef {object} Budget
 * @property {number} splats most Gaussians that are drawn
 * @property {number} bytes most bytes of the file that are held
 */

/** A promise and what settles it. `Promise.withResolvers` is younger than the browsers that the processor draws for. */
function promised() {
  const made = {};
  made.promise = new Promise((resolve, reject) => Object.assign(made, { resolve, reject }));
  return made;
}

export class Stream {
  /** Resolves when all that the first view shows is drawn. Rejects if that fails. */
  whole;
  /** Whether it was. */
  isWhole = false;
  #source;
  #core;
  #pool;
  #signal;
  #on;
  #budget;
  /** The view of the last choice, and the one to choose for next. */
  #last;
  #eye;
  #chosen = { splats: 0, bytes: 0 };
  #counts = new Map();
  #looked = -Infinity;
  #timer;
  #isLooking = false;
  #requests = 0;
  #isChanging = false;
  #failure;
  #woken = promised();
  #first = promised();
  #settled = promised();

  /**
   * @param {object} input
   * @param {object} input.source where the bytes come from
   * @param {object} input.core the `Stream` of WebAssembly
   * @param {object} input.pool decodes, and was told the start of the file
   * @param {Budget} input.budget
   * @param {AbortSignal} input.signal ends it
   * @param {object} on
   * @param {(change: {removed: number[], parts: {index: number, form: Uint8Array, part: Uint8Array}[]}) => Promise<unknown>} on.change
   *     shows a change, all of it at once
   * @param {() => void} on.progress
   */
  constructor({ source, core, pool, budget, signal }, on) {
    this.#source = source;
    this.#core = core;
    this.#pool = pool;
    this.#budget = budget;
    this.#signal = signal;
    this.#on = on;
    this.whole = this.#first.promise;
    // Before there is a view, the first layer is what there is to see.
    this.#choose(core.begin(budget.splats));
  }

  /** Numbers of Gaussians and bytes that were chosen for the view, and of those that are there. */
  get state() {
    const drawn = [...this.#counts.values()].reduce((sum, count) => sum + count, 0);
    return { ...this.#chosen, drawn, held: this.#core?.held() ?? 0, complete: this.#isComplete };
  }

  get #isComplete() {
    return this.#isLooking && !this.#eye && this.#requests === 0 && !this.#isChanging;
  }

  /** Asks for what `eye` sees, numbers as in the viewer's report. */
  look(eye) {
    const before = this.#eye ?? this.#last;
    if (before && before.every((value, k) => value === eye[k])) return;
    this.#eye = eye;
    this.#wake();
  }

  /** Resolves when all that the view shows is drawn. */
  settled() {
    this.#wake();
    return this.#settled.promise;
  }

  /** Keeps another budget from here on. @param {Budget} budget */
  set budget(budget) {
    this.#budget = budget;
    this.#eye ??= this.#last;
    this.#wake();
  }

  /** Goes on until it is ended. Rejects with the reason if something fails. */
  async run() {
    const wake = () => this.#wake();
    this.#signal?.addEventListener('abort', wake);
    try {
      for (;;) {
        this.#signal?.throwIfAborted();
        if (this.#failure) throw this.#failure.error;
        this.#lookNow();
        this.#request();
        this.#change();
        if (this.#isComplete) {
          this.isWhole = true;
          this.#first.resolve();
          this.#settled.resolve();
          this.#settled = promised();
        }
        await this.#woken.promise;
        this.#woken = promised();
      }
    } catch (error) {
      for (const { promise, reject } of [this.#first, this.#settled]) {
        // Perhaps nobody waits for it.
        promise.catch(() => {});
        reject(error);
      }
      throw error;
    } finally {
      this.#signal?.removeEventListener('abort', wake);
      this.#core.free();
      this.#core = undefined;
    }
  }

  #wake() {
    this.#woken.resolve();
  }

  #fail(error) {
    this.#failure ??= { error };
    this.#wake();
  }

  #choose([splats, bytes]) {
    this.#chosen = { splats, bytes };
  }

  #lookNow() {
    if (!this.#eye) return;
    const left = this.#looked + PAUSE - performance.now();
    if (left > 0) {
      this.#timer ??= setTimeout(() => this.#wake(), left);
      return;
    }
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#looked = performance.now();
    this.#isLooking = true;
    [this.#last, this.#eye] = [this.#eye, undefined];
    this.#choose(this.#core.look(new Float32Array(this.#last), this.#budget.splats, this.#budget.bytes));
  }

  #request() {
    const runs = this.#core.wants(REQUESTS);
    for (let k = 0; k < runs.length; k += 2) {
      const [from, to] = runs.subarray(k, k + 2);
      this.#requests++;
      this.#source
        .range(from, to, this.#signal)
        .then((bytes) => this.#core?.feed(from, bytes))
        .catch((error) => this.#fail(error))
        .finally(() => {
          this.#requests--;
          this.#on.progress();
          this.#wake();
        });
    }
  }

  /** Begins the next change, unless one is under way. */
  #change() {
    const change = this.#isChanging ? undefined : this.#core.change(CHUNKS);
    if (!change) return;
    this.#isChanging = true;
    this.#show(JSON.parse(change))
      .catch((error) => this.#fail(error))
      .finally(() => {
        this.#isChanging = false;
        this.#on.progress();
        this.#wake();
      });
  }

  async #show({ removed, decoded }) {
    const decode = async (index) => {
      const job = this.#core.job(index);
      const { count, form, part } = await this.#pool.ask({ type: 'job', job, as: 'gpu' }, [job.buffer]);
      return { index, count, form, part };
    };
    const parts = await Promise.all(decoded.map(decode));
    removed.forEach((index) => this.#counts.delete(index));
    for (const { index, count } of parts) this.#counts.set(index, count);
    await this.#on.change({ removed, parts });
  }
}

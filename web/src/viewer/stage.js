// The canvas: draws when something changed, coarsely while the view moves, in full when it rests.

// Time without motion after which the picture is drawn in full, in milliseconds.
const REST = 200;
// Time that a picture may take while the view moves, in milliseconds: 30 a second.
const FLUENT = 33;
// Least share of the canvas's width that a picture is drawn at while the view moves.
const COARSEST = 0.25;
// Most pixels along a side that every device of WebGPU can draw (maxTextureDimension2D of its default limits).
const LARGEST = 8192;

/**
 * Draws by a `Viewer` on a canvas. A viewer is asked nothing while it draws, since its calls may not overlap.
 * The canvas is `aria-busy` until it shows the last picture of what was asked for, in full.
 */
export class Stage {
  #viewer;
  #drawing = false;
  #scheduled = 0;
  #resting = 0;
  #moved = -Infinity;
  #scale = 1;
  #again = false;
  #closed = false;
  #queue = [];
  #observer;

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {{drawn: (report: any, moving: boolean) => void, failed: (error: unknown) => void, step: (now: number) => boolean}} on
   *     step is called before each picture and returns whether the view keeps moving by itself
   */
  constructor(canvas, on) {
    this.canvas = canvas;
    this.on = on;
  }

  /** Creates the viewer. Rejects with the reason where this browser cannot draw. */
  async start(Viewer, options) {
    const viewer = await Viewer.create(this.canvas, JSON.stringify(options));
    this.#viewer = viewer;
    if (this.#closed) return this.#proceed();
    this.#observer = new ResizeObserver((entries) => this.#resize(entries[entries.length - 1]));
    try {
      this.#observer.observe(this.canvas, { box: 'device-pixel-content-box' });
    } catch {
      this.#observer.observe(this.canvas);
    }
    this.#proceed();
  }

  /**
   * Calls `change` with the viewer as soon as it does not draw, then draws.
   * @template T
   * @param {(viewer: any) => T | Promise<T>} change
   * @param {boolean} [moving] whether the view moves, so that a coarse picture is enough for now
   * @returns {Promise<T>}
   */
  act(change, moving = false) {
    return new Promise((resolve, reject) => {
      this.#queue.push({ change, moving, resolve, reject });
      this.#proceed();
    });
  }

  /** The share of the canvas's width at which a moving view is drawn fluently, at most 1. */
  get scale() {
    return this.#scale;
  }

  /** Draws with the next frame of the screen. */
  request() {
    if (this.#drawing) this.#again = true;
    else this.#scheduled ||= requestAnimationFrame((now) => this.#frame(now));
    this.#tell();
  }

  #tell() {
    const busy = this.#drawing || this.#again || this.#scheduled !== 0 || this.#resting !== 0 || this.#queue.length > 0;
    if (this.canvas.ariaBusy !== String(busy)) this.canvas.ariaBusy = String(busy);
  }

  /** Frees the viewer. */
  close() {
    cancelAnimationFrame(this.#scheduled);
    clearTimeout(this.#resting);
    this.#observer?.disconnect();
    this.#closed = true;
    this.#proceed();
  }

  // Calls come one after another in the order in which they were asked for.
  #proceed() {
    if (this.#drawing) return;
    if (this.#closed) {
      this.#viewer?.free?.();
      this.#viewer = undefined;
      for (const { reject } of this.#queue.splice(0)) reject(new DOMException('The viewer was closed.', 'AbortError'));
    }
    while (this.#viewer && !this.#drawing && this.#queue.length > 0) {
      const { change, moving, resolve, reject } = this.#queue.shift();
      if (moving) this.#moved = performance.now();
      try {
        const result = change(this.#viewer);
        // A change that takes time holds the viewer, too.
        resolve(result instanceof Promise ? this.#hold(result) : result);
      } catch (error) {
        reject(error);
      }
      this.request();
    }
  }

  async #hold(work) {
    this.#drawing = true;
    try {
      return await work;
    } finally {
      this.#drawing = false;
      if (this.#again) this.request();
      this.#proceed();
      this.#tell();
    }
  }

  async #frame(now) {
    this.#scheduled = 0;
    if (!this.#viewer) return;
    if (this.#drawing) {
      this.#again = true;
      return;
    }
    const viewer = this.#viewer;
    const flies = this.on.step(now);
    if (flies) this.#moved = performance.now();
    const moving = performance.now() - this.#moved < REST;
    this.#again = flies;
    clearTimeout(this.#resting);
    this.#resting = moving ? setTimeout(() => this.#rest(), REST + 1 - (performance.now() - this.#moved)) : 0;
    try {
      const draw = async () => (await viewer.draw(moving ? this.#scale : 1)) && JSON.parse(viewer.report());
      const report = await this.#hold(draw());
      if (this.#closed) return;
      if (report) this.#measured(report, moving);
    } catch (error) {
      clearTimeout(this.#resting);
      this.#resting = 0;
      this.#tell();
      if (!this.#closed) this.on.failed(error);
    }
  }

  #rest() {
    this.#resting = 0;
    this.request();
  }

  // The time of a picture grows with its pixels, the square of its scale.
  #measured(report, moving) {
    const full = report.milliseconds / (moving ? this.#scale ** 2 : 1);
    if (full > 0) this.#scale = Math.min(1, Math.max(COARSEST, Math.sqrt(FLUENT / full)));
    this.on.drawn(report, moving);
  }

  #resize(entry) {
    const exact = entry.devicePixelContentBoxSize?.[0];
    const ratio = exact ? 1 : devicePixelRatio;
    const width = exact?.inlineSize ?? entry.contentRect.width;
    const height = exact?.blockSize ?? entry.contentRect.height;
    const pixels = [width, height].map((side) => Math.min(LARGEST, Math.round(side * ratio)));
    if (Math.min(...pixels) < 1) return;
    this.act((viewer) => viewer.resize(...pixels)).catch(this.on.failed);
  }
}

// The canvas: draws when something changed, coarsely while the view moves, in full when it rests.

import { openViewer } from './engine.js';

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
  /** Why WebGPU does not draw; empty if it does, or was not asked. */
  why = '';
  #viewer;
  #painter;
  /** Whether a picture in full is being drawn on the processor. */
  #thorough = false;
  #lost = false;
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
   * @param {{drawn: (report: any, moving: boolean) => void, failed: (error: unknown) => void, step: (now: number) => boolean, lost: () => void}} on
   *     step is called before each picture and returns whether the view keeps moving by itself; lost is told that the GPU was
   *     lost, and with it all scenes
   */
  constructor(canvas, on) {
    this.canvas = canvas;
    this.on = on;
  }

  /**
   * Creates the viewer. Rejects with the reason where this browser cannot draw.
   * @param {{program: import('./engine.js').Program, forced?: boolean}} options of `openViewer`
   */
  async start(options) {
    await this.#open(options);
    if (this.#closed) return this.#proceed();
    this.#observer = new ResizeObserver((entries) => this.#resize(entries[entries.length - 1]));
    this.#observe();
    this.#proceed();
  }

  /** Creates another viewer in place of the one whose GPU was lost. Rejects with the reason where there is none to be had. */
  async restart(options) {
    await this.act((viewer) => {
      viewer.free?.();
      this.#viewer = undefined;
      return this.#open(options);
    });
    // It tells the new viewer the size at once.
    this.#observer?.disconnect();
    this.#observe();
  }

  async #open(options) {
    this.#lost = false;
    const opened = {};
    const lost = () => {
      if (this.#closed || this.#viewer !== opened.viewer) return;
      this.#lost = true;
      this.on.lost();
    };
    Object.assign(opened, await openViewer({ canvas: this.canvas, lost, ...options }));
    [this.#viewer, this.#painter, this.why] = [opened.viewer, opened.painter, opened.why];
    if (this.#painter) this.#scale = COARSEST;
  }

  #observe() {
    try {
      this.#observer.observe(this.canvas, { box: 'device-pixel-content-box' });
    } catch {
      this.#observer.observe(this.canvas);
    }
  }

  /** Whether the processor draws, which takes its time. */
  get isSlow() {
    return Boolean(this.#painter);
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
      // A moving view does not wait for a picture of where it was.
      if (moving && this.#thorough) this.#painter.stop();
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
    if (this.#thorough) this.#painter.stop();
    this.#proceed();
  }

  // Calls come one after another in the order in which they were asked for.
  #proceed() {
    if (this.#drawing) return;
    if (this.#closed) {
      this.#viewer?.free?.();
      this.#painter?.close();
      this.#viewer = this.#painter = undefined;
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
      this.#thorough = this.isSlow && !moving;
      const draw = async () => (await viewer.draw(moving ? this.#scale : 1)) && JSON.parse(viewer.report());
      const report = await this.#hold(draw()).finally(() => (this.#thorough = false));
      if (this.#closed) return;
      if (report) this.#measured(report, moving);
    } catch (error) {
      clearTimeout(this.#resting);
      this.#resting = 0;
      this.#tell();
      // Of a lost GPU all calls fail.
      if (!this.#closed && !this.#lost) this.on.failed(error);
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

// The way from the viewer to the worker that draws on the processor, and from there to the screen.

import { make } from './dom.js';

// What is said when the WebAssembly of the worker failed, which happens when memory runs out.
const FAULT = 'The processor’s renderer failed, perhaps for lack of memory';
// What is said of a worker that never began. Browsers give no reason.
const NO_SCRIPT = 'its script could not be loaded: is it where the package’s other files are, and does the page allow it (worker-src)?';

// Places of the numbers that `Viewer.begin` gives: whether the last pictures are arranged anew, the arrangement, the place on the
// canvas, and the view.
const [ARRANGEMENT, PLACE, VIEW] = [1, 4, 8];

/** The worker, and the canvas on which its pictures are shown. */
export class Painter {
  #worker;
  #waiting = new Map();
  #next = 1;
  #pen;
  #coarse;
  #shown;

  /**
   * Starts the worker.
   * @param {import('./engine.js').Processor | undefined} parts
   * @param {HTMLCanvasElement} canvas what takes the pointer; pictures are shown on a canvas of their own over it, since one
   *     that WebGPU had cannot be painted on
   */
  static async open(parts, canvas) {
    if (!parts) throw new Error('The parts that draw on the processor are not there.');
    const painter = new Painter(canvas, parts.worker());
    try {
      await painter.#ask({ type: 'module', module: await parts.compile() });
    } catch (error) {
      painter.close();
      throw error;
    }
    return painter;
  }

  constructor(canvas, worker) {
    this.element = make('canvas', { class: 'picture', 'aria-hidden': 'true' });
    canvas.after(this.element);
    // The browser may have no GPU either.
    this.#pen = this.element.getContext('2d', { alpha: false, willReadFrequently: true });
    this.#coarse = document.createElement('canvas').getContext('2d', { alpha: false, willReadFrequently: true });
    this.#worker = worker;
    worker.addEventListener('message', ({ data: { id, reply, error, fatal } }) => {
      const { resolve, reject } = this.#waiting.get(id) ?? {};
      this.#waiting.delete(id);
      if (error === undefined) resolve?.(reply);
      else reject?.(new Error(fatal ? `${FAULT} (${error}).` : error));
    });
    worker.addEventListener('error', (event) => this.#failAll(new Error(`The worker of the processor’s renderer failed: ${event.message ?? NO_SCRIPT}`)));
  }

  /**
   * Draws for a viewer: from here on its own calls go to the worker, too.
   * @param {any} viewer of `Viewer.on_processor`
   */
  serve(viewer) {
    const own = (name) => viewer[name].bind(viewer);
    const [form, part, removePart, remove, resize] = ['form', 'part', 'remove_part', 'remove', 'resize'].map(own);
    return Object.assign(viewer, {
      form: async (slot, bytes, info) => {
        await form(slot, bytes, info);
        await this.#ask({ type: 'form', slot, bytes }, [bytes.buffer]);
      },
      part: async (slot, index, bytes) => {
        await part(slot, index, bytes);
        await this.#ask({ type: 'part', slot, index, bytes }, [bytes.buffer]);
      },
      remove_part: (slot, index) => {
        removePart(slot, index);
        this.#tell({ type: 'removePart', slot, index });
      },
      remove: (slot) => {
        remove(slot);
        this.#tell({ type: 'remove', slot });
      },
      resize: (width, height) => {
        resize(width, height);
        this.#resize(width, height);
      },
      draw: (scale) => this.#draw(viewer, scale),
      picture: () => this.picture(),
    });
  }

  async #draw(viewer, scale) {
    const began = performance.now();
    const numbers = viewer.begin(scale);
    if (!numbers) return false;
    const [mode, split, gain] = numbers.subarray(ARRANGEMENT);
    const view = numbers[0] === 1 ? undefined : numbers.slice(VIEW);
    const reply = await this.#ask({ type: 'draw', view, mode, split, gain });
    // It was stopped.
    if (!reply) return false;
    const { figures, ...shown } = reply;
    const background = [...numbers.slice(-3)].map((share) => `${100 * share}%`);
    this.#pen.fillStyle = `rgb(${background.join(' ')})`;
    this.#pen.fillRect(0, 0, this.element.width, this.element.height);
    if (shown.data) {
      this.#shown = shown;
      this.#show(numbers.subarray(PLACE, VIEW));
    }
    viewer.drawn(Float64Array.of(performance.now() - began, ...figures));
    return true;
  }

  /** What is shown: width, height, and red, green, blue and opacity of each pixel. */
  picture() {
    return this.#shown ?? { width: 0, height: 0, data: new Uint8Array() };
  }

  /** Stops the picture that is being drawn. */
  stop() {
    this.#worker.postMessage({ type: 'stop' });
  }

  /** Ends the worker. */
  close() {
    this.#worker.terminate();
    this.#failAll(new DOMException('The viewer was closed.', 'AbortError'));
    this.element.remove();
  }

  #resize(width, height) {
    Object.assign(this.element, { width, height });
    // A canvas of another size is empty.
    if (this.#shown) this.#show([0, 0, width, height]);
  }

  #show([left, top, across, down]) {
    const { width, height, data } = this.#shown;
    const image = new ImageData(new Uint8ClampedArray(data.buffer, data.byteOffset, data.length), width, height);
    if (width === across && height === down) return this.#pen.putImageData(image, left, top);
    Object.assign(this.#coarse.canvas, { width, height });
    this.#coarse.putImageData(image, 0, 0);
    this.#pen.drawImage(this.#coarse.canvas, left, top, across, down);
  }

  #ask(message, transfer = []) {
    return new Promise((resolve, reject) => {
      const id = this.#next++;
      this.#waiting.set(id, { resolve, reject });
      this.#worker.postMessage({ ...message, id }, transfer);
    });
  }

  // What goes wrong is told by what is asked next.
  #tell(message) {
    this.#ask(message).catch(() => {});
  }

  #failAll(error) {
    this.#waiting.forEach(({ reject }) => reject(error));
    this.#waiting.clear();
  }
}

// <lexi-viewer>: the viewer in any page.

import { App } from './app.js';
import { listenToDrops } from './drop.js';
import { obstacle } from './engine.js';
import { folder } from './folder.js';

const ATTRIBUTES = ['src', 'src2', 'poster', 'mode', 'controls', 'alt', 'camera', 'annotations', 'still', 'budget', 'budget-bytes', 'renderer'];
// Attributes that are there or not.
const FLAGS = ['still'];
// Attributes after a change of which the element begins anew.
const SHAPES = ['controls', 'still', 'renderer'];
// A number of a camera, not a place.
const NUMBER = /^\s*\d+\s*$/;
// Where there is no browser the module can still be loaded, as servers that prepare pages do.
const Base = globalThis.HTMLElement ?? class {};

/**
 * Shows a scene, or two to compare. It begins when it is seen; with a poster, when it is asked to.
 *
 * Attributes, which are properties, too (`budgetBytes` for `budget-bytes`): `src` and `src2` (addresses), `poster` (address of a still picture), `mode`
 * (first, second, side, wipe or difference; follows what the user chooses), `controls` (nothing for a small bar, `all` for the
 * panel, `none`), `camera` (the first view: a link's text, or its part after `view=`), `annotations` (JSON: a list of `at`,
 * `text`, `view`), `still` (the scene does not turn by itself), `budget` and `budget-bytes` (most Gaussians that are drawn of a
 * .lexi, and bytes of it that are held; of a larger one is drawn what the view shows), `renderer` (`processor` draws without WebGPU, as
 * browsers that have none do), `alt` (what the scene is, in words). Events: `load`, `progress`, `error`, each with a `detail`.
 */
export class LexiViewer extends Base {
  /** Where the program's parts are. Set it before the first element begins if they are not beside this file. */
  static program = folder;
  static observedAttributes = ATTRIBUTES;

  #app;
  #seen;
  #stop;
  #begun = false;

  constructor() {
    super();
    this.attachShadow({ mode: 'open' });
  }

  connectedCallback() {
    const on = (name, detail) => this.#told(name, detail);
    this.#stop = new AbortController();
    // A scene that was begun before the element was moved, or changed its shape, goes on without being asked for again.
    const goesOn = this.#begun;
    this.#begun = false;
    this.#app = new App(this.shadowRoot, {
      program: LexiViewer.program,
      controls: this.#controls(),
      still: this.still,
      renderer: this.renderer,
      budget: this.#budget(),
      whole: false,
      poster: this.poster,
      label: this.alt,
      on,
    });
    this.#app.annotate(this.annotations);
    if (this.#controls() === 'all') {
      listenToDrops(this, {
        signal: this.#stop.signal,
        hover: (over) => this.#app?.element.classList.toggle('over', over),
        take: (files, first) => this.#app?.take(files, first),
      });
    }
    if (this.poster && !goesOn && !obstacle()) return this.#app.notice.begin(() => this.start());
    this.#seen = new IntersectionObserver((entries) => {
      if (entries.some((entry) => entry.isIntersecting)) this.start();
    });
    this.#seen.observe(this);
  }

  disconnectedCallback() {
    this.#seen?.disconnect();
    this.#stop?.abort();
    this.#app?.close();
    this.#app = undefined;
  }

  attributeChangedCallback(name, before, after) {
    if (!this.#app || before === after) return;
    if (SHAPES.includes(name)) {
      this.disconnectedCallback();
      this.connectedCallback();
    } else if (name === 'poster') this.#app.notice.poster(after);
    else if (name === 'alt') this.#app.label(after);
    else if (name === 'annotations') this.#app.annotate(after);
    else if (name.startsWith('budget')) this.#app.budget(this.#budget());
    else if (!this.#begun) return;
    else if (name === 'camera') this.#app.arrange(this.#view());
    else if (name !== 'mode') this.#open(name === 'src' ? 0 : 1, after);
    else if (after && after !== this.report?.mode) this.#app.run(`mode=${after}`).catch((error) => this.#app?.fail(error));
  }

  /** Begins now. Resolves with whether this browser can draw. */
  async start() {
    if (!this.#app) return false;
    this.#seen?.disconnect();
    if (!this.#begun) {
      this.#begun = true;
      this.#app.notice.begun();
      this.#app.arrange(this.#view());
      for (const [slot, source] of [this.src, this.src2].entries()) if (source) this.#open(slot, source);
    }
    return this.#app.start();
  }

  /** Opens a scene in slot 0 or 1: an address, or a file. Resolves with whether all of it came. */
  async open(source, slot = 0) {
    await this.start();
    return this.#app?.open(source, slot) ?? false;
  }

  /** Carries out words of a script of `lexisplat view`. Rejects with the reason if one is wrong. */
  async run(words) {
    return this.#app?.run(words);
  }

  /** Returns the value of `camera` for the view that is shown. */
  async link() {
    return this.#app?.link();
  }

  /** The scenes that are shown, and their figures; undefined before there is a picture. */
  get report() {
    const report = this.#app?.report;
    return report && { ...report, streams: this.#app.loads.streams };
  }

  #budget() {
    return { splats: this.budget, bytes: this.budgetBytes };
  }

  #controls() {
    return ['all', 'none'].includes(this.controls) ? this.controls : 'bar';
  }

  // The first view in words and as a link.
  #view() {
    const { camera, mode } = this;
    const isLink = camera.includes('=');
    const place = camera && !isLink && (NUMBER.test(camera) ? `camera=${camera.trim()}` : `view=${camera.trim()}`);
    return { words: [place, mode && `mode=${mode}`].filter(Boolean).join(','), link: isLink ? camera.replace(/^#/, '') : '' };
  }

  #open(slot, source) {
    if (source) this.#app.open(source, slot);
    else this.#app.remove(slot);
  }

  #told(name, detail) {
    if (name !== 'view') return void this.dispatchEvent(new CustomEvent(name, { detail }));
    // The choice between two scenes is kept in the page; one scene alone leaves nothing to choose.
    if (detail.models.every(Boolean) && this.mode !== detail.mode) this.mode = detail.mode;
  }
}

for (const name of ATTRIBUTES) {
  const flag = FLAGS.includes(name);
  const property = name.replace(/-(.)/g, (_, letter) => letter.toUpperCase());
  Object.defineProperty(LexiViewer.prototype, property, {
    configurable: true,
    enumerable: true,
    get() {
      return flag ? this.hasAttribute(name) : (this.getAttribute(name) ?? '');
    },
    set(value) {
      if (flag) this.toggleAttribute(name, Boolean(value));
      else if (value === null || value === undefined) this.removeAttribute(name);
      else this.setAttribute(name, value);
    },
  });
}

globalThis.customElements?.define('lexi-viewer', LexiViewer);

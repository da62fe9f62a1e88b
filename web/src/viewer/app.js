// The viewer: a canvas with what lies over it, and the panel. The page and the custom element are made of it.

import { load as loadEngine, obstacle } from './engine.js';
import { make, reason } from './dom.js';
import { makeDock } from './dock.js';
import { makeHint } from './hint.js';
import { budgetOf } from './budget.js';
import { Keys } from './keys.js';
import { Loads } from './loads.js';
import { makeMarks, parseMarks } from './marks.js';
import { makeMessages, makeOverlay } from './overlay.js';
import { makeNotice } from './notice.js';
import { makePanel } from './panel.js';
import { listenToPointers } from './pointer.js';
import { save } from './picture.js';
import { Stage } from './stage.js';
import { adopt } from './style.js';
import { Turn, wantsStill } from './turn.js';

/** Ends of the names of files that are read. */
export const EXTENSIONS = ['.lexi', '.ply', '.spz', '.sog', '.splat', '.ksplat', '.glb'];

/** Losses of the GPU after which it is still asked again. */
const MOST_LOSSES = 1;

/** Words of a script, or parts of a link, that say where the view is from. */
const PLACES = /^\s*(view|camera|orbit|frame)\b/;

/**
 * @typedef {object} Options
 * @property {import('./engine.js').Program} program where the program's parts are
 * @property {'all' | 'bar' | 'none'} controls the whole panel, a small bar, or nothing
 * @property {boolean} [still] whether the scene does not turn by itself
 * @property {boolean} whole whether the viewer is all of its page, which then takes keys and the wheel from everywhere
 * @property {string} [renderer] `processor` draws on the processor in any case; else that is what draws where there is no WebGPU
 * @property {{splats?: number | string, bytes?: number | string}} [budget] most Gaussians that are drawn of a .lexi, and bytes of it that are held
 * @property {string} [poster] address of a still picture, shown until the scene is
 * @property {string} [label] what the scene is, for those who do not see it
 * @property {() => void} [link] copies a link; leaves the button out if there is none
 * @property {(name: string, detail?: any) => void} on is told of `load`, `progress`, `error` and `view` (a new picture)
 */

export class App {
  /** The viewer's report of its last picture. */
  report;
  #stop = new AbortController();
  #begun;
  #home = '';
  #isTouched = false;
  #wanted = { words: '', link: '', slots: new Set() };
  #losses = 0;

  /** @param {ShadowRoot} root @param {Options} options */
  constructor(root, options) {
    this.options = options;
    this.root = root;
    const { signal } = this.#stop;
    const run = (words) => this.run(words).catch((error) => this.fail(error));
    this.canvas = make('canvas', { tabIndex: 0, role: 'application' });
    this.overlay = makeOverlay((split) => run(`split=${split}`));
    this.messages = makeMessages();
    const all = options.controls === 'all';
    this.notice = makeNotice({ poster: options.poster, open: all && (() => this.choose()) });
    this.hint = makeHint(options.whole);
    this.marks = makeMarks((view) => {
      this.#touched();
      run(`view=${view}`);
    });
    this.files = make('input', { type: 'file', multiple: true, accept: EXTENSIONS.join(','), hidden: true });
    this.files.addEventListener('change', () => {
      this.take(this.files.files);
      this.files.value = '';
    });
    const full = document.fullscreenEnabled ? () => this.fullScreen() : undefined;
    const reset = () => this.reset();
    if (all) {
      this.panel = makePanel({
        run,
        reset,
        full,
        open: () => this.choose(),
        link: options.link,
        picture: () => this.picture(),
        remove: (slot) => this.remove(slot),
        cancel: (slot) => this.loads.cancel(slot),
      });
    } else if (options.controls === 'bar') {
      this.dock = makeDock({ run, reset, full, turn: () => (this.turn.on ? this.turn.stop() : this.turn.start(true)) });
    }
    this.label(options.label);
    const over = [this.notice.element, this.marks.element, this.overlay.element, this.hint.element];
    const view = make('div', { class: 'view' }, this.canvas, ...over);
    const look = ['app', options.whole && 'whole', !all && 'clean'].filter(Boolean).join(' ');
    this.element = make('div', { class: look }, view, this.messages.element);
    if (options.whole) this.element.prepend(make('h1', { class: 'unseen' }, 'Viewer of Gaussian splats'));
    if (this.panel) this.element.append(this.panel.element, this.files);
    if (this.dock) this.element.append(this.dock.element);
    adopt(root);
    root.append(this.element);

    this.stage = new Stage(this.canvas, {
      drawn: (report, moving) => this.#update(report, moving),
      failed: (error) => this.fail(error),
      lost: () => this.#lost().catch((error) => this.#cannot(error)),
      step: (now) => {
        const act = (change) => this.stage.act(change, true).catch(() => {});
        const flies = this.keys.fly(now, act);
        return this.turn.step(now, act) || flies;
      },
    });
    this.turn = new Turn(this.stage, { element: this.element, signal, changed: () => this.dock?.update(this.report, this.turn.on) });
    this.loads = new Loads(this.stage, this.#budget(), {
      changed: (slot) => this.#changed(slot),
      formed: () => this.#tell(() => {}).catch((error) => this.fail(error)),
      begun: (slot) => this.#first(slot),
      loaded: (slot, load) => {
        this.#welcome();
        options.on('load', { slot, name: load.name, ...this.report?.models[slot] });
      },
      failed: (slot, message, error) => this.fail(message, error),
    });
    const own = { p: () => this.picture(), h: () => this.panel?.toggle(), r: reset };
    const touched = () => this.#touched();
    this.keys = new Keys(options.whole ? window : root, this.stage, { signal, own, touched });
    listenToPointers(this.stage, { signal, touched, wheel: () => options.whole || root.activeElement === this.canvas });
    // A wide panel leaves the picture room, a narrow one would not.
    this.panel?.show(this.element.clientWidth >= 640);
    this.#look();
  }

  /** Loads the program and takes hold of the GPU. Resolves with whether this browser can draw; says why if not. */
  start() {
    this.#begun ??= this.#start();
    return this.#begun;
  }

  /** Loads a scene into a slot. Resolves with whether all of it came. Never rejects. */
  async open(source, slot = 0) {
    this.#wanted.slots.add(slot);
    this.notice.busy();
    if (!(await this.start()) || this.#stop.signal.aborted) return false;
    const { env } = await loadEngine(this.options.program);
    return this.loads.open(source, slot, env);
  }

  /** Opens files: two as both scenes, one as the second if there is a first, and not `first`. */
  async take(list, first = false) {
    const files = [...list];
    if (files.length === 0) return this.fail('That was no file.');
    if (files.length > 2) this.messages.add(`${files.length} files were given. The first two are opened.`);
    this.#wanted = { words: '', link: '', slots: new Set() };
    const one = first || !this.#occupied(0) ? 0 : 1;
    const opened = files.length === 1 ? [this.open(files[0], one)] : [this.open(files[0], 0), this.open(files[1], 1)];
    await Promise.all(opened);
  }

  /** Empties a slot. */
  remove(slot) {
    this.loads.remove(slot);
    return this.#tell((viewer) => viewer.remove(slot)).catch((error) => this.fail(error));
  }

  /** Carries out words of a script of `lexisplat view`. Rejects with the reason if one is wrong. */
  run(words) {
    return this.#tell((viewer) => viewer.run(words));
  }

  /** Arranges the view by words or a link, now and again as the scenes of the page come. */
  arrange({ words = this.#wanted.words, link = this.#wanted.link }) {
    this.#wanted = { ...this.#wanted, words, link };
    const home = [...words.split(','), ...link.split('&')].filter((word) => PLACES.test(word));
    if (home.length > 0) this.#home = home.join(',');
    const [, behind] = /background=([^,&]+)/.exec(link || words) ?? [];
    const colour = behind?.split(':').map((share) => `${100 * share}%`);
    if (colour?.length === 3) this.element.style.setProperty('--picture', `rgb(${colour.join(' ')})`);
    if (!this.report?.models.some(Boolean)) return;
    // With no scene to come, nothing else would say it.
    if (words && this.#wanted.slots.size === 0) this.run(words).catch((error) => this.fail(error));
    this.#arranged();
  }

  /** Returns to the first view: the one that was asked for, or else that of the scene. */
  async reset() {
    this.#touched();
    try {
      await this.stage.act((viewer) => viewer.key('r'));
      if (this.#home) await this.run(this.#home);
    } catch (error) {
      this.fail(error);
    }
  }

  /** Draws within another budget. @param {Options['budget']} budget */
  budget(budget) {
    this.options.budget = budget;
    this.loads.budget = this.#budget();
  }

  #budget() {
    return budgetOf(this.options.budget, this.stage.isSlow);
  }

  /** Shows annotations, a text that `parseMarks` reads. */
  annotate(text) {
    try {
      this.marks.set(parseMarks(text));
      if (this.report) this.marks.update(this.report);
    } catch (error) {
      this.fail(error);
    }
  }

  /** The link's text for what is shown. */
  link() {
    return this.stage.act((viewer) => viewer.link());
  }

  /** Saves what is shown as a PNG. */
  async picture() {
    try {
      const picture = await this.stage.act((viewer) => viewer.picture());
      const name = await save(picture, this.report?.models.find(Boolean)?.name);
      this.messages.add(`${name} was saved`);
    } catch (error) {
      this.fail(error);
    }
  }

  /** Fills the screen, or returns from there. */
  async fullScreen() {
    const host = this.options.whole ? document.documentElement : this.root.host;
    try {
      if (document.fullscreenElement) await document.exitFullscreen();
      else await host.requestFullscreen();
    } catch {
      this.fail('The browser does not allow full screen here.');
    }
  }

  /** Lets people choose files. */
  choose() {
    this.files.click();
  }

  /** Says what is shown to those who do not see it. */
  label(text) {
    this.canvas.setAttribute('aria-label', text || 'The scene. Arrow keys orbit, W A S D Q E fly.');
  }

  /** Shows what went wrong, and tells the page. */
  fail(message, error = message) {
    if (this.#stop.signal.aborted || error?.name === 'AbortError') return;
    this.messages.add(message, { wrong: true });
    this.options.on('error', { message: reason(message) });
    this.#look();
  }

  /** Stops everything and frees the GPU's memory. */
  close() {
    this.#stop.abort();
    for (const slot of [0, 1]) this.loads.cancel(slot);
    this.stage.close();
    this.element.remove();
  }

  async #start() {
    const { signal } = this.#stop;
    const missing = obstacle();
    if (missing) return this.#cannot(missing);
    try {
      await this.stage.start(this.#renderer());
      this.#begin();
      if (this.#wanted.words) await this.run(this.#wanted.words);
    } catch (error) {
      return this.#cannot(error);
    }
    return !signal.aborted;
  }

  // A GPU that is lost again and again is not asked any more.
  #renderer() {
    const { program, renderer } = this.options;
    return { program, forced: renderer === 'processor' || this.#losses > MOST_LOSSES };
  }

  // What depends on who draws.
  #begin() {
    this.loads.budget = this.#budget();
    this.overlay.note(this.stage.isSlow && this.options.controls !== 'none' ? this.stage.why : undefined);
  }

  // Scenes are loaded again, since they were in the memory of the GPU.
  async #lost() {
    this.#losses++;
    const link = await this.link();
    const sources = this.loads.slots.map((load) => load?.source);
    for (const slot of [0, 1]) this.loads.remove(slot);
    await this.stage.restart(this.#renderer());
    this.#begin();
    this.#wanted = { words: '', link, slots: new Set() };
    sources.forEach((source, slot) => source && this.open(source, slot));
  }

  #cannot(why) {
    if (this.#stop.signal.aborted) return false;
    this.element.classList.add('still');
    this.notice.cannot(reason(why));
    this.options.on('error', { message: reason(why) });
    return false;
  }

  // Changes the viewer and shows what it says then, before it draws.
  async #tell(change) {
    const report = await this.stage.act((viewer) => {
      change(viewer);
      return JSON.parse(viewer.report());
    });
    this.#update(report);
  }

  #first(slot) {
    this.#arranged();
    this.#wanted.slots.delete(slot);
  }

  // A new scene moves the camera and may change the mode, so that what is wanted is said after it.
  #arranged() {
    const { words, link, slots } = this.#wanted;
    if (words && slots.size > 0) this.#tell((viewer) => viewer.run(words)).catch((error) => this.fail(error));
    if (link) {
      this.#tell((viewer) => viewer.set_link(link)).catch((error) => {
        this.#wanted.link = '';
        this.fail(`The view of the link could not be shown: ${reason(error)}`, error);
      });
    }
    if (slots.size <= 1) this.#wanted = { ...this.#wanted, words: '', link: '' };
  }

  #changed(slot) {
    const load = this.loads.slots[slot];
    this.panel?.cards[slot].load(load);
    if (load?.progress) this.options.on('progress', { slot, ...load.progress });
    this.#look();
  }

  #update(report, moving = false) {
    if (this.#stop.signal.aborted) return;
    // Coarse pictures may have no PSNR; the last one stays rather than to flicker.
    if (moving && !report.identical) report.psnr ??= this.report?.psnr ?? null;
    this.report = report;
    this.overlay.update(report);
    this.panel?.update(report);
    this.marks.update(report);
    this.loads.look(report.eye);
    this.#look();
    this.options.on('view', report);
  }

  #occupied(slot) {
    return Boolean(this.report?.models[slot] || this.loads.slots[slot]);
  }

  // The notice, or the still picture, is there until something of a scene is drawn.
  #look() {
    const load = this.loads?.slots.find((load) => load?.active);
    const { models = [], drawn = [] } = this.report ?? {};
    const shown = models.some(Boolean) && (!load || drawn.some((count) => count > 0));
    this.element.classList.toggle('shown', shown);
    this.notice.update({ shown, load });
    this.dock?.update(shown ? this.report : undefined, Boolean(this.turn?.on));
    this.dock?.load(shown ? load : undefined);
  }

  // One scene that is whole turns until somebody touches it.
  #welcome() {
    if (this.#isTouched || this.options.controls === 'all') return;
    this.hint.show();
    if (!this.options.still && !wantsStill() && !this.#occupied(1)) this.turn.start();
  }

  #touched() {
    this.#isTouched = true;
    this.hint.hide();
    this.turn.stop();
  }
}

// Scenes on their way into the two slots of the viewer.

import { percent, shareOf } from './arrival.js';
import { reason } from './dom.js';

// Most bytes that a scene and its drawing may take in memory, that of the GPU or of the processor. Phones end pages that take more.
const MEMORY = 2 ** 30;

/** The state of a scene that is being loaded, or was.
 * @typedef {object} Load
 * @property {string} name
 * @property {string | URL | Blob} source what it is loaded from
 * @property {boolean} file whether it is a file, not an address
 * @property {boolean} active whether bytes still come
 * @property {boolean} shown whether the viewer has it
 * @property {boolean} begun whether there is something to see of it
 * @property {Promise<unknown>} [last] the last part on its way to the viewer; those before are done when it is
 * @property {any} [info] what its header says
 * @property {import('../stream.js').Stream} [stream] of a scene of which only what a view shows is drawn
 * @property {{loaded: number, total?: number, decoded: number, gaussians: number, ms: number, stalled?: number}} [progress]
 */

export class Loads {
  /** @type {(Load | undefined)[]} the load of each slot */
  slots = [undefined, undefined];
  #stops = [undefined, undefined];
  #budget;
  #eye;

  /**
   * `formed` is told that the viewer has a scene, `begun` that there is something to see of it.
   * @param {import('./stage.js').Stage} stage
   * @param {import('../stream.js').Budget} budget
   * @param {{changed: (slot: number) => void, formed: (slot: number) => void, begun: (slot: number) => void, loaded: (slot: number, load: Load) => void,
   *     failed: (slot: number, message: string, error: unknown) => void}} on
   */
  constructor(stage, budget, on) {
    this.stage = stage;
    this.#budget = budget;
    this.on = on;
  }

  /**
   * Loads a scene. The scene of the slot stays until the first bytes of the new scene are understood. Never rejects.
   * @param {string | URL | Blob} source
   * @param {0 | 1} slot
   * @param {any} env of `engine.load`
   * @returns {Promise<boolean>} whether it was loaded to the end
   */
  async open(source, slot, env) {
    this.cancel(slot);
    const stop = new AbortController();
    const before = this.slots[slot]?.shown ? this.slots[slot] : undefined;
    const load = { name: nameOf(source), source, file: source instanceof Blob, active: true, shown: false, begun: false, progress: undefined };
    this.#stops[slot] = stop;
    this.slots[slot] = load;
    this.on.changed(slot);
    // The viewer refuses what does not fit it, after which further bytes are of no use. On the processor coarse pictures have to do
    // until all of it came, since each part would wait for a picture in full.
    let refusal;
    const act = (change) =>
      this.stage.act((viewer) => stop.signal.aborted || change(viewer), this.stage.isSlow).catch((error) => {
        refusal ??= error;
        stop.abort();
      });
    const pending = [];
    try {
      const { show } = await import('../session.js');
      await show(source, {
        env,
        slot,
        signal: stop.signal,
        budget: this.#budget,
        memory: MEMORY,
        onForm: (bytes, info) => {
          load.info = info;
          const formed = act((viewer) => viewer.form(slot, bytes, JSON.stringify({ ...info, name: load.name })));
          pending.push(formed.then(() => stop.signal.aborted || this.#formed(slot, load)));
          return formed;
        },
        onPart: (index, bytes) => {
          const part = act((viewer) => viewer.part(slot, index, bytes));
          if (!load.begun) pending.push(part.then(() => stop.signal.aborted || this.#begun(slot, load)));
          load.last = part;
          return part;
        },
        onChange: ({ removed, parts }) => {
          const change = act(async (viewer) => {
            removed.forEach((index) => viewer.remove_part(slot, index));
            for (const { index, part } of parts) await viewer.part(slot, index, part);
          });
          if (!load.begun) pending.push(change.then(() => stop.signal.aborted || this.#begun(slot, load)));
          load.last = change;
          return change;
        },
        onStream: (stream) => {
          load.stream = stream;
          // A scene beside another is seen from where that is.
          if (this.#eye && this.slots[1 - slot]?.shown) stream.look(this.#eye);
        },
        onFail: (error) => {
          if (!stop.signal.aborted) this.on.failed(slot, named(load.name, reason(error)), error);
        },
        onProgress: (progress) => {
          load.progress = progress;
          if (!stop.signal.aborted) this.on.changed(slot);
        },
      });
      await Promise.all([...pending, load.last]);
      if (refusal) throw refusal;
      if (stop.signal.aborted) return false;
      load.active = false;
      this.#begun(slot, load);
      this.on.loaded(slot, load);
      return true;
    } catch (error) {
      await Promise.all([...pending, load.last]);
      load.active = false;
      const replaced = this.slots[slot] !== load;
      if (!replaced && !load.shown) this.slots[slot] = before;
      const wrong = refusal ?? error;
      if (refusal || !stop.signal.aborted) this.on.failed(slot, `${named(load.name, reason(wrong))}${rest(load)}`, wrong);
      return false;
    } finally {
      load.active = false;
      this.on.changed(slot);
    }
  }

  /** Tells scenes of which a part is drawn from where they are seen. @param {number[] | null} eye as in the viewer's report */
  look(eye) {
    if (!eye) return;
    this.#eye = eye;
    for (const load of this.slots) load?.stream?.look(eye);
  }

  /** Keeps another budget from here on. */
  set budget(budget) {
    this.#budget = budget;
    for (const load of this.slots) if (load?.stream) load.stream.budget = budget;
  }

  /** The states of the streams of both scenes; undefined for a scene that is drawn whole. */
  get streams() {
    return this.slots.map((load) => load?.stream?.state);
  }

  /** Stops the load of a slot. Its shown part stays. */
  cancel(slot) {
    this.#stops[slot]?.abort();
    this.#stops[slot] = undefined;
  }

  /** Empties a slot. */
  remove(slot) {
    this.cancel(slot);
    this.slots[slot] = undefined;
    this.on.changed(slot);
  }

  #begun(slot, load) {
    if (!load.begun) this.on.begun(slot);
    load.begun = true;
  }

  #formed(slot, load) {
    if (!load.shown) {
      load.shown = true;
      this.on.formed(slot);
    }
  }
}

// The decoder begins what it says with the name.
function named(name, text) {
  return text.startsWith(`${name}:`) ? text : `${name}: ${text}`;
}

function rest(load) {
  if (!load.shown) return '';
  const share = shareOf(load);
  return share === undefined ? ' What had come of it stays.' : ` ${percent(share)} of it had come, which stays.`;
}

// A file's name, or the last part of an address.
function nameOf(source) {
  if (source instanceof Blob) return source.name || 'scene';
  try {
    const { pathname, hostname } = new URL(source, document.baseURI);
    return decodeURIComponent(pathname.split('/').pop()) || hostname || 'scene';
  } catch {
    return String(source);
  }
}

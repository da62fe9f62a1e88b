// Scenes on their way into the two slots of the viewer.

import { show } from '../session.js';
import { reason } from './dom.js';

// Most bytes of files that are held at once while they are decoded.
const BUDGET = 256 * 2 ** 20;

/** What is known of a scene that is being loaded, or was.
 * @typedef {object} Load
 * @property {string} name
 * @property {boolean} file whether it is a file, not an address
 * @property {boolean} active whether bytes still come
 * @property {boolean} shown whether the viewer has it
 * @property {{loaded: number, total?: number, decoded: number, gaussians: number, ms: number}} [progress]
 */

export class Loads {
  /** @type {(Load | undefined)[]} the load of each slot */
  slots = [undefined, undefined];
  #stops = [undefined, undefined];

  /**
   * @param {import('./stage.js').Stage} stage
   * @param {{changed: (slot: number) => void, formed: (slot: number) => void, loaded: (slot: number, load: Load) => void,
   *     failed: (slot: number, message: string, error: unknown) => void}} on
   */
  constructor(stage, on) {
    this.stage = stage;
    this.on = on;
  }

  /**
   * Loads a scene. What the slot shows stays until the first bytes of the new scene are understood. Never rejects.
   * @param {string | URL | Blob} source
   * @param {0 | 1} slot
   * @param {any} env of `engine.load`
   * @returns {Promise<boolean>} whether it was loaded to the end
   */
  async open(source, slot, env) {
    this.cancel(slot);
    const stop = new AbortController();
    const before = this.slots[slot]?.shown ? this.slots[slot] : undefined;
    const load = { name: nameOf(source), file: source instanceof Blob, active: true, shown: false, progress: undefined };
    this.#stops[slot] = stop;
    this.slots[slot] = load;
    this.on.changed(slot);
    // The viewer refuses what does not fit it, after which further bytes are of no use.
    let refusal;
    const act = (change) =>
      this.stage.act((viewer) => stop.signal.aborted || change(viewer)).catch((error) => {
        refusal ??= error;
        stop.abort();
      });
    const pending = [];
    try {
      await show(source, {
        env,
        slot,
        signal: stop.signal,
        budget: BUDGET,
        onForm: (bytes, info) => {
          const formed = act((viewer) => viewer.form(slot, bytes, JSON.stringify({ ...info, name: load.name })));
          pending.push(formed.then(() => stop.signal.aborted || this.#formed(slot, load)));
          return formed;
        },
        onPart: (index, bytes) => {
          const part = act((viewer) => viewer.part(slot, index, bytes));
          pending.push(part);
          return part;
        },
        onProgress: (progress) => {
          load.progress = progress;
          if (!stop.signal.aborted) this.on.changed(slot);
        },
      });
      await Promise.all(pending);
      if (refusal) throw refusal;
      if (stop.signal.aborted) return false;
      load.active = false;
      this.on.loaded(slot, load);
      return true;
    } catch (error) {
      await Promise.all(pending);
      load.active = false;
      const replaced = this.slots[slot] !== load;
      if (!replaced && !load.shown) this.slots[slot] = before;
      const wrong = refusal ?? error;
      if (refusal || !stop.signal.aborted) this.on.failed(slot, `${load.name}: ${reason(wrong)}${rest(load)}`, wrong);
      return false;
    } finally {
      load.active = false;
      this.on.changed(slot);
    }
  }

  /** Stops the load of a slot. What was shown of it stays. */
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

  #formed(slot, load) {
    if (!load.shown) {
      load.shown = true;
      this.on.formed(slot);
    }
  }
}

function rest(load) {
  if (!load.shown) return '';
  const { decoded, gaussians } = load.progress ?? {};
  const part = gaussians > 0 ? ` ${Math.floor((100 * decoded) / gaussians)} % of it had come, which stays.` : '';
  return part || ' What had come of it stays.';
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

// The scene turns slowly by itself until somebody touches it.

// Time of a whole turn, in milliseconds.
const WHOLE_TURN = 45_000;
// Longest step, in milliseconds, however long the last picture took.
const LONGEST_STEP = 100;
// A machine that cannot draw fluently at this share of the width shows the still picture, which is finer.
const COARSE = 0.5;

export class Turn {
  #on = false;
  #asked = false;
  #seen = true;
  #last;
  #stage;
  #changed;

  /**
   * @param {import('./stage.js').Stage} stage
   * @param {{element: Element, signal: AbortSignal, changed: () => void}} options element: what has to be on the screen;
   *     changed: is told that it began or ended
   */
  constructor(stage, { element, signal, changed }) {
    this.#stage = stage;
    this.#changed = changed;
    const observer = new IntersectionObserver((entries) => {
      this.#seen = entries[entries.length - 1].isIntersecting;
      if (this.#seen && this.#on) stage.request();
    });
    observer.observe(element);
    signal.addEventListener('abort', () => observer.disconnect(), { once: true });
  }

  get on() {
    return this.#on;
  }

  /** Begins to turn, unless this machine is too slow for it and nobody `asked`. */
  start(asked = false) {
    if (this.#on || (!asked && this.#isTooSlow)) return;
    [this.#on, this.#asked, this.#last] = [true, asked, undefined];
    this.#changed();
    this.#stage.request();
  }

  // Where the processor draws, a scene that turns would keep it at work.
  get #isTooSlow() {
    return this.#stage.isSlow || this.#stage.scale < COARSE;
  }

  stop() {
    if (!this.#on) return;
    this.#on = false;
    this.#changed();
  }

  /** Turns to where the scene should be at the time `now`, in milliseconds; returns whether it goes on. */
  step(now, act) {
    if (!this.#on || !this.#seen) {
      this.#last = undefined;
      return false;
    }
    if (!this.#asked && this.#isTooSlow) {
      this.stop();
      return false;
    }
    const passed = Math.min(LONGEST_STEP, now - (this.#last ?? now));
    this.#last = now;
    if (passed > 0) act((viewer) => viewer.orbit((2 * Math.PI * passed) / WHOLE_TURN, 0));
    return true;
  }
}

/** Whether people asked their system for less motion. */
export function wantsStill() {
  return matchMedia('(prefers-reduced-motion: reduce)').matches;
}

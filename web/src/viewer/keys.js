// Keys: those of `lexisplat view`, and what only a page has.

// Speed of a flight in scene radii a second, and the factor on it while shift is held, as in the window.
const SPEED = 0.6;
const FAST = 4;
// Longest step of a flight, in seconds, however long the last picture took.
const LONGEST_STEP = 0.1;
// Angle of one press of an arrow key, in degrees.
const TURN = 5;

// Flights by the place of the key, so that the hand rests alike on all keyboards: right, up, forward.
const FLIGHT = { KeyD: [1, 0, 0], KeyA: [-1, 0, 0], KeyE: [0, 1, 0], KeyQ: [0, -1, 0], KeyW: [0, 0, 1], KeyS: [0, 0, -1] };
const TURNS = { ArrowLeft: [-TURN, 0], ArrowRight: [TURN, 0], ArrowUp: [0, -TURN], ArrowDown: [0, TURN] };
// Keys with a command of the viewer.
const COMMANDS = new Set(['[', ']', '1', '2', '3', '4', '5', ' ', '+', '=', '-', 'f', 'r']);

/** Keys and their effects, for the panel. */
export const HELP = [
  ['drag, one finger', 'orbit'],
  ['right or shift drag, two fingers', 'pan'],
  ['ctrl drag', 'look around'],
  ['wheel, pinch', 'nearer, farther'],
  ['double click', 'orbit around this point'],
  ['arrows', 'orbit'],
  ['W A S D, Q E', 'fly; shift: faster'],
  ['[ ]', 'previous, next camera'],
  ['1 2', 'first, second scene'],
  ['3 4 5', 'side by side, wipe, difference'],
  ['space', 'the other scene'],
  ['+ -', 'difference gain'],
  ['F', 'the whole scene'],
  ['R', 'back to the start'],
  ['P, H', 'picture, panel'],
];

/** Listens to keys. */
export class Keys {
  #held = new Set();
  // Keys pressed since the last picture. A key that was released before it still flies one step.
  #pressed = new Set();
  #fast = false;
  #last;

  /**
   * @param {EventTarget} target what keys are pressed on
   * @param {import('./stage.js').Stage} stage
   * @param {{signal: AbortSignal, own: Record<string, () => void>, touched: () => void}} options own: what keys of the page
   *     do; touched: is told of a key that steers
   */
  constructor(target, stage, { signal, own, touched }) {
    const on = (on, name, listener) => on.addEventListener(name, listener, { signal });
    on(target, 'keydown', (event) => this.#press(event, stage, own, touched));
    // A key may be released elsewhere than it was pressed.
    on(window, 'keyup', (event) => {
      this.#held.delete(event.code);
      this.#fast = event.shiftKey;
    });
    on(window, 'blur', () => {
      this.#held.clear();
      this.#pressed.clear();
    });
  }

  /** Flies by the keys that were held or pressed until the time `now`, in milliseconds; returns whether one is held. */
  fly(now, act) {
    const sum = [0, 0, 0];
    for (const code of new Set([...this.#held, ...this.#pressed])) FLIGHT[code].forEach((step, axis) => (sum[axis] += step));
    this.#pressed.clear();
    const seconds = Math.min(LONGEST_STEP, Math.max(0, (now - (this.#last ?? now - 1000 / 60)) / 1000));
    const flies = this.#held.size > 0;
    this.#last = flies ? now : undefined;
    const steps = sum.map((step) => step * seconds * SPEED * (this.#fast ? FAST : 1));
    if (steps.some((step) => step !== 0)) act((viewer) => viewer.fly(...steps));
    return flies;
  }

  #press(event, stage, own, touched) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.defaultPrevented || writes(event)) return;
    this.#fast = event.shiftKey;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.code in FLIGHT) {
      this.#held.add(event.code);
      this.#pressed.add(event.code);
      stage.request();
    } else if (key in TURNS) stage.act((viewer) => viewer.run(`orbit=${TURNS[key].join(':')}`), true).catch(stage.on.failed);
    else if (own[key]) own[key]();
    else if (COMMANDS.has(key)) stage.act((viewer) => viewer.key(event.key)).catch(stage.on.failed);
    else return;
    touched();
    event.preventDefault();
  }
}

// Whether a key means something to what has the focus: text, a slider or a button.
function writes(event) {
  const at = event.composedPath()[0];
  if (!(at instanceof Element)) return false;
  if (at.matches('input:not([type=range]), textarea, select, [contenteditable]')) return true;
  if (at.matches('[role=slider], input[type=range]')) return event.key.startsWith('Arrow');
  return event.key === ' ' && at.matches('button, summary, a');
}

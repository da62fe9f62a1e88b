// How to move, said once over the picture. It goes away by itself, and as soon as somebody moves.

import { make } from './dom.js';

// Time that it is shown, in milliseconds.
const SHOWN = 9000;

/**
 * @param {boolean} whole whether the wheel is the viewer's without a click before
 */
export function makeHint(whole) {
  const wheel = whole ? 'scroll to come nearer' : 'click and scroll to come nearer';
  const text = matchMedia('(pointer: coarse)').matches ? 'Drag to turn, pinch to come nearer' : `Drag to turn, ${wheel}`;
  // The label of the canvas says it to those who do not see it.
  const element = make('p', { class: 'hint', hidden: true, 'aria-hidden': 'true' }, text);
  let [used, timer] = [false, 0];
  const hide = () => {
    used = true;
    clearTimeout(timer);
    element.hidden = true;
  };
  return {
    element,
    /** Shows it, if nobody has moved yet. */
    show: () => {
      if (used) return;
      used = true;
      element.hidden = false;
      timer = setTimeout(hide, SHOWN);
    },
    hide,
  };
}

// The line of the wipe: a slider over the canvas, for pointers and keys.

import { make } from './dom.js';

// Steps of arrow keys and of page keys, as shares of the width.
const STEP = 0.01;
const LEAP = 0.1;

/**
 * Makes the line.
 * @param {(split: number) => void} move is called with the place that the user chose, 0 (left) to 1
 * @returns {{element: HTMLElement, set: (split: number) => void}} set: shows where the line is
 */
export function wipeLine(move) {
  let split = 0.5;
  const element = make('div', {
    class: 'wipe',
    role: 'slider',
    tabIndex: 0,
    hidden: true,
    'aria-label': 'Line between the scenes',
    'aria-orientation': 'horizontal',
    'aria-valuemin': 0,
    'aria-valuemax': 100,
    onpointerdown: (event) => {
      element.setPointerCapture(event.pointerId);
      element.focus({ preventScroll: true });
      event.preventDefault();
    },
    onpointermove: (event) => {
      if (!element.hasPointerCapture(event.pointerId)) return;
      const box = element.parentElement.getBoundingClientRect();
      choose((event.clientX - box.left) / Math.max(1, box.width));
    },
    onkeydown: (event) => {
      const steps = { ArrowLeft: -STEP, ArrowDown: -STEP, ArrowRight: STEP, ArrowUp: STEP, PageDown: -LEAP, PageUp: LEAP };
      if (event.key in steps) choose(split + steps[event.key]);
      else if (event.key === 'Home') choose(0);
      else if (event.key === 'End') choose(1);
      else return;
      event.preventDefault();
    },
  });
  element.append(make('span', { class: 'grip', 'aria-hidden': 'true' }));

  function choose(share) {
    // Two digits beyond a per cent are finer than pixels, and short in links.
    const rounded = Math.round(1e4 * Math.min(1, Math.max(0, share))) / 1e4;
    set(rounded);
    move(rounded);
  }

  function set(share) {
    split = share;
    element.style.left = `${100 * share}%`;
    element.setAttribute('aria-valuenow', Math.round(100 * share));
    element.setAttribute('aria-valuetext', `${Math.round(100 * share)} % of the width shows the first scene`);
  }

  set(split);
  return { element, set };
}

// The overlay of the picture: names of the scenes, PSNR, the wipe's line, and messages.

import { make, reason, say } from './dom.js';
import { wipeLine } from './wipe.js';

// Messages that are kept.
const MOST = 3;

/** Makes the names and the line over the picture. @param {(split: number) => void} split */
export function makeOverlay(split) {
  const line = wipeLine(split);
  const [left, right, score] = ['left', 'right', 'score'].map((name) => make('span', { class: `label ${name}`, hidden: true }));
  const middle = make('span', { class: 'middle', hidden: true });
  const note = make('p', { class: 'drawn', hidden: true }, 'Drawn by the processor');
  const element = make('div', { class: 'overlay' }, middle, left, right, score, line.element, note);
  const label = (where, text) => {
    where.hidden = !text;
    say(where, text);
  };

  /** Shows what the viewer reports. */
  function update(report) {
    const { mode, models } = report;
    const both = models.every(Boolean);
    const beside = both && (mode === 'side' || mode === 'wipe');
    const difference = both && mode === 'difference';
    middle.hidden = !(both && mode === 'side');
    line.element.hidden = !(both && mode === 'wipe');
    line.set(report.split);
    const alone = models[mode === 'second' ? 1 : 0] ?? models.find(Boolean);
    const first = beside ? models[0].name : both && alone ? alone.name : '';
    label(left, difference ? `difference x ${Number(report.gain.toFixed(2))}` : first);
    label(right, beside ? models[1].name : '');
    const psnr = report.identical ? 'identical' : report.psnr === null ? '' : `PSNR ${report.psnr.toFixed(2)} dB`;
    label(score, beside || difference ? psnr : '');
  }

  return {
    element,
    update,
    /** Says that the processor draws, and why; says nothing for `undefined`. */
    note(why) {
      note.hidden = why === undefined;
      note.title = why ?? '';
    },
  };
}

/** Makes the list of messages, which screen readers read as they come. */
export function makeMessages() {
  const element = make('div', { class: 'messages', role: 'log', 'aria-label': 'Messages' });

  /**
   * Shows a message until it is closed, or others take its place.
   * @param {unknown} what a text or an error
   * @param {{wrong?: boolean, text?: string}} [options] text: something to copy
   */
  function add(what, { wrong = false, text } = {}) {
    // An error that comes again with each picture is said once.
    const last = element.lastElementChild;
    if (last?.firstElementChild.textContent === reason(what) && !text) return last;
    const close = make('button', { type: 'button', class: 'small', onclick: () => message.remove() }, 'Close');
    const message = make('div', { class: wrong ? 'message wrong' : 'message' }, make('p', {}, reason(what)), close);
    if (text) message.insertBefore(make('input', { readOnly: true, value: text, 'aria-label': 'Link' }), close);
    element.append(message);
    while (element.children.length > MOST) element.firstElementChild.remove();
    return message;
  }

  return { element, add, clear: () => element.replaceChildren() };
}

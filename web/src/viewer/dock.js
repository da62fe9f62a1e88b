// The small bar of a page that shows a scene: turn, first view, full screen, and the choice between two scenes.

import { shareOf, setBar, stalled } from './arrival.js';
import { choice, icon, make, say } from './dom.js';

const ICONS = {
  play: 'M7 5l8 5l-8 5z',
  pause: 'M7.5 5v10M12.5 5v10',
  reset: 'M5 7.5a6 6 0 1 1-.8 4M4 4v4h4',
  full: 'M3.5 8V3.5H8M12 3.5h4.5V8M16.5 12v4.5H12M8 16.5H3.5V12',
};
const MODES = [
  ['first', 'First'],
  ['side', 'Side'],
  ['wipe', 'Wipe'],
  ['second', 'Second'],
];

/**
 * @param {object} on what the user asks for
 * @param {() => void} on.turn begins or ends to turn the scene
 * @param {() => void} on.reset
 * @param {(() => void) | undefined} on.full undefined leaves the button out
 * @param {(words: string) => void} on.run
 */
export function makeDock(on) {
  const button = (name, label, onclick) =>
    make('button', { type: 'button', class: 'icon', title: label, 'aria-label': label, onclick }, icon(ICONS[name]));
  const turn = button('play', 'Turn', on.turn);
  const reset = button('reset', 'Back to the first view', on.reset);
  const full = on.full ? [button('full', 'Full screen', on.full)] : [];
  const mode = choice('View', MODES.map(([value, text]) => [value, text]), (value) => on.run(`mode=${value}`));
  const tools = make('div', { class: 'dock', role: 'toolbar', 'aria-label': 'Viewer', hidden: true }, mode.element, turn, reset, ...full);
  const bar = make('progress', { class: 'thin', 'aria-label': 'Loaded', max: 1, hidden: true });
  const note = make('p', { class: 'waits', role: 'status', hidden: true });
  const element = make('div', { class: 'foot' }, bar, note, tools);
  let turns;

  return {
    element,
    /** Shows what the viewer reports, and whether the scene turns. */
    update(report, turning) {
      const both = Boolean(report?.models.every(Boolean));
      tools.hidden = !report?.models.some(Boolean);
      mode.element.hidden = !both;
      if (report) mode.set(report.mode);
      if (turns === turning) return;
      turns = turning;
      turn.title = turning ? 'Stop turning' : 'Turn';
      turn.setAttribute('aria-label', turn.title);
      turn.replaceChildren(icon(ICONS[turning ? 'pause' : 'play']));
    },
    /** Shows how far a load is whose scene is seen already. */
    load(load) {
      const goesOn = Boolean(load?.active);
      bar.hidden = !goesOn;
      if (goesOn) setBar(bar, load);
      const text = goesOn ? stalled(load) : '';
      note.hidden = !text;
      const share = goesOn ? shareOf(load) : undefined;
      say(note, text && share !== undefined ? `${text}. The scene is coarse so far.` : text);
    },
  };
}

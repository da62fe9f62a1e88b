// The panel: buttons, what is shown, and its figures.

import { bytes, choice, count, icon, make, say, time } from './dom.js';
import { HELP } from './keys.js';
import { sceneCard } from './card.js';

const ICONS = {
  link: 'M8.5 11.5a3.5 3.5 0 0 0 5 0l2.5-2.5a3.5 3.5 0 0 0-5-5L10 5M11.5 8.5a3.5 3.5 0 0 0-5 0L4 11a3.5 3.5 0 0 0 5 5l1-1',
  picture: 'M3 6.5h3L7.5 4.5h5L14 6.5h3v9H3zM10 13.5a2.75 2.75 0 1 0 0-5.5a2.75 2.75 0 0 0 0 5.5',
  full: 'M3.5 8V3.5H8M12 3.5h4.5V8M16.5 12v4.5H12M8 16.5H3.5V12',
  panel: 'M5 8l5 5l5-5',
  previous: 'M12 5l-5 5l5 5',
  next: 'M8 5l5 5l-5 5',
};
const MODES = [
  ['first', 'First', '1'],
  ['second', 'Second', '2'],
  ['side', 'Side', '3'],
  ['wipe', 'Wipe', '4'],
  ['difference', 'Diff', '5'],
];
const DEGREES = [
  ['0', 'Off'],
  ['1', '1'],
  ['2', '2'],
  ['3', '3'],
  ['all', 'All'],
];
// Gains of the slider for differences: from 1 to 100, evenly in the logarithm, as in the window.
const LARGEST_GAIN = 100;
const GAIN_STEPS = 100;

/**
 * Makes the panel.
 * @param {object} on what the user asks for
 * @param {(words: string) => void} on.run
 * @param {(() => void)} on.open
 * @param {() => void} on.reset
 * @param {(() => void) | undefined} on.link undefined leaves the button out
 * @param {() => void} on.picture
 * @param {(() => void) | undefined} on.full
 * @param {(slot: number) => void} on.remove
 * @param {(slot: number) => void} on.cancel
 */
export function makePanel(on) {
  const round = (name, label, listener, more = {}) =>
    make('button', { type: 'button', class: 'icon', title: label, 'aria-label': label, onclick: listener, ...more }, icon(ICONS[name]));
  const section = (title, ...children) => make('section', { 'aria-label': title }, make('h2', {}, title), ...children);

  const cards = [0, 1].map((slot) => sceneCard(slot, on));
  const scenes = make('div', { class: 'cards' }, ...cards.map((card) => card.element));
  const mode = choice('View', MODES.map(([value, text, key]) => [value, text, `key ${key}`]), (value) => on.run(`mode=${value}`));
  const gain = make('input', { type: 'range', min: 0, max: GAIN_STEPS, step: 1, 'aria-label': 'Gain of the difference' });
  gain.addEventListener('input', () => on.run(`gain=${(LARGEST_GAIN ** (gain.value / GAIN_STEPS)).toFixed(2)}`));
  const gainText = make('output', {});
  const gainRow = make('div', { class: 'row' }, make('span', {}, 'Gain'), gain, gainText);
  const psnr = make('output', { class: 'psnr' });
  const psnrRow = make('div', { class: 'row spread' }, make('span', {}, 'PSNR of this view'), psnr);
  const view = section('View', mode.element, gainRow, psnrRow);

  const camera = make('output', { class: 'grow' });
  const steps = [
    round('previous', 'Previous camera', () => on.run('key=[')),
    round('next', 'Next camera', () => on.run('key=]')),
  ];
  const reset = make('button', { type: 'button', onclick: on.reset }, 'Reset');
  const cameras = section('Camera', make('div', { class: 'row' }, ...steps, camera, reset));

  const degree = choice('SH degree', DEGREES, (value) => on.run(`degree=${value}`));
  const colour = make('input', { type: 'color', 'aria-label': 'Colour behind the scene' });
  colour.addEventListener('input', () => on.run(`background=${shares(colour.value).join(':')}`));
  const plain = ['Black', 'White'].map((name, share) =>
    make('button', { type: 'button', onclick: () => on.run(`background=${share}:${share}:${share}`) }, name),
  );
  const drawing = section(
    'Drawing',
    make('div', { class: 'row spread' }, make('span', {}, 'SH'), degree.element),
    make('div', { class: 'row' }, make('span', { class: 'grow' }, 'Behind'), ...plain, colour),
  );

  const figures = make('dl', {});
  const numbers = section('Figures', figures);
  const keys = make('table', {}, make('caption', { class: 'unseen' }, 'Keys and pointers'));
  for (const [key, effect] of HELP) keys.append(make('tr', {}, make('th', { scope: 'row' }, key), make('td', {}, effect)));
  const help = make('details', {}, make('summary', {}, 'Keys and pointers'), keys);

  const seen = [view, cameras, drawing, numbers];
  const body = make('div', { class: 'body', id: 'panel-body', tabIndex: -1 }, scenes, ...seen, help);
  const toggle = round('panel', 'Panel', () => show(body.hidden), { 'aria-controls': 'panel-body', class: 'icon turn' });
  const copy = on.link ? [round('link', 'Copy a link to this view', on.link)] : [];
  const full = on.full ? [round('full', 'Full screen', on.full)] : [];
  const picture = round('picture', 'Save a picture', on.picture);
  const bar = make(
    'div',
    { class: 'bar', role: 'toolbar', 'aria-label': 'Viewer' },
    make('button', { type: 'button', class: 'main', onclick: on.open }, 'Open files'),
    make('span', { class: 'grow' }),
    ...copy,
    picture,
    ...full,
    toggle,
  );
  const element = make('div', { class: 'panel', role: 'region', 'aria-label': 'Scenes and view' }, bar, body);

  function show(open) {
    body.hidden = !open;
    toggle.setAttribute('aria-expanded', String(open));
  }

  /** Shows what the viewer reports; before its first report, that there is nothing. */
  function update(report) {
    const models = report?.models ?? [null, null];
    const both = models.every(Boolean);
    const any = models.some(Boolean);
    for (const part of seen) part.hidden = !any;
    for (const button of [...copy, picture]) button.disabled = !any;
    models.forEach((model, slot) => cards[slot].model(model, report));
    if (!any) return;

    view.hidden = !both;
    mode.set(report.mode);
    gainRow.hidden = report.mode !== 'difference';
    gain.value = (GAIN_STEPS * Math.log(report.gain)) / Math.log(LARGEST_GAIN);
    say(gainText, `x ${Number(report.gain.toFixed(2))}`);
    const score = report.identical ? 'identical' : report.psnr === null ? '-' : `${report.psnr.toFixed(2)} dB`;
    say(psnr, score);
    for (const step of steps) step.disabled = report.cameras < 1;
    say(camera, report.free || report.cameras < 1 ? 'free' : `${report.index + 1} of ${report.cameras}`);
    degree.set(String(report.degree ?? 'all'));
    colour.value = hex(report.background);
    list(figures, rows(report));
  }

  update();
  return { element, cards, update, show, toggle: () => show(body.hidden) };
}

function rows(report) {
  const both = (values) => values.filter((value) => value !== null && value !== undefined);
  const drawn = both(report.drawn).map(count).join(' / ');
  const [geometry, sh] = ['geometry', 'sh'].map((part) =>
    both(report.scene_bytes.map((scene) => scene?.[part])).map(bytes).join(' / '),
  );
  return [
    ['Gaussians drawn', drawn],
    ['Frame', report.milliseconds === null ? '' : time(report.milliseconds)],
    ['Picture', `${report.width} x ${report.height}`],
    [report.renderer === 'processor' ? 'Memory' : 'GPU memory', bytes(report.resident_bytes)],
    ['of it geometry', geometry],
    ['of it SH', sh],
    ['most it ever was', report.most_bytes ? bytes(report.most_bytes) : ''],
    ['Drawn by', report.device],
  ].filter(([, value]) => value);
}

function list(element, rows) {
  while (element.children.length > rows.length) element.lastElementChild.remove();
  while (element.children.length < rows.length) element.append(make('div', {}, make('dt'), make('dd')));
  rows.forEach(([name, value], row) => {
    say(element.children[row].children[0], name);
    say(element.children[row].children[1], String(value));
  });
}

function shares(colour) {
  return [1, 3, 5].map((at) => Number((parseInt(colour.slice(at, at + 2), 16) / 255).toFixed(4)));
}

function hex(background) {
  return `#${background.map((share) => Math.round(255 * Math.min(1, Math.max(0, share))).toString(16).padStart(2, '0')).join('')}`;
}
